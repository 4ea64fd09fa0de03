"""One thread owns the mount's line: it asks where the mount is and does one order at a time.

Nothing of Qt: the view runs :meth:`MountLine.run` in a job, and hears of it in the frozen words
of :mod:`app.ui.mount.words`. Stop does not pass through here at all; see :meth:`MountLine.stop`.
"""

import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any

from app.core.errors import DeviceError, KochabError, LineLostError, NoAnswerError
from app.core.progress import Progress, Task
from app.mounts.guard import Guard
from app.ui.mount.words import (
    CannotStop,
    Connected,
    Done,
    Failed,
    Lost,
    Report,
    Silent,
    Stopped,
    Under,
    Word,
)

POLL_S = 0.5
LISTEN_S = 0.05
RETRY_S = 2.0

Order = tuple[str, Callable[[Guard], Task[Any]]]


class MountLine:
    """``opening`` opens the mount behind its guard; ``tell`` is called from this line's threads.

    ``afterwards`` is called when everything is over, such as to end a practice telescope.
    """

    def __init__(
        self,
        opening: Callable[[], Guard],
        tell: Callable[[Word], None],
        afterwards: Callable[[], None] = lambda: None,
    ) -> None:
        self._opening, self._tell, self._afterwards = opening, tell, afterwards
        self._orders: SimpleQueue[Order] = SimpleQueue()
        self._halt = threading.Event()
        self._guard: Guard | None = None
        self._looked = 0.0
        self._silent = False

    # from any thread --------------------------------------------------------------------------
    def order(self, name: str, make: Callable[[Guard], Task[Any]]) -> None:
        """Do this when the orders before it are done; it is told as Done, Failed or Stopped."""
        self._halt.clear()
        self._orders.put((name, make))

    def cancel(self) -> None:
        """Give up the present order, at its next yield, and those that wait; what moves stops."""
        self._halt.set()

    def stop(self) -> None:
        """Stop the mount now and give up every order; returns at once, whatever the line does.

        The bytes are written by a thread of their own, ahead of whatever waits for an answer.
        """
        self._halt.set()
        guard = self._guard
        if guard is not None:
            thread = threading.Thread(
                target=self._stop, args=(guard,), name="kochab-stop", daemon=True
            )
            thread.start()

    def _stop(self, guard: Guard) -> None:
        try:
            guard.stop()
        except DeviceError as error:
            self._tell(CannotStop(str(error)))
        else:
            self._tell(Stopped())

    # the thread of the line -------------------------------------------------------------------
    def run(self) -> Task[None]:
        """Open the mount, serve orders until closed, then stop what moves and give the port back.

        Raises
        ------
        app.core.errors.KochabError
            The mount cannot be opened; one sentence with what to do.

        """
        try:
            yield Progress("connecting")
            self._guard = guard = self._opening()
            self._tell(_connected(guard))
            while True:
                yield Progress("listening")
                try:
                    self._look(guard)
                    yield from self._next(guard)
                except LineLostError as error:
                    yield from self._wait_for(guard, error)
        finally:
            if self._guard is not None:
                self._guard.close()
            self._afterwards()

    def _next(self, guard: Guard) -> Task[None]:
        try:
            name, make = self._orders.get(timeout=LISTEN_S)
        except Empty:
            return
        if self._halt.is_set():
            self._tell(Failed(name, "Stopped.", stopped=True))
            return
        self._tell(Under(name, Progress(name)))
        try:
            done, result = yield from self._steps(guard, name, make)
        except LineLostError as error:
            self._tell(Failed(name, str(error)))
            raise
        except KochabError as error:
            self._tell(Failed(name, str(error), stopped=self._halt.is_set()))
        else:
            told = Done(name, result) if done else Failed(name, "Stopped.", stopped=True)
            self._look(guard, now=True)
            self._tell(told)

    def _steps(
        self, guard: Guard, name: str, make: Callable[[Guard], Task[Any]]
    ) -> Task[tuple[bool, Any]]:
        """One order, its progress told, and the mount looked at between its steps."""
        task = make(guard)
        try:
            while not self._halt.is_set():
                try:
                    progress = next(task)
                except StopIteration as end:
                    return True, end.value
                self._tell(Under(name, progress))
                self._look(guard)
                yield progress
        finally:
            task.close()  # a motion under way is stopped by its own task
        return False, None

    def _look(self, guard: Guard, now: bool = False) -> None:
        """Ask where the mount is and how it is, twice a second."""
        if not now and monotonic() - self._looked < POLL_S:
            return
        self._looked = monotonic()
        try:
            said = Report(guard.position_icrs(), guard.state(), guard.can_undo)
        except NoAnswerError as error:
            self._tell(Silent(str(error)))
        else:
            self._tell(said)

    def _wait_for(self, guard: Guard, error: LineLostError) -> Task[None]:
        """The line is lost: try it again and again; when it is back, what moved is stopped."""
        self._tell(Lost(str(error)))
        tried = monotonic()
        while True:
            yield Progress("line lost")
            self._drop_orders()
            if monotonic() - tried < RETRY_S:
                threading.Event().wait(LISTEN_S)
                continue
            tried = monotonic()
            try:
                guard.reconnect()
            except DeviceError as still:
                self._tell(Lost(str(error), str(still)))
            else:
                self._tell(_connected(guard))
                return

    def _drop_orders(self) -> None:
        while not self._orders.empty():
            name, _ = self._orders.get()
            self._tell(Failed(name, "The line to the mount is lost."))


def _connected(guard: Guard) -> Connected:
    try:
        name = guard.identify()
    except NoAnswerError:
        name = guard.name
    rates: tuple[float, ...] = getattr(guard.mount, "rates_deg_s", ())
    return Connected(name, dict(guard.lacks), guard.epoch, guard.site, rates)
