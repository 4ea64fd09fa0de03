"""What a comparison looks at: a frame or a simulated field, all that is known of it, and one trial upon it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.attitude.fit import Fit, refine
from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude
from kochab.core.errors import UsageError
from kochab.core.frame import Detections, Frame, Hint
from kochab.core.progress import Progress, Task
from kochab.core.registry import checked
from kochab.core.solution import Identification, NoSolution, Solution
from kochab.core.values import frozen
from kochab.detection import DETECTORS
from kochab.identification import IDENTIFIERS
from kochab.lab.laboratory.comparison import (
    FIT,
    PLACE_DEG,
    REGISTRIES,
    Choice,
    ComparedPart,
    FieldTruth,
    Trial,
    compare,
    judged,
    scale_hint,
    sigma_of,
    thread_s,
    timed,
    try_detector,
)
from kochab.simulate.random_fields import FieldPlan, random_field, random_picture
from kochab.sky import open_catalogue
from kochab.sky.apparent import julian_years
from kochab.solver import UNKNOWN_YEAR, SolveOptions
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
    """Run one method; a second time when the first had to make its tables. UsageError as `checked`.

    Parameters
    ----------
    detections : Detections
        Of the frame.
    choice : Choice
        The method and its options.
    hint : Hint or None
        What is known of the frame; None: nothing.
    truth : FieldTruth or None
        Where it points; None: nobody knows.
    year : float
        Epoch of the stars' places, Julian year.
    limit_s : float
        The longest run.
    """
    options = checked(REGISTRIES[ComparedPart.METHOD].load(choice.name), choice.options)
    identifier = IDENTIFIERS.make(choice.name, **options)
    found, spent = yield from timed(identifier.identify(detections, hint, year), limit_s)
    seconds, tables = sum(spent.values()), 0.0
    # A method that ran out of time is not asked again: it would only run out once more.
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


@frozen(eq=False)
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
    """Name every star by the default method; None when that took too long.

    Parameters
    ----------
    detections : Detections
        Of the frame.
    hint : Hint or None
        What is known of it; None: nothing.
    year : float
        Epoch of the stars' places, Julian year.
    limit_s : float
        The longest that it may take.
    """
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
        start = thread_s()
        fit, refusal = estimate()
        spent += thread_s() - start
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

    turn_arcsec = Rotation.from_matrix(a.matrix @ b.matrix.T).as_rotvec(degrees=True) * 3600.0
    return float(np.hypot(*turn_arcsec[:2])), float(abs(turn_arcsec[2]))


LARGEST_PX = 8192
"""Side of a simulated picture; a larger one takes gigabytes."""
OPEN_FIRST = "Open a frame first, or choose a simulated field."


@frozen(eq=False)
class Scene:
    """A ``frame``, or the ``detections`` of one, or both.

    ``places`` (N, 2) px are all stars of a simulated picture. ``believed`` is the hint when no truth is known.
    """

    detections: Detections | None = None
    frame: Frame | None = None
    truth: FieldTruth | None = None
    places: Floats | None = None
    believed: Hint | None = None

    @property
    def time_utc(self) -> datetime | None:
        """When the frame was taken."""
        return None if self.frame is None else self.frame.hint.time_utc

    @property
    def year(self) -> float:
        """The Julian year of it, or the one taken for frames that do not say."""
        return UNKNOWN_YEAR if self.time_utc is None else julian_years(self.time_utc)

    def hint(self, scale: bool, place: bool) -> Hint | None:
        """What the methods know beforehand."""
        if not scale:
            return None
        if self.truth is not None:
            return scale_hint(self.truth, PLACE_DEG if place else None)
        if self.believed is None or place:
            return self.believed
        return replace(self.believed, centre_deg=None)


def scene_of_frame(
    frame: Frame, detections: Detections | None, result: Solution | NoSolution | None, believed: Hint | None
) -> Task[Scene]:
    """The open frame; its solution, where there is one, stands for the truth.

    Parameters
    ----------
    frame : Frame
        The open frame.
    detections : Detections or None
        Its stars; None: not detected yet.
    result : Solution or NoSolution or None
        What solving gave; None: not solved.
    believed : Hint or None
        What the person says of it; None: what the header says.
    """
    yield Progress("laboratory", None, "taking the open frame")
    truth = FieldTruth(result.camera, result.attitude) if isinstance(result, Solution) else None
    return Scene(detections, frame, truth, believed=believed if believed is not None else frame.hint)


def simulated_scene(kind: ComparedPart, plan: FieldPlan, seeds: Sequence[int]) -> Task[Scene]:
    """The stars of a field at a random place, the same for the same seeds, and the truth of it.

    Detectors are compared on its picture, whose faintest star is as bright as the noise of a position asks.
    """
    rng = np.random.default_rng(list(seeds))
    if kind is not ComparedPart.DETECTOR:
        yield Progress("laboratory", None, "making a field")
        field = random_field(open_catalogue(), rng, plan)
        return Scene(field.detections, truth=FieldTruth.of(field, plan))
    if plan.size_px > LARGEST_PX:
        raise UsageError(f"A simulated image is {LARGEST_PX} px wide at most.")
    yield Progress("laboratory", None, "making a picture")
    picture = random_picture(open_catalogue(), rng, plan)
    return Scene(frame=picture.frame, truth=FieldTruth.of(picture, plan), places=picture.places)


def comparison(
    source: Task[Scene] | None,
    kind: ComparedPart,
    choices: Sequence[Choice],
    scale: bool,
    place: bool,
    limit_s: float,
    tell: Callable[[Trial], None],
) -> Task[list[Trial]]:
    """Get the stars and run the choices on them; UsageError when there are none to get.

    Parameters
    ----------
    source : Task[Scene] or None
        Gets them; None: no frame is open.
    kind : ComparedPart
        Methods, detectors or estimators.
    choices : Sequence[Choice]
        Those to compare.
    scale, place : bool
        What they know beforehand.
    limit_s : float
        The longest trial.
    tell : Callable[[Trial], None]
        Called with every trial.
    """
    if source is None:
        raise UsageError(OPEN_FIRST)
    scene = yield from source
    tries = yield from tries_on(scene, kind, choices, scene.hint(scale, place), limit_s)
    names = [choice.name for choice in choices]
    return (yield from compare(list(zip(names, tries, strict=True)), tell))


def tries_on(
    scene: Scene, kind: ComparedPart, choices: Sequence[Choice], hint: Hint | None, limit_s: float
) -> Task[list[Task[Trial]]]:
    """A task for each choice, none of them begun; what all of them need is made here.

    Parameters
    ----------
    scene : Scene
        The stars, or the image that they are detected in.
    kind : ComparedPart
        Methods, detectors or estimators.
    choices : Sequence[Choice]
        Those to compare.
    hint : Hint or None
        What they know beforehand; None: nothing.
    limit_s : float
        The longest trial.
    """
    if kind is ComparedPart.DETECTOR:
        if (frame := scene.frame) is None:
            raise UsageError("A star list has no image to detect stars in.")
        known, truth = replace(hint or Hint(), time_utc=scene.time_utc), scene.truth
        return [try_detector(frame, choice, known, truth, scene.places, limit_s) for choice in choices]
    stars = scene.detections
    if stars is None:
        assert scene.frame is not None, "a scene without stars is a frame"
        yield Progress("detect", None, "detecting stars")
        stars = DETECTORS.make().detect(scene.frame)
    if kind is ComparedPart.ATTITUDE:
        named = yield from name_stars(stars, hint, scene.year, limit_s)
        return [try_attitude(named, choice, scene.truth) for choice in choices]
    return [try_method(stars, choice, hint, scene.truth, scene.year, limit_s) for choice in choices]
