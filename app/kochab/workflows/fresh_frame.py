"""Fresh frames, solved: from a camera, begun after the request, or from files."""

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from kochab.core.capture import CameraSource
from kochab.core.errors import NoAnswerError, UsageError
from kochab.core.frame import Detections, Frame, Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.solver import SolveOptions
from kochab.solver.pipeline import merged_hint, solve_detections, solve_frame
from kochab.text.translation import tr

SLICE_S = 0.2
PATIENCE_S = 90.0


class SolvedFrames(ABC):
    """Solves one frame after the other; ``time_utc`` and ``site`` are what the last one says itself.

    ``used`` names the files that were solved.
    """

    def __init__(self, options: SolveOptions | None) -> None:
        self.time_utc: datetime | None = None
        self.site: Site | None = None
        self.used: list[str] = []
        self._options = options

    @abstractmethod
    def solve_now(self) -> Task[Solution | NoSolution]:
        """The next frame's solution."""


class CameraFrames(SolvedFrames):
    """Solves fresh frames of a camera; one that only its file dates has no time of its own."""

    def __init__(self, camera: CameraSource, options: SolveOptions | None = None) -> None:
        super().__init__(options)
        self._camera = camera

    def solve_now(self) -> Task[Solution | NoSolution]:
        """The solution of a frame begun after this call."""
        frame = lost_in_space((yield from fresh_frame(self._camera)))
        result = yield from solve_frame(frame, self._options)
        self.time_utc = frame.hint.taken_utc
        return result


def fresh_frame(camera: CameraSource, patience_s: float = PATIENCE_S) -> Task[Frame]:
    """The first frame whose exposure began after this call.

    A frame's own time proves it. Where clocks disagree or a frame has no time, the second frame
    to arrive is taken: a camera begins one exposure when the one before is over.

    Raises NoAnswerError when no frame came within ``patience_s``.
    """
    since, end = camera.now_utc(), time.monotonic() + patience_s
    camera.next_frame(0.0)  # what was ready already
    doubtful = 0
    while True:
        yield Progress("wait for a frame", None, camera.name)
        frame = camera.next_frame(SLICE_S)
        if frame is None:
            if time.monotonic() > end:
                raise NoAnswerError(
                    "The camera gave no new frame within {patience:g} s. Is it exposing?", patience=patience_s
                )
            continue
        if doubtful or _began_after(frame, since, camera.now_utc()):
            return frame
        doubtful += 1


def lost_in_space(frame: Frame) -> Frame:
    """The same frame without its header's coordinates: they may come from the lost mount."""
    return replace(frame, hint=replace(frame.hint, centre_deg=None))


def _began_after(frame: Frame, since: datetime, now: datetime) -> bool:
    middle = frame.hint.time_utc
    if middle is None:
        return False
    began = middle - timedelta(seconds=(frame.hint.exposure_s or 0.0) / 2.0)
    return since <= began <= now


# -- Frames that lie in files, solved one after the other as if a camera gave them -------------
# A single frame is solved twice, from the stars of its left half and from those of its right: two
# solutions that share no star, and so as good a proof against a wrong one as two frames. Every
# other star would do as well, but where half the stars are missing few patterns are left.

NEWEST = 5  # of a folder


class NoMoreFramesError(NoAnswerError):
    """Every file has been used."""


class FileFrames(SolvedFrames):
    """Gives the solutions of files."""

    def __init__(self, paths: Sequence[str | Path], options: SolveOptions | None = None) -> None:
        super().__init__(options)
        files = image_files(paths)
        self._coming = deque(files)
        self._single = len(files) == 1
        self._halves: deque[Detections] = deque()
        self._frame: Frame | None = None

    def solve_now(self) -> Task[Solution | NoSolution]:
        """The next frame's solution. Raises NoMoreFramesError when all have been used."""
        if self._halves and self._frame is not None:
            return (yield from self._half(self._frame))
        if not self._coming:
            raise NoMoreFramesError("No more frames: take another.")
        yield Progress("read", None, str(self._coming[0]))
        frame = yield from self._read(self._coming.popleft())
        if not self._single:
            return (yield from solve_frame(frame, self._options))
        result = yield from solve_frame(frame, self._options)
        if isinstance(result, NoSolution):
            return result
        self._frame, self._halves = frame, deque(_halves(frame, self._options))
        return (yield from self._half(frame))

    def _half(self, frame: Frame) -> Task[Solution | NoSolution]:
        options = self._options or SolveOptions()
        hint = merged_hint(options.hint, frame.hint if options.use_header else None)
        return (yield from solve_detections(self._halves.popleft(), replace(options, hint=hint)))

    def _read(self, path: Path) -> Task[Frame]:
        from kochab.frames import reading

        frame = lost_in_space((yield from reading(path)))
        self.used.append(str(path))
        self.time_utc = frame.hint.time_utc
        self.site = frame.hint.site or self.site
        return frame


def image_files(paths: Sequence[str | Path]) -> list[Path]:
    """The files, and of folders the newest few, newest first. Raises UsageError when there is none."""
    from kochab.frames import frames_of

    files: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir():
            files += sorted(frames_of(path), key=lambda p: -p.stat().st_mtime_ns)[:NEWEST]
        else:
            files.append(path)
    if not files:
        raise UsageError("{paths} has no images.", paths=", ".join(map(str, paths)) or tr("The list"))
    return files


def _halves(frame: Frame, options: SolveOptions | None) -> list[Detections]:
    from kochab.detection import DETECTORS

    stars = DETECTORS.make((options or SolveOptions()).detector).detect(frame)
    left = stars.xy[:, 0] < np.median(stars.xy[:, 0])  # the median: as many stars in each half
    return [stars.take(left), stars.take(~left)]
