"""When it is night."""

import numpy as np

from app.core.hint import Site
from app.simulate.local_sky import LocalSky, altitude_deg
from app.simulate.sky_glow import lamps

DARK_DEG = -16.0


def midnight_unix(near_unix: float, site: Site) -> float:
    """The true midnight nearest to a time: the Sun is then lowest at the site."""
    hours = np.arange(-12.0, 12.0, 0.25) * 3600.0
    return float(
        near_unix + hours[np.argmin([sun_altitude_deg(near_unix + h, site) for h in hours])]
    )


def sun_altitude_deg(unix_s: float, site: Site) -> float:
    """How high the Sun stands, degrees."""
    return float(altitude_deg(lamps(LocalSky(site, unix_s), unix_s).sun))
