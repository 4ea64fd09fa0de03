"""A camera runs and a person wants to know, at any moment, where it points now.

The camera fills a mailbox from its own thread; whoever steps this generator solves. While a frame
is being solved newer ones overtake each other in the mailbox, so the next one solved is always the
newest and nothing piles up, however slow the solver is.
"""

from collections import deque
from collections.abc import Callable, Generator
from dataclasses import replace
from datetime import datetime
from time import monotonic
from typing import Protocol

from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.solve.track import TrackUpdate
from app.workflows.live_capture import Capture, Shot
from app.workflows.live_drift import DriftMeter
from app.workflows.live_update import GoodPointing, LiveSummary, LiveUpdate

WAIT_S = 0.1
WARNING = "warning"
"""The stage of a :class:`Progress` whose detail is a sentence for the person: a broken file."""
RATE_OVER = 20
"""Rates are means over so many of the last frames."""

Live = Generator[Progress | LiveUpdate, None, LiveSummary]


class Engine(Protocol):
    """What makes a pointing of a frame: :class:`app.solve.track.Tracker`."""

    def update(self, frame: Frame, time_utc: datetime | None = None) -> Task[TrackUpdate]:
        """Take one frame in."""
        ...


def live_solve(capture: Capture, engine: Engine, frames: int | None = None) -> Live:
    """Start ``capture`` and solve its newest frame, again and again.

    Yields :class:`LiveUpdate` for every frame looked at and :class:`Progress` in between, at
    least ten times a second while waiting. Closing the generator stops the camera; it is also
    stopped after ``frames`` looked at, which returns a :class:`LiveSummary`.

    Raises
    ------
    app.core.errors.DeviceError
        The camera cannot be opened, is silent, or was unplugged: one sentence, after the last
        frame it gave.

    """
    stream = _Stream(capture)
    yield Progress("open camera")
    capture.start()
    try:
        while frames is None or stream.looked_at < frames:
            shot = capture.mailbox.take(WAIT_S)
            if shot is None:
                capture.raise_fault()
                for sentence in capture.take_warnings():
                    yield Progress(WARNING, None, sentence)
                yield Progress("wait for a frame", None, _waiting(stream, capture))
                continue
            track = yield from engine.update(shot.frame, shot.time_utc)
            yield stream.told(shot, track)
    finally:
        capture.stop()
    return stream.summary()


def posted(live: Live, post: Callable[[LiveUpdate], None]) -> Task[LiveSummary]:
    """The same as a plain task: updates go to ``post``, called in the thread that solves."""
    try:
        while True:
            try:
                step = next(live)
            except StopIteration as end:
                return end.value  # type: ignore[no-any-return]
            if isinstance(step, Progress):
                yield step
            else:
                post(step)
                yield Progress("solved", None, f"frame {step.shot.number}")
    finally:
        live.close()


class _Stream:
    """What is remembered from frame to frame; its size does not grow."""

    def __init__(self, capture: Capture) -> None:
        self._capture = capture
        self._drift = DriftMeter()
        self._good: GoodPointing | None = None
        self._solved_at: deque[float] = deque(maxlen=RATE_OVER)
        self._numbers: deque[tuple[float, int]] = deque(maxlen=RATE_OVER)
        self.looked_at = 0
        self.solved = 0

    def told(self, shot: Shot, track: TrackUpdate) -> LiveUpdate:
        """The update of one frame."""
        done = monotonic()
        self.looked_at += 1
        self._numbers.append((shot.received_s, shot.number))
        update = LiveUpdate(
            shot, track, done, dropped=self._capture.mailbox.dropped,
            warnings=(*shot.warnings, *shot.frame.warnings),
        )  # fmt: skip
        if track.solution is None:
            self._drift.forget()
        else:
            self.solved += 1
            self._solved_at.append(done)
            self._good = GoodPointing(track.solution, shot.number, shot.shutter_s)
            drift = self._drift.add(track.time_utc.timestamp(), track.solution.centre_vector)
            update = replace(update, drift=drift)
        return replace(
            update, last_good=self._good, solved_hz=_rate(self._solved_at, done),
            frames_hz=_frame_rate(self._numbers),
        )  # fmt: skip

    def summary(self) -> LiveSummary:
        """How it went."""
        box = self._capture.mailbox
        return LiveSummary(box.put_count, self.looked_at, self.solved, box.dropped)


def _waiting(stream: _Stream, capture: Capture) -> str:
    name = capture.name or "camera"
    return f"{name}, {stream.solved} of {stream.looked_at} solved" if stream.looked_at else name


def _rate(moments: deque[float], now_s: float) -> float | None:
    """Events a second up to now, so that it falls when they stay away."""
    if len(moments) < 2 or now_s <= moments[0]:
        return None
    return (len(moments) - 1) / (now_s - moments[0])


def _frame_rate(numbers: deque[tuple[float, int]]) -> float | None:
    """Frames a second that came, those overtaken included."""
    if len(numbers) < 2 or numbers[-1][0] <= numbers[0][0]:
        return None
    return (numbers[-1][1] - numbers[0][1]) / (numbers[-1][0] - numbers[0][0])
