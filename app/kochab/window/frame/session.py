"""The open frame, what is known of it, and the jobs that read and solve it."""

import logging
from collections.abc import Callable, Iterable
from dataclasses import field, replace
from importlib import import_module
from pathlib import Path
from time import monotonic, perf_counter
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

from kochab.core.frame import Detections, Frame
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import mutable
from kochab.gear.mounts import DRIVERS
from kochab.identification import IDENTIFIERS
from kochab.solver import SolveOptions
from kochab.text.translation import tr
from kochab.window.image.frame_image import FrameImage, prepare
from kochab.window.image.screen_image import RenderedFrame
from kochab.window.job import Job, Jobs

if TYPE_CHECKING:
    from kochab.workflows.solve_frame import SolvedFrame

# Loaded in the background, so that the first frame is solved as quickly as the second.
NEEDED = (
    "kochab.frames.fits",
    "scipy.spatial.transform",
    "kochab.workflows.solve_frame",
    "kochab.identification.triangles",
    "kochab.solver.diagnosis",
    "kochab.sky.horizon",
    "erfa",
    *(target.partition(":")[0] for target in (*IDENTIFIERS.own.values(), *DRIVERS.own.values())),
)


class WorkflowEngine:
    """Reads and solves, as tasks; ``views`` are modules that :meth:`prepare` loads as well."""

    def __init__(self, views: Iterable[str] = ()) -> None:
        self._views = tuple(views)

    def read(self, path: Path) -> Task[Frame]:
        """The frame in a file; raises :class:`kochab.core.errors.FrameError`."""
        yield Progress("read", None, tr("reading {file}", file=path.name))
        from kochab.frames import reading

        return (yield from reading(path))

    def solve(self, frame: Frame, options: SolveOptions, read_ms: float) -> "Task[SolvedFrame]":
        yield Progress("detect", None, tr("detecting stars"))
        from kochab.solver.pipeline import with_doubts
        from kochab.workflows.solve_frame import solve_open_frame

        solved = yield from solve_open_frame(frame, options, read_ms=read_ms)
        return replace(solved, result=with_doubts(solved.result, options, frame.hint))

    def prepare(self) -> Task[None]:
        """Load what a solve, the views and the search need; build the small-field index, too large to ship."""
        for name in (*NEEDED, *self._views):
            yield Progress("load", None, name)
            import_module(name)
        DRIVERS.others()  # asks every package that is installed
        from kochab.identification.index import fine
        from kochab.sky.completion import completion
        from kochab.solver.own_index import own_folder, own_volumes
        from kochab.workflows.fine_patterns import make_elsewhere

        yield Progress("load", None, "names")
        completion()  # so that the search lists from the first letter
        if fine() is None or (own_folder() is not None and not own_volumes()):
            yield from make_elsewhere()


log = logging.getLogger("kochab")


@mutable
class Known:
    """The open frame; ``last_good`` outlives a solve of it again that fails, and ends with the frame.

    ``path`` is None and ``name`` is set when the frame came from a camera; ``shown_at_s`` is when, by the monotonic
    clock.
    """

    path: Path | None = None
    frame: Frame | None = None
    picture: FrameImage | None = None
    detections: Detections | None = None
    result: Solution | NoSolution | None = None
    last_good: Solution | None = None
    last_good_from: str = ""
    read_ms: float = 0.0
    options: SolveOptions = field(default_factory=SolveOptions)
    name: str = ""
    shown_at_s: float = 0.0

    @property
    def solution(self) -> Solution | None:
        """What it was solved to; None when it is not, or not yet."""
        return self.result if isinstance(self.result, Solution) else None


class Session(QObject):
    """Runs the jobs and holds their results; views listen to it, never to each other.

    A new job replaces an older one of its kind, which is abandoned.
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
    live = Signal(str)  # how it stands with that camera and its pointing, in a few words
    stopped = Signal()  # cancelled by the person
    idle = Signal()

    def __init__(self, engine: WorkflowEngine, jobs: Jobs) -> None:
        super().__init__(jobs)
        self.jobs = jobs
        self.known = Known()
        self.streams = False  # whether a camera's frames are shown as they come
        self.options_for: Callable[[Frame], SolveOptions | None] = lambda _: None
        self._engine = engine
        self._running: dict[str, Job] = {}  # by their kind

    @property
    def engine(self) -> WorkflowEngine:
        return self._engine

    @property
    def busy(self) -> bool:
        return bool(self._running)

    def open(self, path: Path | str) -> None:
        """Read a file, show it, and solve it."""
        self._renew(path=Path(path))
        log.info("opening %s", self.known.path)
        self.opening.emit(self.known.path)
        self._start("read", _timed(self._engine.read(Path(path))), self._has_read)

    def _renew(self, **known: Any) -> None:
        """Forget the open frame."""
        for kind in list(self._running):
            self._drop(kind)
        self.streams = False
        # A new object, not a cleared one: what comes late compares it by identity.
        self.known = Known(**known)

    def solve(self, options: SolveOptions | None = None) -> None:
        """Solve the open frame, again if it was solved before."""
        if options is not None:
            self.known.options = options
        if (frame := self.known.frame) is None:
            return
        self._drop("solve")
        self.known.result = None
        self.solving.emit()
        task = self._engine.solve(frame, self.known.options, self.known.read_ms)
        self._start("solve", task, self._has_result)

    def show(self, frame: Frame, name: str) -> None:
        """Show a camera's frame; whoever took it solves it, see :meth:`answer`."""
        self._renew(frame=frame, name=name, shown_at_s=monotonic())
        self.opening.emit(Path(name))
        self.opened.emit(frame)
        self._display(frame)

    def answer(self, solved: "SolvedFrame") -> None:
        """Take the solution of the frame given to :meth:`show`; that of another frame is dropped."""
        if solved.frame is self.known.frame:
            self._has_result(solved)
            if not self._running:
                self.idle.emit()

    def begin_stream(self, name: str) -> None:
        """A camera starts: close the open frame; :meth:`stream` brings the camera's."""
        self._renew(name=name)
        self.streams = True
        self.idle.emit()
        self.streaming.emit(name)

    def stream(self, frame: Frame, picture: RenderedFrame, result: Solution | NoSolution | None) -> None:
        """Show a rendered frame of a running camera, with its solution if there is one yet."""
        known = self.known
        known.frame, known.result, known.shown_at_s = frame, result, monotonic()
        if isinstance(result, Solution):
            known.last_good, known.last_good_from = result, known.name
        # No `solved` here, with up to 30 frames a second: LiveDisplay tells of a solution once a second.
        self.streamed.emit(picture)

    def cancel(self) -> None:
        """Stop reading or solving; the image of a frame that was read is still shown."""
        for kind, job in self._running.items():
            if kind != "display":
                job.cancel()

    def _start(self, kind: str, task: Task[Any], succeeded: Callable[[Any], None]) -> None:
        self._running[kind] = job = self.jobs.run(task, kind)
        job.progressed.connect(self.progressed)
        job.failed.connect(self._has_failed)
        job.cancelled.connect(self.stopped)
        job.succeeded.connect(succeeded)
        job.finished.connect(lambda: self._has_finished(kind))

    def _drop(self, kind: str) -> None:
        if (job := self._running.pop(kind, None)) is not None:
            job.abandon()

    def _has_read(self, timed: tuple[Frame, float]) -> None:
        self.known.frame, self.known.read_ms = timed
        frame = self.known.frame
        log.info("%d x %d %s read in %.0f ms", frame.width, frame.height, frame.pixels.dtype, self.known.read_ms)
        for warning in frame.warnings:
            log.warning("%s", warning)
        self.known.options = self.options_for(frame) or SolveOptions()
        self.opened.emit(frame)
        self._display(frame)
        self.solve()

    def _display(self, frame: Frame) -> None:
        self._start("display", prepare(frame), self._has_picture)

    def _has_picture(self, picture: FrameImage) -> None:
        self.known.picture = picture
        self.pictured.emit(picture)

    def _has_result(self, solved: "SolvedFrame") -> None:
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

    def _has_finished(self, kind: str) -> None:
        del self._running[kind]  # an older one of its kind was abandoned, and says nothing any more
        if not self._running:
            self.idle.emit()


def _timed(task: Task[Frame]) -> Task[tuple[Frame, float]]:
    start = perf_counter()
    yield Progress("read")
    frame = yield from task
    return frame, (perf_counter() - start) * 1e3


def _line(s: Solution) -> str:
    ra, dec = s.ra_dec_deg
    return (
        f"RA {ra:.5f} Dec {dec:+.5f} roll {s.roll_deg:.3f} deg, "
        f"{s.camera.scale_arcsec_px:.4f} arcsec/px, {len(s.stars)} stars, "
        f"RMS {s.rms_px:.2f} px, {s.elapsed_ms.get('total', 0.0):.0f} ms"
    )
