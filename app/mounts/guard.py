"""The guard: a mount that moves and syncs only within its limits.

Whoever moves a mount holds it through a :class:`Guard`. It is itself a
:class:`~app.core.mount.Mount`; every motion is planned, judged by :mod:`app.mounts.rules`, written
into a log, watched while it lasts, and ended when something goes wrong. Time and site are never
sent to a mount.
"""

from math import inf

from app.core.errors import LineLostError
from app.core.mount import Ability, Direction, Pointing
from app.core.progress import Task
from app.mounts.arrival import arrival
from app.mounts.held import CANNOT_STOP
from app.mounts.room import longest_turn_deg, room_of
from app.mounts.synced import Synced
from app.mounts.watch import Watch

__all__ = ["CANNOT_STOP", "Guard"]


class Guard(Synced):
    """A :class:`~app.core.mount.Mount` whose motions are watched."""

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Begin a slew that every rule allows; see :meth:`slew` for one that is waited for."""
        self._begin(ra_deg, dec_deg)

    def slew(self, ra_deg: float, dec_deg: float) -> Task[Pointing]:
        """Go to the mount's own coordinates and stay until it is there.

        The mount is stopped when it takes too long, does not answer, leaves its way or the limits,
        or when the task is cancelled or fails.
        """
        limit_s = self._begin(ra_deg, dec_deg)
        there = False
        try:
            result = yield from arrival(self, (ra_deg, dec_deg), self._wait, limit_s)
            there = True
        except LineLostError:
            self.unfinished = True
            raise
        finally:
            if not there:
                self.halt()
        self._motion.end()
        self.log.add("goto", "done")
        return result

    def slew_icrs(self, ra_deg: float, dec_deg: float) -> Task[Pointing]:
        """:meth:`slew` to ICRS degrees."""
        return (yield from self.slew(*self.to_mount(ra_deg, dec_deg)))

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """Guide for a bounded time."""
        self._able(Ability.PULSE)
        longest = self.limits.longest_pulse_ms
        if not 0 < milliseconds <= longest:
            self._refuse("pulse", f"A pulse of {milliseconds} ms is refused: 1 to {longest} ms.")
        watch = self._move_watch("pulse", direction, 0.008, milliseconds / 1000.0)
        self._send(
            "pulse",
            milliseconds / 1000.0 + 0.5,
            lambda: self.mount.pulse(direction, milliseconds),
            watch,
            direction=str(direction),
            milliseconds=milliseconds,
        )

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """Move for a bounded time, over a bounded angle."""
        self._able(Ability.MOVE)
        rate = self.rate_deg_s(rate_deg_s)
        limits = self.limits
        if not 0.0 < seconds <= limits.longest_move_s:
            allowed = f"at most {limits.longest_move_s:g} s are allowed."
            self._refuse("move", f"A move of {seconds:g} s is refused: {allowed}")
        if not 0.0 < rate * seconds <= limits.longest_move_deg:
            allowed = f"at most {limits.longest_move_deg:g} deg are allowed."
            self._refuse("move", f"A move of {rate * seconds:.1f} deg is refused: {allowed}")
        watch = self._move_watch("move", direction, rate, seconds)
        self._send(
            "move",
            seconds + 2.0,
            lambda: self.mount.move(direction, rate_deg_s, seconds),
            watch,
            direction=str(direction),
            rate_deg_s=rate,
            seconds=seconds,
        )

    def track(self, on: bool) -> None:
        """Sidereal tracking on or off."""
        self._able(Ability.TRACKING)
        if on and self.state().parked:
            self._refuse("track", "The mount is parked: unpark it before it tracks.")
        self._send("track", 0.0, lambda: self.mount.track(on), on=int(on))

    def _begin(self, ra_deg: float, dec_deg: float) -> float:
        """Send a goto; in how many seconds it must have ended."""
        self._able(Ability.GOTO)
        plan, preview = self._goto_judged(ra_deg, dec_deg)
        self._require(preview, confirmed=True)
        watch = Watch(plan, room_of(plan))
        self._send(
            "goto",
            inf,
            lambda: self.mount.goto(ra_deg, dec_deg),
            watch,
            ra_deg=ra_deg,
            dec_deg=dec_deg,
        )
        limits = self.limits
        turning_s = longest_turn_deg(plan) / limits.slowest_slew_deg_s
        return min(limits.slew_timeout_s, limits.slew_start_s + turning_s)
