"""How surely an axis will be known, before and during: how much to turn, and whether it helps."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.polar.axis_fit import foreseen_covariance
from app.polar.rotations import ARCSEC, about, direction

Floats = NDArray[np.float64]

STEP_DEG, MOST_DEG = 5.0, 120.0


@dataclass(frozen=True, slots=True)
class Optics:
    """What one solve is worth, arcsec: across the field and in roll."""

    sigma_arcsec: float = 2.0
    sigma_roll_arcsec: float = 20.0

    @classmethod
    def of_field(cls, scale_arcsec_px: float, width_px: int, stars: int = 50) -> "Optics":
        """The usual errors of a camera: 0.2 px a star, roll from stars spread over the frame."""
        a_star = 0.2 * scale_arcsec_px / np.sqrt(max(stars, 3))
        spread_px = width_px / np.sqrt(12.0)
        roll = a_star / (spread_px * scale_arcsec_px * ARCSEC)
        return cls(max(float(a_star), 0.5), max(float(roll), 2.0))

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3), rad^2, of a rotation about the camera's axes."""
        sigma = np.array([self.sigma_arcsec, self.sigma_arcsec, self.sigma_roll_arcsec])
        return np.diag(np.square(sigma * ARCSEC))


def plane_of_three_arcsec(sigma_arcsec: float, turn_deg: float) -> float:
    """Uncertainty of the plane through three boresights, evenly turned, both directions."""
    half = np.radians(turn_deg) / 2.0
    return float(
        np.hypot(
            sigma_arcsec / (np.sqrt(2.0) * np.sin(half)),
            sigma_arcsec * np.sqrt(1.5) / (1.0 - np.cos(half)),
        )
    )


def two_attitudes_arcsec(optics: Optics, rho_deg: float, turn_deg: float) -> float:
    """Uncertainty of the axis of two attitudes, boresight ``rho_deg`` from it, both directions."""
    rho, half = np.radians([rho_deg, turn_deg / 2.0])
    across = optics.sigma_arcsec**2 * (1.0 + np.cos(rho) ** 2)
    roll = (optics.sigma_roll_arcsec * np.sin(rho)) ** 2
    return float(np.sqrt(2.0 * (across + roll)) / (2.0 * np.sin(half)))


def weighted_arcsec(optics: Optics, rho_deg: float, turn_deg: float, frames: int) -> float:
    """Uncertainty of the weighted fit of ``frames`` attitudes, evenly turned, both directions."""
    turns = np.radians(turn_deg) * np.linspace(0.0, 1.0, frames)
    return _uncertainty_arcsec(optics, rho_deg, turns)


def turn_needed_deg(
    optics: Optics, rho_deg: float, goal_arcsec: float, frames: int = 3
) -> float | None:
    """The smallest turn, in steps of 5 deg, that gets the axis that sure; None: not by 120 deg."""
    return _least(
        MOST_DEG,
        lambda turn: weighted_arcsec(optics, rho_deg, turn, frames) <= goal_arcsec,
    )


def more_turn_deg(
    optics: Optics, rho_deg: float, turns_rad: Floats, goal_arcsec: float
) -> float | None:
    """How much further to turn, with one more frame there; 0 when it is enough, None: hopeless."""
    if len(turns_rad) >= 2 and _uncertainty_arcsec(optics, rho_deg, turns_rad) <= goal_arcsec:
        return 0.0
    first, last = float(np.min(turns_rad)), float(np.max(turns_rad))
    room = MOST_DEG - np.degrees(last - first)
    return _least(
        room,
        lambda more: (
            _uncertainty_arcsec(optics, rho_deg, np.append(turns_rad, last + np.radians(more)))
            <= goal_arcsec
        ),
    )


def _least(most_deg: float, enough: Callable[[float], bool]) -> float | None:
    """The smallest turn in steps that is enough, up to the most; None: not even that one.

    Turning further never makes it worse, up to half a turn, so the steps are halved.
    """
    low, high = 0, int(np.ceil((most_deg + 1.0) / STEP_DEG)) - 1
    if high < 1 or not enough(high * STEP_DEG):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle * STEP_DEG) else (middle, high)
    return high * STEP_DEG


def _uncertainty_arcsec(optics: Optics, rho_deg: float, turns_rad: Floats) -> float:
    """What the fit itself says of perfect attitudes with these errors."""
    if float(np.ptp(turns_rad)) < 1e-4:
        return float("inf")
    axis = direction(0.7, 0.0)
    sideways = np.array([1.0, 0.0, 0.0])
    boresight = about(sideways, np.radians(rho_deg)) @ axis
    first = np.stack([sideways, np.cross(boresight, sideways), boresight], axis=1)
    covariance = foreseen_covariance(axis, turns_rad - turns_rad[0], first, optics.covariance)
    return float(np.sqrt(np.trace(covariance))) / ARCSEC
