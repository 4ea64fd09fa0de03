"""A German mount whose axis is moved by hand or rate does not flip: it runs into its pier."""

import numpy as np

from app.core.mount import PierSide
from app.mounts.rules.plan import Finding, Plan, refuse

SLACK_DEG = 0.05
EAST_MOST_DEG = -270.0  # past the lower meridian counts on from there


def past_meridian(plan: Plan) -> list[Finding]:
    """Refuse a move that carries the telescope too far past the meridian on its side of the pier.

    Only where the mount tells the side: west of the pier it looks at the eastern sky. What is too
    far already may come back, and a mount that tells no side may be a fork.
    """
    side, limit = plan.state.pier_side, plan.limits.past_meridian_deg
    turns_dec = abs(plan.target_deg[1] - plan.start_deg[1]) > SLACK_DEG
    if plan.limits.crosses_meridian or side is None or plan.site is None or turns_dec:
        return []
    along = np.degrees(np.unwrap(np.radians(plan.path_hour_angles_deg())))
    past = along if side is PierSide.WEST else -along
    past -= 360.0 * np.floor((past[0] - EAST_MOST_DEG) / 360.0)  # begins in [-270, 90)
    upper, lower = float(past.max()), float(-180.0 - past.min())
    start = max(float(past[0]), float(-180.0 - past[0]))
    worst = max(upper, lower)
    if worst <= max(limit, start) + SLACK_DEG:
        return []
    return [
        refuse(
            f"The move would carry the telescope {worst:.0f} deg past the meridian on the {side}"
            f" side of its pier, where it may hit it; the limit is {limit:g} deg. Begin further"
            " from the meridian, or move the other way; a fork or wedge goes on (choose Meridian in"
            " the Mount view, or --fork)."
        )
    ]
