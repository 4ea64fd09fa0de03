"""Least squares of one step, columns scaled to one length."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def _scaled(jacobian: Floats) -> tuple[Floats, Floats]:
    """Scales of the columns and their scaled normal matrix."""
    scale = np.sqrt(np.einsum("ij,ij->j", jacobian, jacobian))
    scale = np.where(scale > 0, scale, 1.0)
    scaled = jacobian / scale
    return scale, scaled.T @ scaled


def solve(jacobian: Floats, residual: Floats, damping: float = 0.0) -> Floats:
    """The step (K,) of least squares of residuals (N,) over columns (N, K)."""
    scale, normal = _scaled(jacobian)
    normal[np.diag_indices_from(normal)] += damping + 1e-13
    return np.asarray(np.linalg.solve(normal, (residual @ jacobian) / scale) / scale)


def remainder(jacobian: Floats, residual: Floats) -> float:
    """Sum of squares left after a linear step."""
    left = residual - jacobian @ solve(jacobian, residual)
    return float(left @ left)


def inverse(jacobian: Floats) -> Floats:
    """The inverse (K, K) of the normal matrix of columns (N, K)."""
    scale, normal = _scaled(jacobian)
    normal[np.diag_indices_from(normal)] += 1e-13
    return np.asarray(np.linalg.inv(normal) / np.outer(scale, scale))


def chance(before: float, after: float, freedom: int) -> float:
    """Probability, at most, that a useless term lowers the sum of squares this much."""
    if freedom <= 0 or before <= 0:
        return 1.0
    ratio = max(after / before, 1e-30)
    return float(min(ratio, 1.0) ** (freedom / 2.0))
