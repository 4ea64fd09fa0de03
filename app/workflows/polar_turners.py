"""Who turns the RA axis between the frames: the mount within its guard, or a hand."""

import time
from collections.abc import Callable
from typing import Protocol

from app.core.errors import RefusedError
from app.core.mount import Direction, Mount
from app.core.progress import Progress, Task

RATE_DEG_S = 2.0
AT_ONCE_S = 20.0  # one bounded motion; longer turns are several
SETTLE_S = 2.0
SLOW = 6.0  # times longer than expected is given up


class Turner(Protocol):
    """Turns the RA axis. ``by_hand`` tells that nothing is known of how far it went."""

    by_hand: bool

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """Turn, and return when the axis is at rest, or at once when a person does it."""


class HandTurner:
    """Says in words what to do; the frames themselves show when it was done."""

    by_hand = True

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """Ask for it."""
        yield Progress(
            "turn",
            None,
            f"Turn the RA axis by hand, about {degrees:.0f} deg to the {direction}; leave the"
            " declination locked, lock RA again and let go.",
        )


class MountTurner:
    """Moves a mount that is given already guarded: every refusal comes from there.

    ``sleep`` and ``now`` are the wall's unless a test has its own.
    """

    by_hand = False

    def __init__(
        self,
        mount: Mount,
        rate_deg_s: float = RATE_DEG_S,
        sleep: Callable[[float], None] = time.sleep,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._mount = mount
        self._rate = rate_deg_s
        self._sleep = sleep
        self._now = now

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """Several bounded motions, each waited for; stopped whenever this is given up."""
        left = degrees
        try:
            while left > 0.01:
                part = min(left, self._rate * AT_ONCE_S)
                yield Progress("turn", 1.0 - left / degrees, f"{left:.0f} deg to the {direction}")
                self._mount.move(direction, self._rate, part / self._rate)
                yield from self._wait(part / self._rate)
                left -= part
        finally:
            self._mount.stop()
        self._sleep(SETTLE_S)

    def _wait(self, seconds: float) -> Task[None]:
        begun = self._now()
        while self._now() - begun < seconds or self._mount.state().slewing:
            if self._now() - begun > SLOW * seconds + 10.0:
                raise RefusedError("The mount says that it is still moving: it was stopped.")
            yield Progress("turn")
            self._sleep(0.1)
