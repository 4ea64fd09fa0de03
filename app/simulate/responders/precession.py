"""Precession from J2000 to a date and back, which is all a hand controller does."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Place = tuple[float, float]


@lru_cache(maxsize=64)
def _matrix(year: float) -> Floats:
    """Mean equator of J2000 to that of ``year`` (IAU 2006; Capitaine et al. 2003)."""
    import erfa

    bias, precession, _ = erfa.bp06(2451545.0, (year - 2000.0) * 365.25)
    del bias
    return np.asarray(precession, dtype=np.float64)


def from_j2000(ra_deg: float, dec_deg: float, year: float) -> Place:
    """Mean equatorial degrees of ``year``, without nutation and aberration."""
    return _place(_matrix(round(year, 3)) @ _vector(ra_deg, dec_deg))


def to_j2000(ra_deg: float, dec_deg: float, year: float) -> Place:
    """The inverse."""
    return _place(_matrix(round(year, 3)).T @ _vector(ra_deg, dec_deg))


def separation_deg(one: Place, other: Place) -> float:
    """The angle between two places."""
    a, b = _vector(*one), _vector(*other)
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _vector(ra_deg: float, dec_deg: float) -> Floats:
    a, d = np.radians([ra_deg, dec_deg])
    return np.array([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)])


def _place(v: Floats) -> Place:
    ra = float(np.degrees(np.arctan2(v[1], v[0]))) % 360.0
    return ra, float(np.degrees(np.arctan2(v[2], np.hypot(v[0], v[1]))))
