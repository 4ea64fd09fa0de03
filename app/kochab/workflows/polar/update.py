"""What a polar alignment reports while it runs, and the buttons a person can press."""

from enum import StrEnum

from kochab.core.mount import Direction
from kochab.core.progress import Progress
from kochab.core.values import frozen
from kochab.polar.drift import Drift
from kochab.polar.live import LiveError, SteadyError
from kochab.polar.measure import Measurement, PolarFinding
from kochab.polar.tutor import Instruction
from kochab.text.translation import tr_noop


@frozen
class PolarUpdate(Progress):
    """Progress with everything a screen shows; what does not belong to the phase is None.

    ``stage`` is "measure", "turn", "adjust" or "done"; ``detail`` is a sentence for the person.
    ``more_turn_deg`` is how much further to turn for the goal: 0 enough, None not known.
    ``solved`` tells whether the newest frame had a solution; ``moves`` counts the bolts' movements. ``drift`` is an
    axis by drift, in place of a measurement; ``notes`` are what else is known in the end.
    """

    measurement: Measurement | None = None
    live: LiveError | None = None
    steady: SteadyError | None = None
    instruction: Instruction | None = None
    findings: tuple[PolarFinding, ...] = ()
    more_turn_deg: float | None = None
    solved: bool = True
    moves: int = 0
    drift: Drift | None = None
    notes: str = ""


@frozen
class TurnInstruction(Progress):
    """A person is asked to turn an axis: RA east or west, declination north or south."""

    direction: Direction = Direction.WEST
    degrees: float = 0.0


class PolarButton(StrEnum):
    """What a person may press while an alignment runs."""

    TURNED = tr_noop("the axis or bolt was turned as asked: go on even if the frames show no motion")
    REMEASURE = tr_noop("measure again now")
    ENOUGH = tr_noop("accept the frames taken, or leave the bolts, and go on to the next phase")
    BACK = tr_noop("turn RA back to the start and take one more frame, to check for slip")
    SECOND_SWEEP = tr_noop("sweep again at another declination, to measure flexure")


class PolarControls:
    """Buttons beside a running alignment; safe to press from any thread."""

    def __init__(self) -> None:
        self._pressed: set[PolarButton] = set()

    def press(self, button: PolarButton) -> None:
        """Press it; pressed again before it was taken it counts once."""
        self._pressed.add(button)

    def pressed(self, button: PolarButton) -> bool:
        """Whether it was pressed and not taken yet."""
        return button in self._pressed

    def take(self, button: PolarButton) -> bool:
        """Whether it was pressed since last taken."""
        pressed = self.pressed(button)  # set operations alone: no lock is needed between threads
        self._pressed.discard(button)
        return pressed
