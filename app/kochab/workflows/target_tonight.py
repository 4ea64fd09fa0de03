"""A place of the sky tonight at a site: how high, rising or setting, and when it comes to the meridian or up."""

from datetime import datetime, timedelta

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.frame import Site
from kochab.core.mount import Epoch
from kochab.core.values import frozen
from kochab.gear.mounts.coordinates import to_mount_epoch
from kochab.gear.mounts.motion_plan import Limits
from kochab.sky.horizon import Horizon, hour_angle_deg
from kochab.text.duration_text import duration_text
from kochab.text.translation import number, tr

SIDEREAL_DEG_H = 15.0410686  # that the sky turns in an hour of a clock


@frozen
class TargetTonight:
    """Where a place of the sky stands, and when it comes where.

    ``meridian_h`` are hours until it crosses the meridian, negative since; ``rises_h`` hours until it comes over the
    horizon limit, 0 when it is above, None when it never does.
    """

    altitude_deg: float
    azimuth_deg: float
    meridian_h: float
    rises_h: float | None

    @property
    def rising(self) -> bool:
        """Whether it climbs: all of the eastern sky does."""
        return self.meridian_h > 0.0


def target_tonight(vector: Floats, site: Site, when: datetime, limits: Limits) -> TargetTonight:
    """The same of a direction.

    Parameters
    ----------
    vector : Floats
        ICRS unit vector (3,).
    site : Site
        Where the observer stands.
    when : datetime
        UTC.
    limits : Limits
        Whose horizon it has to come over.
    """
    altitude, azimuth = Horizon(site, when).altaz_deg(vector)
    ra, dec = to_mount_epoch(*radec_deg(vector), Epoch.DATE, when)
    hour = hour_angle_deg(ra, site, when)
    return TargetTonight(altitude, azimuth, -hour / SIDEREAL_DEG_H, _rises_h(hour, dec, site, limits))


def _rises_h(hour_deg: float, dec_deg: float, site: Site, limits: Limits) -> float | None:
    """Hours until it stands above the horizon limit, within a day, to a minute."""
    hours = np.arange(0.0, 24.0, 1.0 / 60.0)
    turned = np.radians(hour_deg + SIDEREAL_DEG_H * hours)
    dec, latitude = np.radians(dec_deg), np.radians(site.latitude_deg)
    up = np.sin(latitude) * np.sin(dec) + np.cos(latitude) * np.cos(dec) * np.cos(turned)
    north = np.cos(latitude) * np.sin(dec) - np.sin(latitude) * np.cos(dec) * np.cos(turned)
    azimuths = np.degrees(np.arctan2(-np.cos(dec) * np.sin(turned), north)) % 360.0
    above = np.flatnonzero(np.degrees(np.arcsin(np.clip(up, -1.0, 1.0))) > limits.floors_deg(azimuths))
    return float(hours[above[0]]) if len(above) else None


def tonight_text(place: TargetTonight, when: datetime, limits: Limits) -> str:
    """It in a line: altitude, rising or setting, the meridian; when it comes up where it is too low.

    The mount of a fork or wedge crosses the meridian, any other flips there.
    """
    if place.rises_h is None:
        return tr("never above your horizon limit here")
    high = number(place.altitude_deg, ".0f")
    if place.rises_h > 0.0:
        time = f"{when + timedelta(hours=place.rises_h):%H:%M}"
        return tr("altitude {high}°: too low, rises at {time} UTC", high=high, time=time)
    words = [tr("altitude {high}°", high=high), tr("rising") if place.rising else tr("setting")]
    if place.meridian_h > 0.0:
        left = duration_text(3600.0 * place.meridian_h)
        crosses = limits.crosses_meridian
        words.append(tr("meridian in {time}", time=left) if crosses else tr("flips in {time}", time=left))
    elif place.meridian_h > -LONG_H:
        words.append(tr("past the meridian for {time}", time=duration_text(-3600.0 * place.meridian_h)))
    return ", ".join(words)


LONG_H = 3.0  # nobody waits for the flip of a place that far behind the meridian
