"""What the window needs from below, and the real thing, imported when first used."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Protocol

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.identify import IDENTIFIERS
from app.mounts import DRIVERS
from app.solve.options import SolveOptions

# Loaded while nobody waits: the first frame is then solved as quickly as the second.
NEEDED = (
    "app.frames.fits",
    "scipy.spatial.transform",
    "app.workflows.solve_frame",
    "app.identify.volumes",
    "app.polar.horizon",
    "erfa",
    *(target.partition(":")[0] for target in (*IDENTIFIERS.values(), *DRIVERS.values())),
)


class Solved(Protocol):
    """A frame's answer with what was detected on the way."""

    @property
    def frame(self) -> Frame: ...
    @property
    def detections(self) -> Detections: ...
    @property
    def result(self) -> Solution | NoSolution: ...


class Engine(Protocol):
    """Reads and solves, as tasks."""

    def read(self, path: Path) -> Task[Frame]:
        """The frame in a file; raises :class:`app.core.errors.FrameError`."""
        ...

    def solve(self, frame: Frame, options: SolveOptions, read_ms: float) -> Task[Solved]:
        """Where the frame points, or why that is not known."""
        ...

    def prepare(self) -> Task[None]:
        """What has to be made once on this machine; ends at once when it is there."""
        ...


class WorkflowEngine:
    """The engine of the workflows."""

    def read(self, path: Path) -> Task[Frame]:
        """Read a file; the heavy imports happen here, in the job's thread."""
        yield Progress("read", None, f"reading {path.name}")
        from app.frames import read_frame

        return read_frame(path)

    def solve(self, frame: Frame, options: SolveOptions, read_ms: float) -> Task[Solved]:
        """Solve a frame that has been read."""
        yield Progress("detect", None, "looking for stars")
        from app.solve.contradicted import with_doubts
        from app.workflows.solve_frame import solve_open_frame

        solved = yield from solve_open_frame(frame, options, read_ms=read_ms)
        return replace(solved, result=with_doubts(solved.result, options, frame.hint))

    def prepare(self) -> Task[None]:
        """Load what a solve and the views need, and make the patterns for small fields.

        Those are too large to ship.
        """
        from app.ui.views import VIEWS  # they know what the window is made of, and so of us

        views = (made_by.partition(":")[0] for _, _, made_by in VIEWS.values())
        for name in (*NEEDED, *views):
            yield Progress("load", None, name)
            import_module(name)
        from app.identify.volumes import fine
        from app.ui.fine_patterns import make_elsewhere

        if fine() is None:
            yield from make_elsewhere()
