"""How bending under its own weight shifts the axis that a sweep measures.

A tube that droops by ``f cos(altitude)`` - the term TF of a pointing model (Wallace's TPOINT) -
turns the camera by ``-f b x u``, with b the boresight and u straight up. While b goes round the
axis a at the angle rho, the part of it that is not constant in the camera lies along a, where a
turn hides it; the constant part in E, N, U is ``-f cos(rho) a x u``. So the sweep fits as well as
ever, and finds the axis too low by ``f cos(rho) cos(altitude of the axis)``. Two sweeps with
different rho tell f.

What else gives way - focuser, saddle, mirror - is taken as a small turn of the camera linear in
gravity's pull on it. Half of its changing part shifts the axis, in any direction, and is not seen
at all; the other half swings twice as fast as the axis turns, ``exp(2 i t)``, and over less than
half a turn passes for a shift of the same size, ``exp(2 i t) ~ 2 exp(i t) - 1``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.polar.rotations import ARCSEC

Floats = NDArray[np.float64]

TUBE_ARCSEC = 30.0
"""One sigma of the droop before anything is known; a 9 inch Schmidt-Cassegrain's guide scope was
seen to sag by 32 arcsec in 85 minutes (astronomy.mdodd.com/flexure.html)."""

REST_ARCSEC = 10.0
"""One sigma of each element of what else gives way."""


@dataclass(frozen=True, slots=True)
class Droop:
    """How much the tube sinks between zenith and horizon, and one sigma of it."""

    arcsec: float = 0.0
    sigma_arcsec: float = TUBE_ARCSEC


UNKNOWN = Droop()


def lever(axis: Floats, rho_rad: float) -> float:
    """By how much a droop of 1 shifts the altitude of the axis found.

    ``axis`` (3,) in E, N, U is the elevated end; ``rho_rad`` lies between it and the boresight.
    """
    return -float(np.hypot(axis[0], axis[1]) * np.cos(rho_rad))


def rest_covariance(axis: Floats) -> Floats:
    """Covariance (2, 2), rad^2, along (altitude, azimuth on the sky) of what no sweep can show."""
    level = float(np.hypot(axis[0], axis[1]))
    return np.eye(2) * (REST_ARCSEC * ARCSEC * level) ** 2
