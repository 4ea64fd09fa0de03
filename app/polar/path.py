"""Which way to turn the RA axis: where the boresight goes, before anything moves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.core.mount import Direction
from app.polar.measure import Settings
from app.polar.poles import northern, pole_direction
from app.polar.rotations import about

Floats = NDArray[np.float64]

LOWEST_DEG = 20.0
PAST_MERIDIAN_DEG = 5.0
STEPS = 13


@dataclass(frozen=True, slots=True)
class Way:
    """A turn of the RA axis: how low the boresight comes, how far past the meridian."""

    direction: Direction
    turn_deg: float
    lowest_deg: float
    past_meridian_deg: float

    @property
    def good(self) -> bool:
        """Whether it stays well up and on its side of the meridian."""
        return self.lowest_deg >= LOWEST_DEG and self.past_meridian_deg <= PAST_MERIDIAN_DEG


def way(boresight: Floats, settings: Settings, direction: Direction, turn_deg: float) -> Way:
    """Where a turn leads, supposing that the axis is near its pole.

    ``boresight`` (3,) in E, N, U. West is the way the sky goes: about the visible pole clockwise in
    the north, anticlockwise in the south.
    """
    pole = pole_direction(settings.site, settings.pole, settings.air)
    sign = -1.0 if northern(settings.site) == (direction is Direction.WEST) else 1.0
    path = np.stack(
        [about(pole, sign * a) @ boresight for a in np.linspace(0, np.radians(turn_deg), STEPS)]
    )
    lowest = float(np.degrees(np.arcsin(path[:, 2].min())))
    side = np.sign(path[0, 0]) or 1.0
    high = np.maximum(np.hypot(path[:, 1], path[:, 2]), 1e-9)
    past = np.degrees(np.arctan2(-side * path[:, 0], high)).max()
    return Way(direction, turn_deg, lowest, max(0.0, float(past)))


def best_way(boresight: Floats, settings: Settings, turn_deg: float) -> Way:
    """East or west, whichever stays higher without crossing the meridian; the longest good turn.

    When neither way is good the one that stays higher is returned, and says so itself.
    """
    for wanted in np.arange(turn_deg, 9.0, -10.0):
        ways = [
            way(boresight, settings, d, float(wanted)) for d in (Direction.WEST, Direction.EAST)
        ]
        good = [w for w in ways if w.good]
        if good:
            return max(good, key=lambda w: w.lowest_deg)
    ways = [way(boresight, settings, d, turn_deg) for d in (Direction.WEST, Direction.EAST)]
    return max(ways, key=lambda w: w.lowest_deg)
