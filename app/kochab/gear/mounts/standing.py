"""Whether the tube stands: two positions that agree, whatever the mount says of itself."""

from collections.abc import Callable
from time import monotonic

from kochab.core.attitude import apart_deg
from kochab.core.mount import SIDEREAL_DEG_S, Pointing
from kochab.gear.mounts.emergency_stop import LOOK_S, STILL_DEG

LOOKS = 8  # a nudge has run out by then


def place_of_rest(
    read: Callable[[], Pointing], wait: Callable[[float], None], looks: int = LOOKS
) -> tuple[Pointing, bool]:
    """The last position that was read, and whether it agrees with the one before: then the tube stands.

    A mount that does not track drifts at the sidereal rate, which is no motion. Raises what ``read`` raises.
    """
    begun, here = monotonic(), read()
    for _ in range(looks - 1):
        wait(LOOK_S)
        before, since, begun = here, begun, monotonic()
        here = read()
        moved_deg = apart_deg((here.ra_deg, here.dec_deg), (before.ra_deg, before.dec_deg))
        # A simulated clock's seconds pass in the wait, which is part of the time allowed.
        if moved_deg <= STILL_DEG + 2.0 * SIDEREAL_DEG_S * max(begun - since, LOOK_S):
            return here, True
    return here, False
