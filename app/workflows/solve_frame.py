"""A person opens a frame and wants to know where it points."""

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from app.core.detections import Detections
from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.solve.options import SolveOptions
from app.solve.solver import examine_frame


@dataclass(frozen=True, slots=True, eq=False)
class SolvedFrame:
    """A frame, what was detected in it, and the answer or its lack.

    ``detections`` is empty when the search was over before detection.
    """

    path: str
    frame: Frame
    detections: Detections
    result: Solution | NoSolution


def solve_file(path: str | Path, options: SolveOptions | None = None) -> Task[SolvedFrame]:
    """Read the file at ``path`` and solve it.

    Raises
    ------
    app.core.errors.FrameError
        The file cannot be read as a picture; one sentence.
    app.core.errors.UsageError
        The options name a method or detector that does not exist.

    """
    from app.frames import read_frame

    start = perf_counter()
    yield Progress("read", 0.0, str(path))
    frame = read_frame(path)
    read_ms = (perf_counter() - start) * 1e3
    return (yield from solve_open_frame(frame, options, read_ms=read_ms))


def solve_open_frame(
    frame: Frame, options: SolveOptions | None = None, read_ms: float = 0.0
) -> Task[SolvedFrame]:
    """Solve a frame already in memory; ``read_ms`` is what reading it had cost, for the record."""
    examined = yield from examine_frame(frame, options or SolveOptions(), read_ms=read_ms)
    return SolvedFrame(frame.path, frame, examined.detections, examined.result)
