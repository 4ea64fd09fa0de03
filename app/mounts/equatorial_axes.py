"""Two motors of a German mount and the sky: from encoder angles to hour angle and declination.

Both angles are zero at home: counterweight down, telescope at the pole. The first grows as the sky
turns in the north; in the south the same motor turns the other way over the sky. With the second
at or below zero the telescope is west of its pier, else east (as EQMOD has it).
"""

from app.core.mount import PierSide
from app.mounts.sky_frame import wrapped

Degrees = tuple[float, float]


def to_sky(axes_deg: Degrees, south: bool) -> tuple[float, float, PierSide]:
    """Hour angle in [-180, 180), declination and side of the pier."""
    first, second = axes_deg[0], wrapped(axes_deg[1])
    west = second <= 0.0
    hour_angle = first - 90.0 if west else first + 90.0
    dec = 90.0 - abs(second)
    side = PierSide.WEST if west else PierSide.EAST
    return (wrapped(-hour_angle), -dec, _other(side)) if south else (wrapped(hour_angle), dec, side)


def to_axes(hour_angle_deg: float, dec_deg: float, side: PierSide, south: bool) -> Degrees:
    """Encoder angles that point there from one side of the pier."""
    if south:
        hour_angle_deg, dec_deg, side = -hour_angle_deg, -dec_deg, _other(side)
    if side is PierSide.WEST:
        return wrapped(hour_angle_deg + 90.0), dec_deg - 90.0
    return wrapped(hour_angle_deg - 90.0), 90.0 - dec_deg


def natural_side(hour_angle_deg: float) -> PierSide:
    """West of the pier for what is east of the meridian: the counterweight stays below."""
    return PierSide.WEST if hour_angle_deg < 0.0 else PierSide.EAST


def _other(side: PierSide) -> PierSide:
    return PierSide.WEST if side is PierSide.EAST else PierSide.EAST
