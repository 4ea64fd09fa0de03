"""What a mount's computer makes of its encoders: sides of the pier, and what syncs have set."""

import math


class Belief:
    """The offsets that syncs leave: believed axis angle = encoder + offset."""

    def __init__(self) -> None:
        self.offset_deg = (0.0, 0.0)

    def of(self, hour_deg: float, dec_deg: float) -> tuple[float, float]:
        """Believed axis angles of encoders."""
        return hour_deg + self.offset_deg[0], dec_deg + self.offset_deg[1]

    def motors_for(self, hour_deg: float, dec_deg: float) -> tuple[float, float]:
        """Encoders of believed axis angles; the hour angle up to whole turns."""
        return hour_deg - self.offset_deg[0], dec_deg - self.offset_deg[1]

    def set(self, motors: tuple[float, float], there: tuple[float, float]) -> None:
        """Believe that encoders ``motors`` are axis angles ``there``."""
        hour, dec = (b - a for a, b in zip(motors, there, strict=True))
        self.offset_deg = (wrapped(hour), wrapped(dec))


def fold(hour_deg: float, dec_deg: float, flipped: bool, north: bool) -> tuple[float, float]:
    """Axis angles for an hour angle and a declination; ``flipped`` goes through the pole."""
    if not flipped:
        return wrapped(hour_deg), dec_deg
    return wrapped(hour_deg + 180.0), (180.0 if north else -180.0) - dec_deg


def unfold(hour_deg: float, dec_deg: float) -> tuple[float, float]:
    """Hour angle in (-180, 180] and declination of axis angles, through the pole or not."""
    d = math.radians(dec_deg)
    beyond = math.cos(d) < 0.0
    return wrapped(hour_deg + 180.0 if beyond else hour_deg), math.degrees(math.asin(math.sin(d)))


def halves(german: bool, past_meridian_deg: float) -> tuple[float, float]:
    """The range of the hour axis: weights down by half a turn, or a fork's whole turn."""
    if german:
        return -past_meridian_deg, 180.0 + past_meridian_deg
    return -180.0, 180.0


def wrapped(degrees: float) -> float:
    """The same angle in (-180, 180]."""
    turned = degrees % 360.0
    return turned - 360.0 if turned > 180.0 else turned
