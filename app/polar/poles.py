"""Which point of the sky the axis should point at."""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from app.core.hint import Site
from app.polar.horizon import STANDARD_AIR, Air
from app.polar.rotations import alt_az, direction

Floats = NDArray[np.float64]


class Pole(StrEnum):
    """The three points that people align to; they lie up to an arcminute apart and more.

    Tracking over the sky is best at the refracted pole at middle latitudes, and half-way between
    the two near latitude 20 degrees.
    """

    REFRACTED = "refracted"
    TRUE = "true"
    HALF_WAY = "half-way"


def northern(site: Site) -> bool:
    """Whether the axis points to the north celestial pole there; the equator counts as north."""
    return site.latitude_deg >= 0.0


def pole_direction(site: Site, pole: Pole = Pole.REFRACTED, air: Air = STANDARD_AIR) -> Floats:
    """Unit vector (3,) in E, N, U of the elevated pole."""
    azimuth = 0.0 if northern(site) else np.pi
    true = abs(np.radians(site.latitude_deg))
    if pole is Pole.TRUE:
        return direction(true, azimuth)
    seen = refracted_altitude(site, air)
    return direction(seen if pole is Pole.REFRACTED else 0.5 * (true + seen), azimuth)


def refracted_altitude(site: Site, air: Air = STANDARD_AIR) -> float:
    """Altitude, radians, at which the air shows the elevated pole (ERFA ``apio``, ``atioq``)."""
    import erfa

    context = erfa.apio(
        0.0, 0.0, 0.0, np.radians(site.latitude_deg), site.height_m, 0.0, 0.0, *air.constants(site)
    )
    context["diurab"] = 0.0  # a star there is seen 0.3 arcsec aside; the axis is not
    up = np.pi / 2.0 if northern(site) else -np.pi / 2.0
    _, zenith_distance, *_ = erfa.atioq(0.0, up, context)
    return float(np.pi / 2.0 - zenith_distance)


def name_of(pole: Pole, site: Site) -> str:
    """Words for a screen: which pole, of which sky."""
    sky = "north" if northern(site) else "south"
    return f"{pole} {sky} pole at altitude {np.degrees(alt_az(pole_direction(site, pole))[0]):.2f}°"
