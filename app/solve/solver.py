"""One frame, or one list of stars, to a ``Solution`` or a ``NoSolution``."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from functools import cache
from typing import TYPE_CHECKING

from app.attitude.belief import FocalBelief
from app.attitude.fit import Fit, refine
from app.core.detections import Detections
from app.core.frame import Frame
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import Identification, Matches, NoSolution, Solution
from app.solve.diagnose import FEWEST_STARS, Evidence, diagnose, timed_out
from app.solve.options import DEFAULT_METHOD, UNKNOWN_YEAR, SolveOptions
from app.solve.pick import known, pick
from app.solve.stopwatch import Stopwatch, TimedOut

FEWEST_TO_TRY = 3
"""With fewer stars than a triangle no method has anything to look for."""

if TYPE_CHECKING:
    from app.sky import Catalogue

__all__ = ["Examined", "SolveOptions", "examine_frame", "solve_detections", "solve_frame"]


@dataclass(frozen=True, slots=True, eq=False)
class Examined:
    """The answer together with the detections it was made from."""

    detections: Detections
    result: Solution | NoSolution


def solve_frame(
    frame: Frame, options: SolveOptions | None = None, *, read_ms: float = 0.0
) -> Task[Solution | NoSolution]:
    """Detect the stars of ``frame``, identify them and refine the pointing.

    Raises
    ------
    UsageError
        The options name a method or detector that does not exist.

    """
    return (yield from examine_frame(frame, options, read_ms=read_ms)).result


def examine_frame(
    frame: Frame, options: SolveOptions | None = None, *, read_ms: float = 0.0
) -> Task[Examined]:
    """As :func:`solve_frame`, and also hand back the detections, for who wants to draw them."""
    from app.detect import DETECTORS
    from app.detect.points import single_pixels

    options = options or SolveOptions()
    clock = Stopwatch(options.timeout_s, read_ms)
    detector = pick(DETECTORS, options.detector, "detector", options.detector_options)
    yield Progress("detect", 0.1)
    with clock.stage("detect"):
        detections = detector.detect(frame)
    said = with_field(options, frame.width)
    hint = merged_hint(said, frame.hint if options.use_header else None)
    result = yield from _solve(detections, replace(options, hint=hint), clock, frame)
    few = len(detections) < FEWEST_STARS
    if few and isinstance(result, NoSolution) and options.detector == "auto":
        points = single_pixels(frame, detector)
        if len(points) >= FEWEST_STARS:
            second = yield from _solve(points, replace(options, hint=hint), clock, frame)
            if isinstance(second, Solution):
                return Examined(points, second)
    return Examined(detections, result)


def solve_detections(
    detections: Detections, options: SolveOptions | None = None, *, read_ms: float = 0.0
) -> Task[Solution | NoSolution]:
    """Identify a list of stars and refine the pointing; there is no frame to look at.

    Raises
    ------
    UsageError
        The options name a method that does not exist.

    """
    options = options or SolveOptions()
    if options.fov_deg is not None:
        options = replace(options, hint=with_field(options, detections.width))
    return (yield from _solve(detections, options, Stopwatch(options.timeout_s, read_ms), None))


def merged_hint(said: Hint | None, header: Hint | None) -> Hint | None:
    """What the person says, and where they are silent what the header says."""
    if said is None or header is None:
        return said or header
    silent = Hint()
    told = {f.name: getattr(said, f.name) for f in fields(said)}
    return replace(header, **{k: v for k, v in told.items() if v != getattr(silent, k)})


def with_field(options: SolveOptions, width: int) -> Hint | None:
    """The person's hint, its scale from the field's width where that is what they gave."""
    if options.fov_deg is None:
        return options.hint
    focal_px = width / 2.0 / math.tan(math.radians(options.fov_deg) / 2.0)
    scale = math.degrees(1.0 / focal_px) * 3600.0
    return replace(
        options.hint or Hint(source="person"), scale_arcsec_px=(scale / 1.1, scale * 1.1)
    )


def year_of(moment: datetime | None) -> float:
    """Julian year of an aware time; a middling recent year when unknown."""
    if moment is None:
        return UNKNOWN_YEAR
    return 2000.0 + (moment - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() / 31557600.0


def _solve(
    detections: Detections, options: SolveOptions, clock: Stopwatch, frame: Frame | None
) -> Task[Solution | NoSolution]:
    from app.attitude import ESTIMATORS
    from app.identify import IDENTIFIERS

    known(IDENTIFIERS, options.method, "method")
    if options.attitude is not None:
        known(ESTIMATORS, options.attitude, "attitude")
    year = year_of(options.hint.time_utc if options.hint else None)
    evidence = Evidence(detections, options.hint, frame)
    refusal: NoSolution | None = None
    attempts = _attempts(options) if len(detections) >= FEWEST_TO_TRY else ()
    try:
        for hint in attempts:
            found = yield from _identify(detections, options, hint, year, clock)
            if isinstance(found, Identification):
                yield Progress("attitude", 0.8)
                return _finished(detections, found, year, options, clock, frame)
            if refusal is None or found.looked:  # without the hint it may lack what it needs
                refusal = found
        few = _few(detections, options, year, clock)
        if few is not None:
            yield Progress("attitude", 0.8)
            return _finished(detections, few, year, options, clock, frame)
    except TimedOut:
        return timed_out(evidence, options.timeout_s or 0.0, clock.elapsed_ms())
    yield Progress("diagnose", 0.9)
    return diagnose(evidence, refusal, clock.elapsed_ms())


def _finished(
    detections: Detections,
    found: Identification,
    year: float,
    options: SolveOptions,
    clock: Stopwatch,
    frame: Frame | None,
) -> Solution:
    with clock.stage("attitude"):
        solution = _conclude(detections, found, year, options)
    warnings = (frame.warnings if frame else ()) + solution.warnings
    return replace(solution, elapsed_ms=clock.elapsed_ms(), warnings=warnings)


def _few(
    detections: Detections, options: SolveOptions, year: float, clock: Stopwatch
) -> Identification | None:
    """The last resort of the default method when stars are few."""
    from app.solve.few_stars import identify_few

    if options.method != DEFAULT_METHOD:
        return None
    with clock.stage("identify"):
        return identify_few(detections, options.hint, _catalogue(), year)


@cache
def _catalogue() -> "Catalogue":
    """One catalogue a process: its table of names is read once."""
    from app.sky import open_catalogue

    return open_catalogue()


def _attempts(options: SolveOptions) -> Iterator[Hint | None]:
    """Hints to try in order: with the belief first, blind after."""
    hint = options.hint
    if hint is not None and hint.helps:
        yield hint
        if not options.blind_after_hint:
            return
    yield None


def _identify(
    detections: Detections,
    options: SolveOptions,
    hint: Hint | None,
    year: float,
    clock: Stopwatch,
) -> Task[Identification | NoSolution]:
    from app.identify import IDENTIFIERS

    yield Progress("identify", 0.3, "with a hint" if hint else "blind")
    with clock.stage("identify"):
        identifier = pick(IDENTIFIERS, options.method, "method", options.method_options)
        task: Task[Identification | NoSolution] = identifier.identify(detections, hint, year)
        return (yield from clock.watch(task))


def _conclude(
    detections: Detections, found: Identification, year: float, options: SolveOptions
) -> Solution:
    from app.solve.build import build_solution
    from app.solve.estimate import with_estimate
    from app.solve.extend import centroid_sigma, extend

    catalogue = _catalogue()
    usable = detections.take(slice(0, options.max_stars))
    focal = _believed_focal(options.hint)
    matches, fit = extend(
        usable, found, catalogue, year,
        distortion=options.distortion, focal=focal, worst_px=options.worst_px,
    )  # fmt: skip
    seen = matches
    warnings: tuple[str, ...] = ()
    if options.aberration:
        moment = options.hint.time_utc if options.hint else None
        if moment is None:
            warnings = ("Aberration is not corrected: the frame does not say when it was taken.",)
        else:
            seen, fit = geometric_fit(matches, fit, moment, focal, options.worst_px)
    if options.attitude is not None:
        sigma = centroid_sigma(usable)[seen.detection]
        fit, doubt = with_estimate(seen, fit, options.attitude, sigma, options.attitude_options)
        warnings += (doubt,) if doubt else ()
    solution = build_solution(matches, fit, found, catalogue)
    return replace(solution, detections=len(detections), warnings=warnings)


def _believed_focal(hint: Hint | None) -> FocalBelief | None:
    """What the hint says of the focal length; a fit leaves it out when the stars contradict it."""
    if hint is None or hint.scale_arcsec_px is None:
        return None
    return FocalBelief.of_scale(*hint.scale_arcsec_px)


def geometric_fit(
    matches: Matches,
    fit: Fit,
    moment: datetime,
    focal: FocalBelief | None = None,
    worst_px: float | None = None,
) -> tuple[Matches, Fit]:
    """The stars where the moving Earth sees them at ``moment``, and the same fit against those.

    Its attitude says where the camera points geometrically, up to 20.5 arcsec from where the
    stars of the plate are in ICRS.
    """
    from app.sky.apparent import with_aberration

    seen = replace(matches, vectors=with_aberration(matches.vectors, moment))
    distortion = bool(fit.terms[4:])
    return seen, refine(
        seen, fit.camera, fit.attitude, distortion=distortion, focal=focal, worst_px=worst_px
    )
