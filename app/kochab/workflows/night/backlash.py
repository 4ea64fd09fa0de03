"""Backlash of the Dec axis from frames: where they point against where the mount said it was when they were taken.

A mount's computer counts the turns of its motor. Where that turns Dec back, for a dither or another centring, the
motor moves and the sky does not until the play is crossed. Headers have the motor's word (RA and DEC, as capture
programs ask the mount for them), solutions the sky's; the axis follows the motor behind play (`polar.pulses`). The
slow rest, polar axis, refraction, flexure and the epoch of the header's coordinates, is a smooth drift to the fit.
"""

from collections.abc import Sequence

import numpy as np

from kochab.core.arrays import Floats
from kochab.polar.pulses import LEAST_FRAMES, pulse_response
from kochab.text.translation import tr, tr_noop
from kochab.workflows.night.measure import Measure

COPIED_ARCSEC = 3.0
"""Half of a night's frames closer than this to the header: its place was solved, and is not the mount's."""
AGREES = 0.2
"""The header's steps are those of the sky to this part, or they are not of the motor."""
SHOWN_ARCSEC, SHOWN_SHARE = 1.0, 0.3
"""A backlash is told where its sigma is below this, or below this share of it."""


def told_backlash(size: float, sigma: float) -> Measure | None:
    """A backlash that is known well enough to be told, arcsec."""
    return Measure(size, sigma) if sigma < max(SHOWN_ARCSEC, SHOWN_SHARE * size) else None


def dec_backlash(
    time_s: Floats, dec_arcsec: Floats, reported_arcsec: Floats, level: Floats, off_ra_arcsec: Floats
) -> Measure | str:
    """The backlash in arcsec, or a sentence why it is not known.

    Parameters
    ----------
    time_s : Floats
        Mid-exposures (N,), in order.
    dec_arcsec, reported_arcsec : Floats
        Dec solved and Dec by the header, each (N,); NaN where the header has none.
    level : Floats
        Counts (N,) the jumps that the motor knows nothing of.
    off_ra_arcsec : Floats
        RA solved less RA by the header, on the sky (N,).
    """
    known = np.isfinite(reported_arcsec)
    if not known.any():
        return tr_noop("the headers do not say where the mount was")
    time, dec, motor, of = (each[known] for each in (time_s, dec_arcsec, reported_arcsec, level))
    if np.median(np.hypot(dec - motor, off_ra_arcsec[known])) < COPIED_ARCSEC:
        return tr_noop("the headers repeat the solution, not the mount's own place")
    if not _reverses(motor):
        return tr_noop("by the headers Dec was never turned back")
    if len(time) - len(np.unique(of)) < LEAST_FRAMES:
        return tr_noop("too few frames")
    middle = float(np.median(motor))
    found = pulse_response(time, dec - middle, motor - middle, of)
    if found is None or abs(found.scale - 1.0) > AGREES:
        return tr_noop("the frames do not follow the mount's own place")
    if not np.isfinite(found.backlash):
        return tr_noop("Dec was not turned far enough")
    return told_backlash(found.backlash, found.backlash_sigma) or tr_noop("the frames scatter too much")


def _reverses(motor: Floats) -> bool:
    """Whether the motor turned both ways, each by more than the rounding of a header."""
    steps = np.diff(motor)
    return bool(steps.max(initial=0.0) > SHOWN_ARCSEC and steps.min(initial=0.0) < -SHOWN_ARCSEC)


def words_of(found: Sequence[Measure | str]) -> str:
    """What the page says of it: the reason of the first field when no field shows it; empty without fields."""
    if not found or any(isinstance(one, Measure) for one in found):
        return ""
    return tr("Backlash unknown: {why}.", why=tr(str(found[0])))
