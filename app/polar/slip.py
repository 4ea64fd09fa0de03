"""Whether the axis turned as far as it was told: what a slipping clutch looks like."""

from app.polar.findings import Finding, Kind

TOLERANCE_DEG = 1.5
SHARE = 0.1


def slipping(asked_deg: float, turned_deg: float) -> Finding | None:
    """A finding when the turn a mount believes in and the measured one differ.

    A mount counts its motor's steps to a part in a thousand, so a tenth and a degree and a half
    more is not its computer but its clutch.
    """
    missing = abs(asked_deg) - abs(turned_deg)
    if abs(missing) <= TOLERANCE_DEG + SHARE * abs(asked_deg):
        return None
    return Finding(
        Kind.SLIPPING,
        f"The mount says that it turned {abs(asked_deg):.0f} deg and the sky says"
        f" {abs(turned_deg):.0f} deg: the RA clutch slips, or its gears were not engaged.",
    )
