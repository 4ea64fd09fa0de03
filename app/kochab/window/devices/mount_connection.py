"""The line to the mount, opened, listened to and closed in the window's thread."""

from collections.abc import Callable
from contextlib import suppress

from PySide6.QtCore import QObject, Signal

from kochab.gear.mount_events import StopFailed
from kochab.gear.mount_line import MakeTask, MountLine
from kochab.gear.session import Opening
from kochab.window.job import Job, Jobs


class MountConnection(QObject):
    """One open line at a time, run by a job; what it reports comes in the window's thread."""

    heard = Signal(object)  # MountEvent or SolvedFrame
    closed = Signal(str, str, object)  # why, empty when a person closed it, the opening's farewell, a practice's score
    _posted = Signal(object, object)  # a line, and its event

    def __init__(self, jobs: Jobs) -> None:
        super().__init__(jobs)
        self.line: MountLine | None = None
        self.opening: Opening | None = None
        self._jobs = jobs
        self._job: Job | None = None  # it runs the line, also while that is being closed
        self._posted.connect(self._receive)

    @property
    def open(self) -> bool:
        """Whether there is a line, also while it is being opened or closed."""
        return self._job is not None

    @property
    def may_move(self) -> bool:
        """Whether the mount may be moving."""
        return self.line is not None and self.line.may_move

    def begin(self, opening: Opening, over: Callable[[], None]) -> None:
        """Open a line in place of the one before; ``over`` is called in its thread when it ends."""

        def ended() -> None:
            over()
            opening.over()

        line = MountLine(opening, lambda event: self.post(event, line), ended)
        self.line, self.opening = line, opening
        self._job = job = self._jobs.run(line.run(), "mount")
        # A line never succeeds: it serves orders until it is cancelled or fails.
        job.failed.connect(lambda sentence: self._ended(job, sentence))
        job.cancelled.connect(lambda: self._ended(job, ""))

    def end(self) -> None:
        """Stop what moves and close the line."""
        self.stop()
        # The Stop goes out in a thread of its own; the line ends when it comes to its next yield.
        if self._job is not None:
            self._job.cancel()

    def stop(self) -> None:
        """Stop the mount now; never waits."""
        if self.line is not None:
            self.line.stop()

    def aside(self, name: str, make: MakeTask) -> None:
        """Do this in the line's thread between the orders; nothing where there is no line."""
        if self.line is not None:
            self.line.order(name, make)

    def post(self, event: object, line: MountLine | None = None) -> None:
        """Pass an event on from another thread; it counts as said by ``line``, or by the one that is open."""
        with suppress(RuntimeError):  # the window is gone
            self._posted.emit(self.line if line is None else line, event)

    def _receive(self, line: MountLine | None, event: object) -> None:
        # Of a line that another has replaced only matters whether its mount stands.
        if line is self.line or isinstance(event, StopFailed):
            self.heard.emit(event)

    def _ended(self, job: Job, sentence: str) -> None:
        # A later line has taken its place.
        if job is self._job:
            farewell, score = ("", None) if self.opening is None else (self.opening.farewell, self.opening.score)
            self._job = self.line = self.opening = None
            self.closed.emit(sentence, farewell, score)
