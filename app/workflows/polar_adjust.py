"""The adjusting phase: the live error while a person turns the bolts, and the tutor's words."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from app.core.progress import Task
from app.core.solution import NoSolution
from app.polar.error import PolarError
from app.polar.findings import Kind
from app.polar.history import History
from app.polar.live import LiveError, LivePhase
from app.polar.measure import Measurement
from app.polar.rotations import ARCSEC, tangents
from app.polar.steady import Steady, SteadyError
from app.polar.tutor import BoltTutor, Instruction, Step
from app.workflows.polar_sources import SightingSource
from app.workflows.polar_update import PolarControls, PolarUpdate

SURE_FRAMES = 5
"""So many quiet frames before the tutor's Stop is taken for the end."""

MOVED2, LEAST_NOISE_ARCSEC = 16.0, 1.0
"""Squared distance in sigmas beyond which the axis is not where it was measured."""

QUIET_FRAMES = 40
"""After so many the same is said anew from what is known by then."""


class End(StrEnum):
    """Why adjusting ended."""

    THERE = "there"
    LARGE_MOVE = "large move"
    DEC_MOVED = "declination moved"
    ASKED = "asked"
    SECOND_SWEEP = "second sweep"


SPOILT = {Kind.REMEASURE: End.LARGE_MOVE, Kind.DEC_MOVED: End.DEC_MOVED}
"""What makes the live error worthless, so that it is measured again by itself."""


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
        self._measured = measurement.error
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
        if self._fresh_stop(steady):
            return steady, self.instruction
        if steady.settled and self._heard != self.steady.movements:
            self._heard = self.steady.movements
            self.instruction = self.tutor.advise(steady.error, noise_arcsec=steady.noise_arcsec)
        elif steady.frames == (SURE_FRAMES if self._stopped else QUIET_FRAMES):
            # Better known by now, and no bolt was seen to turn: nothing is learned from it.
            self.instruction = self.tutor.advise(steady.error, turned=0.0)
        self.asked = self.asked or self.instruction.knob is not None
        return steady, self.instruction

    def _fresh_stop(self, steady: SteadyError) -> bool:
        """Whether a measurement said Stop and nothing was asked, turned or seen to move since.

        A reading is never surer than the measurement that it leans on: it may not overrule it.
        """
        return self._stopped and not self.asked and not _moved(self._measured, steady)

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
    """Follow the axis until the tutor says Stop, or something or somebody asks to measure."""
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
        spoilt = {f.kind for f in live.findings} & set(SPOILT)
        if steady.settled and spoilt:
            return Adjusted(SPOILT[spoilt.pop()], adjuster.asked, steady)


def _moved(measured: PolarError, steady: SteadyError) -> bool:
    """Whether a quiet reading shows the axis elsewhere than it was measured, noise considered."""
    gap = np.stack(tangents(measured.axis)) @ (steady.error.axis - measured.axis) / ARCSEC
    return bool(np.sum((gap / np.maximum(steady.noise_arcsec, LEAST_NOISE_ARCSEC)) ** 2) > MOVED2)


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
