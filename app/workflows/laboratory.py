"""A person compares methods of identification on the same stars, with the truth beside them.

The stars are those of a frame, whose accepted solution stands for the truth, or of a simulated
field. The sky's simulator is not known here: :data:`MakeField` is handed in.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import thread_time
from typing import Any, Protocol, TypeVar

import numpy as np

from app.attitude.fit import refine
from app.core.attitude import Attitude, radec_deg
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import Identification, NoSolution
from app.identify import make_identifier
from app.identify.options import checked_options, paper_of
from app.solve.stopwatch import PREPARING

T = TypeVar("T")

RIGHT_PX = 5.0
NOISE_SPARED = 4.0  # an imprecise answer to a noisy field is not a wrong one
SAME_SCALE = 0.03
TOO_LONG = "timed out"
SCALE_SPREAD = 0.02


@dataclass(frozen=True, slots=True)
class Choice:
    """One method with the options that were changed."""

    method: str
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FieldWish:
    """What a simulated field shall be like.

    ``stars`` is the length of its list; ``false`` the number of false stars as a share of the
    real ones; ``missing`` the share of the catalogue's stars that were not detected.
    """

    fov_deg: float = 20.0
    stars: int = 20
    noise_px: float = 0.3
    false: float = 0.1
    missing: float = 0.1
    size_px: int = 2048


class TrueField(Protocol):
    """A list of stars together with the camera that saw them."""

    @property
    def detections(self) -> Detections:
        """What was detected, brightest first."""
        ...

    @property
    def camera(self) -> Camera:
        """The camera that saw it."""
        ...

    @property
    def attitude(self) -> Attitude:
        """Where that pointed."""
        ...


MakeField = Callable[[FieldWish, Sequence[int]], TrueField]
"""Makes a field at a random place; the same seeds make the same field."""


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Where the camera really pointed.

    An answer is right when its centre is within ``reach_px`` of the true one, and a name when its
    star is within that of the detection.
    """

    camera: Camera
    attitude: Attitude
    reach_px: float = RIGHT_PX

    @classmethod
    def of(cls, field: TrueField, wish: FieldWish) -> "Truth":
        """That of a simulated field."""
        return cls(field.camera, field.attitude, max(RIGHT_PX, NOISE_SPARED * wish.noise_px))

    @property
    def centre(self) -> tuple[float, float]:
        """ICRS degrees of the frame's centre."""
        return radec_deg(_centre(self.camera, self.attitude))


@dataclass(frozen=True, slots=True)
class Trial:
    """What one method made of one list of stars.

    ``seconds`` is processor time, with the method's tables at hand; ``tables_s`` is what making
    those took, when this was their first use. ``right`` and ``wrong`` (names that are not the
    star's) are None when the truth is not known. ``off_arcsec`` is between the centres.
    """

    method: str
    paper: str
    seconds: float
    tables_s: float = 0.0
    ra_dec_deg: tuple[float, float] | None = None
    right: bool | None = None
    matches: int = 0
    wrong: int | None = None
    off_arcsec: float | None = None
    sigma_arcsec: tuple[float, float, float] | None = None
    log10_false_alarm: float | None = None
    reason: str = ""
    advice: str = ""

    @property
    def answered(self) -> bool:
        """Whether the method gave an answer, right or wrong."""
        return self.ra_dec_deg is not None


def compare(
    detections: Detections,
    choices: Sequence[Choice],
    hint: Hint | None,
    truth: Truth | None,
    year: float = 2016.0,
    limit_s: float = 30.0,
    tell: Callable[[Trial], None] = lambda _: None,
) -> Task[list[Trial]]:
    """Run every chosen method on the same detections; ``tell`` hears of each as it is done.

    Raises
    ------
    UsageError
        A method is not known, or one of its options is not allowed.

    """
    trials = []
    for number, choice in enumerate(choices):
        share = number / len(choices)
        yield Progress("laboratory", share, choice.method)
        task = try_method(detections, choice, hint, truth, year, limit_s)
        trial = yield from told_as(task, share, choice.method)
        trials.append(trial)
        tell(trial)
    return trials


def try_method(
    detections: Detections,
    choice: Choice,
    hint: Hint | None,
    truth: Truth | None,
    year: float = 2016.0,
    limit_s: float = 30.0,
) -> Task[Trial]:
    """Run one method; a second time when the first had to make its tables."""
    identifier = make_identifier(choice.method, **checked_options(choice.method, choice.options))
    found, seconds = yield from _limited(identifier.identify(detections, hint, year), limit_s)
    tables = 0.0
    if found is not None and _first_use(choice, hint, detections):
        first = seconds
        found, seconds = yield from _limited(identifier.identify(detections, hint, year), limit_s)
        tables = max(0.0, first - seconds)
    return _trial(choice.method, found, truth, seconds, tables)


def scale_hint(truth: Truth, radius_deg: float | None = None) -> Hint:
    """The scale to 2 %, and with ``radius_deg`` the place to within that, as a hint."""
    scale = truth.camera.scale_arcsec_px
    centre = None if radius_deg is None else (*truth.centre, radius_deg)
    span = (scale / (1.0 + SCALE_SPREAD), scale * (1.0 + SCALE_SPREAD))
    return Hint(scale_arcsec_px=span, centre_deg=centre, source="laboratory")


_used: set[object] = set()


def _first_use(choice: Choice, hint: Hint | None, detections: Detections) -> bool:
    """Whether this may have made tables: they depend on method, options and field."""
    scale = hint.scale_arcsec_px[0] if hint is not None and hint.scale_arcsec_px else 0.0
    field_deg = round(scale * detections.width / 3600.0)
    key = (choice.method, tuple(sorted((k, str(v)) for k, v in choice.options.items())), field_deg)
    new = key not in _used
    _used.add(key)
    return new


def _limited(
    task: Task[Identification | NoSolution], limit_s: float
) -> Task[tuple[Identification | NoSolution | None, float]]:
    """The task's result, None when it took longer than ``limit_s``; and its processor time, s."""
    spent, stage = 0.0, ""
    try:
        while True:
            start = thread_time()
            try:
                progress = next(task)
            except StopIteration as end:
                return end.value, spent + thread_time() - start
            if stage != PREPARING:
                spent += thread_time() - start
            stage = progress.stage
            if spent > limit_s:
                return None, spent
            yield progress
    finally:
        task.close()


def told_as(task: Task[T], share: float, detail: str) -> Task[T]:
    """The same task with every step told as the laboratory's, but for long preparations."""
    while True:
        try:
            progress = next(task)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        told = Progress("laboratory", share, detail)
        yield progress if progress.stage == PREPARING else told


def _trial(
    method: str, found: Identification | NoSolution | None, truth: Truth | None, seconds: float,
    tables_s: float,
) -> Trial:  # fmt: skip
    paper = paper_of(method) or "Kochab's own"
    if not isinstance(found, Identification):
        reason = TOO_LONG if found is None else str(found.reason)
        said = "Allow it more time." if found is None else found.tried or found.advice
        right = None if truth is None else False
        return Trial(method, paper, seconds, tables_s, right=right, reason=reason, advice=said)
    found, sigma = pointed(found)
    right, off, wrong = (None, None, None) if truth is None else judge(found, truth)
    return Trial(
        method, paper, seconds, tables_s,
        radec_deg(_centre(found.camera, found.attitude)), right, len(found.matches), wrong, off,
        sigma, found.log10_false_alarm,
    )  # fmt: skip


def judge(found: Identification, truth: Truth) -> tuple[bool, float, int]:
    """Whether an answer is right, how far its centre is off (arcsec), and how many names wrong."""
    camera = truth.camera
    a = _centre(found.camera, found.attitude)
    off_rad = float(np.linalg.norm(a - _centre(camera, truth.attitude)))
    same_scale = abs(found.camera.focal_px / camera.focal_px - 1.0) < SAME_SCALE
    right = off_rad * camera.focal_px < truth.reach_px and same_scale
    right = right and found.camera.mirrored == camera.mirrored
    true_xy = camera.project(found.matches.vectors @ truth.attitude.matrix.T)
    gap = np.hypot(*(true_xy - found.matches.xy).T)
    wrong = int((~(gap <= truth.reach_px)).sum())  # behind the camera is NaN, and wrong
    return bool(right), float(np.degrees(off_rad) * 3600.0), wrong


def _centre(camera: Camera, attitude: Attitude) -> np.ndarray:
    middle = np.array([[(camera.width - 1) / 2.0, (camera.height - 1) / 2.0]])
    return np.asarray(attitude.matrix.T @ camera.unproject(middle)[0])


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
    sigma = fit.attitude.sigma_arcsec
    if not all(np.isfinite(sigma)):
        return found, None
    return replace(found, camera=fit.camera, attitude=fit.attitude), sigma
