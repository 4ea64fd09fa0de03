"""Least squares of one step: normal equations with the columns scaled to one length."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

RIDGE = 1e-13
"""Added to the scaled diagonal: columns that are one and the same share what they explain."""


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """The derivatives ``rows`` (K, N) of N residuals by K parameters, and what they make.

    ``scale`` (K,) are the rows' lengths and ``matrix`` (K, K) the normal matrix of rows of length
    one.
    """

    rows: Floats
    scale: Floats
    matrix: Floats

    @classmethod
    def of(cls, rows: Floats) -> "Normal":
        """Of derivatives (K, N), each parameter's in a row."""
        matrix = rows @ rows.T
        scale = np.sqrt(matrix.diagonal())
        scale[scale == 0.0] = 1.0
        matrix /= scale
        matrix /= scale[:, None]
        matrix.ravel()[:: len(matrix) + 1] += RIDGE
        return cls(rows, scale, matrix)

    def only(self, free: Indices) -> "Normal":
        """The same with no other parameters than ``free``."""
        matrix = self.matrix.take(free, axis=0).take(free, axis=1)
        return Normal(self.rows.take(free, axis=0), self.scale.take(free), matrix)

    def step(self, residual: Floats, damping: float = 0.0) -> Floats:
        """The step (K,) of least squares of residuals (N,)."""
        matrix = self.matrix
        if damping:
            matrix = matrix.copy()
            matrix.ravel()[:: len(matrix) + 1] += damping
        return np.asarray(np.linalg.solve(matrix, (self.rows @ residual) / self.scale) / self.scale)

    def remainder(self, residual: Floats) -> float:
        """Sum of squares left of residuals (N,) after a linear step."""
        left = residual - self.step(residual) @ self.rows
        return float(left @ left)

    def inverse(self) -> Floats:
        """The inverse (K, K) of the normal matrix."""
        return np.asarray(np.linalg.inv(self.matrix) / self.scale / self.scale[:, None])


def chance(before: float, after: float, freedom: int) -> float:
    """Probability, at most, that a useless term lowers the sum of squares this much."""
    if freedom <= 0 or before <= 0:
        return 1.0
    ratio = max(after / before, 1e-30)
    return float(min(ratio, 1.0) ** (freedom / 2.0))
