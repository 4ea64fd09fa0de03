"""What live solving tells of every frame. Nothing in it is shown without its age."""

from dataclasses import dataclass, field
from time import monotonic

from app.core.solution import NoSolution, Solution
from app.solve.track import Mode, TrackUpdate
from app.workflows.live_capture import Shot
from app.workflows.live_drift import Drift


@dataclass(frozen=True, slots=True, eq=False)
class GoodPointing:
    """The last pointing there was. It is old as soon as a later frame has none."""

    solution: Solution
    number: int
    shutter_s: float

    def age_s(self, now_s: float | None = None) -> float:
        """Seconds since its mid-exposure, at ``now_s`` of :func:`time.monotonic` (now)."""
        return (monotonic() if now_s is None else now_s) - self.shutter_s


@dataclass(frozen=True, slots=True, eq=False)
class LiveUpdate:
    """One frame, its answer or the lack of one, and how the stream is doing.

    ``last_good`` is this frame's own answer, else the last one before, which is then old:
    :attr:`is_old`. ``solved_hz`` is over the last frames solved, ``frames_hz`` over those that
    came; ``dropped`` counts frames that a newer one overtook before they were looked at.
    """

    shot: Shot
    track: TrackUpdate
    done_s: float
    last_good: GoodPointing | None = None
    drift: Drift | None = None
    solved_hz: float | None = None
    frames_hz: float | None = None
    dropped: int = 0
    warnings: tuple[str, ...] = field(default=())

    @property
    def result(self) -> Solution | NoSolution:
        """What this very frame told."""
        answer = self.track.solution or self.track.reason
        assert answer is not None
        return answer

    @property
    def mode(self) -> Mode:
        """Whether it was searched for blind or where it was expected."""
        return self.track.mode

    @property
    def is_old(self) -> bool:
        """Whether ``last_good`` belongs to an earlier frame."""
        return self.last_good is not None and self.last_good.number != self.shot.number

    @property
    def latency_ms(self) -> float:
        """From the frame's arrival to its answer."""
        return (self.done_s - self.shot.received_s) * 1e3

    def age_s(self, now_s: float | None = None) -> float:
        """Seconds since mid-exposure, at ``now_s`` of :func:`time.monotonic` (by default now)."""
        return (monotonic() if now_s is None else now_s) - self.shot.shutter_s


@dataclass(frozen=True, slots=True)
class LiveSummary:
    """How a stream went: frames that came, were looked at, were solved, and were overtaken."""

    captured: int = 0
    looked_at: int = 0
    solved: int = 0
    dropped: int = 0
