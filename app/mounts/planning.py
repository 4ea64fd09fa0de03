"""From what is asked of a mount to the plan that the rules judge."""

from dataclasses import replace
from datetime import datetime

from app.core.attitude import radec_deg
from app.core.hint import Site
from app.core.mount import Direction, Epoch, MountState, Pointing
from app.mounts import paths
from app.mounts.epoch import from_mount_epoch, to_mount_epoch
from app.mounts.limits import Limits
from app.mounts.rules.meridian import crosses
from app.mounts.rules.plan import Plan


def here_deg(here: Pointing) -> tuple[float, float]:
    """RA and Dec of a pointing."""
    return here.ra_deg, here.dec_deg


def planned(
    action: str, here: Pointing, to_deg: tuple[float, float], state: MountState,
    limits: Limits, time_utc: datetime, site: Site | None,
) -> Plan:  # fmt: skip
    """A plan from ``here`` to a place in the same epoch, without its ways yet."""
    start_icrs = from_mount_epoch(here, time_utc)
    target_icrs = from_mount_epoch(Pointing(*to_deg, here.epoch), time_utc)
    return Plan(
        start_deg=to_mount_epoch(*start_icrs, Epoch.DATE, time_utc),
        target_deg=to_mount_epoch(*target_icrs, Epoch.DATE, time_utc),
        target_icrs_deg=target_icrs,
        state=state,
        limits=limits,
        time_utc=time_utc,
        site=site,
        action=action,
    )


def with_ways(plan: Plan) -> Plan:
    """The ways a slew may take; over the pole only when a flip is allowed and due."""
    start, target = plan.start_deg, plan.target_deg
    ways = [paths.great_circle(start, target), paths.by_axes(start, target)]
    if plan.limits.allow_flip and plan.state.pier_side is not None and crosses(plan):
        north = plan.site is None or plan.site.latitude_deg >= 0.0
        ways.append(paths.over_the_pole(start, target, north))
    return replace(plan, paths=tuple(ways))


def with_move(plan: Plan, direction: Direction, angle_deg: float) -> Plan:
    """A turn of one axis by so much, its end the target."""
    east, north = {
        Direction.EAST: (angle_deg, 0.0),
        Direction.WEST: (-angle_deg, 0.0),
        Direction.NORTH: (0.0, angle_deg),
        Direction.SOUTH: (0.0, -angle_deg),
    }[direction]
    path = paths.turned(plan.start_deg, east, north)
    return replace(plan, target_deg=radec_deg(path[-1]), paths=(path,))
