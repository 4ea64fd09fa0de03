"""The room of a motion: every place where a telescope may be seen while it does what was judged.

A slew's two axes need not keep step, so its room is wider than the ways that were judged before it
began: all between start and target by right ascension and declination, the same by azimuth and
altitude, and for a mount that may change the side of its pier everything about the pole.
"""

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import radec_deg, unit_vectors
from app.mounts.rules.meridian import crosses
from app.mounts.rules.plan import Plan
from app.mounts.sky_frame import horizon_frame, sidereal_deg, wrapped

Floats = NDArray[np.float64]
Degrees = tuple[float, float]
STEP_DEG = 2.0
FOLLOWED_DEG = 30.0  # so far beyond the meridian a mount may have followed without a flip


def room_of(plan: Plan) -> Floats:
    """Unit vectors of date (N, 3), a few degrees from one to the next."""
    start, target = plan.start_deg, plan.target_deg
    rooms = [*plan.paths, _between(start, target)]
    if plan.site is not None:
        level = horizon_frame(plan.site, sidereal_deg(plan.site, plan.time_utc))
        here, there = (radec_deg(v @ level) for v in (plan.start, plan.target))
        rooms.append(_between(here, there, both_ways=plan.limits.crosses_meridian) @ level.T)
    if may_flip(plan):
        rooms.append(_about_the_pole(plan))
    return np.concatenate(rooms)


def may_flip(plan: Plan) -> bool:
    """Whether nothing forbids that the mount changes the side of its pier on its way."""
    if plan.limits.allow_flip:
        return True
    if plan.limits.crosses_meridian or plan.state.pier_side is not None:
        return False
    ends = plan.hour_angles_deg()
    return ends is None or crosses(plan) or 0.0 <= ends[0] < FOLLOWED_DEG


def longest_turn_deg(plan: Plan) -> float:
    """The most that one axis turns."""
    if may_flip(plan):
        return 180.0
    (ra, dec), (to_ra, to_dec) = plan.start_deg, plan.target_deg
    return max(abs(wrapped(to_ra - ra)), abs(to_dec - dec))


def _between(start: Degrees, target: Degrees, both_ways: bool = False) -> Floats:
    """All places between two longitudes, the short way round or both, and two latitudes."""
    turn = 360.0 if both_ways else wrapped(target[0] - start[0])
    return _grid(start[0], start[0] + turn, start[1], target[1])


def _about_the_pole(plan: Plan) -> Floats:
    """A flip goes over the pole, wherever the other axis is then."""
    north = plan.site is None or plan.site.latitude_deg >= 0.0
    ends = (plan.start_deg[1], plan.target_deg[1])
    return _grid(0.0, 360.0, *((min(ends), 90.0) if north else (-90.0, max(ends))))


def _grid(west_deg: float, east_deg: float, low_deg: float, high_deg: float) -> Floats:
    longitudes, latitudes = (
        np.linspace(a, b, max(2, int(np.ceil(abs(b - a) / STEP_DEG)) + 1))
        for a, b in ((west_deg, east_deg), (low_deg, high_deg))
    )
    grid = np.meshgrid(longitudes, latitudes)
    return unit_vectors(grid[0].ravel(), grid[1].ravel())
