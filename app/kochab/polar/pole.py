"""The pole to align to: true, refracted or half-way, of the site's sky."""

from enum import StrEnum

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.polar.rotations import alt_az, direction
from kochab.sky.horizon import STANDARD_REFRACTION, Refraction, observed_at
from kochab.text.translation import tr, tr_noop


class Pole(StrEnum):
    """The three points that people align to; they lie up to an arcminute apart and more.

    Tracking over the sky is best at the refracted pole at middle latitudes, and half-way between
    the two near latitude 20 degrees.
    """

    REFRACTED = tr_noop("refracted")
    TRUE = tr_noop("true")
    HALF_WAY = tr_noop("half-way")


def northern(site: Site) -> bool:
    """Whether the axis points to the north celestial pole there; the equator counts as north."""
    return site.latitude_deg >= 0.0


def tracking_rad_s(site: Site) -> float:
    """The rate of a camera that tracks the sky, right-handed about the elevated pole."""
    return -SIDEREAL_RAD_S if northern(site) else SIDEREAL_RAD_S


def pole_direction(site: Site, pole: Pole = Pole.REFRACTED, refraction: Refraction = STANDARD_REFRACTION) -> Floats:
    """Unit vector (3,) in E, N, U of the elevated pole (refracted by ERFA ``apio``, ``atioq``)."""
    azimuth = 0.0 if northern(site) else np.pi
    true = abs(np.radians(site.latitude_deg))
    if pole is Pole.TRUE:
        return direction(true, azimuth)
    # the pole refracted as a star that stands there, its hour angle any
    up = np.pi / 2.0 if northern(site) else -np.pi / 2.0
    refracted = float(np.arcsin(observed_at(site, refraction, np.zeros(1), np.full(1, up))[0, 2]))
    return direction(refracted if pole is Pole.REFRACTED else 0.5 * (true + refracted), azimuth)


POLES = {
    Pole.REFRACTED: (
        tr_noop("refracted north pole at altitude {altitude:.2f}°"),
        tr_noop("refracted south pole at altitude {altitude:.2f}°"),
    ),
    Pole.TRUE: (
        tr_noop("true north pole at altitude {altitude:.2f}°"),
        tr_noop("true south pole at altitude {altitude:.2f}°"),
    ),
    Pole.HALF_WAY: (
        tr_noop("half-way north pole at altitude {altitude:.2f}°"),
        tr_noop("half-way south pole at altitude {altitude:.2f}°"),
    ),
}


def name_of(pole: Pole, site: Site) -> str:
    """Words for a screen: which pole, of which sky."""
    north, south = POLES[pole]
    altitude = np.degrees(alt_az(pole_direction(site, pole))[0])
    return tr(north if northern(site) else south, altitude=altitude)
