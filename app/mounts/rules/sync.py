"""A sync on a wrong solution: two agreeing solves, a residual gate, and the size of the step."""

from itertools import combinations

from app.core.attitude import separation_deg, unit_vectors
from app.mounts.limits import Limits
from app.mounts.rules.plan import Finding, Plan, confirm, refuse


def sync(plan: Plan) -> list[Finding]:
    """Refuse without evidence and beyond the largest step; ask beyond the smaller one."""
    return [*_step(plan), *_evidence(plan)]


def _step(plan: Plan) -> list[Finding]:
    limits, step = plan.limits, plan.distance_deg
    if step > limits.refuse_sync_deg and not plan.armed:
        return [
            refuse(
                f"The sync would shift the mount by {step:.1f} deg, more than "
                f"{limits.refuse_sync_deg:g}: arm it when you are sure."
            )
        ]
    if step > limits.confirm_sync_deg:
        return [confirm(f"The sync would shift the mount by {step:.1f} deg: confirm it.")]
    return []


def _evidence(plan: Plan) -> list[Finding]:
    if plan.by_hand:
        return []
    e, limits = plan.evidence, plan.limits
    if e is None or len(e.centres_deg) < 2:
        count = 0 if e is None else len(e.centres_deg)
        return [refuse(f"A sync needs two solves that agree, there are {count}: take another.")]
    if not len(e.centres_deg) == len(e.rms_px) == len(e.log10_false_alarm):
        return [refuse("The evidence of the sync is incomplete: solve again.")]
    return [
        *_agreement(plan, e.centres_deg),
        *_quality(max(e.rms_px), max(e.log10_false_alarm), limits),
    ]


def _agreement(plan: Plan, centres: tuple[tuple[float, float], ...]) -> list[Finding]:
    allowed = plan.limits.solves_agree_arcsec
    seen = [unit_vectors(*centre) for centre in centres]
    apart = max(separation_deg(a, b) for a, b in combinations(seen, 2)) * 3600.0
    if not apart <= allowed:
        return [
            refuse(f"The solves differ by {apart:.0f} arcsec, {allowed:g} allowed: wait, solve.")
        ]
    target = unit_vectors(*plan.target_icrs_deg)
    away = min(separation_deg(target, centre) for centre in seen) * 3600.0
    if not away <= allowed:
        return [refuse(f"The sync is {away:.0f} arcsec from what the solves say: solve again.")]
    return []


def _quality(rms_px: float, false_alarm: float, limits: Limits) -> list[Finding]:
    findings = []
    if not rms_px <= limits.worst_rms_px:
        findings.append(
            refuse(f"The solve's residual is {rms_px:.1f} px, {limits.worst_rms_px:g} allowed.")
        )
    if not false_alarm <= limits.worst_log10_false_alarm:
        findings.append(
            refuse(
                f"The solve may be chance (10^{false_alarm:.0f}), "
                f"10^{limits.worst_log10_false_alarm:g} is allowed: solve a better frame."
            )
        )
    return findings
