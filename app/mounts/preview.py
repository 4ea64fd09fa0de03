"""What would happen: the offset in numbers, and what the rules say, without moving anything."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from app.mounts.rules.plan import Finding, Plan, Severity
from app.mounts.sky_frame import wrapped

Rule = Callable[[Plan], list[Finding]]


@dataclass(frozen=True, slots=True)
class Preview:
    """A motion or sync that has not been done; positions in the mount's own epoch, degrees.

    ``offset_deg`` is the angle on the sky, ``east_deg`` and ``north_deg`` its parts (east already
    times the cosine of the declination).
    """

    action: str
    from_deg: tuple[float, float]
    to_deg: tuple[float, float]
    offset_deg: float
    east_deg: float
    north_deg: float
    refusals: tuple[str, ...] = ()
    confirmations: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def allowed(self) -> bool:
        """Whether it may be done, perhaps after a yes."""
        return not self.refusals


def preview_of(
    plan: Plan, from_deg: tuple[float, float], to_deg: tuple[float, float], rules: Iterable[Rule]
) -> Preview:
    """Ask every rule; each finding once."""
    from math import cos, radians

    found = [finding for rule in rules for finding in rule(plan)]

    def of(severity: Severity) -> tuple[str, ...]:
        return tuple(dict.fromkeys(f.sentence for f in found if f.severity is severity))

    return Preview(
        action=plan.action,
        from_deg=from_deg,
        to_deg=to_deg,
        offset_deg=plan.distance_deg,
        east_deg=wrapped(to_deg[0] - from_deg[0]) * cos(radians(to_deg[1])),
        north_deg=to_deg[1] - from_deg[1],
        refusals=of(Severity.REFUSE),
        confirmations=of(Severity.CONFIRM),
        warnings=of(Severity.WARN),
    )
