"""What a polar alignment says while it goes on, and what a person can say to it."""

import threading
from dataclasses import dataclass, field

from app.core.progress import Progress
from app.polar.findings import Finding
from app.polar.live import LiveError
from app.polar.measure import Measurement
from app.polar.steady import SteadyError
from app.polar.tutor import Instruction


@dataclass(frozen=True, slots=True)
class PolarUpdate(Progress):
    """Progress with everything a screen shows; what does not belong to the phase is None.

    ``stage`` is "measure", "turn", "adjust" or "done"; ``detail`` is a sentence for the person.
    ``more_turn_deg`` is how much further to turn for the goal: 0 enough, None not known.
    ``solved`` tells whether the newest frame had an answer; ``moves`` counts the bolts' movements.
    """

    measurement: Measurement | None = None
    live: LiveError | None = None
    steady: SteadyError | None = None
    instruction: Instruction | None = None
    findings: tuple[Finding, ...] = ()
    more_turn_deg: float | None = None
    solved: bool = True
    frames: int = 0
    moves: int = 0


@dataclass(slots=True)
class PolarControls:
    """Buttons beside a running alignment; safe to press from any thread."""

    _turned: threading.Event = field(default_factory=threading.Event)
    _remeasure: threading.Event = field(default_factory=threading.Event)
    _enough: threading.Event = field(default_factory=threading.Event)
    _second: threading.Event = field(default_factory=threading.Event)

    def turned(self) -> None:
        """The bolt was turned as told: go on even if nothing was seen to move."""
        self._turned.set()

    def remeasure(self) -> None:
        """Measure again now."""
        self._remeasure.set()

    def enough(self) -> None:
        """Accept the frames taken, or leave the bolts, and go on to the next phase."""
        self._enough.set()

    def second_sweep(self) -> None:
        """Sweep again at another declination, to see how the tube bends."""
        self._second.set()

    @property
    def second_sweep_wanted(self) -> bool:
        """Whether it was pressed and nobody has answered yet."""
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
