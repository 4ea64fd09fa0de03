"""Coordinates of a mount: sidereal time, hour angle, altitude, the Sun, and the epoch."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Degrees, apart_deg, radec_deg, unit_vectors, wrapped
from kochab.core.errors import NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Mount, Pointing
from kochab.sky.apparent import JD_UNIX, apparent, from_apparent, julian_date_tt


def sidereal_deg(site: Site, time_utc: datetime) -> float:
    """Local apparent sidereal time, degrees in [0, 360) (ERFA ``gst06a``, UT1 taken as UTC)."""
    import erfa

    ut1 = JD_UNIX + time_utc.astimezone(UTC).timestamp() / 86400.0  # they differ by less than 0.9 s, which is 14 arcsec
    turn = np.degrees(erfa.gst06a(ut1, 0.0, julian_date_tt(time_utc), 0.0))
    return float((turn + site.longitude_deg) % 360.0)


def hour_angle_deg(ra_deg: float, site: Site, time_utc: datetime) -> float:
    """Hour angle of a right ascension of date, degrees in [-180, 180), west positive."""
    return wrapped(sidereal_deg(site, time_utc) - ra_deg)


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


# Kochab uses ICRS, mounts the equator of date or J2000.
# J2000 and ICRS differ by 0.02 arcsec and are taken as one. "Of date" is the apparent place: true
# equator and equinox, with nutation and annual aberration, as the makers and INDI use it.


def to_mount_epoch(ra_deg: float, dec_deg: float, epoch: Epoch, time_utc: datetime) -> tuple[float, float]:
    """ICRS degrees in the mount's ``epoch``."""
    if epoch is Epoch.J2000:
        return ra_deg % 360.0, dec_deg
    return radec_deg(apparent(np.atleast_2d(unit_vectors(ra_deg, dec_deg)), time_utc)[0])


def from_mount_epoch(pointing: Pointing, time_utc: datetime) -> tuple[float, float]:
    """ICRS degrees of a mount's position."""
    if pointing.epoch is Epoch.J2000:
        return pointing.ra_deg % 360.0, pointing.dec_deg
    return radec_deg(from_apparent(np.atleast_2d(unit_vectors(pointing.ra_deg, pointing.dec_deg)), time_utc)[0])


def utc_of(year: int, month: int, day: int, hour: int, minute: int, second: int, utc_offset_h: float) -> datetime:
    """Universal time of a local time; `ValueError` when there is no such time."""
    return datetime(year, month, day, hour, minute, second, tzinfo=UTC) - timedelta(hours=utc_offset_h)


# -- The epoch of a mount's coordinates, found by comparison with its own altitude and azimuth --
# No protocol names the epoch, but a mount that reports altitude and azimuth beside right ascension
# and declination shows it: its own site and time turn them into coordinates of date, which are
# some 20 arcmin from those of J2000.

AGREES_DEG, DIFFERS_DEG = 4.0 / 60.0, 12.0 / 60.0  # some report their angles in whole arcminutes


def reported_epoch(mount: Mount) -> Epoch | None:
    """The epoch of the mount's coordinates; None when it does not report enough or nothing fits.

    A mount whose altitude and azimuth come from axes that are not level fits neither epoch.
    """
    try:
        pointing, altaz, report = mount.position(), mount.altaz_deg(), mount.site_report()
    except NoAnswerError:
        return None
    if altaz is None or report.site is None or report.time_utc is None:
        return None
    return epoch_of(pointing, altaz, report.site, report.time_utc)


def epoch_of(pointing: Pointing, altaz_deg: Degrees, site: Site, time_utc: datetime) -> Epoch | None:
    """The epoch in which ``pointing`` is the place at an altitude and azimuth (degrees) of a site.

    Azimuth is from north over east, or as some mounts have it from south.
    """
    altitude, azimuth = altaz_deg
    for turned in (azimuth, azimuth + 180.0):
        place = from_altaz(altitude, turned, site, time_utc)
        away = {e: apart_deg(place, of_date(replace(pointing, epoch=e), time_utc)) for e in Epoch}
        (nearest, near), (_, far) = sorted(away.items(), key=lambda pair: pair[1])
        if near < AGREES_DEG and far > DIFFERS_DEG:
            return nearest
    return None


def from_altaz(altitude: float, azimuth: float, site: Site, time_utc: datetime) -> Degrees:
    """RA and Dec of date, degrees, of a geometric altitude and azimuth (north over east)."""
    h, a = np.radians([altitude, azimuth])
    # The frame's x is south, its y east, its z up.
    level = np.array([-np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)])
    return radec_deg(horizon_frame(site, sidereal_deg(site, time_utc)) @ level)


def of_date(pointing: Pointing, time_utc: datetime) -> Degrees:
    """RA and Dec of date, degrees, of a pointing in either epoch."""
    return to_mount_epoch(*from_mount_epoch(pointing, time_utc), Epoch.DATE, time_utc)
