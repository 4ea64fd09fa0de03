"""Which stored positions are not at J2000, and taking them there.

Stellarium's list gives most stars at J2000, but Hipparcos stars that Tycho-2 lacks (the very
bright ones, and close or fast pairs) at 1991.65 or so; Tycho-2's supplement stands at 1991.25. At
1 arcsec/yr that is an error of 8 arcsec. The judges are the independent list, whose positions are
at 2024.0 (but within 5 deg of the poles lack proper motion, so are at 1991.25), and Tycho-2.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ARCSEC = np.radians(1.0 / 3600.0)
EARLY = 1991.65  # the median over the stars found so, with a spread of 0.15 yr
SUPPLEMENT = 1991.25
LIST_EPOCH = 2024.0
POLE_SIN = np.sin(np.radians(85.0))  # nearer the poles the independent list has no motion


def tangent(vector: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (N, 3) to the east and the north at ``vector`` (N, 3)."""
    x, y, z = vector.T
    flat = np.maximum(np.hypot(x, y), 1e-15)
    east = np.stack([-y / flat, x / flat, np.zeros_like(x)], axis=1)
    return east, np.cross(vector, east)


def moved(vector: Floats, pm_mas: Floats, years: Floats | float) -> Floats:
    """Vectors (N, 3) after ``years`` of the motion (N, 2) pmRA*, pmDE in mas/yr."""
    east, north = tangent(vector)
    step = pm_mas * 1e-3 * ARCSEC * np.reshape(years, (-1, 1))
    out = vector + step[:, :1] * east + step[:, 1:] * north
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))


def offsets(vector: Floats, other: Floats) -> Floats:
    """Where ``other`` (N, 3) lies as seen from ``vector``: (N, 2) arcsec east and north."""
    east, north = tangent(vector)
    gap = other - vector
    return np.stack([np.sum(gap * east, axis=1), np.sum(gap * north, axis=1)], axis=1) / ARCSEC


def early_by_list(vector: Floats, pm_mas: Floats, listed: Floats) -> Flags:
    """Stars (N,) whose place fits the independent list ``listed`` (N, 3) only if at 1991.65.

    Rows of ``listed`` are NaN for stars it lacks. Where motion over eight years is too small to
    tell, the answer is no, and no harm is done.
    """
    near_pole = np.abs(vector[:, 2]) > POLE_SIN
    epoch = np.where(near_pole, SUPPLEMENT, LIST_EPOCH)
    seen = offsets(vector, listed)
    motion = pm_mas * 1e-3
    now = np.hypot(*(seen - motion * (epoch - 2000.0)[:, None]).T)
    then = np.hypot(*(seen - motion * (epoch - EARLY)[:, None]).T)
    shift = np.hypot(*motion.T) * (2000.0 - EARLY)
    return np.asarray((shift > 0.15) & (then < 0.5 * now) & (then < 0.15 + 0.35 * shift))
