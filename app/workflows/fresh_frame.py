"""Solving what a camera sees now: a frame that was begun after somebody asked for it."""

import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta

from app.core.capture import CameraSource
from app.core.errors import NoAnswerError
from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.solve.options import SolveOptions
from app.solve.solver import solve_frame

SolveNow = Callable[[], Task[Solution | NoSolution]]
"""Each call takes a new frame and solves it."""

SLICE_S = 0.2
PATIENCE_S = 90.0


def solver_of(
    camera: CameraSource,
    options: SolveOptions | None = None,
    patience_s: float = PATIENCE_S,
    seen: Callable[[Frame, Solution | NoSolution], None] | None = None,
) -> SolveNow:
    """What solves a fresh frame of ``camera``; ``seen`` is shown every frame with its answer."""

    def solve_now() -> Task[Solution | NoSolution]:
        frame = lost_in_space((yield from fresh_frame(camera, patience_s)))
        result = yield from solve_frame(frame, options)
        if seen is not None:
            seen(frame, result)
        return result

    return solve_now


def fresh_frame(camera: CameraSource, patience_s: float = PATIENCE_S) -> Task[Frame]:
    """The first frame whose exposure began after this call.

    A frame's own time proves it. Where clocks disagree or a frame has no time, the second frame
    to arrive is taken: a camera begins one exposure when the one before is over.

    Raises
    ------
    NoAnswerError
        No frame came within ``patience_s``.

    """
    asked, end = _now(camera), time.monotonic() + patience_s
    camera.next_frame(0.0)  # what was ready already
    doubtful = 0
    while True:
        yield Progress("wait for a frame", None, camera.name)
        frame = camera.next_frame(SLICE_S)
        if frame is None:
            if time.monotonic() > end:
                raise NoAnswerError(
                    f"The camera gave no new frame within {patience_s:g} s: is it taking pictures?"
                )
            continue
        if doubtful or _began_after(frame, asked, _now(camera)):
            return frame
        doubtful += 1


def lost_in_space(frame: Frame) -> Frame:
    """The same frame without what its header believes of the place: a mount may have told it."""
    return replace(frame, hint=replace(frame.hint, centre_deg=None))


def _began_after(frame: Frame, asked: datetime, now: datetime) -> bool:
    middle = frame.hint.time_utc
    if middle is None:
        return False
    began = middle - timedelta(seconds=(frame.hint.exposure_s or 0.0) / 2.0)
    return asked <= began <= now


def _now(camera: CameraSource) -> datetime:
    """The camera's own clock where it has one: simulated time need not be ours."""
    clock = getattr(camera, "now_utc", None)
    return datetime.now(UTC) if clock is None else clock()
