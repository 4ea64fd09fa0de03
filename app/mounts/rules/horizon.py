"""Pier, tripod and ground: altitude and hour angle along the whole path."""

import numpy as np

from app.mounts.rules.plan import Finding, Plan, refuse, warn
from app.mounts.sky_frame import altitude_deg

SLACK_DEG = 0.05


def horizon(plan: Plan) -> list[Finding]:
    """Refuse a target or a path outside the altitudes and hour angles allowed.

    A telescope that stands too low already may go up, never further down.
    """
    if plan.site is None:
        return [_without_site(plan)]
    if plan.action == "sync":
        return _sync_target(plan)
    return [*_altitudes(plan), *_hour_angles(plan)]


def _without_site(plan: Plan) -> Finding:
    if plan.limits.allow_without_site or plan.action == "pulse":
        return warn("The site is not known, so nothing watches the horizon.")
    return refuse(
        f"The site is not known, so the horizon cannot be watched: give it before a {plan.action}."
    )


def _sync_target(plan: Plan) -> list[Finding]:
    assert plan.site is not None
    (height,) = altitude_deg(np.atleast_2d(plan.target), plan.site, plan.time_utc)
    if height >= 0.0:
        return []
    return [
        refuse(
            f"The sync is refused: that place is {-height:.1f} deg below the horizon; "
            "check the site, the time and the solve."
        )
    ]


def _altitudes(plan: Plan) -> list[Finding]:
    assert plan.site is not None
    limits = plan.limits
    ends = altitude_deg(np.stack([plan.start, plan.target]), plan.site, plan.time_utc)
    start, target = float(ends[0]), float(ends[1])
    low, high = limits.lowest_altitude_deg, limits.highest_altitude_deg
    leaving = plan.action in ("move", "pulse")  # these may creep back into the allowed range
    if target < low and not (leaving and target >= start):
        return [refuse(f"The target is {target:.1f} deg high, the limit is {low:g} deg.")]
    if target > high and not (leaving and target <= start):
        return [refuse(f"The target is {target:.1f} deg high, the upper limit is {high:g} deg.")]
    for path in plan.paths:
        along = altitude_deg(path, plan.site, plan.time_utc)
        bottom, top = float(along.min()), float(along.max())
        if bottom < min(low, start) - SLACK_DEG:
            return [refuse(f"The way would dip to {bottom:.1f} deg, the limit is {low:g} deg.")]
        if top > max(high, start) + SLACK_DEG:
            return [refuse(f"The way would rise to {top:.1f} deg, the limit is {high:g} deg.")]
    return []


def _hour_angles(plan: Plan) -> list[Finding]:
    east, west = plan.limits.hour_angle_deg
    ends = plan.hour_angles_deg()
    if ends is None or (east <= -180.0 and west >= 180.0):
        return []
    along = plan.path_hour_angles_deg()
    start = ends[0]
    lowest, highest = float(along.min()), float(along.max())
    if lowest < min(east, start) - SLACK_DEG or highest > max(west, start) + SLACK_DEG:
        worst = lowest if lowest < min(east, start) - SLACK_DEG else highest
        return [
            refuse(
                f"The way reaches hour angle {worst / 15:+.1f} h, "
                f"the limits are {east / 15:+.1f} to {west / 15:+.1f} h."
            )
        ]
    return []
