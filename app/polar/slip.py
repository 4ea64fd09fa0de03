"""Whether the axis turned as far as it was told: what a slipping clutch looks like."""

from app.polar.findings import Finding, Kind

TOLERANCE_DEG = 1.5
SHARE = 0.1


def slipping(asked_deg: float, turned_deg: float) -> Finding | None:
    """A finding when a commanded turn and the measured one differ; tracking is in neither.

    A mount's own rates are good to a part in a thousand, so a tenth and a degree and a half more
    is not its computer but its clutch, or a declination axis that turned along.
    """
    missing = abs(asked_deg) - abs(turned_deg)
    if abs(missing) <= TOLERANCE_DEG + SHARE * abs(asked_deg):
        return None
    return Finding(
        Kind.SLIPPING,
        f"The mount was asked to turn {abs(asked_deg):.0f} deg and the sky says"
        f" {abs(turned_deg):.0f} deg: the RA clutch slips, or its gears were not engaged.",
    )
