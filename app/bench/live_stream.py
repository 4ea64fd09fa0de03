"""A stream without end from a few rendered frames: a camera that swings to and fro.

The pointing follows a cosine, so that the frames of half a swing, shown forth and back, are every
moment's frame. Rendering would cost more than what is measured here.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from app.attitude.filter import rotation_vector
from app.attitude.wahba import small_rotation
from app.core.attitude import attitude_from
from app.core.camera import Camera
from app.core.frame import Frame
from app.core.hint import Hint
from app.simulate.stars import Sensor, Sky, StarImage, render
from app.sky import open_catalogue

Floats = NDArray[np.float64]

START = datetime(2026, 3, 1, 21, 0, tzinfo=UTC)
YEAR = 2026.16
SIZES = {"1.2 MP": (1280, 960), "2 MP": (1920, 1080), "6 MP": (3000, 2000)}
EXPOSURE_S = 0.02
SWING_DEG = 0.4
SCALE_ARCSEC_PX = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """Frames of half a swing and where each truly points, ``matrices`` (N, 3, 3)."""

    camera: Camera
    frames: list[Frame]
    matrices: Floats

    def stream(self, count: int, fps: float) -> Iterator[tuple[Frame, datetime, Floats]]:
        """``count`` frames with their times and true attitudes."""
        period = 2 * (len(self.frames) - 1)
        for k in range(count):
            at = k % period
            at = min(at, period - at)
            yield self.frames[at], START + timedelta(seconds=k / fps), self.matrices[at]


def make_ring(
    width: int, height: int, count: int = 31, seed: int = 1, swing_deg: float = SWING_DEG,
    bayer: str | None = None,
) -> Ring:  # fmt: skip
    """Frames of a rich field at 30 arcsec a pixel, 20 ms each, with hot pixels.

    ``bayer`` is the pattern of a colour camera.
    """
    camera = Camera.centred(width, height, float(1.0 / np.radians(SCALE_ARCSEC_PX / 3600.0)))
    middle = attitude_from(305.0, 40.0, 12.0).matrix
    phase = np.pi * np.arange(count) / max(1, count - 1)
    axis = np.radians(swing_deg) / 2.0 * np.array([0.6, 0.8, 0.3])
    matrices = np.array([small_rotation(np.cos(p) * axis) @ middle for p in phase])
    frames = [star_frame(camera, m, seed + k, bayer=bayer) for k, m in enumerate(matrices)]
    return Ring(camera, frames, matrices)


def star_frame(
    camera: Camera, matrix: Floats, seed: int, trail_px: tuple[float, float] = (0.0, 0.0),
    bayer: str | None = None,
) -> Frame:  # fmt: skip
    """One frame of the sky at ``matrix`` (3, 3)."""
    catalogue = open_catalogue()
    half = float(np.arctan(np.hypot(camera.width, camera.height) / 2.0 / camera.focal_px))
    rows = catalogue.brightest(matrix[2], half, 1500, YEAR)
    xy = camera.project(catalogue.vectors(rows, YEAR) @ matrix.T)
    flux = 4000.0 * 10.0 ** (-0.4 * (catalogue.mag(rows) - 8.0))
    seen = np.isfinite(xy).all(axis=1)
    sky, image = Sky(level_e=80.0, hot_per_mp=20.0), StarImage(2.6, trail_px=trail_px)
    frame = render(
        camera.width, camera.height, xy[seen], flux[seen], image, sky, Sensor(bayer=bayer),
        seed=seed,
    )  # fmt: skip
    return replace(frame, hint=Hint(exposure_s=EXPOSURE_S))


def off_arcsec(matrix: Floats, truth: Floats) -> Floats:
    """The rotation (3,), arcsec, from one attitude to another."""
    return rotation_vector(truth @ matrix.T) * float(np.degrees(3600.0))
