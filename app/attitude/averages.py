"""Accumulated averages: many attitudes of one camera make one better one.

Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34, section "Predictional Estimate") averages
the estimates of successive frames, which takes 15 arcsec to under 2. The errors of N independent
frames leave ``sigma / sqrt(N)`` while the camera stands still among the stars; when it turns
steadily, the turn is fitted with the mean (the error at the middle of the time is then the same).
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.attitude.filter import rotation_vector
from app.attitude.wahba import small_rotation
from app.core.attitude import Attitude

Floats = NDArray[np.float64]


@dataclass(slots=True)
class Averages:
    """Sums over attitudes added so far; their number does not make it grow.

    ``turning`` fits a steady turn besides the mean. Attitudes may be up to a few degrees apart.
    """

    turning: bool = False
    count: int = 0
    _first: Floats | None = None
    _start_s: float = 0.0
    _normal: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    _right: Floats = field(default_factory=lambda: np.zeros(6))

    def add(self, attitude: Attitude, time_s: float) -> None:
        """Take in one attitude with covariance, measured at ``time_s`` on any clock."""
        if attitude.covariance is None:
            raise ValueError("An average needs the covariance of every attitude.")
        if self._first is None:
            self._first, self._start_s = attitude.matrix, time_s
        turn = rotation_vector(attitude.matrix @ self._first.T)
        slope = np.hstack([np.eye(3), (time_s - self._start_s) * np.eye(3)])
        weighted = np.linalg.solve(attitude.covariance, slope)
        self._normal += slope.T @ weighted
        self._right += weighted.T @ turn
        self.count += 1

    def mean(self, time_s: float | None = None) -> Attitude:
        """The averaged attitude at ``time_s``, by default when it is known best.

        Its covariance is that of the weighted mean: of N equal ones, an N-th.

        Raises
        ------
        ValueError
            Nothing was added yet.

        """
        if self._first is None:
            raise ValueError("Nothing was averaged yet.")
        if not self.turning or self.count < 3:
            covariance = np.asarray(np.linalg.inv(self._normal[:3, :3]), dtype=np.float64)
            return Attitude(small_rotation(covariance @ self._right[:3]) @ self._first, covariance)
        inverse = np.asarray(np.linalg.inv(self._normal), dtype=np.float64)
        at = self.middle_s - self._start_s if time_s is None else time_s - self._start_s
        pick = np.hstack([np.eye(3), at * np.eye(3)])
        turn = pick @ inverse @ self._right
        return Attitude(small_rotation(turn) @ self._first, pick @ inverse @ pick.T)

    @property
    def middle_s(self) -> float:
        """The weighted middle of the times."""
        weight = float(np.trace(self._normal[:3, :3]))
        return self._start_s + float(np.trace(self._normal[:3, 3:])) / max(weight, 1e-300)

    @property
    def rates_rad_s(self) -> Floats:
        """The camera's steady angular velocity (3,) about its own axes; zero unless ``turning``."""
        if not self.turning or self.count < 3:
            return np.zeros(3)
        return np.asarray(-np.linalg.solve(self._normal, self._right)[3:])
