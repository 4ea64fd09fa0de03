"""The parts of a solve compared on the same stars, with the truth beside them.

Methods, detectors or estimators of the attitude. The stars are those of a frame, whose accepted
solution stands for the truth, or of a simulated field.
"""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from time import perf_counter, thread_time
from typing import Any, TypeVar

import numpy as np

from kochab.attitude import ESTIMATORS
from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude, radec_deg
from kochab.core.camera import Camera
from kochab.core.frame import Frame, Hint
from kochab.core.pairing import mutual_nearest
from kochab.core.progress import PREPARING, Progress, Task
from kochab.core.registry import Registry, checked
from kochab.core.solution import Identification, Matches, NoSolution, Solution
from kochab.core.values import frozen
from kochab.detection import DETECTORS
from kochab.identification import IDENTIFIERS
from kochab.simulate.random_fields import FieldPlan, RandomField, RandomImage
from kochab.solver import SolveOptions
from kochab.solver.pipeline import examine_frame
from kochab.text.translation import tr

FIT = "fit"
"""The default attitude: least squares of rotation and camera together, not an estimator's."""


class ComparedPart(StrEnum):
    """The part of a solve that is exchanged, as the command line calls it."""

    METHOD = "method"
    DETECTOR = "detector"
    ATTITUDE = "attitude"


REGISTRIES: dict[ComparedPart, Registry[Any]] = {
    ComparedPart.METHOD: IDENTIFIERS,
    ComparedPart.DETECTOR: DETECTORS,
    ComparedPart.ATTITUDE: Registry(
        "attitude", ESTIMATORS.group, {FIT: "kochab.attitude.fit:refine", **ESTIMATORS.own}
    ),
}


def paper_for(kind: ComparedPart, name: str) -> str:
    """Author or title, year and chapter of its source."""
    return str(getattr(REGISTRIES[kind].load(name), "paper", "")) or tr("Kochab's own")


def in_words(name: str) -> str:
    """A registered name as people write it: ``spherical_triangles`` without its underscore."""
    return name.replace("_", " ")


T = TypeVar("T")

RIGHT_PX = 5.0
NOISE_SPARED = 4.0  # an imprecise answer to a noisy field is not a wrong one
SAME_SCALE = 0.03
TOO_LONG = "timed out"
SCALE_SPREAD = 0.02
PLACE_DEG = 10.0
"""Within this of the true centre, when the methods know the place."""


@frozen
class Choice:
    """One method, detector or estimator with the options that were changed."""

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)


def field_plan(fov_deg: float, stars: int, noise_px: float, false: float, missing: float, size_px: int) -> FieldPlan:
    """A field to simulate.

    Parameters
    ----------
    fov_deg : float
        Width of the field, degrees.
    stars : int
        How many the list has.
    noise_px : float
        Error of a place.
    false : float
        Share of false stars, of the real ones.
    missing : float
        Share of real stars that are missing.
    size_px : int
        Side of the frame.
    """
    return FieldPlan(fov_deg, size_px, noise_px, missing, false, brightest=stars)


@frozen(eq=False)
class FieldTruth:
    """Where the camera really points.

    An answer is right when its centre is within ``reach_px`` of the true one, and a name when its
    star is within that of the detection.
    """

    camera: Camera
    attitude: Attitude
    reach_px: float = RIGHT_PX

    @classmethod
    def of(cls, field: RandomField | RandomImage, plan: FieldPlan) -> "FieldTruth":
        """That of a simulated field."""
        return cls(field.camera, field.attitude, max(RIGHT_PX, NOISE_SPARED * plan.noise_px))


@frozen
class Trial:
    """What came of the stars with one method, detector or estimator.

    ``seconds`` is its processor time, with a method's tables at hand; ``tables_s`` is what making those took, when
    this was their first use. ``right`` and ``wrong`` (names that are not the star's) are None when the truth is not
    known. ``off_arcsec`` is between the centres. ``found`` is what a detector saw. ``from_fit_arcsec`` is how far
    an estimator's attitude is from that of the fit, on the sky and in roll. ``sigma_arcsec`` are one-sigma errors
    along x, along y, and of roll.
    """

    kind: ComparedPart
    name: str
    paper: str
    seconds: float = 0.0
    tables_s: float = 0.0
    ra_dec_deg: tuple[float, float] | None = None
    right: bool | None = None
    matches: int = 0
    wrong: int | None = None
    off_arcsec: float | None = None
    sigma_arcsec: tuple[float, float, float] | None = None
    log10_false_alarm: float | None = None
    rms_px: float | None = None
    found: "DetectorScore | None" = None
    from_fit_arcsec: tuple[float, float] | None = None
    reason: str = ""
    advice: str = ""

    @property
    def answered(self) -> bool:
        """Whether there was an answer, right or wrong."""
        return self.ra_dec_deg is not None


def compare(
    tries: Sequence[tuple[str, Task[Trial]]], tell: Callable[[Trial], None] = lambda _: None
) -> Task[list[Trial]]:
    """One after the other, each by its name; ``tell`` is called with each as it is done."""
    trials = []
    for number, (name, task) in enumerate(tries):
        share = number / len(tries)
        yield Progress("laboratory", share, name)
        trial = yield from with_progress(task, share, name)
        trials.append(trial)
        tell(trial)
    return trials


def with_progress(task: Task[T], share: float, detail: str) -> Task[T]:
    """The same task with its progress shown as the Laboratory's, except long preparations."""
    while True:
        try:
            progress = next(task)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        yield progress if progress.stage == PREPARING else Progress("laboratory", share, detail)


def scale_hint(truth: FieldTruth, radius_deg: float | None = None) -> Hint:
    """The scale to 2 %, and with ``radius_deg`` the place to within that, as a hint."""
    scale = truth.camera.scale_arcsec_px
    centre = None if radius_deg is None else (*radec_deg(_centre(truth.camera, truth.attitude)), radius_deg)
    span = (scale / (1.0 + SCALE_SPREAD), scale * (1.0 + SCALE_SPREAD))
    return Hint(scale_arcsec_px=span, centre_deg=centre, source="laboratory")


def judged(
    kind: ComparedPart, name: str, answer: Identification | NoSolution | None, truth: FieldTruth | None, **more: Any
) -> Trial:
    """What came of it, and what the truth says of that.

    Parameters
    ----------
    kind : ComparedPart
        Method, detector or estimator.
    name : str
        Its name.
    answer : Identification or NoSolution or None
        The names and the pointing, the reason for none, or None when the time was over.
    truth : FieldTruth or None
        Where the frame points; None: nobody knows.
    **more : Any
        Fields of the trial.
    """
    if isinstance(answer, Identification):
        names, pointing = answer.matches, (answer.camera, answer.attitude)
        if truth is not None:
            right, off_arcsec = compare_pointing(*pointing, truth)
            wrong = wrong_names(names.xy, names.vectors, truth)
            more |= {"right": right, "off_arcsec": off_arcsec, "wrong": wrong}
        more |= {"matches": len(names), "log10_false_alarm": answer.log10_false_alarm}
        more |= {"ra_dec_deg": radec_deg(_centre(*pointing)), "sigma_arcsec": sigma_of(answer.attitude)}
    else:
        failure = {"reason": TOO_LONG, "advice": "Allow it more time."}
        if answer is not None:
            failure = {"reason": str(answer.reason), "advice": answer.tried or answer.advice}
        more = {"right": None if truth is None else False} | failure | more
    return Trial(kind, name, paper_for(kind, name), **more)


def sigma_of(attitude: Attitude) -> tuple[float, float, float] | None:
    """One-sigma errors along x, y and in roll, arcsec; None when they are not known."""
    sigma = attitude.sigma_arcsec
    return sigma if all(map(math.isfinite, sigma)) else None


def compare_pointing(camera: Camera, attitude: Attitude, truth: FieldTruth) -> tuple[bool, float]:
    """Whether an answer is right, and how far its centre is off, arcsec."""
    true = truth.camera
    off_rad = float(np.linalg.norm(_centre(camera, attitude) - _centre(true, truth.attitude)))
    right = off_rad * true.focal_px < truth.reach_px and camera.mirrored == true.mirrored
    # A likeness of another scale can share the centre.
    right = right and abs(camera.focal_px / true.focal_px - 1.0) < SAME_SCALE
    return bool(right), float(np.degrees(off_rad) * 3600.0)


def wrong_names(xy: Floats, vectors: Floats, truth: FieldTruth) -> int:
    """How many of the stars at ``xy`` (M, 2) px are not those at unit ``vectors`` (M, 3)."""
    true_xy = truth.camera.project(vectors @ truth.attitude.matrix.T)
    gap = np.hypot(*(true_xy - xy).T)
    return int((~(gap <= truth.reach_px)).sum())  # behind the camera is NaN, and wrong


def _centre(camera: Camera, attitude: Attitude) -> Floats:
    middle = np.array([[(camera.width - 1) / 2.0, (camera.height - 1) / 2.0]])
    return np.asarray(attitude.matrix.T @ camera.unproject(middle)[0])


thread_s = perf_counter if sys.platform == "win32" else thread_time
"""The clock for stages, s: on Windows a thread's own advances in steps of 15.6 ms, longer than most stages last."""


def timed(task: Task[T], limit_s: float) -> Task[tuple[T | None, dict[str, float]]]:
    """The task's result, None when it took longer than ``limit_s``; and seconds by stage.

    Preparing the patterns of small fields, once on a machine, counts for neither.
    """
    spent: dict[str, float] = {}
    stage = ""
    try:
        while True:
            start, result = thread_s(), None
            try:
                progress = next(task)
            except StopIteration as end:
                progress, result = None, end.value
            # The time up to a yield belongs to the stage that the yield before announced.
            if stage != PREPARING:
                spent[stage] = spent.get(stage, 0.0) + thread_s() - start
            if progress is None or sum(spent.values()) > limit_s:
                return result, spent
            stage = progress.stage
            yield progress
    finally:
        task.close()


# -- One detector on one picture: what it found, and what a solve makes of that ----------------

REACH_PX = 3.0
"""A detection within this of a star's true place is that star."""


@frozen
class DetectorScore:
    """``stars`` that were detected; of ``there`` true ones, ``true``, off by ``error_px`` (RMS).

    The error is along one axis. All but ``stars`` are None when the true places are not known.
    """

    stars: int
    true: int | None = None
    there: int | None = None
    error_px: float | None = None


def try_detector(
    frame: Frame,
    choice: Choice,
    hint: Hint | None,
    truth: FieldTruth | None,
    places: Floats | None = None,
    limit_s: float = 30.0,
) -> Task[Trial]:
    """Solve a frame with this detector and all else as ever; the time is the detector's.

    UsageError as `checked`.

    Parameters
    ----------
    frame : Frame
        The frame.
    choice : Choice
        The detector and its options.
    hint : Hint or None
        As when methods are compared, one that helps is all that is searched; None: nothing is known.
    truth : FieldTruth or None
        Where the frame points; None: nobody knows.
    places : Floats or None
        Those of all stars (N, 2) in a simulated picture, px; None: not known.
    limit_s : float
        The longest solve.
    """
    options = checked(REGISTRIES[ComparedPart.DETECTOR].load(choice.name), choice.options)
    DETECTORS.make(choice.name).detect(Frame(np.eye(64)))  # loading its libraries is not its time
    chosen: dict[str, Any] = {"detector": choice.name, "detector_options": options, "timeout_s": limit_s}
    solve_options = SolveOptions(hint=hint, use_header=False, blind_after_hint=False, **chosen)
    examined, spent = yield from timed(examine_frame(frame, solve_options), float("inf"))
    assert examined is not None, "there was no limit"
    result = examined.result
    measured: dict[str, Any] = {"found": counted(examined.detections.xy, places), "seconds": spent.get("detect", 0.0)}
    if not isinstance(result, Solution):
        return judged(ComparedPart.DETECTOR, choice.name, result, truth, **measured)
    order = np.arange(len(result.stars), dtype=np.int64)  # which detection and which row of the catalogue is not asked
    pointing = result.camera, result.attitude, result.log10_false_alarm, result.method
    answer = Identification(Matches(order, order, result.stars_px, result.star_vectors), *pointing)
    return judged(ComparedPart.DETECTOR, choice.name, answer, truth, rms_px=result.rms_px, **measured)


def counted(xy: Floats, places: Floats | None) -> DetectorScore:
    """What ``xy`` (M, 2) px found of the stars at ``places`` (N, 2) px; each counts once."""
    if places is None:
        return DetectorScore(len(xy))
    mine, theirs = mutual_nearest(xy, places, REACH_PX)
    error = float(np.sqrt(np.mean((xy[mine] - places[theirs]) ** 2))) if len(mine) else None
    return DetectorScore(len(xy), len(mine), len(places), error)
