"""What the thread of a mount's line reports, and the state of the mount that follows from it."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from kochab.core.attitude import apart_deg
from kochab.core.frame import Frame, Site
from kochab.core.mount import Ability, Epoch, MountState
from kochab.core.progress import Progress
from kochab.core.solution import Solution
from kochab.core.values import frozen, mutable
from kochab.gear.actions import POLAR, action

SLOW_DEG_S = 0.02  # a slew that goes slower than five times the sky has not begun, or has arrived


class MountEvent:
    """One report; every kind is a frozen dataclass below."""


@frozen
class Connected(MountEvent):
    """A mount answers; ``lacks`` is what it cannot do, each with the reason."""

    name: str
    lacks: Mapping[Ability, str]
    epoch: Epoch
    site: Site | None
    rates_deg_s: tuple[float, ...] = ()


@frozen
class EpochDoubted(MountEvent):
    """Something of the mount's settings is not as it is taken to be."""

    sentence: str


@frozen
class PositionReport(MountEvent):
    """Where it says it points, ICRS degrees, how it is, and what its clock or site forbids: all, or all but a sync.

    ``target_deg`` is where a slew under way goes, ICRS degrees; ``time_utc`` is when, by the clock that it goes by, and
    ``monotonic_s`` by this computer's: a busy window hears several reports at once.
    """

    icrs_deg: tuple[float, float]
    state: MountState
    can_undo: bool = False
    clock_conflict: str = ""
    slew_block_reason: str = ""
    altaz_deg: tuple[float, float] | None = None  # by the computer's clock and the site
    target_deg: tuple[float, float] | None = None
    time_utc: datetime | None = None
    monotonic_s: float = 0.0


@frozen(eq=False)
class SolvedPosition(MountEvent):
    """A solved frame, and where the mount said it pointed then (ICRS degrees)."""

    solution: Solution
    mount_deg: tuple[float, float]
    when: datetime


@frozen
class PracticeStarted(MountEvent):
    """A simulated telescope has been started: where its mount answers, and its camera's name."""

    port: str
    camera: str


@frozen(eq=False)
class FrameTaken(MountEvent):
    """The camera gave a frame; it is being solved."""

    frame: Frame


@frozen
class OrderProgress(MountEvent):
    """An order is under way."""

    name: str
    progress: Progress


@frozen
class OrderDone(MountEvent):
    """An order came to its end with this result."""

    name: str
    result: Any


@frozen
class OrderFailed(MountEvent):
    """An order did not; ``stopped`` when a person ended it."""

    name: str
    sentence: str
    stopped: bool = False


@frozen
class Stopped(MountEvent):
    """The bytes of Stop have gone to the mount."""


@frozen
class StandsStill(MountEvent):
    """After a Stop the mount was seen to stand still; ``sentence`` is what it did before, if anything."""

    sentence: str = ""


@frozen
class StopFailed(MountEvent):
    """They could not be sent, or did not help: the mount may be moving."""

    sentence: str


@frozen
class LimitReached(MountEvent):
    """Tracking came to the horizon, the meridian or an hour angle, and was stopped where that can be."""

    sentence: str


@frozen
class NoReply(MountEvent):
    """A question was not answered; the next one may be."""

    sentence: str


@frozen
class LineLost(MountEvent):
    """The line broke; ``again`` is what came of the last try to open it anew."""

    sentence: str
    again: str = ""


# All that the window knows of its mount, kept true by the words of its line; nothing of Qt.


@mutable
class MountSnapshot:
    """All that is known; ``moved_since`` says that the sight is from before the last motion.

    ``alarm`` says, until the mount is seen to stand still, that it may still move after a Stop.
    ``busy`` is the name of the order under way, ``doing`` its newest progress, ``target`` the name of where it goes.
    ``stopping``: a Stop went out, and the mount was not seen to stand yet. ``left_deg`` and ``left_s`` are what a slew
    has still to go, None where that is not known.
    """

    phase: str = "off"
    port: str = ""
    connected: Connected | None = None
    report: PositionReport | None = None
    sight: SolvedPosition | None = None
    moved_since: bool = False
    busy: str = ""
    doing: Progress | None = None
    practice: bool = False
    trouble: str = ""
    alarm: str = ""
    target: str = ""
    stopping: bool = False
    left_deg: float | None = None
    left_s: float | None = None
    _speed_deg_s: float = 0.0
    _looked_s: float = 0.0

    @property
    def user(self) -> str:
        """What uses the mount now, in words; empty when nothing does."""
        return action(self.busy).doing or self.busy

    @property
    def slewing(self) -> bool:
        """Whether it said so last."""
        return self.report is not None and bool(self.report.state.slewing)

    @property
    def at_rest(self) -> bool:
        """Whether it says that it stands or tracks, and no order moves it at this moment."""
        if self.phase == "lost" or self.slewing:
            return False
        if self.busy == POLAR:  # while the bolts are turned the mount stands
            return self.doing is not None and self.doing.stage not in (POLAR, "turn")
        return not action(self.busy).may_move

    def hear(self, word: object) -> None:
        """What a :class:`MountEvent` changes; anything else changes nothing."""
        match word:
            case PracticeStarted():
                self.port = word.port
            case SolvedPosition():
                self.sight, self.moved_since = word, False
            case Connected():
                self.phase, self.connected = "on", word
                self.trouble = self.alarm = ""
            case PositionReport():
                self.report, self.trouble = word, ""
                self._measure_way(word)
                if word.state.slewing:
                    self.has_moved()
            # A quick order excludes nothing, so it does not take the place of the one under way.
            case OrderProgress() if not action(word.name).quick:
                self.busy, self.doing = word.name, word.progress
                if word.progress.stage == "goto" and word.progress.detail:
                    self.target = word.progress.detail
            case OrderDone() | OrderFailed() if not action(word.name).quick:
                self.busy, self.doing, self.target = "", None, ""
                if action(word.name).moves:
                    self.has_moved()
            case LineLost():
                self.phase, self.left_deg, self.left_s = "lost", None, None
            case Stopped():
                self.stopping = True
            case NoReply():
                self.trouble = word.sentence
            case StopFailed():
                self.trouble = self.alarm = word.sentence
                self.stopping = False
            case StandsStill():
                self.alarm, self.stopping = "", False

    def _measure_way(self, report: PositionReport) -> None:
        """What a slew has still to go: its speed is that of the newest readings, for mounts ramp up and down."""
        before, self.left_deg = self.left_deg, None
        if report.target_deg is None:
            self.left_s, self._speed_deg_s = None, 0.0
            return
        self.left_deg = left = apart_deg(report.icrs_deg, report.target_deg)
        passed_s, self._looked_s = report.monotonic_s - self._looked_s, report.monotonic_s
        if before is not None and passed_s > 0.0:
            speed = max(0.0, before - left) / passed_s
            self._speed_deg_s = speed if self._speed_deg_s == 0.0 else 0.3 * self._speed_deg_s + 0.7 * speed
        self.left_s = left / self._speed_deg_s if self._speed_deg_s > SLOW_DEG_S else None

    def has_moved(self) -> None:
        """What was seen last is of another place."""
        self.moved_since = self.sight is not None

    def has_synced(self) -> None:
        """After a sync the mount says something else of the place of the last frame."""
        if self.sight is not None and self.report is not None:
            self.sight = SolvedPosition(self.sight.solution, self.report.icrs_deg, self.sight.when)
            self.moved_since = False
