"""What a polar alignment reports while it runs, and the buttons a person can press."""

import threading
from dataclasses import dataclass, field

from kochab.core.mount import Direction
from kochab.core.progress import Progress
from kochab.polar.live import LiveError, SteadyError
from kochab.polar.measure import Measurement, PolarFinding
from kochab.polar.tutor import Instruction


@dataclass(frozen=True, slots=True)
class PolarUpdate(Progress):
    """Progress with everything a screen shows; what does not belong to the phase is None.

    ``stage`` is "measure", "turn", "adjust" or "done"; ``detail`` is a sentence for the person.
    ``more_turn_deg`` is how much further to turn for the goal: 0 enough, None not known.
    ``solved`` tells whether the newest frame had a solution; ``moves`` counts the bolts' movements.
    """

    measurement: Measurement | None = None
    live: LiveError | None = None
    steady: SteadyError | None = None
    instruction: Instruction | None = None
    findings: tuple[PolarFinding, ...] = ()
    more_turn_deg: float | None = None
    solved: bool = True
    frames: int = 0
    moves: int = 0


@dataclass(frozen=True, slots=True)
class TurnInstruction(Progress):
    """A person is asked to turn an axis: RA east or west, declination north or south."""

    direction: Direction = Direction.WEST
    degrees: float = 0.0


@dataclass(slots=True)
class PolarControls:
    """Buttons beside a running alignment; safe to press from any thread."""

    _turned: threading.Event = field(default_factory=threading.Event)
    _remeasure: threading.Event = field(default_factory=threading.Event)
    _enough: threading.Event = field(default_factory=threading.Event)
    _second: threading.Event = field(default_factory=threading.Event)

    def turned(self) -> None:
        """The axis or bolt was turned as asked: go on even if the frames show no motion."""
        self._turned.set()

    def remeasure(self) -> None:
        """Measure again now."""
        self._remeasure.set()

    def enough(self) -> None:
        """Accept the frames taken, or leave the bolts, and go on to the next phase."""
        self._enough.set()

    def second_sweep(self) -> None:
        """Sweep again at another declination, to measure flexure."""
        self._second.set()

    @property
    def second_sweep_wanted(self) -> bool:
        """Whether it was pressed and not taken yet."""
        return self._second.is_set()

    def take_second_sweep(self) -> bool:
        """Whether it was pressed since last asked."""
        return _take(self._second)

    def take_turned(self) -> bool:
        """Whether it was pressed since last asked."""
        return _take(self._turned)

    def take_remeasure(self) -> bool:
        """Whether it was pressed since last asked."""
        return _take(self._remeasure)

    def take_enough(self) -> bool:
        """Whether it was pressed since last asked."""
        return _take(self._enough)


def _take(event: threading.Event) -> bool:
    pressed = event.is_set()
    event.clear()
    return pressed
