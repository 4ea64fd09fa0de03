"""The Sun: a cone no path may enter while it is up or nearly so."""

import numpy as np

from app.core.attitude import separation_deg
from app.mounts.rules.plan import Finding, Plan, refuse
from app.mounts.sky_frame import altitude_deg, sun_vector


def sun(plan: Plan) -> list[Finding]:
    """Refuse a way that comes within the cone; without a site the Sun is taken to be up.

    A telescope that is inside the cone already may leave it, but not come nearer.
    """
    towards = sun_vector(plan.time_utc)
    if plan.site is not None:
        height = float(altitude_deg(np.atleast_2d(towards), plan.site, plan.time_utc)[0])
        if height <= plan.limits.sun_up_deg:
            return []
    cone = plan.limits.sun_cone_deg
    start = separation_deg(plan.start, towards)
    target = separation_deg(plan.target, towards)
    leaving = plan.action in ("move", "pulse") and target >= start
    if target < cone and not leaving:
        return [refuse(f"The target is {target:.0f} deg from the Sun, nearer than {cone:g} deg.")]
    for path in plan.paths:
        nearest = float(np.degrees(np.arccos(np.clip(path @ towards, -1.0, 1.0))).min())
        if nearest < min(cone, start) - 0.05:
            return [refuse(f"The way passes {nearest:.0f} deg from the Sun, nearer than {cone:g}.")]
    return []
