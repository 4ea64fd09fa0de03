"""Coordinates of a mount: the epoch it uses, given, or found by its own altitude and azimuth."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from kochab.core.attitude import Degrees, apart_deg, radec_deg, unit_vectors
from kochab.core.errors import NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Mount, Pointing
from kochab.sky.apparent import apparent, from_apparent
from kochab.sky.horizon import from_altaz

# Kochab uses ICRS, mounts the equator of date or J2000.
# J2000 and ICRS differ by 0.02 arcsec and are taken as one. "Of date" is the apparent place: true
# equator and equinox, with nutation and annual aberration, as the makers and INDI use it.


def to_mount_epoch(ra_deg: float, dec_deg: float, epoch: Epoch, time_utc: datetime) -> tuple[float, float]:
    """RA and Dec, degrees, in the mount's epoch.

    Parameters
    ----------
    ra_deg, dec_deg : float
        The place, ICRS degrees.
    epoch : Epoch
        The mount's: J2000 or of date.
    time_utc : datetime
        The date.
    """
    if epoch is Epoch.J2000:
        return ra_deg % 360.0, dec_deg
    return radec_deg(apparent(np.atleast_2d(unit_vectors(ra_deg, dec_deg)), time_utc)[0])


def from_mount_epoch(pointing: Pointing, time_utc: datetime) -> tuple[float, float]:
    """ICRS degrees of a mount's position."""
    if pointing.epoch is Epoch.J2000:
        return pointing.ra_deg % 360.0, pointing.dec_deg
    return radec_deg(from_apparent(np.atleast_2d(unit_vectors(pointing.ra_deg, pointing.dec_deg)), time_utc)[0])


def utc_of(year: int, month: int, day: int, hour: int, minute: int, second: int, utc_offset_h: float) -> datetime:
    """Universal time of a local time; `ValueError` when there is no such time.

    Parameters
    ----------
    year, month, day : int
        The local date.
    hour, minute, second : int
        The local time.
    utc_offset_h : float
        Hours that local time is ahead of UTC.
    """
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
    """The epoch in which a place is at an altitude and azimuth of a site; None when neither or both may be.

    Parameters
    ----------
    pointing : Pointing
        The place; its own epoch does not count.
    altaz_deg : Degrees
        Altitude and azimuth, degrees; azimuth from north over east, or as some mounts have it from south.
    site : Site
        Where the mount stands.
    time_utc : datetime
        When.
    """
    altitude, azimuth = altaz_deg
    for turned in (azimuth, azimuth + 180.0):
        place = from_altaz(altitude, turned, site, time_utc)
        away = {e: apart_deg(place, of_date(replace(pointing, epoch=e), time_utc)) for e in Epoch}
        (nearest, near), (_, far) = sorted(away.items(), key=lambda pair: pair[1])
        if near < AGREES_DEG and far > DIFFERS_DEG:
            return nearest
    return None


def of_date(pointing: Pointing, time_utc: datetime) -> Degrees:
    """RA and Dec of date, degrees, of a pointing in either epoch."""
    return to_mount_epoch(*from_mount_epoch(pointing, time_utc), Epoch.DATE, time_utc)
