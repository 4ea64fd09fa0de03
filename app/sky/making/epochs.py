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
# Proxima: not in Tycho-2, in a full cell of the index, and too faint for the independent list.
ALSO_EARLY = (70890,)
# Where the table of motions is 80 mas/yr off: Barnard's and Kapteyn's stars, from Gaia DR3
# (Gaia Collaboration 2023, A&A 674, A1), pmRA*, pmDE in mas/yr.
MOTIONS = {87937: (-801.55, 10362.39), 24186: (6491.22, -5708.61)}
TELLING = 0.15  # arcsec: a smaller shift can neither be told nor does it harm
POLE_SIN = np.sin(np.radians(85.0))  # nearer the poles the independent list has no motion


def tangent(vector: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (N, 3) to the east and the north at ``vector`` (N, 3)."""
    x, y = vector[:, 0], vector[:, 1]
    flat = np.maximum(np.hypot(x, y), 1e-15)
    east = np.stack([-y / flat, x / flat, np.zeros_like(x)], axis=1)
    return east, np.asarray(np.cross(vector, east), dtype=np.float64)


def moved(vector: Floats, pm_mas: Floats, years: Floats | float) -> Floats:
    """Vectors (N, 3) after ``years`` of the motion (N, 2) pmRA*, pmDE in mas/yr."""
    east, north = tangent(vector)
    step = pm_mas * 1e-3 * ARCSEC * np.reshape(years, (-1, 1))
    out: Floats = vector + step[:, :1] * east + step[:, 1:] * north
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True), dtype=np.float64)


def offsets(vector: Floats, other: Floats) -> Floats:
    """Where ``other`` (N, 3) lies as seen from ``vector``: (N, 2) arcsec east and north."""
    east, north = tangent(vector)
    gap = other - vector
    along = [np.sum(gap * axis, axis=1) / ARCSEC for axis in (east, north)]
    return np.stack(along, axis=1)


def shift_arcsec(pm_mas: Floats) -> Floats:
    """How far (N,) the motions (N, 2) in mas/yr carry a star from 1991.65 to J2000, arcsec."""
    return np.asarray(np.hypot(*pm_mas.T) * 1e-3 * (2000.0 - EARLY))


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
    shift = shift_arcsec(pm_mas)
    return np.asarray((shift > TELLING) & (then < 0.5 * now) & (then < 0.15 + 0.35 * shift))
