"""Where a controller believes to look over the horizon."""

import math

from app.simulate.telescope import Telescope


def horizontal_deg(telescope: Telescope, latitude_deg: float) -> tuple[float, float]:
    """Altitude, and azimuth from north over east in [0, 360), degrees, without air."""
    ra_deg, dec_deg = telescope.believed_deg()
    hour = math.radians(telescope.sidereal_deg() - ra_deg)
    dec, p = math.radians(dec_deg), math.radians(latitude_deg)
    east = -math.cos(dec) * math.sin(hour)
    north = math.sin(dec) * math.cos(p) - math.cos(dec) * math.cos(hour) * math.sin(p)
    up = math.sin(dec) * math.sin(p) + math.cos(dec) * math.cos(hour) * math.cos(p)
    altitude = math.degrees(math.atan2(up, math.hypot(east, north)))
    return altitude, math.degrees(math.atan2(east, north)) % 360.0
