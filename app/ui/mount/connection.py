"""A mount's line while it is open: its thread, what comes from it, and how it ends."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from app.ui.job import Job
from app.ui.mount.line_thread import MountLine
from app.ui.mount.opening import Opening, PracticeOpening
from app.ui.mount.words import Word
from app.ui.services import Jobs
from app.ui.wiring import Practice


class Connection(QObject):
    """One line at a time; of one that was left nothing more is heard but that it is closed."""

    heard = Signal(object)  # Word
    closed = Signal(str, str)  # a sentence, empty when a person wanted it so, and a farewell
    _told = Signal(object)

    def __init__(self, jobs: Jobs, parent: QObject) -> None:
        super().__init__(parent)
        self.line: MountLine | None = None
        self._jobs = jobs
        self._opening: Opening | None = None
        self._job: Job | None = None
        self._told.connect(self._hear)

    @property
    def practice(self) -> Practice | None:
        """The practice night that the line leads to, once it has begun."""
        opening = self._opening
        return opening.practice if isinstance(opening, PracticeOpening) else None

    def open(self, opening: Opening, let_go: Callable[[], None]) -> None:
        """Open a line in any way; ``let_go`` is called in its thread when it is over."""

        def over() -> None:
            let_go()
            opening.over()

        line = MountLine(opening, lambda word: self.tell(line, word), over)
        self.line, self._opening = line, opening
        self._job = job = self._jobs.run(line.run(), "mount")
        job.failed.connect(lambda sentence: self._over(job, sentence))
        job.cancelled.connect(lambda: self._over(job, ""))

    def leave(self) -> bool:
        """Stop what moves and give the port back; whether there is anything to wait for."""
        if self._job is None:
            return False
        if self.line is not None:
            self.line.stop()
        self._job.cancel()
        self.line = None
        return True

    def tell(self, line: MountLine | None, word: Word) -> None:
        """From the line's threads."""
        try:
            self._told.emit((line, word))
        except RuntimeError:  # the window is gone
            return

    def _hear(self, told: tuple[MountLine | None, Word]) -> None:
        line, word = told
        if line is self.line:
            self.heard.emit(word)

    def _over(self, job: Job, sentence: str) -> None:
        if job is not self._job:
            return
        farewell = self._opening.farewell if self._opening is not None else ""
        self._job = self.line = self._opening = None
        self.closed.emit(sentence, farewell)
