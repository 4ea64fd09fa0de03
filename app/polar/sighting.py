"""A solved frame as polar alignment sees it: an attitude at a moment, and how sure it is."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude
from app.core.hint import Site
from app.core.solution import Solution
from app.polar.horizon import STANDARD_AIR, Air, Horizon
from app.polar.rotations import ARCSEC, alt_az, best_rotation

Floats = NDArray[np.float64]

GRID = 5  # field points a side
WIDEST_DEG = 20.0
"""Beyond this much of the field refraction is no longer nearly linear; its middle is used."""

FLOOR_ARCSEC = 0.7
"""No frame is believed to better than this: seeing, and refraction as the air really is."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """Where a camera pointed, ICRS, at mid-exposure.

    ``attitude`` carries its covariance; ``field_deg`` is (width, height). ``sweep`` counts the
    sweeps: frames of one sweep differ only by turns about the axis. ``label`` names the frame.
    """

    attitude: Attitude
    time_utc: datetime
    field_deg: tuple[float, float] = (2.0, 2.0)
    label: str = ""
    sweep: int = 0

    @classmethod
    def of(
        cls, solution: Solution, time_utc: datetime, label: str = "", sweep: int = 0
    ) -> "Sighting":
        """The sighting of a solved frame."""
        return cls(solution.attitude, time_utc, solution.camera.fov_deg, label, sweep)


@dataclass(frozen=True, slots=True, eq=False)
class LocalAttitude:
    """A camera among the things on the ground.

    ``matrix`` (3, 3) takes camera axes to E, N, U; ``covariance`` (3, 3), rad^2, is of a small
    rotation about the camera's axes.
    """

    matrix: Floats
    covariance: Floats
    time_utc: datetime
    label: str = ""
    sweep: int = 0

    @property
    def boresight(self) -> Floats:
        """Unit vector (3,) in E, N, U."""
        return np.asarray(self.matrix[:, 2])

    @property
    def altitude_deg(self) -> float:
        """How high the camera looks."""
        return float(np.degrees(alt_az(self.boresight)[0]))


def to_local(sighting: Sighting, site: Site, air: Air = STANDARD_AIR) -> LocalAttitude:
    """The sighting's camera in E, N, U: field points taken to apparent places, then a rotation.

    The rotation is the least-squares one over a grid of the field, which is what the solver would
    have found from stars spread over it.
    """
    points = _field_points(sighting.field_deg)
    icrs = points @ sighting.attitude.matrix
    seen = Horizon(site, sighting.time_utc, air).observed(icrs)
    matrix = best_rotation(points, seen)
    return LocalAttitude(
        matrix, covariance_of(sighting.attitude), sighting.time_utc, sighting.label, sighting.sweep
    )


def covariance_of(attitude: Attitude) -> Floats:
    """The attitude's covariance, with what no solve can know added.

    Raises
    ------
    ValueError
        The attitude has none, so nothing could be said of the axis's uncertainty.

    """
    if attitude.covariance is None:
        raise ValueError("An attitude without a covariance cannot be weighed.")
    return np.asarray(attitude.covariance + np.eye(3) * (FLOOR_ARCSEC * ARCSEC) ** 2)


def _field_points(field_deg: tuple[float, float]) -> Floats:
    """Unit vectors (GRID^2, 3) in camera axes over the field, or over its middle."""
    half = [np.tan(np.radians(min(max(side, 0.05), WIDEST_DEG) / 2.0)) for side in field_deg]
    steps = np.linspace(-1.0, 1.0, GRID)
    x, y = np.meshgrid(half[0] * steps, half[1] * steps)
    v = np.stack([x.ravel(), y.ravel(), np.ones(GRID * GRID)], axis=-1)
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))
