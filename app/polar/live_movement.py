"""What moved between two live frames: a bolt, the RA axis, or the declination axis.

Any small rotation can be made of two bolts and a turn about RA, so one movement of the declination
axis always passes for all three at once. It is told by being simple: the whole change is a turn
about the one line across boresight and polar axis, while neither the bolts with RA as the clock
says, nor RA alone, explain it. Where that line lies in the plane of the two bolts - on the
meridian, and everywhere from the Earth's equator - nothing tells it from them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.polar.rotations import ARCSEC, about, rotation_vector
from app.polar.sighting import LocalAttitude

Floats = NDArray[np.float64]

CLOCK_SIGMA_RAD = 20.0 * ARCSEC
LEAST_RAD = 60.0 * ARCSEC
REFUTED, BELIEVED = 20.0, 9.0
"""Chi-squares, one or two degrees of freedom: too large for noise, and well within it."""


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A live frame: its turn about RA, with the variance and slope of that, and its axis (3,)."""

    attitude: LocalAttitude
    theta_rad: float
    slope: Floats
    axis: Floats

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3), rad^2, of a small rotation in E, N, U."""
        matrix = self.attitude.matrix
        return np.asarray(matrix @ self.attitude.covariance @ matrix.T)


def declination_moved(before: Moment, now: Moment, turns_rad: Sequence[float]) -> float | None:
    """By how much, radians, the declination axis moved between two frames; None: it did not.

    ``turns_rad`` are the turns about RA that a clock allows: standing still, tracking or both.
    """
    if any(_bolts_did_it(before, now, turn) for turn in turns_rad) or _axis_stood(before, now):
        return None
    found = [angle for turn in turns_rad if (angle := _declination(before, now, turn)) is not None]
    return max(found, key=abs, default=None)


def _bolts_did_it(before: Moment, now: Moment, turn_rad: float) -> bool:
    """Whether RA turned as the clock says, so that bolts explain the rest, or nothing moved."""
    left = (now.theta_rad - before.theta_rad - turn_rad + np.pi) % (2.0 * np.pi) - np.pi
    variance = sum(m.slope @ m.attitude.covariance @ m.slope for m in (before, now))
    return bool(left**2 <= REFUTED * (variance + CLOCK_SIGMA_RAD**2))


def _axis_stood(before: Moment, now: Moment) -> bool:
    """Whether the polar axis is where it was, as when only RA turned, however far."""
    shift = np.cross(before.axis, now.axis)
    covariance = before.covariance + now.covariance
    return bool(shift @ np.linalg.solve(covariance, shift) <= REFUTED)


def _declination(before: Moment, now: Moment, turn_rad: float) -> float | None:
    """The turn about the declination axis alone that makes the one frame of the other."""
    turned = about(before.axis, turn_rad) @ before.attitude.matrix
    moved = rotation_vector(now.attitude.matrix @ turned.T)
    across = np.cross(turned[:, 2], before.axis)
    length = float(np.linalg.norm(across))
    if length < 0.05:  # the camera looks along the polar axis
        return None
    across /= length
    angle = float(moved @ across)
    covariance = before.covariance + now.covariance
    covariance = covariance + CLOCK_SIGMA_RAD**2 * np.outer(before.axis, before.axis)
    rest = moved - angle * across
    inverse = np.linalg.inv(covariance)
    chi2 = rest @ inverse @ rest - (across @ inverse @ rest) ** 2 / (across @ inverse @ across)
    return angle if chi2 <= BELIEVED and abs(angle) > LEAST_RAD else None
