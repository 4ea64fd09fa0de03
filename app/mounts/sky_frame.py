"""The sky over a site: sidereal time, hour angle, altitude, and where the Sun is."""

from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import unit_vectors
from app.core.hint import Site
from app.sky.apparent import JD_UNIX, apparent, julian_date_tt

Floats = NDArray[np.float64]


def sidereal_deg(site: Site, time_utc: datetime) -> float:
    """Local apparent sidereal time, degrees in [0, 360) (ERFA ``gst06a``, UT1 taken as UTC)."""
    import erfa

    ut1 = JD_UNIX + time_utc.astimezone(UTC).timestamp() / 86400.0
    turn = np.degrees(erfa.gst06a(ut1, 0.0, julian_date_tt(time_utc), 0.0))
    return float((turn + site.longitude_deg) % 360.0)


def hour_angle_deg(ra_deg: float, site: Site, time_utc: datetime) -> float:
    """Hour angle of a right ascension of date, degrees in [-180, 180), west positive."""
    return wrapped(sidereal_deg(site, time_utc) - ra_deg)


def wrapped(angle_deg: float) -> float:
    """An angle in [-180, 180)."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def altitude_deg(vectors: Floats, site: Site, time_utc: datetime) -> Floats:
    """Geometric altitudes (N,), degrees, of equatorial vectors of date (N, 3); no refraction."""
    zenith = unit_vectors(sidereal_deg(site, time_utc), site.latitude_deg)
    return np.degrees(np.arcsin(np.clip(vectors @ zenith, -1.0, 1.0)))


def horizon_frame(site: Site, sidereal: float) -> Floats:
    """Rotation (3, 3) to vectors of date from (south, east, up); ``sidereal`` in degrees."""
    up = unit_vectors(sidereal, site.latitude_deg)
    east = unit_vectors(sidereal + 90.0, 0.0)
    return np.stack([np.cross(east, up), east, up], axis=1)


def sun_vector(time_utc: datetime) -> Floats:
    """Apparent direction (3,) of the Sun, true equator and equinox of date (ERFA ``epv00``)."""
    import erfa

    heliocentric, _ = erfa.epv00(julian_date_tt(time_utc), 0.0)
    towards = -np.asarray(heliocentric["p"], dtype=np.float64)
    return np.asarray(apparent(np.atleast_2d(towards / np.linalg.norm(towards)), time_utc)[0])
