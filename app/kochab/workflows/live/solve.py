"""Live solving: the pointing of a running camera, frame after frame.

The camera fills a mailbox from its own thread; the caller that steps this generator solves. While
a frame is solved newer ones replace each other in the mailbox, so the next one solved is always
the newest and nothing piles up, however slow the solver is.
"""

from collections import deque
from collections.abc import Generator
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from time import monotonic

from kochab.core.frame import Frame
from kochab.core.progress import Progress, Task
from kochab.solver import SolveOptions
from kochab.solver.camera_profile import Profile, load_profile, save_profile
from kochab.solver.tracker import Tracker, TrackUpdate
from kochab.text.translation import tr
from kochab.workflows.live.capture import Capture, Shot
from kochab.workflows.live.update import DriftMeter, GoodPointing, LiveUpdate

WAIT_S = 0.1
WARNING = "warning"
"""The stage of a :class:`Progress` whose detail is a sentence for the person: a broken file."""
RATE_OVER = 20  # rates are means over so many of the last frames

Live = Generator[Progress | LiveUpdate, None, None]


def live_solve(capture: Capture, engine: "ProfiledTracker", frames: int | None = None) -> Live:
    """Start ``capture`` and solve its newest frame, again and again.

    Yields :class:`LiveUpdate` for every frame looked at and :class:`Progress` in between, at least ten times a second
    while waiting. Closing the generator stops the camera; it is also stopped after ``frames`` looked at.

    Raises DeviceError when the camera cannot be opened, is silent, or was unplugged: one sentence, after the
    last frame it gave.
    """
    stream = _Stream(capture)
    yield Progress("open camera")
    capture.start()
    try:
        while frames is None or stream.looked_at < frames:
            shot = capture.mailbox.take(WAIT_S)
            if shot is None:
                capture.raise_fault()  # only when nothing is left to take: the last frame is solved first
                for sentence in capture.take_warnings():
                    yield Progress(WARNING, None, sentence)
                yield Progress("wait for a frame", None, _waiting(stream, capture))
                continue
            track = yield from engine.update(shot.frame, shot.time_utc)
            yield stream.update(shot, track)
    finally:
        capture.stop()  # a closed generator comes here too


class _Stream:
    """The state kept from frame to frame; its size does not grow."""

    def __init__(self, capture: Capture) -> None:
        self._capture = capture
        self._drift = DriftMeter()
        self._good: GoodPointing | None = None
        self._solved: deque[tuple[float, int]] = deque(maxlen=RATE_OVER)
        self._numbers: deque[tuple[float, int]] = deque(maxlen=RATE_OVER)
        self.looked_at = 0
        self.solved = 0

    def update(self, shot: Shot, track: TrackUpdate) -> LiveUpdate:
        """The update of one frame."""
        done = monotonic()
        self.looked_at += 1
        self._numbers.append((shot.received_s, shot.number))
        update = LiveUpdate(
            shot,
            track,
            done,
            dropped=self._capture.mailbox.dropped,
            warnings=(*self._capture.take_warnings(), *shot.frame.warnings),
        )
        if track.solution is None:
            self._drift.forget()
        else:
            self.solved += 1
            self._solved.append((done, self.solved))
            self._good = GoodPointing(track.solution, shot.number, shot.shutter_s)
            drift = self._drift.add(track.time_utc.timestamp(), track.solution.centre_vector)
            update = replace(update, drift=drift)
        # Solved ones up to now, so that the rate falls when they stop; frames that came, dropped ones included.
        solved_hz, frames_hz = _rate(self._solved, done), _rate(self._numbers, shot.received_s)
        return replace(update, last_good=self._good, solved_hz=solved_hz, frames_hz=frames_hz)


def _waiting(stream: _Stream, capture: Capture) -> str:
    name = capture.name or "camera"
    return (
        tr("{name}, {solved} of {looked_at} solved", name=name, solved=stream.solved, looked_at=stream.looked_at)
        if stream.looked_at
        else name
    )


def _rate(counts: deque[tuple[float, int]], until_s: float) -> float | None:
    """How many a second, from moments and the counts then; None before there are two."""
    if len(counts) < 2 or until_s <= counts[0][0]:
        return None
    return (counts[-1][1] - counts[0][1]) / (until_s - counts[0][0])


class ProfiledTracker:
    """Tracks with the profile of one camera and lens, which ``name`` stands for; without a name none is kept.

    Which profile that is depends on the frames' size too, so it is recalled with the first frame.
    """

    def __init__(self, name: str = "", options: SolveOptions | None = None, folder: Path | None = None) -> None:
        self.name = name
        self._options = options
        self._folder = folder
        self._tracker: Tracker | None = None
        self._size = (0, 0)

    @property
    def profile(self) -> Profile | None:
        """What is known of the camera so far; None before the first frame of a new one."""
        known = None if self._tracker is None else self._tracker.profile
        return None if known is None else replace(known, name=self.name)

    def update(self, frame: Frame, time_utc: datetime | None = None) -> Task[TrackUpdate]:
        """Take one frame in.

        Raises KochabError when the kept profile cannot be read, or the one before this size of frame not be kept.
        """
        size = (frame.width, frame.height)
        if self._tracker is None or size != self._size:
            self.keep()
            known = load_profile(self.name, *size, self._folder) if self.name else None
            self._tracker, self._size = Tracker(self._options, known), size
        return (yield from self._tracker.update(frame, time_utc))

    def keep(self) -> Path | None:
        """Write what was learned; None when nothing was, or nothing is to be kept.

        Raises KochabError when it cannot be written.
        """
        profile = self.profile
        if not self.name or profile is None or not profile.frames:
            return None
        return save_profile(profile, self._folder)
