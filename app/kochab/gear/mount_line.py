"""One thread owns the mount's line: it polls the mount and does one order at a time.

Nothing of Qt: the view runs :meth:`MountLine.run` in a job, and hears of it in the frozen words of
:mod:`kochab.gear.mount_events`. Stop does not pass through here at all; see :meth:`MountLine.stop`.
"""

import logging
import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import monotonic, sleep
from typing import Any

from kochab.core.errors import DeviceError, KochabError, LineLostError, NoAnswerError, NotStoppedError
from kochab.core.progress import Progress, Task, run
from kochab.core.values import frozen
from kochab.gear import mount_events as events
from kochab.gear.actions import action
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.guard import Guard
from kochab.text.translation import tr_noop

# -- What is asked of the thread of a mount's line ---------------------------------------------

MakeTask = Callable[[Guard], Task[Any]]
SurvivesLineLoss = Callable[[Progress], bool]


def never(_: Progress) -> bool:
    """An order that ends when the line breaks, as whatever moves must."""
    return False


@frozen
class MountOrder:
    """Something to do; ``stops`` is how often all was stopped when it was wished for.

    ``survives_line_loss`` tells by the newest progress whether it can wait for a line that is lost and found
    again: only what does not move the mount then.
    """

    name: str
    make: MakeTask
    stops: int
    survives_line_loss: SurvivesLineLoss = never


logger = logging.getLogger(__name__)
POLL_S = 0.5
LISTEN_S = 0.05
REPORT_S = 0.05
RETRY_S = 2.0
WATCH_S = 5.0
STOP_S = 5.0  # a Stop may wait so long for its answer before the port is closed
STOPPED = tr_noop("Stopped.")
LOST = tr_noop("Connection to the mount lost.")


class MountLine:
    """``opening`` opens the mount behind its guard; ``tell`` is called from this line's threads.

    ``afterwards`` is called when everything is over, such as to end a practice telescope.
    """

    def __init__(
        self,
        opening: Callable[[], Guard],
        tell: Callable[[events.MountEvent], None],
        afterwards: Callable[[], None] = lambda: None,
    ) -> None:
        self._opening, self._tell, self._afterwards = opening, tell, afterwards
        self._orders: SimpleQueue[MountOrder] = SimpleQueue()
        self._stops = 0  # an order that was wished for before a Stop is given up
        self._guard: Guard | None = None
        self._stopper: threading.Thread | None = None
        self._looked = self._spoke = 0.0
        self._unasked = True  # which epoch it speaks in, and which clock and site it has
        self._watched, self._limit = 0.0, ""  # when its tracking was compared with the limits, and what was told
        self._stage = ""  # what was told last

    # from any thread --------------------------------------------------------------------------
    def order(self, name: str, make: MakeTask, survives_line_loss: SurvivesLineLoss = never) -> None:
        """Do this when the orders before it are done; Done or Failed tells of its end."""
        self._orders.put(MountOrder(name, make, self._stops, survives_line_loss))

    @property
    def may_move(self) -> bool:
        """Whether something of the mount may move, or nobody has seen yet that a Stop has worked."""
        guard = self._guard
        return guard is not None and guard.emergency.unseen

    def cancel(self) -> None:
        """Give up the present order, at its next yield, and those that wait; what moves stops."""
        self._stops += 1

    def stop(self) -> None:
        """Stop the mount now and give up every order; returns at once, whatever the line does.

        The bytes are written by a thread of their own, ahead of whatever waits for an answer.
        """
        self._stops += 1
        guard = self._guard
        if guard is not None:
            # A thread of its own: a line that does not take the bytes must not hold up the caller.
            stopper = threading.Thread(target=self._stop, args=(guard,), name="kochab-stop", daemon=True)
            stopper.start()
            self._stopper = stopper  # started, as only then it can be joined

    def _stop(self, guard: Guard) -> None:
        try:
            guard.stop()
        except DeviceError as error:
            self._tell(events.StopFailed(str(error)))
        else:
            self._tell(events.Stopped())

    # the thread of the line -------------------------------------------------------------------
    def run(self) -> Task[None]:
        """Open the mount, serve orders until closed, then stop what moves and give the port back.

        Raises `KochabError` when the mount cannot be opened: one sentence with what to do.
        """
        try:
            yield Progress("connecting")
            self._guard = guard = self._opening()
            self._tell(_connected(guard))
            while True:
                yield Progress("listening")
                try:
                    self._see_stopped(guard)
                    self._look(guard)
                    self._ask_once(guard)
                    yield from self._next(guard)
                except LineLostError as error:
                    yield from self._wait_for(guard, error)
        finally:
            opened, self._guard = self._guard, None  # a Stop on a closed port would be told as one that failed
            if opened is not None:
                if self._stopper is not None:
                    self._stopper.join(STOP_S)
                self._part(opened)
            self._afterwards()

    def _see_stopped(self, guard: Guard) -> None:
        """After a Stop: whether it has worked, in this thread, for the Stop has long been sent."""
        if not guard.emergency.unconfirmed:
            return
        try:
            seen = guard.emergency.confirm()
        except NotStoppedError as error:
            self._tell(events.StopFailed(str(error)))
        else:
            self._tell(events.StandsStill(seen))

    def _part(self, guard: Guard) -> None:
        """The end of the session: whatever moves is stopped and seen to stand, and what was seen is told."""
        moved = guard.emergency.unseen
        try:
            try:
                seen = guard.see_stopped()
            except NotStoppedError:
                raise
            except LineLostError as error:  # told at once: nobody knows whether it moves
                self._tell(events.StopFailed(str(error)))
                guard.stop_on_new_line()
                seen = ""
        except DeviceError as error:
            self._tell(events.StopFailed(str(error)))
        else:
            if moved:
                self._tell(events.StandsStill(seen))
        guard.close()

    def _next(self, guard: Guard) -> Task[None]:
        try:
            order = self._orders.get(timeout=LISTEN_S)
        except Empty:
            return
        self._tell(events.OrderProgress(order.name, Progress(order.name)))
        try:
            ended, result = yield from self._steps(guard, order)
        except LineLostError as error:
            self._tell(events.OrderFailed(order.name, str(error)))
            raise
        except KochabError as error:
            logger.debug("%s failed", order.name, exc_info=True)
            self._tell(events.OrderFailed(order.name, str(error), stopped=self._given_up(order)))
        else:
            # So that whoever hears that the order is done sees the position after it.
            self._look(guard, now=True)
            done, stopped = events.OrderDone(order.name, result), events.OrderFailed(order.name, STOPPED, stopped=True)
            self._tell(done if ended else stopped)

    def _given_up(self, order: MountOrder) -> bool:
        # What is quick moves nothing, and new limits, once drawn, must hold for the motion after the Stop.
        return order.stops != self._stops and not action(order.name).quick

    def _steps(self, guard: Guard, order: MountOrder) -> Task[tuple[bool, Any]]:
        """One order to its end, its progress told and the mount looked at between its steps."""
        task = order.make(guard)
        try:
            while not self._given_up(order):
                try:
                    progress = next(task)
                except StopIteration as end:
                    return True, end.value
                self._say(order.name, progress)
                try:
                    self._look(guard)
                except LineLostError as error:
                    if not order.survives_line_loss(progress):
                        raise
                    yield from self._wait_for(guard, error, order)
                yield progress
        finally:
            task.close()  # a motion under way is stopped by its own task
        return False, None

    def _say(self, name: str, progress: Progress) -> None:
        """The progress of an order: every new stage, else as often as anybody can read it."""
        if progress.stage != self._stage or monotonic() - self._spoke >= REPORT_S:
            self._spoke, self._stage = monotonic(), progress.stage
            self._tell(events.OrderProgress(name, progress))

    def _look(self, guard: Guard, now: bool = False) -> None:
        """Ask where the mount is and how it is, twice a second."""
        if not now and monotonic() - self._looked < POLL_S:
            return
        # Set before the questions: a mount that answers slowly is not asked twice as often.
        self._looked = monotonic()
        try:
            here, read_s = guard.position(), monotonic()
            doubts = guard.policy.clock_conflict, guard.policy.slew_block_reason
            icrs_deg, altaz_deg = from_mount_epoch(here, guard.clock()), guard.policy.altaz_deg(here)
            state, at = guard.state(), guard.clock()
            target_deg = guard.supervisor.target_icrs_deg
            report = events.PositionReport(icrs_deg, state, guard.can_undo, *doubts, altaz_deg, target_deg, at, read_s)
            if monotonic() - self._watched >= WATCH_S:
                self._watched = monotonic()
                before, self._limit = self._limit, guard.hold_limits()
                if self._limit not in ("", before):
                    self._tell(events.LimitReached(self._limit))
        except LineLostError:
            raise
        except DeviceError as error:
            self._tell(events.NoReply(str(error)))
        else:
            self._tell(report)

    def _ask_once(self, guard: Guard) -> None:
        """The question that may take a while, after the first report."""
        if self._unasked:
            self._unasked = False
            guard.clock_doubt()
            if doubt := guard.epoch_doubt():
                self._tell(events.EpochDoubted(doubt))

    def _wait_for(self, guard: Guard, error: LineLostError, order: MountOrder | None = None) -> Task[None]:
        """The line is lost: try it again and again; when it is back, what moved is stopped.

        An ``order`` that waits too is over when a person stops everything meanwhile.
        """
        self._tell(events.LineLost(str(error)))
        tried = monotonic()
        while True:
            yield Progress("line lost")
            # Orders that waited were meant for the mount of before: none may move it once the line is back.
            while not self._orders.empty():
                waiting = self._orders.get()
                if action(waiting.name).quick:  # it needs no line
                    run(waiting.make(guard))
                else:
                    self._tell(events.OrderFailed(waiting.name, LOST))
            if order is not None and self._given_up(order):
                raise error
            if monotonic() - tried < RETRY_S:
                sleep(LISTEN_S)
                continue
            tried = monotonic()
            try:
                guard.reconnect()
                self._unasked = True
                again = _connected(guard)
            except DeviceError as still:
                self._tell(events.LineLost(str(error), str(still)))
            else:
                self._tell(again)
                return


def _connected(guard: Guard) -> events.Connected:
    try:
        name = guard.identify()
    except NoAnswerError:
        name = guard.name
    return events.Connected(name, dict(guard.lacks), guard.epoch, guard.site, guard.rates_deg_s)
