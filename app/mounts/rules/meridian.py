"""The meridian: where a German mount changes the side of its pier."""

from app.mounts.rules.plan import Finding, Plan, refuse, warn

ACROSS = (
    "The sync would carry the mount across the meridian and so to the other side of its pier: "
    "slew away from the meridian first; a fork or wedge goes on (choose Meridian, or --fork)."
)


def crosses(plan: Plan) -> bool:
    """Whether start and target lie on different sides of the meridian."""
    ends = plan.hour_angles_deg()
    return ends is not None and (ends[0] < 0.0) != (ends[1] < 0.0)


def flip(plan: Plan) -> list[Finding]:
    """No automatic flip: a slew across the meridian is asked for in so many words."""
    if plan.limits.crosses_meridian or not crosses(plan):
        return []
    if plan.limits.allow_flip:
        return [warn("The mount will flip to the other side of its pier: watch the cables.")]
    if plan.state.pier_side is None:
        return [warn("The way crosses the meridian: a German mount would flip there.")]
    return [
        refuse(
            f"The way crosses the meridian and would flip the mount from the {plan.state.pier_side}"
            " side of its pier: choose a target on this side, or allow the flip (Meridian in the"
            " Mount view, or --allow-flip); a fork or wedge goes on without (--fork)."
        )
    ]


def sync_across_meridian(plan: Plan) -> list[Finding]:
    """A sync across the meridian would make the mount believe in the other pier side."""
    findings = []
    if not plan.limits.crosses_meridian and crosses(plan):
        findings.append(refuse(ACROSS))
    if abs(plan.target_deg[1]) > plan.limits.near_pole_deg:
        findings.append(
            warn(
                f"At declination {plan.target_deg[1]:+.1f} deg a sync says little about the right "
                "ascension axis: sync again further from the pole."
            )
        )
    return findings
