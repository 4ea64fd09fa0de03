"""How fast the Earth turns under the stars, which is how fast a mount must follow them."""

from math import radians

SIDEREAL_DAY_S = 86164.0905
"""A turn as the equinox counts it; against the stars themselves it takes 8 ms longer."""
SIDEREAL_DEG_S = 360.0 / SIDEREAL_DAY_S
SIDEREAL_RAD_S = radians(SIDEREAL_DEG_S)
