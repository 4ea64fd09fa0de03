"""Whether the tube stands: its places agree for long enough, whatever the mount says of itself.

The axes either follow the sky or stand while it turns: then right ascension stays or grows at the sidereal rate, and
declination stays. Every other drift is a motion, once it is larger than what the readout hides.
"""

from collections.abc import Callable, Sequence
from datetime import datetime
from math import ceil, cos, inf, radians
from time import monotonic

from kochab.core.attitude import wrapped
from kochab.core.mount import SIDEREAL_DEG_S, Epoch, Pointing
from kochab.core.values import frozen

LOOK_S = 0.7  # between two readings
LOOKS = 8  # a nudge has run out by then
SLOWEST_DEG_S = 0.5 * SIDEREAL_DEG_S  # of the motions that a mount may be left in: the usual guide rate
WANDERS_DEG_S = 0.2 * SIDEREAL_DEG_S  # guiding, the Moon's rate, a drive that is not steady
LONGEST_S = 5.0  # it is not looked at for longer: what whole minutes of arc hide by then is 1.4 times sidereal
STILL_DEG = 20.0 / 3600.0  # what is not as the mount told it: 15 arcsec of RA, brought to another epoch
FINE_DEG = 5.0 / 3600.0  # of a readout finer than that: backlash, wind, the steps of a motor
ROUNDED_DEG = 1.0 / 3600.0  # two looks are not at the same moment of a second
TURNED_DEG = 0.03  # in RA, whose smallest steps are of any size beside the pole
READOUTS_DEG = (1.0 / 40.0, 1.0 / 60.0), (360.0 / 65536.0, 360.0 / 65536.0), (1.0 / 240.0, 1.0 / 3600.0)
"""What RA and Dec count in: tenths of a minute and minutes of arc; a turn in 16 bits; seconds."""


@frozen
class Reading:
    """A position, and when it was asked for, by `monotonic` and by a clock that may be simulated.

    ``slewing`` is what the mount said of itself; None where it says nothing, or was not asked.
    ``answered_s`` is when its answer had come; None: at once.
    """

    here: Pointing
    asked_s: float
    asked: datetime
    slewing: bool | None = None
    answered_s: float | None = None

    def agrees(self, before: "Reading", lag_s: float = 0.0) -> bool:
        """Whether the tube has stood or followed the sky since; ``lag_s`` as :attr:`Mount.lag_s`."""
        answered_s = self.asked_s if self.answered_s is None else self.answered_s
        passed_s = max(answered_s - before.asked_s, (self.asked - before.asked).total_seconds())
        turned = wrapped(self.here.ra_deg - before.here.ra_deg)
        moved = abs(self.here.dec_deg - before.here.dec_deg)
        hidden_ra, hidden_dec = hidden_deg((self, before))
        wanders = WANDERS_DEG_S * passed_s
        # An axis that turns backwards as slowly as the sky turns is let pass: an answer may be late.
        eastward = 2.0 * SIDEREAL_DEG_S * passed_s + SIDEREAL_DEG_S * lag_s
        return moved <= hidden_dec + wanders and -hidden_ra - wanders <= turned <= hidden_ra + eastward


def hidden_deg(readings: Sequence[Reading]) -> tuple[float, float]:
    """By how much RA and Dec may differ between two readings of a tube that follows the sky."""
    dec_deg = readings[0].here.dec_deg
    least = FINE_DEG if readings[0].here.epoch is Epoch.DATE else STILL_DEG
    ra, dec = next((steps for steps in READOUTS_DEG if all(_counts_in(steps, r.here) for r in readings)), (0.0, 0.0))
    beside_pole = min(TURNED_DEG, least / max(cos(radians(dec_deg)), 1e-9))
    return max(ra + ROUNDED_DEG, beside_pole), max(dec + ROUNDED_DEG, least)


def seen_to_stand(
    read: Callable[[], Reading | None],
    wait: Callable[[float], None],
    looks: int = LOOKS,
    longest_s: float = inf,
    slowest_deg_s: float = SLOWEST_DEG_S,
    lag_s: float = 0.0,
) -> tuple[list[Reading], bool]:
    """The readings in order, and whether the last ones agree for long enough, of which none says that the mount slews.

    Raises what ``read`` raises.

    Parameters
    ----------
    read : Callable[[], Reading or None]
        Gives None for an answer that was missed; after one, readings are needed anew: a late answer may be of before.
    wait : Callable[[float], None]
        Waits so many seconds between readings.
    looks : int
        In how many readings it may run out of a motion: the first later one that does not agree tells that it moves.
    longest_s : float
        The same in seconds.
    slowest_deg_s : float
        The slowest motion that is to be told from following the sky, as far as the readout shows it.
    lag_s : float
        How old a place may be that it tells, see :attr:`Mount.lag_s`.
    """
    begun, readings, agreeing = monotonic(), list[Reading](), list[Reading]()
    for look in range(1, looks + ceil((LONGEST_S + lag_s) / LOOK_S) + 1):
        if look > 1:
            wait(LOOK_S)
        now = read()
        if now is not None:
            readings.append(now)
        if now is not None and agreeing and not now.slewing and _all_agree(now, agreeing, lag_s):
            agreeing.append(now)
            if LOOK_S * (len(agreeing) - 1) >= _baseline_s(agreeing, slowest_deg_s) + lag_s:
                return readings, True
            continue
        agreeing = [] if now is None else [now]
        if look >= looks or monotonic() - begun > longest_s:
            break
    return readings, False


def _all_agree(now: Reading, before: Sequence[Reading], lag_s: float) -> bool:
    return now.agrees(before[-1], lag_s) and now.agrees(before[0], lag_s)


def _baseline_s(readings: Sequence[Reading], slowest_deg_s: float) -> float:
    """How long a tube must agree with itself until a motion at this rate would show."""
    shows_s = max(hidden_deg(readings)) / max(slowest_deg_s - WANDERS_DEG_S, 1e-9)
    return min(shows_s, LONGEST_S)


def _counts_in(steps_deg: tuple[float, float], here: Pointing) -> bool:
    counts = here.ra_deg / steps_deg[0], here.dec_deg / steps_deg[1]
    return all(abs(count - round(count)) < 1e-3 for count in counts)
