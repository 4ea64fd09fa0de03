"""A mount that is held: what was sent to it is written down, watched, and ended when it must be."""

import weakref
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from time import sleep
from types import TracebackType
from typing import NoReturn, Self

from app.core.errors import (
    DeviceError,
    LineLostError,
    NoAnswerError,
    RefusedError,
    StoppedError,
    StrayedError,
)
from app.core.hint import Site
from app.core.mount import Mount, MountState, Pointing
from app.mounts.asked import Asked
from app.mounts.limits import Limits
from app.mounts.motion import stop_at_exit
from app.mounts.motion_log import MotionLog, utc_now
from app.mounts.watch import Watch

CANNOT_STOP = "The mount cannot be stopped over its line: cut its power."


class Held(Asked):
    """Sends once, stops, connects again and lets go.

    ``reopen`` opens the same mount again after the line was lost; see :meth:`reconnect`.
    """

    def __init__(
        self,
        mount: Mount,
        site: Site | None = None,
        limits: Limits | None = None,
        clock: Callable[[], datetime] = utc_now,
        log: MotionLog | None = None,
        reopen: Callable[[], Mount] | None = None,
        wait: Callable[[float], None] = sleep,
    ) -> None:
        super().__init__(mount, site, limits or Limits(), clock)
        self.log = log or MotionLog(clock=clock)
        self.stops = 0  # by a person: what was asked for before a Stop is not gone on with
        self.strayed = ""  # why the last motion was stopped on its way
        self.unfinished = False  # a motion was under way when the line broke
        self._reopen = reopen
        self._wait = wait
        self._finalizer = weakref.finalize(self, stop_at_exit, self._motion)

    # -- while it moves -------------------------------------------------------------------------

    def position(self) -> Pointing:
        """Where it says it points; a mount that leaves its way is stopped.

        Raises
        ------
        StrayedError
            It was under way and twice said a place where it must not be.

        """
        here = super().position()
        watch = self._motion.watched
        if watch is not None and watch.finding(here, self.clock()):
            here = super().position()  # a spoilt line may bring a place of long ago
            found = watch.finding(here, self.clock())
            if found:
                self._stray(found)
        return here

    def state(self) -> MountState:
        """How it is, and while it moves where it is, too: see :meth:`position`."""
        state = super().state()
        watch = self._motion.watched
        if watch is not None and watch.side_finding(state.pier_side):
            state = super().state()
            found = watch.side_finding(state.pier_side)
            if found:
                self._stray(
                    f"{found}: allow the flip (Meridian, or --allow-flip), and watch the cables"
                )
        if watch is not None and watch.due:
            self.position()
        return state

    def go_on(self, stops: int, what: str) -> None:
        """Raise when what was begun at ``stops`` has been stopped since."""
        if self.strayed:
            raise StrayedError(self.strayed)
        if self.stops != stops:
            raise StoppedError(f"The {what} was stopped.")

    def _stray(self, found: str) -> NoReturn:
        self.strayed = f"The mount was stopped on its way: {found}."
        self.log.add("stray", "failed", self.strayed)
        self.halt()
        raise StrayedError(self.strayed)

    # -- the end of things ----------------------------------------------------------------------

    def stop(self) -> None:
        """A person's Stop: now, ahead of everything, from any thread; tried twice."""
        self.stops += 1
        self.halt()

    def halt(self) -> None:
        """The same for a reason of one's own, such as a slew that failed."""
        self.log.add("stop", "sent")
        try:
            try:
                self.mount.stop()
            except NoAnswerError:
                self.mount.stop()
        except DeviceError as error:
            self.unfinished = self.unfinished or self._motion.possible
            self.log.add("stop", "failed", CANNOT_STOP)
            raise LineLostError(f"{CANNOT_STOP} ({error})") from error
        self._motion.end()

    def reconnect(self) -> None:
        """Open the line again and, first of all, stop what was moving; repeat no motion."""
        if self._reopen is None:
            raise LineLostError("The line to the mount is lost: connect to it again.")
        self.mount.close()
        self._motion.mount = self._reopen()
        if self.unfinished or self._motion.possible:
            self.halt()
            self.unfinished = False

    def close(self) -> None:
        """Stop what moves and give the port back; never raises."""
        if self._motion.possible:
            with suppress(DeviceError):
                self.stop()
        self._finalizer.detach()
        self.mount.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # -- sending --------------------------------------------------------------------------------

    def _refuse(self, action: str, sentence: str) -> NoReturn:
        self.log.add(action, "refused", sentence)
        raise RefusedError(sentence)

    def _send(
        self,
        action: str,
        lasts_s: float,
        do: Callable[[], None],
        watch: Watch | None = None,
        **detail: float | str,
    ) -> None:
        """Send once. When it is not known what the mount made of it, stop; never repeat."""
        self.log.add(action, "sent", detail=detail)
        if lasts_s:
            self.strayed = ""
            self._motion.begin(lasts_s, watch)
        try:
            do()
        except RefusedError as error:
            if lasts_s:
                self._motion.end()
            self.log.add(action, "failed", str(error))
            raise
        except DeviceError as error:
            self.log.add(action, "failed", str(error))
            if lasts_s:
                self.unfinished = True
                self.halt()
                self.unfinished = False
            raise
