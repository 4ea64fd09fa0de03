"""Lost in space once, then tracking: every frame of a stream to a pointing and a rate.

The first frame is solved blind. From then on the filter (:mod:`app.attitude.filter`) says where
the camera points at the next frame's time, and only small windows around the stars expected there
are read. When what is found there is no better than chance, the same frame is solved blind.
"""

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Literal

from app.attitude.filter import Motion, State, begin, predicted, updated
from app.core.attitude import Attitude
from app.core.frame import Frame
from app.core.progress import Task
from app.core.solution import NoSolution, Solution
from app.solve.options import SolveOptions
from app.solve.solver import examine_frame

if TYPE_CHECKING:
    from app.sky import Catalogue

Mode = Literal["lost", "tracking"]


@dataclass(frozen=True, slots=True)
class TrackOptions:
    """Choices for a stream: how a lost frame is solved, and how the camera is believed to move."""

    solve: SolveOptions = field(default_factory=SolveOptions)
    motion: Motion = field(default_factory=Motion)


@dataclass(frozen=True, slots=True, eq=False)
class TrackUpdate:
    """What one frame told. Everything in it belongs to ``time_utc``, the frame's own moment.

    ``solution`` is what this frame's stars say alone, None when there is none and ``reason`` says
    why. ``mode`` tells how it was found. ``filtered`` is the attitude after all frames so far, as
    long as it is a pointing at all; its ``sigma_arcsec`` is smaller than the solution's.
    ``rates_deg_s`` are the camera's angular velocities against the stars about its own x, y and z
    (x right, y down, z out), and ``rates_sigma_deg_s`` their errors.
    """

    time_utc: datetime
    mode: Mode
    solution: Solution | None
    reason: NoSolution | None
    filtered: Attitude | None = None
    rates_deg_s: tuple[float, float, float] | None = None
    rates_sigma_deg_s: tuple[float, float, float] | None = None
    expected: int = 0
    matched: int = 0

    @property
    def sigma_arcsec(self) -> tuple[float, float, float] | None:
        """One-sigma errors of ``filtered`` along x, along y, and of roll."""
        return None if self.filtered is None else self.filtered.sigma_arcsec


class Tracker:
    """Follows one camera. Not safe for several threads at once.

    ``catalogue`` is the shipped one unless given.
    """

    def __init__(
        self, catalogue: "Catalogue | None" = None, options: TrackOptions | None = None
    ) -> None:
        from app.sky import open_catalogue

        self.catalogue = catalogue or open_catalogue()
        self.options = options or TrackOptions()
        self.state: State | None = None

    def forget(self) -> None:
        """Be lost: the next frame is solved blind."""
        self.state = None

    def update(self, frame: Frame, time_utc: datetime | None = None) -> Task[TrackUpdate]:
        """Take one frame in, newer than the last.

        ``time_utc`` is its mid-exposure; by default what the frame says of itself, else now.
        """
        moment = time_utc or frame.hint.time_utc or datetime.now(UTC)
        return (yield from self._lost(frame, moment))

    def _lost(self, frame: Frame, moment: datetime) -> Task[TrackUpdate]:
        examined = yield from examine_frame(frame, self.options.solve)
        if isinstance(examined.result, NoSolution):
            self.state = None
            return TrackUpdate(moment, "lost", None, examined.result)
        return self._take_in(examined.result, moment, "lost", 0)

    def _take_in(
        self, solution: Solution, moment: datetime, mode: Mode, expected: int
    ) -> TrackUpdate:
        """Update the filter by a solution, or begin it anew."""
        motion, now = self.options.motion, moment.timestamp()
        if self.state is None:
            self.state = begin(solution.attitude, now, motion)
        else:
            self.state = updated(predicted(self.state, now, motion), solution.attitude, motion)
        return TrackUpdate(
            moment, mode, solution, None, self.state.attitude, self.state.rates_deg_s,
            self.state.rates_sigma_deg_s, expected, len(solution.stars),
        )  # fmt: skip
