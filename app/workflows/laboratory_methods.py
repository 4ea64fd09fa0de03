"""One method of identification on one list of stars."""

from dataclasses import replace

from app.attitude.fit import refine
from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import Task
from app.core.solution import Identification, NoSolution
from app.identify import make_identifier
from app.workflows.laboratory import Choice, Trial, Truth, answer_of, none_of, sigma_of
from app.workflows.laboratory_kinds import Kind, allowed
from app.workflows.laboratory_time import timed


def try_method(
    detections: Detections,
    choice: Choice,
    hint: Hint | None,
    truth: Truth | None,
    year: float = 2016.0,
    limit_s: float = 30.0,
) -> Task[Trial]:
    """Run one method; a second time when the first had to make its tables.

    Raises
    ------
    UsageError
        The method is not known, or one of its options is not allowed.

    """
    options = allowed(Kind.METHOD, choice.name, choice.options)
    identifier = make_identifier(choice.name, **options)
    found, spent = yield from timed(identifier.identify(detections, hint, year), limit_s)
    seconds, tables = sum(spent.values()), 0.0
    if found is not None and _first_use(choice, hint, detections):
        first = seconds
        found, spent = yield from timed(identifier.identify(detections, hint, year), limit_s)
        seconds = sum(spent.values())
        tables = max(0.0, first - seconds)
    return replace(_trial(choice.name, found, truth), seconds=seconds, tables_s=tables)


_used: set[object] = set()


def _first_use(choice: Choice, hint: Hint | None, detections: Detections) -> bool:
    """Whether this may have made tables: they depend on method, options and field."""
    scale = hint.scale_arcsec_px[0] if hint is not None and hint.scale_arcsec_px else 0.0
    field_deg = round(scale * detections.width / 3600.0)
    key = (choice.name, tuple(sorted((k, str(v)) for k, v in choice.options.items())), field_deg)
    new = key not in _used
    _used.add(key)
    return new


def _trial(name: str, found: Identification | NoSolution | None, truth: Truth | None) -> Trial:
    if not isinstance(found, Identification):
        return none_of(Kind.METHOD, name, found, truth)
    found, sigma = pointed(found)
    trial = answer_of(
        Kind.METHOD, name, found.camera, found.attitude, found.matches.xy, found.matches.vectors,
        truth,
    )  # fmt: skip
    return replace(trial, sigma_arcsec=sigma, log10_false_alarm=found.log10_false_alarm)


def pointed(
    found: Identification,
) -> tuple[Identification, tuple[float, float, float] | None]:
    """The answer with the pointing that its names give, and its one-sigma errors, arcsec.

    Methods end with names and a pointing good to some pixels; what they are worth is what a fit
    makes of the names, as it does in every solve. The errors are along x, y and in roll; None
    with fewer than three matches, which leave the pointing as it is.
    """
    if len(found.matches) < 3:
        return found, None
    fit = refine(found.matches, found.camera, found.attitude, distortion=False)
    sigma = sigma_of(fit.attitude)
    if sigma is None:
        return found, None
    return replace(found, camera=fit.camera, attitude=fit.attitude), sigma
