"""The emergency stop: what may be moving, Stop, the check that it worked, and the watchdog."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from math import inf
from threading import Lock, Timer
from time import monotonic

from kochab.core.attitude import apart_deg
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, NotStoppedError
from kochab.core.mount import Mount
from kochab.gear.journal import MotionLog
from kochab.gear.mounts.standing import SLOWEST_DEG_S, Reading, seen_to_stand
from kochab.text.translation import tr, tr_noop

CANNOT_STOP = tr_noop("Kochab can't stop the mount: cut its power.")
MAY_STILL_MOVE = tr_noop("THE MOUNT MAY STILL MOVE: CUT ITS POWER.")
MOVES = tr_noop("It is still moving after two Stop commands.")
MUTE = tr_noop("It does not answer after two Stop commands.")
RAN_ON = tr_noop("It ran on, by {moved:.2f}° or more, and was stopped again.")
LOOKS = 4  # motors run out of a slew within two seconds
LONG_S = 4.0  # after this time one that does not agree is stopped again: a silent mount is as bad as a moving one

logger = logging.getLogger(__name__)


class EmergencyStop:
    """Knows whether the mount may be moving, and stops it; `stop` may be called from any thread.

    It never refers to its guard, so that a guard that is dropped still stops its mount.
    """

    def __init__(
        self, mount: Mount, log: MotionLog, clock: Callable[[], datetime], wait: Callable[[float], None]
    ) -> None:
        self.mount = mount
        self.stops = 0  # by the user, or of what strayed: no motion that was ordered before is continued
        self.unfinished = False  # a motion was under way when the line broke
        self.wait = wait
        self._log, self._clock = log, clock
        self._moves_until = 0.0
        self.ended = 0.0, clock()  # when the last motion that was ordered ended, by both clocks
        self._sent = self._confirmed = 0  # Stops sent, and those whose effect was checked
        self._moved = False  # and nobody has seen its end: the bytes that end a move can be lost
        self._slowest_deg_s = SLOWEST_DEG_S  # of what was ordered since

    def begin(self, seconds: float, rate_deg_s: float = 0.0) -> None:
        """A motion lasts at most ``seconds``; ``inf`` until the mount reports its end.

        ``rate_deg_s`` is the slowest that it may have; 0.0: not known.
        """
        slowest = max(SLOWEST_DEG_S, rate_deg_s)
        self._slowest_deg_s = min(self._slowest_deg_s, slowest) if self.unseen else slowest
        self._moved = True
        self._moves_until = max(self._moves_until, monotonic() + seconds)  # a short pulse must not cut a move

    def end(self) -> None:
        """Nothing moves any more, except by tracking."""
        if self._moves_until:
            self.ended = monotonic(), self._clock()
        self._moves_until = 0.0

    @property
    def moving(self) -> bool:
        """Whether something may be moving now."""
        return monotonic() < self._moves_until

    @property
    def endless(self) -> bool:
        """Whether a motion lasts until the mount reports its end."""
        return self._moves_until == inf

    def stop(self) -> None:
        """The user's Stop: now, ahead of everything."""
        self.stops += 1
        self.halt()

    def halt(self) -> None:
        """Send Stop, twice when the first is not answered; `LineLostError` when neither went out."""
        self._log.add("stop", "sent", journal=False)  # a slow disk must not delay a Stop
        try:
            try:
                self.mount.stop()
            except NoAnswerError:  # the reply was lost, or the Stop itself
                self.mount.stop()
        except DeviceError as error:
            self.unfinished = self.unfinished or self.moving
            self._log.add("stop", "failed", CANNOT_STOP)
            raise LineLostError("{cannot_stop} ({error})", cannot_stop=tr(CANNOT_STOP), error=error) from error
        self.end()
        self._sent += 1
        logger.info("stop sent")

    @property
    def unseen(self) -> bool:
        """Whether something may move, or nobody has seen yet that a Stop has worked."""
        return self.moving or self.unfinished or self.unconfirmed or self._moved

    def see_stopped(self) -> str:
        """Before a session ends: stop what moves, and see that it stands; what was seen, as :meth:`confirm`.

        Raises `LineLostError` when no Stop went out, and `NotStoppedError` when the mount moves on, or does not answer.
        """
        if self.moving or self.unfinished:
            self.stop()
        return self.confirm() if self.unseen else ""

    def at_exit(self) -> None:
        """The same when the program ends or the guard was dropped; never raises, and writes what is wrong to stderr."""
        try:
            self.see_stopped()
        except DeviceError as error:
            logger.error("At the program's end: %s", error)
            if sys.stderr is not None:
                sys.stderr.write(f"{error}\n")

    def reconnect(self, reopen: Callable[[], Mount]) -> None:
        """Open the line again and, first of all, stop what was moving; no motion is repeated."""
        self.mount.close()  # first: a serial port is open to one program at a time
        self.mount = reopen()
        if self.unfinished or self.moving:
            self.finish()

    def finish(self) -> None:
        """Stop a motion that may run on; it stays unfinished until a Stop goes out."""
        self.unfinished = True
        self.halt()
        self.unfinished = False

    @property
    def unconfirmed(self) -> bool:
        """Whether a Stop was sent and not checked yet."""
        return self._sent != self._confirmed

    def expect_motion(self) -> None:
        """A motion begins: no earlier Stop needs to be confirmed."""
        self._confirmed = self._sent

    def came_to_rest(self) -> None:
        """The end of the last motion was seen, by the mount's word and its place."""
        self._moved = False

    def confirm(self) -> str:
        """Check that the mount stands still or follows the sky; send Stop once more when it does not.

        Empty when it stood, else what was seen, in one sentence. Only for the thread that owns the port;
        :meth:`stop` never waits for this.

        Raises `NotStoppedError` when it still moves, or does not answer, after the second Stop.
        """
        ran_on = ""
        try:
            # Some mounts lose a Stop while they slew: send one more before raising the alarm.
            seen, stands = self._comes_to_rest()
            if not stands:
                try:
                    self.halt()
                finally:  # afterwards: a slow disk must not delay a Stop
                    self._log.add("stop", "failed", "The mount kept moving after a Stop.")
                again, stands = self._comes_to_rest()
                if not stands:
                    self._log.add("stop", "failed", MAY_STILL_MOVE)
                    raise NotStoppedError("{may} {why}", may=tr(MAY_STILL_MOVE), why=tr(MOVES if again else MUTE))
                ran_on = _ran_on(seen, self.mount.lag_s)
        finally:
            self._confirmed, self._moved, self._slowest_deg_s = self._sent, False, SLOWEST_DEG_S  # reported once
        self._log.add("stop", "done", ran_on)
        return ran_on

    def _comes_to_rest(self) -> tuple[list[Reading], bool]:
        return seen_to_stand(self._read, self.wait, LOOKS, LONG_S, self._slowest_deg_s, self.mount.lag_s)

    def _read(self) -> Reading | None:
        """Past the guard, which would stop a motion that goes wrong: this one has been stopped."""
        sent_s, now = monotonic(), self._clock()
        try:
            slewing = self.mount.state().slewing
            return Reading(self.mount.position(), sent_s, now, slewing, monotonic())
        except LineLostError:
            raise
        except DeviceError:
            return None


def _ran_on(seen: list[Reading], lag_s: float) -> str:
    """How far it was seen to go before it was stopped again; empty where its answers were only missed."""
    if not any(reading.slewing or not reading.agrees(seen[0], lag_s) for reading in seen):
        return ""
    places = [(reading.here.ra_deg, reading.here.dec_deg) for reading in seen]
    return tr(RAN_ON, moved=max(apart_deg(places[0], place) for place in places))


class Watchdog:
    """Calls ``halt`` after the time allowed unless the motion was ended before.

    ``halt`` runs in the timer's thread, so it may call only what any thread may call. It is tried
    three times; then the motion counts as moving until :meth:`check` has told of it.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._timers: dict[str, Timer] = {}
        self.failure: DeviceError | None = None

    def arm(self, name: str, seconds: float, halt: Callable[[], None]) -> Timer:
        """Let the motion ``name`` last ``seconds``; arm before the motion begins."""
        timer = Timer(max(0.0, seconds), lambda: self._expire(name, halt, timer))
        timer.daemon = True  # must not hold up the exit of the program, which stops the mount itself
        with self._lock:
            before, self._timers[name] = self._timers.get(name), timer
        if before is not None:
            before.cancel()
        timer.start()
        return timer

    @contextmanager
    def bounding(self, name: str, seconds: float, halt: Callable[[], None]) -> Iterator[None]:
        """Order the motion ``name`` inside: one that begins late, behind another exchange, is stopped again."""
        over_s = monotonic() + seconds
        timer = self.arm(name, seconds, halt)
        yield
        # The halt went out before the motion's own bytes: without another one it would run for good.
        if monotonic() >= over_s:
            self._expire(name, halt, timer)

    def disarm(self) -> None:
        """Every motion is ended by other means."""
        with self._lock:
            timers, self._timers = list(self._timers.values()), {}  # cancelled outside the lock
        self.failure = None
        for timer in timers:
            timer.cancel()

    @property
    def moving(self) -> bool:
        """Whether a motion is still allowed to run, or could not be ended."""
        with self._lock:
            return bool(self._timers) or self.failure is not None

    def check(self) -> None:
        """Raise `NotStoppedError`, once, when a motion could not be ended."""
        failure, self.failure = self.failure, None
        if failure is not None:
            may = tr(MAY_STILL_MOVE)
            raise NotStoppedError("{may} Its move could not be ended: {error}", may=may, error=failure) from failure

    def _expire(self, name: str, halt: Callable[[], None], timer: Timer) -> None:
        failure: DeviceError | None = None
        for _ in range(3):
            try:
                halt()
                break
            except DeviceError as error:
                failure = error
        else:  # logged after all tries: a slow disk must not delay them
            self.failure = failure
            logger.error("The %s motion could not be ended.", name, exc_info=failure)
        with self._lock:
            if self._timers.get(name) is timer:  # a later move may have begun while the halt was waited for
                del self._timers[name]
