"""Where a stream's camera may point at the next frame's time, and how large its windows must be.

Mostly that is where the filter says. When nothing is there, or when after one frame or a long
exposure the filter knows so little of the velocity that the stars may be outside any window, two
more motions are tried that cameras have at night: none against the stars (a mount that tracks), and
none against the ground, which is the Earth's rotation about the celestial pole. Neither needs a
site.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.attitude.filter import ARCSEC, Motion, State, predicted, rotation_vector
from app.core.camera import Camera
from app.core.earth import SIDEREAL_RAD_S

Floats = NDArray[np.float64]

SMALLEST_PX = 8  # half a window's side at least
APART_PX = 8.0  # places nearer to each other are one


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A prediction, and half the side of the windows around the stars it expects, px.

    ``roll_px`` is what one sigma of roll moves a star at the frame's corner.
    """

    ahead: State
    half: int
    roll_px: float


def places(
    state: State, time_s: float, motion: Motion, camera: Camera, fwhm_px: float,
    most_px: tuple[int, int],
) -> Iterator[Place]:  # fmt: skip
    """Where to look at ``time_s``, the likeliest first.

    ``most_px`` is half the side of the largest window, and of the largest when the prediction is
    less certain than that allows.
    """
    usual, far = most_px
    wide: list[Floats] = []  # looked at in windows that are not small
    least = SMALLEST_PX
    for rates in (state.rates_rad_s, np.zeros(3), SIDEREAL_RAD_S * state.matrix[:, 2]):
        ahead = predicted(_moving(state, rates, motion), time_s, motion)
        if any(_apart_px(ahead.matrix, other, camera) < APART_PX for other in wide):
            continue
        error_px, roll_px = _error_px(ahead, camera), _roll_px(ahead, camera)
        most = usual if error_px <= usual else far
        half = int(np.clip(np.ceil(error_px + 2.0 * fwhm_px + 2.0), least, most))
        yield Place(ahead, half, min(roll_px, float(most)))
        least = usual  # what was believed of the motion was wrong
        if half >= usual:
            wide.append(ahead.matrix)


def _moving(state: State, rates: Floats, motion: Motion) -> State:
    """The same pointing with another velocity (3,), rad/s, which is as little known as at first."""
    if np.array_equal(rates, state.rates_rad_s):
        return state
    covariance = state.covariance.copy()
    covariance[3:, :] = covariance[:, 3:] = 0.0
    covariance[3:, 3:] = np.eye(3) * (motion.rate_sigma_arcsec_s * ARCSEC) ** 2
    return replace(state, rates_rad_s=rates, covariance=covariance)


def _error_px(ahead: State, camera: Camera) -> float:
    """Four sigma of where a star is expected, px."""
    tilt = float(np.sqrt(np.linalg.eigvalsh(ahead.covariance[:2, :2])[-1]))
    return 4.0 * float(np.hypot(camera.focal_px * tilt, _roll_px(ahead, camera)))


def _roll_px(ahead: State, camera: Camera) -> float:
    return _corner_px(camera) * float(np.sqrt(ahead.covariance[2, 2]))


def _apart_px(one: Floats, other: Floats, camera: Camera) -> float:
    """How far apart two attitudes put the same stars."""
    x, y, roll = rotation_vector(one @ other.T)
    return float(np.hypot(camera.focal_px * np.hypot(x, y), _corner_px(camera) * roll))


def _corner_px(camera: Camera) -> float:
    return float(np.hypot(camera.width, camera.height)) / 2.0
