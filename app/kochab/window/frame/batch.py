"""Many files: each is read and solved in turn, in a thread, beside whatever is open."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QObject, Signal

from kochab.core.frame import Frame
from kochab.core.progress import Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import mutable
from kochab.frames import frames_of
from kochab.solver import SolveOptions
from kochab.text.translation import tr
from kochab.window.frame.session import Session, WorkflowEngine
from kochab.window.image.thumbnails import small_picture
from kochab.window.job import Job

if TYPE_CHECKING:
    from kochab.workflows.solve_frame import SolvedFrame


@mutable(eq=False)
class FileState:
    """A file with what is known of it; ``picture`` is small, (H, W, 3) uint8."""

    path: Path
    picture: np.ndarray | None = None
    result: Solution | NoSolution | None = None
    fault: str = ""

    @property
    def failed(self) -> bool:
        return bool(self.fault) or isinstance(self.result, NoSolution)

    @property
    def words(self) -> str:
        """Its state in a word or the reason."""
        if isinstance(self.result, Solution):
            return tr("solved")
        if self.fault or self.result is None:
            return self.fault or tr("waiting")
        return tr("no solution: {reason}", reason=tr(self.result.reason))


def images_in(paths: Iterable[Path]) -> list[Path]:
    """The files of ``paths``, each once; a folder stands for the images in it, by name."""
    # A dict keeps their order, and each once.
    found: dict[Path, None] = {}
    for path in paths:
        found.update(dict.fromkeys(frames_of(path) if path.is_dir() else [path]))
    return list(found)


class Batch(QObject):
    """Solves files one after another with the hints of the window; a file that fails does not stop the others."""

    changed = Signal(object)  # FileState
    moved = Signal()  # started, went on to another file, or ended

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.files: dict[Path, FileState] = {}
        self.at: Path | None = None
        """The file at work; None when none is."""
        self._session = session
        self._job: Job | None = None
        for signal in (session.solved, session.unsolved):
            signal.connect(self._learn)

    @property
    def waiting(self) -> list[FileState]:
        return [f for f in self.files.values() if f.result is None and not f.fault]

    def take(self, files: dict[Path, FileState]) -> None:
        """Begin with these files instead of those before."""
        self.cancel()
        self.files = files
        self.start()

    def start(self) -> None:
        """Go on with the files that have no result yet."""
        if self.at is None:
            self._next()

    def cancel(self) -> None:
        """Stop; keeps solved images."""
        if self._job is not None:
            self._job.abandon()
        self._job, self.at = None, None
        self.moved.emit()

    def _next(self) -> None:
        state = next(iter(self.waiting), None)
        self.at = None if state is None else state.path
        self.moved.emit()
        if state is not None:
            self._run(_look_at(self._session.engine, state.path), state, self._looked)

    def _run(self, task: Task[object], state: FileState, then: object) -> None:
        self._job = job = self._session.jobs.run(task, "batch")
        job.succeeded.connect(lambda made: then(state, made))  # type: ignore[operator]
        job.failed.connect(lambda sentence: self._end(state, fault=sentence))

    def _looked(self, state: FileState, made: tuple[Frame, np.ndarray]) -> None:
        frame, state.picture = made
        self.changed.emit(state)
        if state.result is not None:  # the open one, solved meanwhile
            self._next()
            return
        options = self._session.options_for(frame) or SolveOptions()
        self._run(self._session.engine.solve(frame, options, 0.0), state, self._solved)

    def _solved(self, state: FileState, solved: "SolvedFrame") -> None:
        self._end(state, solved.result)

    def _end(self, state: FileState, result: Solution | NoSolution | None = None, fault: str = "") -> None:
        state.result, state.fault = result, fault
        self.changed.emit(state)
        self._next()

    def _learn(self, result: Solution | NoSolution) -> None:
        """The open file was solved, perhaps with other hints than before."""
        state = None if self._session.known.path is None else self.files.get(self._session.known.path)
        if state is not None:
            state.result, state.fault = result, ""
            self.changed.emit(state)


def _look_at(engine: WorkflowEngine, path: Path) -> Task[tuple[Frame, np.ndarray]]:
    frame = yield from engine.read(path)
    return frame, small_picture(frame)
