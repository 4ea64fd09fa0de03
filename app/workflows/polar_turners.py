"""Who turns the RA axis between the frames: the mount within its guard, or a hand."""

import time
from collections.abc import Callable
from typing import Protocol

from app.core.errors import RefusedError
from app.core.mount import Direction, Mount
from app.core.progress import Progress, Task

RATE_DEG_S = 2.0
AT_ONCE_S = 20.0  # one bounded motion; longer turns are several
NEAR_ENOUGH_DEG = 1.0
SETTLE_S = 2.0
SLOW = 6.0  # times longer than expected is given up
MOST_MOTIONS = 24


class Turner(Protocol):
    """Turns the axes. ``by_hand`` tells that nothing is known of how far they went.

    ``told_deg`` is how far the mount itself says that it turned last, None when it does not.
    """

    by_hand: bool
    told_deg: float | None

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """Turn RA, and return when the axis is at rest, or at once when a person does it."""

    def turn_declination(self, direction: Direction, degrees: float) -> Task[None]:
        """The same with the declination axis, north or south: for a second sweep."""


class HandTurner:
    """Says in words what to do; the frames themselves show when it was done."""

    by_hand = True
    told_deg: float | None = None

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """Ask for it."""
        yield Progress(
            "turn",
            None,
            f"Turn the RA axis by hand, about {degrees:.0f} deg to the {direction}; leave the"
            " declination locked, lock RA again and let go.",
        )

    def turn_declination(self, direction: Direction, degrees: float) -> Task[None]:
        """Ask for that."""
        yield Progress(
            "turn",
            None,
            f"Turn the declination axis by hand, about {degrees:.0f} deg to the {direction}; leave"
            " RA and the bolts alone, lock the declination again and let go.",
        )


class MountTurner:
    """Moves a mount that is given already guarded: every refusal comes from there.

    Few mounts say how fast their fast is, so it goes by the mount's own position: one bounded
    motion, a look at where it says it is, and the next. ``sleep`` and ``now`` are the wall's
    unless a test has its own.
    """

    by_hand = False

    def __init__(
        self,
        mount: Mount,
        rate_deg_s: float = RATE_DEG_S,
        sleep: Callable[[float], None] = time.sleep,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.told_deg: float | None = None
        self._mount = mount
        self._rate = rate_deg_s
        self._seen_deg_s = rate_deg_s
        self._sleep = sleep
        self._now = now

    def turn(self, direction: Direction, degrees: float) -> Task[None]:
        """Several bounded motions, each waited for; stopped whenever this is given up."""
        yield from self._turn(direction, degrees, lambda: self._mount.position().ra_deg)

    def turn_declination(self, direction: Direction, degrees: float) -> Task[None]:
        """The same in declination."""
        yield from self._turn(direction, degrees, lambda: self._mount.position().dec_deg)

    def _turn(self, direction: Direction, degrees: float, where: Callable[[], float]) -> Task[None]:
        begun = where()
        turned, motions = 0.0, 0
        try:
            while degrees - turned > NEAR_ENOUGH_DEG and motions < MOST_MOTIONS:
                motions += 1
                left = degrees - turned
                yield Progress("turn", turned / degrees, f"{left:.0f} deg to the {direction}")
                seconds = min(left / self._seen_deg_s, AT_ONCE_S)
                self._mount.move(direction, self._rate, seconds)
                yield from self._wait(seconds)
                turned = self._moved_on(turned, where() - begun, seconds)
        finally:
            self._mount.stop()
        self.told_deg = turned
        self._sleep(SETTLE_S)

    def _moved_on(self, before: float, moved_deg: float, seconds: float) -> float:
        """How far it says that it has turned in all; its rate is learned from that."""
        turned = abs((moved_deg + 180.0) % 360.0 - 180.0)
        step = turned - before
        if step <= 0.02 * self._seen_deg_s * seconds:
            raise RefusedError(
                "The mount was told to turn and says that it has not moved: is it parked, or at a"
                " limit?"
            )
        self._seen_deg_s = step / seconds
        return turned

    def _wait(self, seconds: float) -> Task[None]:
        begun = self._now()
        while self._now() - begun < seconds or self._mount.state().slewing:
            if self._now() - begun > SLOW * seconds + 10.0:
                raise RefusedError("The mount says that it is still moving: it was stopped.")
            yield Progress("turn")
            self._sleep(0.1)
