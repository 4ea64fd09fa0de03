"""What the window is about: the frame that is open, and what is known of it."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

from PySide6.QtCore import QObject, Signal

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.solve.options import SolveOptions
from app.ui.engine import Engine, Solved
from app.ui.job import Job
from app.ui.picture import Picture, prepare
from app.ui.ready_picture import ReadyPicture

log = logging.getLogger("kochab")
JOIN_S = 3.0


@dataclass(slots=True)
class Known:
    """What is known of the open frame; ``last_good`` outlives the frame it came from.

    ``path`` is None and ``name`` is set when it came from a camera.
    """

    path: Path | None = None
    frame: Frame | None = None
    picture: Picture | None = None
    detections: Detections | None = None
    result: Solution | NoSolution | None = None
    last_good: Solution | None = None
    last_good_from: str = ""
    read_ms: float = 0.0
    options: SolveOptions = field(default_factory=SolveOptions)
    name: str = ""


class Session(QObject):
    """Runs the jobs and holds what they found; views listen and never ask each other.

    Every answer belongs to the job that was started last: an older one is told to stop and is
    not listened to any more.
    """

    opening = Signal(Path)
    opened = Signal(object)  # Frame
    pictured = Signal(object)  # Picture
    solving = Signal()
    progressed = Signal(object)  # Progress
    solved = Signal(object)  # Solution
    unsolved = Signal(object)  # NoSolution
    failed = Signal(str)
    streaming = Signal(str)  # a camera of that name starts
    streamed = Signal(object)  # ReadyPicture of a camera that runs
    stopped = Signal()  # cancelled by the person
    idle = Signal()

    def __init__(self, engine: Engine, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.known = Known()
        self.streams = False  # whether a camera's frames are shown as they come
        self.options_for: Callable[[Frame], SolveOptions | None] = lambda _: None
        self._engine = engine
        self._jobs: dict[str, Job] = {}
        self._ending: list[Job] = []

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        return bool(self._jobs)

    def open(self, path: Path | str) -> None:
        """Read a file, show it, and solve it."""
        self._drop_all()
        old = self.known
        self.known = Known(Path(path), last_good=old.last_good, last_good_from=old.last_good_from)
        self.streams = False
        log.info("opening %s", self.known.path)
        self.opening.emit(self.known.path)
        job = self._job("read", _timed(self._engine.read(Path(path))))
        job.succeeded.connect(self._has_read)
        job.start()

    def solve(self, options: SolveOptions | None = None) -> None:
        """Solve the open frame, again if it was solved before."""
        if options is not None:
            self.known.options = options
        frame = self.known.frame
        if frame is None:
            return
        self._drop("solve")
        self.known.result = None
        self.solving.emit()
        task = self._engine.solve(frame, self.known.options, self.known.read_ms)
        job = self._job("solve", _complete(task))
        job.succeeded.connect(self._has_result)
        job.start()

    def show(self, frame: Frame, name: str) -> None:
        """Show a frame that a camera has just given; who took it solves it, see :meth:`answer`."""
        self._drop_all()
        old = self.known
        self.known = Known(
            frame=frame, last_good=old.last_good, last_good_from=old.last_good_from, name=name
        )
        self.streams = False
        self.opening.emit(Path(name))
        self.opened.emit(frame)
        self._display(frame)

    def answer(self, solved: Solved) -> None:
        """What was found in the frame that :meth:`show` was given; of any other it is dropped."""
        if solved.frame is self.known.frame:
            self._has_result(solved)
            if not self._jobs:
                self.idle.emit()

    def begin_stream(self, name: str) -> None:
        """A camera starts: leave the open frame; :meth:`stream` brings the camera's."""
        self._drop_all()
        old = self.known
        self.known = Known(last_good=old.last_good, last_good_from=old.last_good_from, name=name)
        self.streams = True
        self.idle.emit()
        self.streaming.emit(name)

    def stream(
        self, frame: Frame, picture: ReadyPicture, result: Solution | NoSolution | None
    ) -> None:
        """Show a frame of a running camera, made ready, with its answer if there is one yet."""
        known = self.known
        known.frame, known.result = frame, result
        if isinstance(result, Solution):
            known.last_good, known.last_good_from = result, known.name
        self.streamed.emit(picture)

    def cancel(self) -> None:
        """Stop reading or solving; the views hear of it when it has stopped.

        The picture of a frame that was read is finished all the same: it is what remains to see.
        """
        for kind, job in self._jobs.items():
            if kind != "display":
                job.cancel()

    def close(self, limit_s: float = JOIN_S) -> bool:
        """Stop everything and wait a little; whether every thread has ended."""
        self._drop_all()
        return not [job for job in self._ending if not job.join(limit_s)]

    # jobs -------------------------------------------------------------------------------------
    def _job(self, kind: str, task: Task[Any]) -> Job:
        job = Job(task, kind)
        self._jobs[kind] = job
        job.progressed.connect(self.progressed)
        job.failed.connect(self._has_failed)
        job.cancelled.connect(self.stopped)
        job.finished.connect(self._has_finished)
        return job

    def _drop(self, kind: str) -> None:
        job = self._jobs.pop(kind, None)
        if job is not None:
            job.abandon()
            self._ending = [j for j in self._ending if j.running] + [job]

    def _drop_all(self) -> None:
        for kind in list(self._jobs):
            self._drop(kind)

    def _has_read(self, timed: tuple[Frame, float]) -> None:
        self.known.frame, self.known.read_ms = timed
        frame = self.known.frame
        log.info("%d x %d %s read in %.0f ms", frame.width, frame.height, frame.pixels.dtype,
                 self.known.read_ms)  # fmt: skip
        for warning in frame.warnings:
            log.warning("%s", warning)
        self.known.options = self.options_for(frame) or SolveOptions()
        self.opened.emit(frame)
        self._display(frame)
        self.solve()

    def _display(self, frame: Frame) -> None:
        job = self._job("display", prepare(frame))
        job.succeeded.connect(self._has_picture)
        job.start()

    def _has_picture(self, picture: Picture) -> None:
        self.known.picture = picture
        self.pictured.emit(picture)

    def _has_result(self, solved: Solved) -> None:
        known = self.known
        known.detections, known.result = solved.detections, solved.result
        if isinstance(solved.result, Solution):
            known.last_good = solved.result
            known.last_good_from = known.path.name if known.path else known.name
            log.info("solved: %s", _line(solved.result))
            self.solved.emit(solved.result)
        else:
            log.warning("no solution: %s. %s", solved.result.reason, solved.result.advice)
            self.unsolved.emit(solved.result)

    def _has_failed(self, sentence: str) -> None:
        log.error("%s", sentence)
        self.failed.emit(sentence)

    def _has_finished(self) -> None:
        ended = [kind for kind, job in self._jobs.items() if job is self.sender()]
        for kind in ended:
            self._ending = [j for j in self._ending if j.running] + [self._jobs.pop(kind)]
        if ended and not self._jobs:
            self.idle.emit()


def _timed(task: Task[Frame]) -> Task[tuple[Frame, float]]:
    start = perf_counter()
    yield Progress("read")
    frame = yield from task
    return frame, (perf_counter() - start) * 1e3


def _complete(task: Task[Solved]) -> Task[Solved]:
    """The same, with what the views will show worked out in the job's thread.

    The quaternion's library takes a quarter of a second to import, which the window has not got.
    """
    solved = yield from task
    if isinstance(solved.result, Solution):
        solved.result.attitude.quaternion  # noqa: B018
    return solved


def _line(s: Solution) -> str:
    ra, dec = s.ra_dec_deg
    return (
        f"RA {ra:.5f} Dec {dec:+.5f} roll {s.roll_deg:.3f} deg, "
        f"{s.camera.scale_arcsec_px:.4f} arcsec/px, {len(s.stars)} stars, "
        f"RMS {s.rms_px:.2f} px, {s.elapsed_ms.get('total', 0.0):.0f} ms"
    )
