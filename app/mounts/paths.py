"""The ways a telescope may take from here to there.

A mount's own way is not known: an equatorial one turns both axes at one speed until each arrives, a
fork in altitude and azimuth follows roughly a great circle, and a German mount that changes sides
goes over the pole. A slew is allowed when all of them are.
"""

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import angle_between, unit_vectors
from app.mounts.sky_frame import wrapped

Floats = NDArray[np.float64]
Degrees = tuple[float, float]
STEP_DEG = 1.0


def great_circle(start_deg: Degrees, target_deg: Degrees) -> Floats:
    """Unit vectors (N, 3) along the shortest way, both ends included."""
    a, b = unit_vectors(*start_deg), unit_vectors(*target_deg)
    angle = angle_between(a, b)
    if angle < 1e-9 or np.pi - angle < 1e-6:
        return np.stack([a, b])
    t = np.linspace(0.0, angle, _count(np.degrees(angle)))[:, None]
    return np.asarray((np.sin(angle - t) * a + np.sin(t) * b) / np.sin(angle))


def by_axes(start_deg: Degrees, target_deg: Degrees) -> Floats:
    """Unit vectors (N, 3) when both equatorial axes turn at one speed until each arrives."""
    return _turned(start_deg, (wrapped(target_deg[0] - start_deg[0]), target_deg[1] - start_deg[1]))


def over_the_pole(start_deg: Degrees, target_deg: Degrees, north: bool) -> Floats:
    """Unit vectors (N, 3) of a flip: the declination axis turns through the pole."""
    pole = 180.0 if north else -180.0
    return _turned(
        start_deg,
        (wrapped(target_deg[0] + 180.0 - start_deg[0]), pole - target_deg[1] - start_deg[1]),
    )


def turned(start_deg: Degrees, ra_turn_deg: float, dec_turn_deg: float) -> Floats:
    """Unit vectors (N, 3) of a move of the axes by so much."""
    return _turned(start_deg, (ra_turn_deg, dec_turn_deg))


def _turned(start_deg: Degrees, turn_deg: Degrees) -> Floats:
    longest = max(abs(turn_deg[0]), abs(turn_deg[1]))
    t = np.linspace(0.0, longest, _count(longest))
    ra = start_deg[0] + np.sign(turn_deg[0]) * np.minimum(t, abs(turn_deg[0]))
    dec = start_deg[1] + np.sign(turn_deg[1]) * np.minimum(t, abs(turn_deg[1]))
    return unit_vectors(ra, dec)  # past the pole the vectors are right as they are


def _count(angle_deg: float) -> int:
    return max(2, int(np.ceil(angle_deg / STEP_DEG)) + 1)
