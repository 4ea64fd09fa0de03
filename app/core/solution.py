"""The answer, and the honest lack of one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude, radec_deg, roll_at
from app.core.camera import Camera

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Detections paired with catalogue stars; all arrays share the length M.

    ``detection`` (M,) indexes the detections, ``star`` (M,) the catalogue's rows; ``xy`` (M, 2)
    px; ``vectors`` (M, 3) ICRS unit vectors at the frame's date.
    """

    detection: Ints
    star: Ints
    xy: Floats
    vectors: Floats

    def __len__(self) -> int:
        return len(self.detection)


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """What an identifier returns: matches, a camera and an attitude good to a pixel or so.

    ``log10_false_alarm`` bounds the probability that chance alone gives so good an agreement,
    after counting every candidate tried (``candidates``).
    """

    matches: Matches
    camera: Camera
    attitude: Attitude
    log10_false_alarm: float
    method: str
    candidates: int = 1


@dataclass(frozen=True, slots=True)
class NamedStar:
    """One identified star, for people and for JSON. ``mag`` is V; degrees are ICRS."""

    x: float
    y: float
    id: str
    name: str
    mag: float
    ra_deg: float
    dec_deg: float
    residual_px: float


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """A pointing with its evidence. Angles are ICRS (J2000) and belong to the frame's centre."""

    camera: Camera
    attitude: Attitude
    stars: tuple[NamedStar, ...]
    rms_px: float
    log10_false_alarm: float
    method: str
    detections: int = 0
    elapsed_ms: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def centre_vector(self) -> Floats:
        """ICRS unit vector (3,) at the middle of the frame, distortion included."""
        middle = np.array([[(self.camera.width - 1) / 2, (self.camera.height - 1) / 2]])
        return np.asarray(self.attitude.matrix.T @ self.camera.unproject(middle)[0])

    @property
    def ra_dec_deg(self) -> tuple[float, float]:
        """ICRS degrees of the middle of the frame."""
        return radec_deg(self.centre_vector)

    @property
    def roll_deg(self) -> float:
        """Position angle of the frame's up at its middle, degrees east of north."""
        return roll_at(self.attitude.matrix, self.centre_vector)

    @property
    def rms_arcsec(self) -> float:
        """Residual RMS on the sky."""
        return self.rms_px * self.camera.scale_arcsec_px

    def sky_at(self, pixels: Floats) -> Floats:
        """ICRS unit vectors (N, 3) of pixels (N, 2)."""
        return np.asarray(self.camera.unproject(pixels) @ self.attitude.matrix)

    def pixels_of(self, vectors: Floats) -> Floats:
        """Pixels (N, 2) of ICRS unit vectors (N, 3); NaN behind the camera."""
        return self.camera.project(np.asarray(vectors) @ self.attitude.matrix.T)


class Reason(StrEnum):
    """Why there is no answer; the fixed list."""

    TOO_FEW_STARS = "too few stars"
    TRAILED = "trailed"
    OUT_OF_FOCUS = "out of focus"
    CLOUDED_OR_DARK = "clouded or dark"
    FIELD_TOO_SMALL = "field too small for the catalogue"
    NO_PATTERN_AGREED = "no pattern agreed"
    DISTORTION_TOO_STRONG = "distortion too strong"
    CANCELLED = "cancelled"
    TIMED_OUT = "timed out"


@dataclass(frozen=True, slots=True)
class NoSolution:
    """No answer is a value: why, what was measured and tried, and one thing to do next."""

    reason: Reason
    advice: str
    tried: str = ""
    detections: int = 0
    elapsed_ms: Mapping[str, float] = field(default_factory=dict)
    measured: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def looked(self) -> bool:
        """Whether anything was looked at: a method that lacks what it needs tries ``nothing``."""
        return not self.tried.startswith("nothing")
