"""Frames that lie in files, solved one after the other as if a camera gave them.

A single frame is solved twice, from every other star and from those between: two answers that
share no star, and so as good a proof against a wrong one as two frames.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from app.core.detections import Detections
from app.core.errors import NoAnswerError, UsageError
from app.core.frame import Frame
from app.core.hint import Site
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.solve.options import SolveOptions
from app.solve.solver import merged_hint, solve_detections, solve_frame
from app.workflows.fresh_frame import lost_in_space

NEWEST = 5  # of a folder


class NoMoreFramesError(NoAnswerError):
    """Every file has been looked at."""


class FileFrames:
    """Gives the answers of files; ``time_utc`` and ``site`` are of the one solved last.

    ``used`` names the frames that were solved.
    """

    def __init__(self, paths: Sequence[str | Path], options: SolveOptions | None = None) -> None:
        self.time_utc: datetime | None = None
        self.site: Site | None = None
        self.used: list[str] = []
        self._options = options
        files = picture_files(paths)
        self._coming = deque(files)
        self._single = len(files) == 1
        self._halves: deque[Detections] = deque()
        self._frame: Frame | None = None

    def solve_now(self) -> Task[Solution | NoSolution]:
        """The next frame's answer.

        Raises
        ------
        NoMoreFramesError
            All have been looked at.

        """
        if self._halves and self._frame is not None:
            return (yield from self._half(self._frame))
        if not self._coming:
            raise NoMoreFramesError("There are no more frames: take another.")
        yield Progress("read", None, str(self._coming[0]))
        frame = self._read(self._coming.popleft())
        if not self._single:
            return (yield from solve_frame(frame, self._options))
        whole = yield from solve_frame(frame, self._options)
        if isinstance(whole, NoSolution):
            return whole
        self._frame, self._halves = frame, deque(_halves(frame, self._options))
        return (yield from self._half(frame))

    def _half(self, frame: Frame) -> Task[Solution | NoSolution]:
        options = self._options or SolveOptions()
        hint = merged_hint(options.hint, frame.hint if options.use_header else None)
        stars = self._halves.popleft()
        return (yield from solve_detections(stars, replace(options, hint=hint)))

    def _read(self, path: Path) -> Frame:
        from app.frames import read_frame

        frame = lost_in_space(read_frame(path))
        self.used.append(str(path))
        self.time_utc = frame.hint.time_utc
        self.site = frame.hint.site or self.site
        return frame


def picture_files(paths: Sequence[str | Path]) -> list[Path]:
    """The files, and of folders the newest few, newest first.

    Raises
    ------
    UsageError
        There is none.

    """
    from app.frames.formats import SUFFIXES

    files: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir():
            found = [p for p in path.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file()]
            files += sorted(found, key=lambda p: -p.stat().st_mtime_ns)[:NEWEST]
        else:
            files.append(path)
    if not files:
        raise UsageError(f"{', '.join(map(str, paths)) or 'Nothing'} holds no pictures.")
    return files


def _halves(frame: Frame, options: SolveOptions | None) -> list[Detections]:
    from app.detect import DETECTORS
    from app.solve.pick import pick

    name = (options or SolveOptions()).detector
    stars = pick(DETECTORS, name, "detector").detect(frame)
    index = np.arange(len(stars))
    return [stars.take(index % 2 == 0), stars.take(index % 2 == 1)]
