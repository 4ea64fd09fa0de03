"""A person compares the parts of a solve on the same stars, with the truth beside them.

Methods, detectors or estimators of the attitude, see :mod:`app.workflows.laboratory_kinds`. The
stars are those of a frame, whose accepted solution stands for the truth, or of a simulated field.
The sky's simulator is not known here: :data:`MakeField` and :data:`MakePicture` are handed in.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude, radec_deg
from app.core.camera import Camera
from app.core.detections import Detections
from app.core.frame import Frame
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import NoSolution
from app.solve.stopwatch import PREPARING
from app.workflows.laboratory_kinds import Kind, paper_for

if TYPE_CHECKING:
    from app.workflows.laboratory_detectors import Found

Floats = NDArray[np.float64]
T = TypeVar("T")

RIGHT_PX = 5.0
NOISE_SPARED = 4.0  # an imprecise answer to a noisy field is not a wrong one
SAME_SCALE = 0.03
TOO_LONG = "timed out"
SCALE_SPREAD = 0.02
PLACE_DEG = 10.0
"""Within this of the true centre, when the methods are told the place."""


@dataclass(frozen=True, slots=True)
class Choice:
    """One method, detector or estimator with the options that were changed."""

    name: str
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


class Seen(Protocol):
    """The camera that saw something, and where it pointed."""

    @property
    def camera(self) -> Camera:
        """The camera that saw it."""
        ...

    @property
    def attitude(self) -> Attitude:
        """Where that pointed."""
        ...


class TrueField(Seen, Protocol):
    """A list of stars together with the camera that saw them."""

    @property
    def detections(self) -> Detections:
        """What was detected, brightest first."""
        ...


class TruePicture(Seen, Protocol):
    """A simulated picture together with its camera and its stars."""

    @property
    def frame(self) -> Frame:
        """The picture."""
        ...

    @property
    def places(self) -> Floats:
        """Where its stars are, (N, 2) px."""
        ...


MakeField = Callable[[FieldWish, Sequence[int]], TrueField]
"""Makes a field at a random place; the same seeds make the same field."""
MakePicture = Callable[[FieldWish, Sequence[int]], TruePicture]
"""The same as a picture: the faintest star is as bright as its noise of a position asks."""


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
    def of(cls, field: Seen, wish: FieldWish) -> "Truth":
        """That of a simulated field."""
        return cls(field.camera, field.attitude, max(RIGHT_PX, NOISE_SPARED * wish.noise_px))

    @property
    def centre(self) -> tuple[float, float]:
        """ICRS degrees of the frame's centre."""
        return radec_deg(_centre(self.camera, self.attitude))


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of the stars with one method, detector or estimator.

    ``seconds`` is its processor time, with a method's tables at hand; ``tables_s`` is what making
    those took, when this was their first use. ``right`` and ``wrong`` (names that are not the
    star's) are None when the truth is not known. ``off_arcsec`` is between the centres.
    ``found`` is what a detector saw. ``from_fit_arcsec`` is how far an estimator's attitude is
    from that of the fit, on the sky and in roll. ``sigma_arcsec`` are one-sigma errors along x,
    along y, and of roll.
    """

    kind: Kind
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
    found: "Found | None" = None
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
    """One after the other, each by its name; ``tell`` hears of each as it is done."""
    trials = []
    for number, (name, task) in enumerate(tries):
        share = number / len(tries)
        yield Progress("laboratory", share, name)
        trial = yield from told_as(task, share, name)
        trials.append(trial)
        tell(trial)
    return trials


def told_as(task: Task[T], share: float, detail: str) -> Task[T]:
    """The same task with every step told as the laboratory's, but for long preparations."""
    while True:
        try:
            progress = next(task)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        told = Progress("laboratory", share, detail)
        yield progress if progress.stage == PREPARING else told


def scale_hint(truth: Truth, radius_deg: float | None = None) -> Hint:
    """The scale to 2 %, and with ``radius_deg`` the place to within that, as a hint."""
    scale = truth.camera.scale_arcsec_px
    centre = None if radius_deg is None else (*truth.centre, radius_deg)
    span = (scale / (1.0 + SCALE_SPREAD), scale * (1.0 + SCALE_SPREAD))
    return Hint(scale_arcsec_px=span, centre_deg=centre, source="laboratory")


def none_of(kind: Kind, name: str, refusal: NoSolution | None, truth: Truth | None) -> Trial:
    """No answer and the reason for it; None when the time was over."""
    reason = TOO_LONG if refusal is None else str(refusal.reason)
    said = "Allow it more time." if refusal is None else refusal.tried or refusal.advice
    right = None if truth is None else False
    return Trial(kind, name, paper_for(kind, name), right=right, reason=reason, advice=said)


def answer_of(
    kind: Kind, name: str, camera: Camera, attitude: Attitude, xy: Floats, vectors: Floats,
    truth: Truth | None,
) -> Trial:  # fmt: skip
    """An answer and what is to be said of it.

    The stars at ``xy`` (M, 2) px were taken for those at ICRS unit ``vectors`` (M, 3).
    """
    centre = radec_deg(_centre(camera, attitude))
    trial = Trial(kind, name, paper_for(kind, name), ra_dec_deg=centre, matches=len(xy))
    if truth is None:
        return trial
    right, off_arcsec = judge(camera, attitude, truth)
    return replace(trial, right=right, off_arcsec=off_arcsec, wrong=wrong_names(xy, vectors, truth))


def sigma_of(attitude: Attitude) -> tuple[float, float, float] | None:
    """One-sigma errors along x, y and in roll, arcsec; None when they are not known."""
    sigma = attitude.sigma_arcsec
    return sigma if all(map(math.isfinite, sigma)) else None


def judge(camera: Camera, attitude: Attitude, truth: Truth) -> tuple[bool, float]:
    """Whether an answer is right, and how far its centre is off, arcsec."""
    true = truth.camera
    off_rad = float(np.linalg.norm(_centre(camera, attitude) - _centre(true, truth.attitude)))
    right = off_rad * true.focal_px < truth.reach_px and camera.mirrored == true.mirrored
    right = right and abs(camera.focal_px / true.focal_px - 1.0) < SAME_SCALE
    return bool(right), float(np.degrees(off_rad) * 3600.0)


def wrong_names(xy: Floats, vectors: Floats, truth: Truth) -> int:
    """How many of the stars at ``xy`` (M, 2) px are not those at unit ``vectors`` (M, 3)."""
    true_xy = truth.camera.project(vectors @ truth.attitude.matrix.T)
    gap = np.hypot(*(true_xy - xy).T)
    return int((~(gap <= truth.reach_px)).sum())  # behind the camera is NaN, and wrong


def _centre(camera: Camera, attitude: Attitude) -> Floats:
    middle = np.array([[(camera.width - 1) / 2.0, (camera.height - 1) / 2.0]])
    return np.asarray(attitude.matrix.T @ camera.unproject(middle)[0])
