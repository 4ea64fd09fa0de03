"""Attitudes of an equatorial mount written down directly: no code of ``kochab.polar`` takes part.

Axes are E, N, U. The axis of a mount that is ``d_alt`` too high and ``d_az`` too far clockwise is
built from angles, turns are scipy's, and noise is a small rotation about the camera's own axes.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from kochab.core.frame import Site
from kochab.polar.sighting import LocalAttitude

ARCSEC = np.pi / 648000.0
WHEN = datetime(2026, 3, 14, 20, 0, tzinfo=UTC)


def pointing(alt_rad, az_rad):
    return np.array([np.cos(alt_rad) * np.sin(az_rad), np.cos(alt_rad) * np.cos(az_rad), np.sin(alt_rad)])


@dataclass(frozen=True)
class Mount:
    """An equatorial mount with its axis off the (true) pole, arcsec; the camera rolled at will."""

    latitude_deg: float = 40.0
    d_alt: float = 0.0
    d_az: float = 0.0
    rho_deg: float = 60.0
    roll_deg: float = 25.0
    hour_deg: float = 10.0
    sigma: float = 2.0
    sigma_roll: float = 20.0

    @property
    def site(self):
        return Site(self.latitude_deg, 10.0, 300.0)

    @property
    def pole(self):
        return pointing(np.radians(abs(self.latitude_deg)), 0.0 if self.latitude_deg >= 0 else np.pi)

    @property
    def axis(self):
        alt = np.radians(abs(self.latitude_deg)) + self.d_alt * ARCSEC
        az = (0.0 if self.latitude_deg >= 0 else np.pi) + self.d_az * ARCSEC
        return pointing(alt, az)

    def attitude(self, turn_deg):
        """Camera to E, N, U after a turn about the axis."""
        return attitude(self, float(turn_deg))

    def see(self, turns_deg, rng=None, after=None, seconds=60.0, sweep=0):
        """Local attitudes at these turns; ``after`` (k, matrix) turns the camera from frame k on."""
        sigma = np.array([self.sigma, self.sigma, self.sigma_roll]) * ARCSEC
        seen = []
        for k, turn in enumerate(turns_deg):
            matrix = self.attitude(turn)
            if after is not None and k >= after[0]:
                matrix = matrix @ after[1]
            if rng is not None:
                matrix = matrix @ Rotation.from_rotvec(rng.normal(0.0, sigma)).as_matrix()
            when = WHEN + timedelta(seconds=seconds * k)
            seen.append(LocalAttitude(matrix, np.diag(sigma**2), when, f"frame {k + 1}", sweep))
        return seen


@lru_cache(maxsize=4096)
def attitude(mount, turn_deg):
    axis = mount.axis
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    boresight = Rotation.from_rotvec(side * np.radians(mount.rho_deg)).apply(axis)
    x = np.cross(boresight, axis) if mount.rho_deg else side
    x /= np.linalg.norm(x)
    upright = np.stack([x, np.cross(boresight, x), boresight], axis=1)
    rolled = upright @ Rotation.from_euler("z", mount.roll_deg, degrees=True).as_matrix()
    turn = Rotation.from_rotvec(axis * np.radians(mount.hour_deg + turn_deg)).as_matrix()
    matrix = turn @ rolled
    matrix.flags.writeable = False  # one for all who ask
    return matrix
