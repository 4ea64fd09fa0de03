"""One trial of a method of identification or of an estimator of the attitude."""

from dataclasses import dataclass, replace
from time import thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.attitude.fit import Fit, refine
from kochab.core.attitude import Attitude
from kochab.core.frame import Detections, Hint
from kochab.core.progress import Progress, Task
from kochab.core.registry import checked
from kochab.core.solution import Identification, NoSolution
from kochab.identification import IDENTIFIERS
from kochab.lab.laboratory.comparison import (
    FIT,
    REGISTRIES,
    Choice,
    ComparedPart,
    FieldTruth,
    Trial,
    judged,
    sigma_of,
    timed,
)
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.matches import centroid_sigma, extend
from kochab.solver.pipeline import with_estimate


def try_method(
    detections: Detections,
    choice: Choice,
    hint: Hint | None,
    truth: FieldTruth | None,
    year: float = 2016.0,
    limit_s: float = 30.0,
) -> Task[Trial]:
    """Run one method; a second time when the first had to make its tables. UsageError as `checked`."""
    options = checked(REGISTRIES[ComparedPart.METHOD].load(choice.name), choice.options)
    identifier = IDENTIFIERS.make(choice.name, **options)
    found, spent = yield from timed(identifier.identify(detections, hint, year), limit_s)
    seconds, tables = sum(spent.values()), 0.0
    if found is not None and _first_use(choice, hint, detections):
        first = seconds
        found, spent = yield from timed(identifier.identify(detections, hint, year), limit_s)
        seconds = sum(spent.values())
        tables = max(0.0, first - seconds)
    times: dict[str, Any] = {"seconds": seconds, "tables_s": tables}
    answer = with_fitted_pointing(found) if isinstance(found, Identification) else found
    return judged(ComparedPart.METHOD, choice.name, answer, truth, **times)


_used: set[object] = set()


def _first_use(choice: Choice, hint: Hint | None, detections: Detections) -> bool:
    """Whether this may have made tables: they depend on method, options and field."""
    scale = hint.scale_arcsec_px[0] if hint is not None and hint.scale_arcsec_px else 0.0
    field_deg = round(scale * detections.width / 3600.0)
    key = (choice.name, tuple(sorted((k, str(v)) for k, v in choice.options.items())), field_deg)
    new = key not in _used
    _used.add(key)
    return new


def with_fitted_pointing(found: Identification) -> Identification:
    """The answer with the pointing that its names give.

    Methods end with names and a pointing good to some pixels; what they are worth is what a fit makes of the names,
    as it does in every solve. Fewer than three matches leave the pointing as it is, and its errors unknown.
    """
    if len(found.matches) < 3:
        return found
    fit = refine(found.matches, found.camera, found.attitude, distortion=False)
    return found if sigma_of(fit.attitude) is None else replace(found, camera=fit.camera, attitude=fit.attitude)


# -- One estimator of the attitude on named stars, beside the fit of every solve ----------------

REPEATS = 20
"""An estimate takes less than a clock of some systems can tell."""
REFUSED = "not with these stars"


@dataclass(frozen=True, slots=True, eq=False)
class NamedStars:
    """``found`` stars whose places are good to ``sigma_px`` (M,), and the fit of them all."""

    found: Identification
    sigma_px: NDArray[np.float64]

    def fit(self) -> Fit:
        """Rotation and camera by all stars."""
        return refine(self.found.matches, self.found.camera, self.found.attitude, self.sigma_px)


def name_stars(
    detections: Detections, hint: Hint | None, year: float, limit_s: float
) -> Task[NamedStars | NoSolution | None]:
    """Name every star by the default method; None when that took longer than ``limit_s``."""
    task = IDENTIFIERS.make().identify(detections, hint, year)
    found, _ = yield from timed(task, limit_s)
    if not isinstance(found, Identification):
        return found
    yield Progress("attitude", None, "matching stars")
    usable = detections.take(slice(0, SolveOptions().max_stars))
    matches, _ = extend(usable, found, open_catalogue(), year)
    return NamedStars(replace(found, matches=matches), centroid_sigma(usable)[matches.detection])


def try_attitude(named: NamedStars | NoSolution | None, choice: Choice, truth: FieldTruth | None) -> Task[Trial]:
    """Run one estimator, or the fit, on the named stars. UsageError as `checked`."""
    options = checked(REGISTRIES[ComparedPart.ATTITUDE].load(choice.name), choice.options)
    if not isinstance(named, NamedStars):
        return judged(ComparedPart.ATTITUDE, choice.name, named, truth)

    first, matches = named.fit(), named.found.matches

    def estimate() -> tuple[Fit, str]:
        if choice.name == FIT:
            return named.fit(), ""
        return with_estimate(matches, first, choice.name, named.sigma_px, options)

    (fit, refusal), spent = estimate(), 0.0
    for _ in range(REPEATS):  # the first is not timed: it may import
        yield Progress("attitude")
        start = thread_time()
        fit, refusal = estimate()
        spent += thread_time() - start
    kind = ComparedPart.ATTITUDE
    measured: dict[str, Any] = {"seconds": spent / REPEATS}
    if refusal:
        return judged(kind, choice.name, None, truth, reason=REFUSED, advice=refusal, **measured)
    answer = replace(named.found, camera=fit.camera, attitude=fit.attitude)
    gap = None if choice.name == FIT else between(fit.attitude, first.attitude)
    return judged(kind, choice.name, answer, truth, rms_px=fit.rms_px, from_fit_arcsec=gap, **measured)


def between(a: Attitude, b: Attitude) -> tuple[float, float]:
    """How far two attitudes are apart, arcsec: on the sky at the boresight, and in roll."""
    from scipy.spatial.transform import Rotation  # also for attitudes that are half a turn apart

    about = Rotation.from_matrix(a.matrix @ b.matrix.T).as_rotvec(degrees=True) * 3600.0
    return float(np.hypot(*about[:2])), float(abs(about[2]))
