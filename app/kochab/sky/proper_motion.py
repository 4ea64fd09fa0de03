"""Where stars are after years of their proper motion."""

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, cross_product, unit


def tangent(vector: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (N, 3) to the east and the north at ``vector`` (N, 3)."""
    x, y = vector[:, 0], vector[:, 1]
    # at a pole itself east is undefined; any direction will do, but not NaN
    flat = np.maximum(np.hypot(x, y), 1e-15)
    east = np.stack([-y / flat, x / flat, np.zeros_like(x)], axis=1)
    return east, np.asarray(cross_product(vector, east), dtype=np.float64)


def moved(vector: Floats, pm_mas: Floats, years: Floats | float) -> Floats:
    """Vectors (N, 3) after ``years`` of the motion (N, 2) pmRA*, pmDE in mas/yr."""
    east, north = tangent(vector)
    step = pm_mas * 1e-3 * ARCSEC * np.reshape(years, (-1, 1))
    return unit(vector + step[:, :1] * east + step[:, 1:] * north)
