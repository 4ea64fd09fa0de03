"""One task in one thread, heard of in the window's thread."""

import logging
import threading
import time
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal

from app.core.errors import KochabError
from app.core.progress import Progress, Task

log = logging.getLogger("kochab")
REPORT_EVERY_S = 0.03  # more often than this nobody can read it


class Job(QObject):
    """Runs a :data:`Task` in a thread of its own.

    All signals arrive in the thread that made the job. Exactly one of ``succeeded``, ``failed``
    or ``cancelled`` comes, and ``finished`` always comes last.
    """

    progressed = Signal(object)  # Progress
    succeeded = Signal(object)
    failed = Signal(str)
    cancelled = Signal()
    finished = Signal()
    _said = Signal(str, object)

    def __init__(self, task: Task[Any], name: str = "job", parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.name = name
        self._task = task
        self._stop = threading.Event()
        self._muted = False
        self._thread = threading.Thread(target=self._drive, name=f"kochab-{name}", daemon=True)
        self._said.connect(self._tell, Qt.ConnectionType.QueuedConnection)

    def start(self) -> None:
        """Begin; returns at once."""
        self._thread.start()

    def cancel(self) -> None:
        """Ask the task to stop at its next yield."""
        self._stop.set()

    def abandon(self) -> None:
        """Cancel, and say nothing more, not even that it finished: its listener is going."""
        self._muted = True
        self._stop.set()

    def join(self, limit_s: float) -> bool:
        """Wait at most ``limit_s``; whether the thread has ended."""
        if self._thread.is_alive():
            self._thread.join(limit_s)
        return not self._thread.is_alive()

    @property
    def running(self) -> bool:
        """Whether the thread is alive."""
        return self._thread.is_alive()

    def _drive(self) -> None:
        kind, value = self._outcome()
        self._say(kind, value)
        self._say("finished", None)

    def _outcome(self) -> tuple[str, Any]:
        last = 0.0
        try:
            while not self._stop.is_set():
                try:
                    progress = next(self._task)
                except StopIteration as end:
                    # Cancelled in its last step: the person said no before there was an answer.
                    return ("cancelled", None) if self._stop.is_set() else ("succeeded", end.value)
                now = time.monotonic()
                if now - last >= REPORT_EVERY_S:
                    last = now
                    self._say("progressed", progress)
            self._task.close()
        except KochabError as error:
            return "failed", str(error)
        except MemoryError:
            return "failed", "There is not enough memory for this; close other programs."
        except Exception as error:  # the one place: a fault must reach the log, not the terminal
            log.exception("%s stopped by a fault", self.name)
            kind = type(error).__name__
            return "failed", f"A fault inside Kochab stopped this ({kind}); the log has details."
        return "cancelled", None

    def _say(self, kind: str, value: Any) -> None:
        if self._muted:
            return
        try:
            self._said.emit(kind, value)
        except RuntimeError:  # the window is gone; nobody is left to tell
            log.debug("%s ended after its window", self.name)

    def _tell(self, kind: str, value: Any) -> None:
        if self._muted:
            return
        if kind == "progressed":
            if isinstance(value, Progress) and not self._stop.is_set():
                self.progressed.emit(value)
        elif kind in ("succeeded", "failed"):
            getattr(self, kind).emit(value)
        else:
            getattr(self, kind).emit()
