"""A slew longer than anybody asks for is a mistake."""

from app.mounts.rules.plan import Finding, Plan, refuse


def slew(plan: Plan) -> list[Finding]:
    """Refuse a slew beyond the cap."""
    cap = plan.limits.longest_slew_deg
    if plan.distance_deg <= cap:
        return []
    return [refuse(f"The slew of {plan.distance_deg:.1f} deg is longer than the {cap:g} allowed.")]
