"""A parked, slewing or unaligned mount is left alone."""

from app.mounts.rules.plan import Finding, Plan, refuse


def readiness(plan: Plan) -> list[Finding]:
    """Refuse when the mount is parked, moves already or has not been aligned."""
    findings = []
    if plan.state.parked:
        findings.append(refuse(f"The mount is parked: unpark it before a {plan.action}."))
    if plan.state.slewing and plan.action != "pulse":
        findings.append(refuse(f"The mount is slewing: wait or stop it before a {plan.action}."))
    if plan.state.aligned is False:
        findings.append(
            refuse("The mount is not aligned: do its alignment on the hand control first.")
        )
    return findings
