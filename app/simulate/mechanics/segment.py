"""Pieces of a motion at constant acceleration, and how a slew is made of them."""

from dataclasses import dataclass
from math import copysign, sqrt

FAST_DEG_S = 0.05  # above: a slew, which may slip; below: tracking and guiding


@dataclass(frozen=True, slots=True)
class Segment:
    """Motion from ``start`` (unix s) on: motor angle, rate and acceleration in degrees.

    ``load_deg`` is where the driven side of the gear is then, ``extra_deg`` what slips and wrong
    rates have added to it so far.
    """

    start: float
    angle_deg: float
    rate_deg_s: float
    acceleration: float
    load_deg: float
    extra_deg: float

    def angle(self, t: float) -> float:
        """Motor angle at ``t``."""
        s = t - self.start
        return self.angle_deg + s * (self.rate_deg_s + 0.5 * self.acceleration * s)

    def rate(self, t: float) -> float:
        """Motor rate at ``t``."""
        return self.rate_deg_s + self.acceleration * (t - self.start)

    def way(self, t: float) -> list[float]:
        """Angles passed up to ``t``, between which the motion is in one direction."""
        if self.acceleration:
            turned = self.start - self.rate_deg_s / self.acceleration
            if self.start < turned < t:
                return [self.angle_deg, self.angle(turned), self.angle(t)]
        return [self.angle_deg, self.angle(t)]

    @property
    def fast(self) -> bool:
        """Whether this is part of a slew."""
        return bool(self.acceleration) or abs(self.rate_deg_s) > FAST_DEG_S


def trapezoid(way: float, rate: float, top: float, brake: float) -> list[tuple[float, float]]:
    """Pieces (s, deg/s^2) that cover ``way`` degrees from ``rate`` and end at rest."""
    pieces: list[tuple[float, float]] = []
    stopping = rate * abs(rate) / (2.0 * brake)
    if rate and (rate * way < 0.0 or abs(stopping) > abs(way) or abs(rate) > top):
        pieces.append((abs(rate) / brake, copysign(brake, -rate)))
        way, rate = way - stopping, 0.0
    forward = copysign(1.0, way)
    way, rate = abs(way), abs(rate)
    peak = min(top, sqrt(brake * way + rate * rate / 2.0))
    up, down = (peak - rate) / brake, peak / brake
    cruise = way - (peak * peak - rate * rate / 2.0) / brake
    pieces.append((up, forward * brake))
    if cruise > 0.0 and peak >= top:
        pieces.append((cruise / top, 0.0))
    pieces.append((down, -forward * brake))
    return [piece for piece in pieces if piece[0] > 1e-9]
