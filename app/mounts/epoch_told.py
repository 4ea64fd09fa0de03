"""The epoch of a mount's coordinates, by the mount's own word.

No protocol names it, but a mount that tells altitude and azimuth beside right ascension and
declination betrays it: with the place and the time that the mount itself believes, altitude and
azimuth give its coordinates of date, some 20 arcmin from those of J2000.
"""

from collections.abc import Callable
from datetime import datetime

import numpy as np

from app.core.attitude import apart_deg, radec_deg
from app.core.errors import NoAnswerError
from app.core.hint import Site
from app.core.mount import Epoch, Mount, Pointing
from app.mounts.beliefs import Beliefs
from app.mounts.epoch import from_mount_epoch, to_mount_epoch
from app.mounts.sky_frame import horizon_frame, sidereal_deg

Degrees = tuple[float, float]
ALIKE_DEG, UNLIKE_DEG = 4.0 / 60.0, 12.0 / 60.0  # some tell their angles in whole arcminutes


def epoch_told(mount: Mount) -> Epoch | None:
    """What the mount's coordinates belong to; None when it does not tell or nothing fits.

    A mount whose altitude and azimuth come from axes that do not stand level fits neither epoch.
    """
    horizontal: Callable[[], Degrees] | None = getattr(mount, "horizontal_deg", None)
    ask: Callable[[], Beliefs] | None = getattr(mount, "beliefs", None)
    if horizontal is None or ask is None:
        return None
    try:
        said, level, beliefs = mount.position(), horizontal(), ask()
    except NoAnswerError:
        return None
    if beliefs.site is None or beliefs.time_utc is None:
        return None
    return epoch_of(said, level, beliefs.site, beliefs.time_utc)


def epoch_of(said: Pointing, level_deg: Degrees, site: Site, time_utc: datetime) -> Epoch | None:
    """The epoch in which ``said`` is the place at an altitude and azimuth (degrees) of a site.

    Azimuth is from north over east, or as some write it from south.
    """
    altitude, azimuth = level_deg
    for turned in (azimuth, azimuth + 180.0):
        place = of_date(altitude, turned, site, time_utc)
        away = {
            epoch: apart_deg(place, _of_date(said, epoch, time_utc))
            for epoch in (Epoch.DATE, Epoch.J2000)
        }
        (nearest, near), (_, far) = sorted(away.items(), key=lambda pair: pair[1])
        if near < ALIKE_DEG and far > UNLIKE_DEG:
            return nearest
    return None


def of_date(altitude: float, azimuth: float, site: Site, time_utc: datetime) -> Degrees:
    """RA and Dec of date, degrees, of a geometric altitude and azimuth (north over east)."""
    h, a = np.radians([altitude, azimuth])
    # The frame's x is south, its y east, its z up.
    level = np.array([-np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)])
    return radec_deg(horizon_frame(site, sidereal_deg(site, time_utc)) @ level)


def _of_date(said: Pointing, epoch: Epoch, time_utc: datetime) -> Degrees:
    icrs = from_mount_epoch(Pointing(said.ra_deg, said.dec_deg, epoch), time_utc)
    return to_mount_epoch(*icrs, Epoch.DATE, time_utc)
