"""Whether the tube stands: two readings in a row that agree, whatever the mount says of itself."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from math import inf
from time import monotonic

from kochab.core.attitude import apart_deg, wrapped
from kochab.core.mount import SIDEREAL_DEG_S, Pointing

LOOK_S = 0.7  # between two readings
STILL_DEG = 20.0 / 3600.0  # a mount that rounds to 15 arcsec may jump by that much
TURNED_DEG = 0.03  # in RA, which moves beside the pole where the sky does not; one in low precision rounds to 0.025
LOOKS = 8  # a nudge has run out by then


@dataclass(frozen=True, slots=True)
class Reading:
    """A position, and when it was asked for, by `monotonic` and by a clock that may be simulated.

    ``slewing`` is what the mount said of itself; None where it says nothing, or was not asked.
    """

    here: Pointing
    asked_s: float
    asked: datetime
    slewing: bool | None = None

    def agrees(self, before: "Reading") -> bool:
        """Whether the tube has stood since, or followed the sky: one that does not track drifts at its rate."""
        passed_s = max(self.asked_s - before.asked_s, (self.asked - before.asked).total_seconds())
        drift_deg = 2.0 * SIDEREAL_DEG_S * passed_s
        here, there = ((one.here.ra_deg, one.here.dec_deg) for one in (self, before))
        turned_deg = abs(wrapped(here[0] - there[0]))
        return apart_deg(here, there) <= STILL_DEG + drift_deg and turned_deg <= TURNED_DEG + drift_deg


def seen_to_stand(
    read: Callable[[], Reading | None], wait: Callable[[float], None], looks: int = LOOKS, longest_s: float = inf
) -> tuple[Reading | None, bool]:
    """The last reading, and whether it agrees with the one before and neither says that the mount slews.

    Raises what ``read`` raises.

    Parameters
    ----------
    read : Callable[[], Reading or None]
        Gives None for an answer that was missed; after one, two readings are needed anew: a late answer may be of
        before.
    wait : Callable[[float], None]
        Waits so many seconds between readings.
    looks : int
        How many readings at most.
    longest_s : float
        After so long no more are made.
    """
    begun, before = monotonic(), None
    for look in range(looks):
        if look:
            wait(LOOK_S)
        now = read()
        if before is not None and now is not None and not now.slewing and now.agrees(before):
            return now, True
        before = now
        if monotonic() - begun > longest_s:
            break
    return before, False
