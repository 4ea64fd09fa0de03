"""Generators run in threads, with signals in the window's thread."""

import logging
import threading
import time
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal, SignalInstance

from kochab.core.errors import KochabError
from kochab.core.progress import Task
from kochab.text.translation import tr

log = logging.getLogger("kochab")
REPORT_EVERY_S = 0.03  # more often than this nobody can read it
JOIN_S = 5.0  # for each job, while the window closes


class Job(QObject):
    """Runs a :data:`Task` in a thread of its own.

    All signals arrive in the thread that made the job. Exactly one of ``succeeded``, ``failed``
    or ``cancelled`` comes, and ``finished`` always comes last. It has no parent: a thread whose job goes with a widget
    crashes where it tells of its progress. Once started it stays until it has ended.
    """

    progressed = Signal(object)  # Progress
    succeeded = Signal(object)
    failed = Signal(str)
    cancelled = Signal()
    finished = Signal()
    _sent = Signal(str, tuple)  # the name of one of these, and what it carries

    def __init__(self, task: Task[Any], name: str = "job") -> None:
        super().__init__()
        self.name = name
        self._task = task
        self._stop = threading.Event()
        self._muted = self._delivered = False
        # A daemon: a task that hangs in a device or a library must not keep the process alive after the window.
        self._thread = threading.Thread(target=self._drive, name=f"kochab-{name}", daemon=True)
        # One queued signal for all kinds, so that they arrive in the order in which the thread sent them.
        self._sent.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    def start(self) -> None:
        _RUNNING[:] = [job for job in _RUNNING if job.waits] + [self]
        self._thread.start()

    def cancel(self) -> None:
        """Stop the task at its next yield."""
        self._stop.set()

    def abandon(self) -> None:
        """Cancel without any further signal, not even ``finished``: the listener is going."""
        self._muted = True
        self._stop.set()

    def join(self, limit_s: float) -> bool:
        """Wait at most ``limit_s``; whether the thread has ended."""
        if self._thread.is_alive():
            self._thread.join(limit_s)
        return not self._thread.is_alive()

    @property
    def running(self) -> bool:
        return self._thread.is_alive()

    @property
    def waits(self) -> bool:
        """Whether the thread is running, or a signal is still to be delivered."""
        return self.running or not (self._delivered or self._muted)

    def _drive(self) -> None:
        kind, *value = self._outcome()
        self._send(kind, *value)
        self._send("finished")

    def _outcome(self) -> tuple[Any, ...]:
        """The name of the signal that ends the job, and its value."""
        last = 0.0
        try:
            while not self._stop.is_set():
                try:
                    progress = next(self._task)
                except StopIteration as end:
                    # Cancelled in its last step: the person said no before there was a result.
                    return ("cancelled",) if self._stop.is_set() else ("succeeded", end.value)
                now = time.monotonic()
                if now - last >= REPORT_EVERY_S:
                    last = now
                    self._send("progressed", progress)
            self._task.close()
        # A failure with a sentence for a person: its traceback is for the log's details alone.
        except KochabError as error:
            log.debug("%s failed", self.name, exc_info=True)
            return "failed", str(error)
        except MemoryError:
            log.exception("%s ran out of memory", self.name)
            return "failed", tr("Out of memory. Close other programs and try again.")
        except Exception as error:  # the one broad except: every fault goes to the log, whole
            log.exception("%s stopped by a fault", self.name)
            return "failed", fault_text(error)
        return ("cancelled",)

    def _send(self, kind: str, *value: Any) -> None:
        if self._muted:
            return
        try:
            self._sent.emit(kind, value)
        except RuntimeError:  # the window is gone: nobody listens any more
            log.debug("%s ended after its window", self.name)

    def _deliver(self, kind: str, value: tuple[Any, ...]) -> None:
        self._delivered |= kind == "finished"
        # Progress that was queued before a cancel would be shown after it.
        if not self._muted and not (kind == "progressed" and self._stop.is_set()):
            getattr(self, kind).emit(*value)


# Holds a started job until its last signal is delivered: a collected one would be deleted under its own thread.
_RUNNING: list[Job] = []


def fault_text(error: BaseException) -> str:
    """One sentence for a fault of the program: its kind, its message, and what to do."""
    what = " ".join(f"{type(error).__name__}: {error}".split()).rstrip(": .")
    return tr("Internal error ({what}). Please report it: Help, Save a report.", what=what)


class Jobs(QObject):
    """Starts the jobs of a window and ends them with it."""

    closing = Signal()

    def __init__(self, window: QObject, window_closing: SignalInstance) -> None:
        super().__init__(window)
        self._jobs: list[Job] = []
        self._closed = False
        window_closing.connect(self._close)

    def run(self, task: Task[Any], name: str) -> Job:
        """Start ``task`` in a thread; signals connected after this are not missed: they are queued."""
        job = Job(task, name)
        self._jobs = [j for j in self._jobs if j.waits] + [job]
        if self._closed:  # a camera's last frame may be solved after its window has closed
            job.abandon()
        job.start()
        return job

    def _close(self) -> None:
        # First of all, since the joins below may take seconds.
        self.closing.emit()  # a view may want to stop a mount first
        self._closed = True
        for job in self._jobs:
            job.abandon()
        self.join()

    def join(self, limit_s: float = JOIN_S) -> bool:
        """Wait at most ``limit_s`` for each job; whether all have ended."""
        late = [job.name for job in self._jobs if not job.join(limit_s)]
        for name in late:
            log.warning("%s did not end in time", name)
        return not late
