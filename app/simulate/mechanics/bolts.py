"""The polar axis on its wedge, and the two bolts that move it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulate.mechanics.geometry import mount_to_enu

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BoltWear:
    """Play of the altitude and azimuth bolts, arcmin, and how far each drags the other axis.

    ``coupling`` is the part of an altitude turn that goes into azimuth, and the reverse.
    """

    backlash_arcmin: tuple[float, float] = (0.0, 0.0)
    coupling: tuple[float, float] = (0.0, 0.0)


class Wedge:
    """Where the polar axis points. Errors are those of POLAR alignment everywhere.

    Altitude error positive when the visible end is too high; azimuth error raw (as the knob
    turns), positive clockwise as seen from above.
    """

    def __init__(
        self, pole_altitude_deg: float, north: bool, error_arcmin: tuple[float, float],
        wear: BoltWear | None = None,
    ) -> None:  # fmt: skip
        self._pole_altitude_deg = pole_altitude_deg
        self._north = north
        self._wear = wear or BoltWear()
        self._error = np.array(error_arcmin, dtype=np.float64)
        self._slack = np.zeros(2)  # how far each bolt has moved within its play, about the middle

    @property
    def error_arcmin(self) -> tuple[float, float]:
        """Altitude and raw azimuth error against the pole this wedge was made for."""
        return float(self._error[0]), float(self._error[1])

    def turn(self, altitude_arcmin: float, azimuth_arcmin: float) -> None:
        """Turn both bolts by what they would move without play or coupling."""
        half = np.array(self._wear.backlash_arcmin) / 2.0
        wanted = self._slack + np.array([altitude_arcmin, azimuth_arcmin])
        self._slack = np.clip(wanted, -half, half)
        moved = wanted - self._slack
        first, second = self._wear.coupling
        self._error += moved + np.array([second * moved[1], first * moved[0]])

    def to_enu(self) -> Floats:
        """Rotation (3, 3) from the mount frame to east, north, up."""
        altitude = self._pole_altitude_deg + self._error[0] / 60.0
        north_end = altitude if self._north else -altitude
        return mount_to_enu(north_end, float(self._error[1]) / 60.0)

    def axis_enu(self) -> Floats:
        """Direction (3,) of the visible end of the polar axis."""
        axis = self.to_enu()[:, 2]
        return np.asarray(axis if self._north else -axis)
