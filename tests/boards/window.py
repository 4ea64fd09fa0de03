"""Evenings at the window, without its panes: orders go to the thread of the mount's line, which looks on by itself."""

import threading
import time
from queue import Empty, SimpleQueue

from kochab.core.errors import KochabError
from kochab.gear import mount_events as events
from kochab.gear.mount_line import MountLine
from kochab.gear.mounts.guard import Guard
from kochab.workflows.nudge import nudge

from .evenings import RUNS_OUT_S, Astronomer

TROUBLE = (events.StopFailed, events.NoReply, events.LineLost, events.LimitReached)


class AtTheWindow(Astronomer):
    """``guard`` is the line's own; it is asked only for its settings."""

    def __init__(self, kind, seed, orders=10, time=None):
        super().__init__(kind, seed, orders, time)
        self.line = self.thread = None
        self.ended = SimpleQueue()
        self.troubles = []  # what the window would show

    # -- the session ---------------------------------------------------------------------------------

    def _connect(self):
        super()._connect()
        guard, found = self.guard, SimpleQueue()
        self.closing, self.ended, self.troubles = threading.Event(), SimpleQueue(), []

        def tell(event):
            if isinstance(event, events.OrderDone | events.OrderFailed):
                self.ended.put(event)
            elif isinstance(event, TROUBLE):
                self.troubles.append(event)

        self.line = MountLine(lambda: guard, tell)

        def serve():
            task = self.line.run()
            try:
                while not self.closing.is_set():
                    next(task)
            except BaseException as error:
                found.put(error)
            finally:
                task.close()

        self.thread = threading.Thread(target=serve, daemon=True)
        self.thread.start()
        time.sleep(0.5)
        if not found.empty():
            self.guard = None
            raise found.get()

    def _disconnect(self):
        def close():
            self.closing.set()
            self.line.cancel()
            self.thread.join()

        self.guard = None
        self._do("disconnect", close)
        time.sleep(RUNS_OUT_S)
        if self.board.moving:
            self._against("running", "after the session's end")
            with self.board.lock:
                self.board.stop()

    def _go_to_bed(self):
        """Disconnect with a slew under way."""
        if self.guard is None:
            return
        if self.random.random() < 0.6:
            target = self._target()
            self.line.order("goto", lambda guard: guard.slew(*target))
            time.sleep(self.random.uniform(0.5, 3.0))
        if self.random.random() < 0.5:
            self.board.lose_stops(1)
        self._disconnect()

    # -- orders --------------------------------------------------------------------------------------

    def _order(self, name, make):
        """To its end, as the window hears of it."""
        self.line.order(name, make)
        while True:
            try:
                event = self.ended.get(timeout=0.5)
            except Empty:
                if not self.thread.is_alive():
                    raise KochabError("the line's thread has ended") from None
                continue
            if event.name == name:
                break
        if isinstance(event, events.OrderFailed):
            raise KochabError(event.sentence.replace("{", "("))

    def _at_once(self, name, do):
        def make(guard: Guard):
            do(guard)
            return
            yield  # a task that is done at once

        return lambda: self._order(name, make)

    def _sync(self):
        ra, dec = self.board.radec_deg()
        armed = self.random.random() < 0.5

        def sync(guard):
            guard.allow_large_sync = armed
            guard.sync(ra, dec, by_hand=True, confirmed=True)

        self._do("sync", self._at_once("sync", sync))

    def _order_nudge(self, direction, rate, seconds):
        self._order("nudge", lambda guard: nudge(guard, direction, 3600.0 * rate * seconds, rate_deg_s=rate))

    def _unpark(self):
        self._do("unpark", self._at_once("unpark", Guard.unpark))

    def _track(self):
        pass  # as the others, and one order more to keep apart

    def _set_clock(self):
        self._do("set clock", self._at_once("set clock", Guard.set_clock))

    def _stop_and_see(self):
        """Until the window says whether it stands."""
        before = len(self.troubles)
        self.line.stop()
        time.sleep(RUNS_OUT_S)
        self._complain(before)

    def _break_off(self):
        self.line.stop()

    def _look_on(self):
        """What the window shows meanwhile."""
        before = len(self.troubles)
        time.sleep(4.0)
        self._complain(before)

    def _look(self):
        time.sleep(1.5)

    def _complain(self, before):
        if shown := self.troubles[before:]:
            raise KochabError(shown[-1].sentence.replace("{", "("))
