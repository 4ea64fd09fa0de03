"""Where a star is tonight: annual aberration, and ICRS to apparent directions and back.

A frame shows directions as the moving Earth sees them. Over a field of a few degrees aberration
is nearly one shift, which the attitude takes up; over wide fields its change (20.5 arcsec x the
field in radians) distorts, and the pointing of the mount needs it always.
"""

from bisect import bisect_right
from datetime import UTC, datetime
from functools import lru_cache

import numpy as np

from kochab.core.arrays import Floats

JD_UNIX = 2440587.5
TT_MINUS_UTC_S = 69.184  # since 2017
# fmt: off
LEAP_DAYS_UNIX = (
    912, 1096, 1461, 1826, 2191, 2557, 2922, 3287, 3652, 4199, 4564, 4929, 5660, 6574, 7305,
    7670, 8217, 8582, 8947, 9496, 10043, 10592, 13149, 14245, 15522, 16617, 17167,
)
"""Days since 1970 that began with one second more between TT and UTC, since 1972 (IERS Bulletin C)."""
UTC_BEGAN_UNIX = 730
DELTA_T_YEAR = (1900.0, 1905.0, 1910.0, 1915.0, 1920.0, 1925.0, 1930.0, 1935.0, 1940.0, 1945.0, 1950.0, 1955.0, 1960.0,
                1965.0, 1970.0, 1972.0)
DELTA_T_S = (-2.8, 3.8, 10.5, 17.2, 21.2, 23.6, 24.0, 23.9, 24.3, 26.8, 29.1, 31.1, 33.2, 35.7, 40.2, 42.184)
"""TT - UT in seconds before there was UTC (Astronomical Almanac 2020, K8): times of that age are taken for UT."""
# fmt: on
LIGHT_AU_DAY = 173.1446326846693


def julian_years(time_utc: datetime) -> float:
    """Julian epoch (such as 2024.0) of an aware time."""
    return 2000.0 + (julian_date_tt(time_utc) - 2451545.0) / 365.25


def julian_date_tt(time_utc: datetime) -> float:
    """Julian date in TT of an aware time."""
    # Unix time has 86400 s in every day, so leap seconds are counted separately: 12 s in 1990 are 6 arcsec of the Moon.
    days = time_utc.astimezone(UTC).timestamp() / 86400.0
    if days < UTC_BEGAN_UNIX:
        return JD_UNIX + days + float(np.interp(1970.0 + days / 365.2425, DELTA_T_YEAR, DELTA_T_S)) / 86400.0
    leaps_to_come = len(LEAP_DAYS_UNIX) - bisect_right(LEAP_DAYS_UNIX, days)
    return JD_UNIX + days + (TT_MINUS_UTC_S - leaps_to_come) / 86400.0


# These series have thousands of terms, and each look at a moving mount needs those of one moment ten times over.


@lru_cache(maxsize=64)
def earth(jd_tt: float) -> tuple[Floats, Floats]:
    """Heliocentric position (3,), au, and barycentric velocity (3,), au a day, of the Earth (ERFA ``epv00``).

    ICRS axes, for a Julian date in TT, which is used as TDB. Both arrays are read-only.
    """
    import erfa

    heliocentric, barycentric = erfa.epv00(jd_tt, 0.0)
    return _kept(heliocentric["p"]), _kept(barycentric["v"])


@lru_cache(maxsize=64)
def _of_date(jd_tt: float) -> Floats:
    import erfa

    return _kept(erfa.pnm06a(jd_tt, 0.0))


@lru_cache(maxsize=64)
def greenwich_deg(jd_ut1: float, jd_tt: float) -> float:
    """Greenwich apparent sidereal time, degrees in [0, 360) (ERFA ``gst06a``), for Julian dates in UT1 and TT."""
    import erfa

    return float(np.degrees(erfa.gst06a(jd_ut1, 0.0, jd_tt, 0.0)))


def _kept(values: object) -> Floats:
    """A read-only float64 copy."""
    own = np.array(values, dtype=np.float64)
    own.setflags(write=False)
    return own


def earth_velocity(time_utc: datetime) -> Floats:
    """Barycentric velocity (3,) of the Earth in units of c, ICRS axes (ERFA ``epv00``)."""
    return earth(julian_date_tt(time_utc))[1] / LIGHT_AU_DAY


def aberrated(vectors: Floats, velocity: Floats) -> Floats:
    """Directions (N, 3) an observer moving at ``velocity`` (3,), in c, sees stars in.

    Exact special relativity (Explanatory Supplement 7.2.3, ERFA ``ab``). To undo it, give the negative velocity.
    """
    import erfa

    # infinitely far from the Sun, whose gravity ERFA would count as well
    return np.asarray(erfa.ab(vectors, velocity, np.inf, np.sqrt(1.0 - velocity @ velocity)))


def with_aberration(vectors: Floats, time_utc: datetime) -> Floats:
    """Catalogue directions (N, 3) as seen from the Earth at a time, still on ICRS axes."""
    return aberrated(vectors, earth_velocity(time_utc))


def without_aberration(vectors: Floats, time_utc: datetime) -> Floats:
    """Catalogue directions (N, 3) of directions seen from the Earth at a time."""
    return aberrated(vectors, -earth_velocity(time_utc))


def of_date_matrix(time_utc: datetime) -> Floats:
    """Rotation (3, 3) from ICRS axes to the true equator and equinox of date (ERFA ``pnm06a``), read-only."""
    return _of_date(julian_date_tt(time_utc))


def apparent(vectors: Floats, time_utc: datetime) -> Floats:
    """Geocentric apparent directions (N, 3), true equator and equinox of date.

    Annual aberration, precession and nutation; parallax and the Sun's bending of light (under
    1 arcsec outside 0.5 deg of the Sun) are left out. Proper motion belongs to the vectors.
    """
    return with_aberration(vectors, time_utc) @ of_date_matrix(time_utc).T


def from_apparent(vectors: Floats, time_utc: datetime) -> Floats:
    """Catalogue directions (N, 3) on ICRS axes of apparent directions of date."""
    # row vectors: multiplying by the matrix itself applies its transpose, which is its inverse
    back = np.asarray(vectors, dtype=np.float64) @ of_date_matrix(time_utc)
    return without_aberration(back, time_utc)
