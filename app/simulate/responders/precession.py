"""Precession from J2000 to a date and back, which is all a hand controller does."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import radec_deg, unit_vectors

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
    return radec_deg(_matrix(round(year, 3)) @ unit_vectors(ra_deg, dec_deg))


def to_j2000(ra_deg: float, dec_deg: float, year: float) -> Place:
    """The inverse."""
    return radec_deg(_matrix(round(year, 3)).T @ unit_vectors(ra_deg, dec_deg))
