"""The adjusting phase: the live error while a person turns the bolts, and the tutor's words."""

from dataclasses import dataclass
from enum import StrEnum

from app.core.progress import Task
from app.core.solution import NoSolution
from app.polar.findings import Kind
from app.polar.history import History
from app.polar.live import LiveError, LivePhase
from app.polar.measure import Measurement
from app.polar.steady import Steady, SteadyError
from app.polar.tutor import BoltTutor, Instruction, Step
from app.workflows.polar_sources import SightingSource
from app.workflows.polar_update import PolarControls, PolarUpdate

SURE_FRAMES = 5
"""So many quiet frames before the tutor's Stop is taken for the end."""

QUIET_FRAMES = 40
"""After so many the same is said anew from what is known by then."""


class End(StrEnum):
    """Why adjusting ended."""

    THERE = "there"
    LARGE_MOVE = "large move"
    ASKED = "asked"
    SECOND_SWEEP = "second sweep"


@dataclass(frozen=True, slots=True)
class Adjusted:
    """Why it ended, whether a bolt was asked to turn, and the last reading, no measurement."""

    end: End
    turned: bool
    last: SteadyError | None


class Adjuster:
    """Turns live frames into instructions; one call of :meth:`see` a frame."""

    def __init__(self, measurement: Measurement, tutor: BoltTutor) -> None:
        self.live = LivePhase(measurement)
        self.steady = Steady()
        self.tutor = tutor
        self._heard = 0  # movements already answered
        tutor.measured_again()
        self.instruction = tutor.advise(measurement.error)
        self.asked = self.instruction.knob is not None

    def see(self, live: LiveError, turned: bool) -> tuple[SteadyError, Instruction]:
        """The quiet mean and what to do; a new instruction once the axis moved and settled."""
        if turned and self.instruction.knob is not None:
            self.steady.forget()
            self._heard = -1
        steady = self.steady.update(live)
        if steady.settled and self._heard != self.steady.movements:
            self._heard = self.steady.movements
            self.instruction = self.tutor.advise(steady.error, noise_arcsec=steady.noise_arcsec)
        elif steady.frames == (SURE_FRAMES if self._stopped else QUIET_FRAMES):
            # Better known by now, and no bolt was seen to turn: nothing is learned from it.
            self.instruction = self.tutor.advise(steady.error, turned=0.0)
        self.asked = self.asked or self.instruction.knob is not None
        return steady, self.instruction

    @property
    def _stopped(self) -> bool:
        return self.instruction.step is Step.STOP


def adjust(
    source: SightingSource,
    measurement: Measurement,
    tutor: BoltTutor,
    controls: PolarControls | None = None,
    history: History | None = None,
) -> Task[Adjusted]:
    """Follow the axis until the tutor says Stop, a large move asks to measure, or a person does."""
    controls, history = controls or PolarControls(), history or History()
    adjuster, steady = Adjuster(measurement, tutor), None
    history.told(measurement.time_utc, measurement.error, adjuster.instruction.words)
    yield _update(None, None, adjuster, measurement)
    while True:
        found = yield from source.sight()
        if controls.take_remeasure() or controls.take_enough():
            return Adjusted(End.ASKED, adjuster.asked, steady)
        if controls.second_sweep_wanted:
            return Adjusted(End.SECOND_SWEEP, adjuster.asked, steady)
        if found is None or isinstance(found, NoSolution):
            yield _unsolved(found, steady, adjuster, measurement)
            continue
        told = adjuster.instruction
        live = adjuster.live.update(found)
        steady, instruction = adjuster.see(live, controls.take_turned())
        history.live(found.time_utc, steady.error)
        if instruction is not told:
            history.told(found.time_utc, steady.error, instruction.words)
        yield _update(live, steady, adjuster, measurement)
        if instruction.step is Step.STOP and steady.settled and steady.frames >= SURE_FRAMES:
            return Adjusted(End.THERE, adjuster.asked, steady)
        if steady.settled and any(f.kind is Kind.REMEASURE for f in live.findings):
            return Adjusted(End.LARGE_MOVE, adjuster.asked, steady)


def _update(
    live: LiveError | None, steady: SteadyError | None, adjuster: Adjuster, start: Measurement
) -> PolarUpdate:
    return PolarUpdate(
        "adjust", None, adjuster.instruction.words, measurement=start, live=live, steady=steady,
        instruction=adjuster.instruction, moves=adjuster.tutor.moves,
        findings=() if live is None else live.findings,
    )  # fmt: skip


def _unsolved(
    found: NoSolution | None, steady: SteadyError | None, adjuster: Adjuster, start: Measurement
) -> PolarUpdate:
    why = "waiting for a frame" if found is None else f"{found.reason}: {found.advice}"
    return PolarUpdate(
        "adjust", None, why, measurement=start, steady=steady, solved=False,
        instruction=adjuster.instruction, moves=adjuster.tutor.moves,
    )  # fmt: skip
