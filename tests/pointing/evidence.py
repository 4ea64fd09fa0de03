"""What the evidence of a suspect says, as a person reads it."""

import re

from kochab.pointing.disagreement import Suspect

UNITS_ARCSEC = {"deg": 3600.0, "arcmin": 60.0, "arcsec": 1.0}


def unexplained_arcsec(suspect: Suspect) -> float:
    """What it leaves unexplained."""
    value, unit = re.search(r"It leaves ([\d.]+) (deg|arcmin|arcsec) unexplained", suspect.evidence).groups()
    return float(value) * UNITS_ARCSEC[unit]
