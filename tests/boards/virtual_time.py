"""Time that passes only while everybody waits: a night of minutes takes a second, and is the same when it is repeated.

Inside :func:`virtual_time` the clocks, waits and timers of Kochab's mounts are those of a :class:`VirtualTime`. Its
threads run one at a time: when all wait, time jumps to the first that waits no longer. Whoever is busy costs no time,
however slow the computer is.
"""

import heapq
import sys
import threading
import time
from contextlib import contextmanager
from datetime import timedelta
from inspect import isclass, isfunction
from itertools import count
from types import SimpleNamespace

import serial

from .port import BoardPort
from .sky import START

PATCHED = ("kochab.gear", "kochab.workflows")
serial_for_url = serial.serial_for_url
STUCK_S = 0.5  # of the computer's: a thread that neither waits nor ends so long waits for a lock of one that waits


class RealTime:
    """The computer's own, in the same words."""

    monotonic, sleep, Timer = staticmethod(time.monotonic), staticmethod(time.sleep), threading.Timer

    @staticmethod
    def start(do):
        """A thread that does it."""
        thread = threading.Thread(target=do, daemon=True)
        thread.start()
        return thread

    @staticmethod
    def join(thread):
        """Wait for its end."""
        thread.join()


class _Waiter:
    """Somebody who waits until a moment, or what begins then."""

    def __init__(self, thread=None, begin=None):
        self.thread, self.begin, self.due, self.cancelled = thread, begin, False, False


class _Member(threading.Thread):
    """A thread that takes part until it has done what it is for.

    Python clears a thread away later, and from 3.13 on so much later that seconds passed for whoever asked whether it ran.
    """

    def __init__(self, time_, do):
        super().__init__(daemon=True)
        self._time, self._do, self._done = time_, do, False

    def run(self):
        """Do it."""
        try:
            self._do()
        finally:
            self._done = True
            self._time._ended(self)

    def is_alive(self):
        """Whether it still does."""
        return not self._done and super().is_alive()


class VirtualTime:
    """Seconds since it began, for the threads that take part: who made it, and those it has started."""

    def __init__(self):
        self._changed = threading.Condition()
        self._now, self._jumps, self._order = 0.0, 0, count()
        self._waiting = []  # a heap of when, order, waiter
        self._members, self._asleep = {threading.current_thread()}, set()
        self._ports = {}
        time_ = self

        class Timer:
            """As `threading.Timer`, in this time."""

            daemon = True

            def __init__(self, interval, function):
                self._interval, self._do, self._thread, self._waiter = interval, function, None, None

            def start(self):
                self._waiter = time_._at(self._interval, self._begin)

            def _begin(self):
                self._thread = time_.start(self._do)

            def cancel(self):
                self._waiter.cancelled = True

            def join(self):
                while not self._waiter.cancelled and (self._thread is None or self._thread.is_alive()):
                    time_.sleep(0.01)

        self.Timer = Timer

    def monotonic(self):
        """As `time.monotonic`."""
        return self._now

    def sleep(self, seconds):
        """As `time.sleep`."""
        me = threading.current_thread()
        with self._changed:
            self._members.add(me)
            waiter = self._put(seconds, _Waiter(thread=me))
            self._asleep.add(me)
            self._jump_while_all_wait()
            while not waiter.due:
                jumps = self._jumps
                if not self._changed.wait(STUCK_S) and jumps == self._jumps:
                    self._jump()

    def start(self, do):
        """A thread that does it and takes part."""

        thread = _Member(self, do)
        with self._changed:
            self._members.add(thread)
        thread.start()
        return thread

    def _ended(self, thread):
        with self._changed:
            self._members.discard(thread)
            self._jump_while_all_wait()

    def join(self, thread):
        """Wait for its end."""
        while thread.is_alive():
            self.sleep(0.01)

    def night(self, start=START):
        """A clock as :class:`~tests.boards.sky.Night` is, in this time."""
        return VirtualNight(self, start)

    def port_of(self, board):
        """What a driver opens to speak with the board."""
        port = f"board://{len(self._ports)}"
        self._ports[port] = board
        return port

    def open_port(self, url, timeout=0.05, **settings):
        """As pyserial's `serial_for_url`."""
        if url not in self._ports:
            return serial_for_url(url, timeout=timeout, **settings)
        return BoardPort(self._ports[url], self, timeout)

    def _at(self, seconds, begin):
        with self._changed:
            return self._put(seconds, _Waiter(begin=begin))

    def _put(self, seconds, waiter):
        heapq.heappush(self._waiting, (self._now + max(0.0, seconds), next(self._order), waiter))
        return waiter

    def _jump_while_all_wait(self):
        while self._waiting and not any(t.is_alive() or t.ident is None for t in self._members - self._asleep):
            self._jump()

    def _jump(self):
        """To the first who waits no longer."""
        while self._waiting:
            when, _, waiter = heapq.heappop(self._waiting)
            if waiter.cancelled:
                continue
            self._now, self._jumps = max(self._now, when), self._jumps + 1
            if waiter.begin is not None:
                waiter.begin()
            else:
                waiter.due = True
                self._asleep.discard(waiter.thread)
                self._changed.notify_all()
            return


class VirtualNight:
    """A clock of virtual time."""

    def __init__(self, time_, start):
        self.time, self.start = time_, start

    def __call__(self):
        return self.start + timedelta(seconds=self.time.monotonic())

    def unix(self):
        """Seconds since 1970."""
        return self.start.timestamp() + self.time.monotonic()


# -- Kochab in it ------------------------------------------------------------------------------


@contextmanager
def virtual_time():
    """Everything of Kochab's mounts that waits, waits in the `VirtualTime` that is given."""
    from kochab.gear import mount_line  # noqa: F401 (all that waits is patched where it stands, so it must be there)
    from kochab.gear.mounts import DRIVERS
    from kochab.workflows import nudge  # noqa: F401

    DRIVERS.loaded()
    virtual, undone = VirtualTime(), []
    try:  # from the first patch on: one that stays would stop the clock of every later test
        for module in [m for name, m in list(sys.modules.items()) if name.startswith(PATCHED)]:
            _patch_names(module, virtual, undone)
            _patch_defaults(module, virtual, undone)
        undone.append(lambda: setattr(serial, "serial_for_url", serial_for_url))
        serial.serial_for_url = virtual.open_port
        yield virtual
    finally:
        for undo in reversed(undone):
            undo()


def _patch_names(module, virtual, undone):
    threads = SimpleNamespace(**vars(threading) | {"Timer": virtual.Timer})
    for name, real, ours in (
        ("monotonic", time.monotonic, virtual.monotonic),
        ("sleep", time.sleep, virtual.sleep),
        ("Timer", threading.Timer, virtual.Timer),
        ("threading", threading, threads),
    ):
        if vars(module).get(name) is real:
            undone.append(lambda name=name, real=real: setattr(module, name, real))
            setattr(module, name, ours)


def _patch_defaults(module, virtual, undone):
    """A function whose argument is `time.sleep` when none is given."""
    classes = [thing for thing in vars(module).values() if isclass(thing) and thing.__module__ == module.__name__]
    functions = [thing for holder in (module, *classes) for thing in vars(holder).values() if isfunction(thing)]
    for function in functions:
        for given in (function.__defaults__ or (), tuple((function.__kwdefaults__ or {}).values())):
            if not any(one is time.sleep for one in given):  # an array is compared element by element
                continue
            undone.append(
                lambda f=function, d=function.__defaults__, k=function.__kwdefaults__: (
                    setattr(f, "__defaults__", d),
                    setattr(f, "__kwdefaults__", k),
                )
            )
            function.__defaults__ = tuple(virtual.sleep if d is time.sleep else d for d in function.__defaults__ or ())
            if function.__kwdefaults__:
                function.__kwdefaults__ = {
                    name: virtual.sleep if d is time.sleep else d for name, d in function.__kwdefaults__.items()
                }
