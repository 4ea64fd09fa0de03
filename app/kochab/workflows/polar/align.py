"""Polar alignment: measure the axis, turn the bolts, measure again until it is good."""

from collections.abc import Callable
from dataclasses import field, replace
from enum import StrEnum
from typing import Protocol

import numpy as np

from kochab.core.attitude import ARCSEC
from kochab.core.errors import RefusedError
from kochab.core.progress import Task
from kochab.core.solution import NoSolution
from kochab.core.values import frozen
from kochab.gear.adjusters import AdjusterAxis
from kochab.polar.camera_axis import CameraAxis, with_axis_seen_before
from kochab.polar.error import Knob, PolarError, angle_in_words, split_in_words, total_in_words
from kochab.polar.flexure import UNKNOWN
from kochab.polar.live import LiveError, LivePhase, Steady, SteadyError
from kochab.polar.measure import Measurement, MeasureSettings, PolarFinding, PolarFindingKind, combine_measurements
from kochab.polar.report import History
from kochab.polar.rotations import tangents
from kochab.polar.sighting import to_local
from kochab.polar.tutor import BoltTutor, Instruction, TutorStep
from kochab.text.translation import tr, tr_noop
from kochab.workflows.polar.measure import Measured, Sweep, Turner, back_at_start, measure_axis, second_sweep
from kochab.workflows.polar.sources import SightingSource
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate

# -- The adjusting phase: the live error while a person turns the bolts, and the instructions ----

SURE_FRAMES = 5  # so many quiet frames before the tutor's Stop is taken for the end
MOVED2, LEAST_NOISE_ARCSEC = 16.0, 1.0  # squared distance in sigmas beyond which the axis is not where it was measured
QUIET_FRAMES = 40  # after so many the instruction is made anew from what is known by then


class AdjustingEnd(StrEnum):
    """Why adjusting ended."""

    THERE = "there"
    LARGE_MOVE = tr_noop("large move")
    DEC_MOVED = tr_noop("declination moved")
    REQUESTED = "requested"
    SECOND_SWEEP = tr_noop("second sweep")


SPOILT = {PolarFindingKind.REMEASURE: AdjustingEnd.LARGE_MOVE, PolarFindingKind.DEC_MOVED: AdjustingEnd.DEC_MOVED}
"""What makes the live error worthless, so that it is measured again by itself."""


@frozen
class Adjusted:
    """Why it ended, whether a bolt was asked to turn, the last reading (not a measurement), and what took it."""

    end: AdjustingEnd
    turned: bool
    last: SteadyError | None
    live: LivePhase


class Motors(Protocol):
    """Motorised adjusters."""

    def move(self, axis: AdjusterAxis, amount: float) -> Task[None]:
        """Move one by so many of its own units and wait until it rests; raises DeviceError."""


AXES = {Knob.AZIMUTH: AdjusterAxis.AZIMUTH, Knob.ALTITUDE: AdjusterAxis.ALTITUDE}
TRIED = {
    Knob.ALTITUDE: tr_noop("The altitude motor makes a small move to see which way it goes."),
    Knob.AZIMUTH: tr_noop("The azimuth motor makes a small move to see which way it goes."),
}
DRIVEN = {
    Knob.ALTITUDE: tr_noop("The altitude motor moves. {left} to go. Keep clear."),
    Knob.AZIMUTH: tr_noop("The azimuth motor moves. {left} to go. Keep clear."),
}
UNSEEN = {
    Knob.ALTITUDE: tr_noop("The altitude motor does not move the axis. Is it coupled, and the other bolts loose?"),
    Knob.AZIMUTH: tr_noop("The azimuth motor does not move the axis. Is it coupled, and the other bolts loose?"),
}
CROSSED = {
    Knob.ALTITUDE: tr_noop("The altitude motor moves azimuth. Swap its cables, or check the clock and time zone."),
    Knob.AZIMUTH: tr_noop("The azimuth motor moves altitude. Swap its cables, or check the clock and time zone."),
}
# A board has units of its own: a turn to the tutor is 4 of them at first, and grows until the axis is seen to move.
FIRST_UNITS, GROWTH, MOST_UNITS = 4.0, 8.0, 500_000.0  # of a board, for what the tutor calls a turn


class MotorisedBolts:
    """Lets motors do what the tutor asks for. Their pitch, sense and backlash are found out by its test moves.

    A test that shows nothing is made 8 times larger the next time: no motor goes far before it is known.
    """

    def __init__(self, motors: Motors, tutor: BoltTutor) -> None:
        self._motors, self._tutor = motors, tutor
        self._units: dict[Knob, float] = {}

    def shown(self, asked: Instruction, error: PolarError) -> Instruction:
        """The instruction as it is told to somebody who has nothing to turn."""
        if asked.knob is None:
            return asked
        text = (TRIED if asked.step is TutorStep.TEST else DRIVEN)[asked.knob]
        return Instruction(asked.step, tr(text, left=angle_in_words(error.knob_arcsec(asked.knob))))

    def follow(self, asked: Instruction) -> Task[None]:
        """Do it; RefusedError when the axis is not seen to follow a motor."""
        knob = asked.knob
        if knob is None:
            return
        units = self._units.get(knob)
        if self._tutor.crosses(knob):
            raise RefusedError(CROSSED[knob])
        if asked.step is TutorStep.TEST and units is not None and not asked.stray:
            units *= GROWTH
            self._tutor.forget(knob)  # what it learned was of smaller units
            if units > MOST_UNITS:
                raise RefusedError(UNSEEN[knob])
        self._units[knob] = units or FIRST_UNITS
        yield from self._motors.move(AXES[knob], asked.turns * self._units[knob])


class AdjustmentGuide:
    """Turns live frames into instructions; one call of :meth:`see` a frame."""

    def __init__(self, measurement: Measurement, tutor: BoltTutor, bolts: MotorisedBolts | None = None) -> None:
        self.bolts = bolts
        self.live = LivePhase(measurement)
        self._measured = measurement.error
        self.steady = Steady()
        self.tutor = tutor
        self._heard = 0  # movements already answered
        tutor.measured_again()
        self.instruction = tutor.advise(measurement.error)
        self.turn_requested = self.instruction.knob is not None

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
            # Better known by now, and no bolt was seen to turn: nothing is learned about it.
            self.instruction = self.tutor.advise(steady.error, turned=0.0)
        self.turn_requested = self.turn_requested or self.instruction.knob is not None
        return steady, self.instruction

    def shown(self, error: PolarError) -> Instruction:
        """The instruction as it is told."""
        return self.instruction if self.bolts is None else self.bolts.shown(self.instruction, error)

    def _fresh_stop(self, steady: SteadyError) -> bool:
        """Whether a measurement said Stop and nothing was asked, turned or seen to move since.

        A reading is never more certain than the measurement it builds on: it may not overrule it.
        """
        return self._stopped and not self.turn_requested and not _moved(self._measured, steady)

    @property
    def _stopped(self) -> bool:
        return self.instruction.step is TutorStep.STOP


def adjust(
    source: SightingSource,
    measurement: Measurement,
    tutor: BoltTutor,
    controls: PolarControls | None = None,
    history: History | None = None,
    bolts: MotorisedBolts | None = None,
) -> Task[Adjusted]:
    """Follow the axis until the tutor says Stop, or something or somebody asks to measure.

    Raises DeviceError when a motor does not do as it should.

    Parameters
    ----------
    source : SightingSource
        Gives solved frames.
    measurement : Measurement
        Where the axis is.
    tutor : BoltTutor
        Says how to turn the bolts.
    controls : PolarControls or None
        What the person presses; None: nothing.
    history : History or None
        Takes what happens; None: it is dropped.
    bolts : MotorisedBolts or None
        Their motors; None: a hand turns them.
    """
    controls, history = controls or PolarControls(), history or History()
    guide, steady = AdjustmentGuide(measurement, tutor, bolts), None
    followed: Instruction | None = None
    controls.take(PolarButton.TURNED)  # pressed for the axis: it is no bolt's
    history.instruction(measurement.time_utc, measurement.error, guide.shown(measurement.error).words)
    yield _update(None, None, guide, measurement)
    while True:
        if bolts is not None and guide.instruction is not followed:
            followed = guide.instruction
            yield from bolts.follow(followed)
            if followed.knob is not None:
                controls.press(PolarButton.TURNED)
                yield from source.sight()  # exposed while the motor went
        found = yield from source.sight()
        if (
            controls.take(PolarButton.REMEASURE)
            or controls.take(PolarButton.ENOUGH)
            or controls.pressed(PolarButton.BACK)
        ):
            return Adjusted(AdjustingEnd.REQUESTED, guide.turn_requested, steady, guide.live)
        if controls.pressed(PolarButton.SECOND_SWEEP):
            return Adjusted(AdjustingEnd.SECOND_SWEEP, guide.turn_requested, steady, guide.live)
        if found is None or isinstance(found, NoSolution):
            why = tr("Waiting for a frame") if found is None else f"{tr(found.reason)}: {found.advice}"
            yield _update(None, steady, guide, measurement, why)
            continue
        before = guide.instruction
        settings = measurement.settings
        live = guide.live.update(to_local(found, settings.site, settings.refraction))
        steady, instruction = guide.see(live, controls.take(PolarButton.TURNED))
        history.live(found.time_utc, steady.error)
        if instruction is not before:
            history.instruction(found.time_utc, steady.error, guide.shown(steady.error).words)
        yield _update(live, steady, guide, measurement)
        if instruction.step is TutorStep.STOP and instruction.stray:
            raise RefusedError(instruction.words)
        if instruction.step is TutorStep.STOP and steady.settled and steady.frames >= SURE_FRAMES:
            return Adjusted(AdjustingEnd.THERE, guide.turn_requested, steady, guide.live)
        spoilt = {f.kind for f in live.findings} & set(SPOILT)
        if steady.settled and spoilt:
            return Adjusted(SPOILT[spoilt.pop()], guide.turn_requested, steady, guide.live)


def _moved(measured: PolarError, steady: SteadyError) -> bool:
    """Whether a quiet reading shows the axis elsewhere than it was measured, noise considered."""
    gap = np.stack(tangents(measured.axis)) @ (steady.error.axis - measured.axis) / ARCSEC
    return bool(np.sum((gap / np.maximum(steady.noise_arcsec, LEAST_NOISE_ARCSEC)) ** 2) > MOVED2)


def _update(
    live: LiveError | None, steady: SteadyError | None, guide: AdjustmentGuide, start: Measurement, unsolved: str = ""
) -> PolarUpdate:
    error = start.error if steady is None else steady.error
    asked = guide.shown(error)
    words, found = unsolved or asked.with_amounts(error), () if live is None else live.findings
    if asked.step is TutorStep.STOP:  # which says the same
        found = tuple(finding for finding in found if finding.kind is not PolarFindingKind.DONE)
    if live is not None and guide.tutor.witness:
        found = (*found, PolarFinding(PolarFindingKind.CLOCK, guide.tutor.witness))
    shown = (start, live, steady, asked, found)
    return PolarUpdate("adjust", None, words, *shown, solved=not unsolved, moves=guide.tutor.moves)


MOST_ROUNDS = 9
ROUGH_SHARE = 0.6
"""Of the goal, which the uncertainty has to be below where the hand at the bolts is rough."""
MOST_QUIET = 5
"""Measurements one after another without a turn of a bolt, after which a rough hand is told where it stands."""


@frozen
class AlignOptions:
    """When it is good: the total and ``sure`` of its sigmas are within ``goal_arcsec``.

    ``sweep`` is how to measure. With ``second_sweep`` one at another declination follows the first,
    before any bolt is turned, and measures flexure; without it only when a person asks.
    """

    goal_arcsec: float = 30.0
    sure: float = 3.0
    sweep: Sweep = field(default_factory=Sweep)
    second_sweep: bool = False


@frozen(eq=False)
class Alignment:
    """How it ended: the last measurement, the bolts' moves, and everything that happened."""

    last: Measurement
    good: bool
    rounds: int
    moves: int
    history: History


def align(
    source: SightingSource,
    turner: Turner,
    settings: MeasureSettings,
    options: AlignOptions | None = None,
    controls: PolarControls | None = None,
    tutor: BoltTutor | None = None,
    keep: Callable[[History], None] = lambda history: None,
    motors: Motors | None = None,
) -> Task[Alignment]:
    """Measure, adjust and measure again until the error is small or within its uncertainty.

    Raises `NotMeasuredError` when a measurement failed, and `DeviceError` when the camera or the mount did, or the
    guard refused.

    Parameters
    ----------
    source : SightingSource
        Gives solved frames.
    turner : Turner
        Turns the RA axis between them.
    settings : MeasureSettings
        Site, pole and refraction.
    options : AlignOptions or None
        How sure and how often; None for the usual.
    controls : PolarControls or None
        What the person presses; None: nothing.
    tutor : BoltTutor or None
        Says how to turn the bolts; None: one that knows nothing of them yet.
    keep : Callable[[History], None]
        Called with the history after every measurement, so that nothing is lost.
    motors : Motors or None
        Of the bolts; None: a hand turns them.
    """
    options, controls = options or AlignOptions(), controls or PolarControls()
    tutor, history = tutor or BoltTutor(), History()
    bolts = None if motors is None else MotorisedBolts(motors, tutor)
    sweep, rounds, droop, wanted = options.sweep, 0, UNKNOWN, options.second_sweep
    quiets = 0  # measurements one after another on which no bolt was turned
    before: Measurement | None = None
    live: LivePhase | None = None
    in_camera: CameraAxis | None = None

    def agreeing(found: Measurement) -> LiveError | None:
        """What the measurement before reads in the first frame of one within the goal, where both agree."""
        if live is None or not _reaches_goal(found, options):
            return None
        read = live.update(found.attitudes[0])
        return read if _agree(read, found.error) else None

    while True:
        rounds += 1
        measured = yield from measure_axis(source, turner, settings, sweep, controls, droop, agreeing)
        if turner.by_hand and (read := agreeing(measured.measurement)) is not None:
            measured = _seconded(read.error, measured)
        if controls.take(PolarButton.BACK):
            measured = yield from back_at_start(source, turner, measured, controls)
        if before is not None:
            both = combine_measurements(before, measured.measurement)
            measured = replace(measured, measurement=both, findings=both.findings)
        else:
            measured = replace(measured, measurement=with_axis_seen_before(measured.measurement, in_camera))
        history.measured(measured.measurement)
        keep(history)
        if controls.take(PolarButton.SECOND_SWEEP) or wanted:
            first, measured = measured, (yield from second_sweep(source, turner, measured, sweep, controls))
            wanted, droop = False, measured.measurement.droop
            if measured is not first:
                history.measured(measured.measurement)
                keep(history)
        error = measured.measurement.error
        enough = good(measured.measurement, options, tutor.rough)
        if enough or rounds == MOST_ROUNDS:
            yield _done(measured, enough, tutor.moves)
            return Alignment(measured.measurement, enough, rounds, tutor.moves, history)
        backwards, turn = measured.ahead
        sweep = replace(sweep, backwards=backwards, turn_deg=turn)  # RA goes back the way it came
        if measured.measurement.spoilt:
            yield _spoilt(measured, tutor.moves)
            before = in_camera = None
            continue
        likely = error.total_arcsec + error.sigma_total_arcsec <= options.goal_arcsec
        if likely and before is None:  # only not sure: a second sweep costs no move of a bolt
            before = measured.measurement
            doubt = _once_more(measured, tutor.moves)
            history.instruction(before.time_utc, error, doubt.detail)
            yield doubt
            continue
        adjusted = yield from adjust(source, measured.measurement, tutor, controls, history, bolts)
        quiet = adjusted.end is AdjustingEnd.THERE and not adjusted.turned
        quiets = quiets + 1 if quiet else 0
        if tutor.rough and found_enough(measured.measurement, options, quiets):  # it is as near as this hand goes
            yield _done(measured, False, tutor.moves)
            return Alignment(measured.measurement, False, rounds, tutor.moves, history)
        before = measured.measurement if quiet else None  # no bolt was turned: both count
        live = adjusted.live if adjusted.end is AdjustingEnd.THERE else None
        in_camera = adjusted.live.camera_axis


def _reaches_goal(found: Measurement, options: AlignOptions) -> bool:
    """Whether the total and some of its sigmas are within the goal."""
    reach = found.error.total_arcsec + options.sure * found.error.sigma_total_arcsec
    return not found.spoilt and reach <= options.goal_arcsec


def good(found: Measurement, options: AlignOptions, rough: bool = False) -> bool:
    """Whether it is within the goal for sure, or within an uncertainty that is itself no larger than the goal.

    Parameters
    ----------
    found : Measurement
        The last, with those before it since a bolt was turned.
    options : AlignOptions
        The goal.
    rough : bool
        Whether the hand was: it has left the axis anywhere within its own width, not near the pole, so that the
        uncertainty has to be smaller.
    """
    small = found.error.uncertainty_arcsec <= (ROUGH_SHARE if rough else 1.0) * options.goal_arcsec
    return _reaches_goal(found, options) or (not found.spoilt and found.error.below_uncertainty and small)


def found_enough(found: Measurement, options: AlignOptions, quiets: int) -> bool:
    """Whether more sweeps on which no bolt is turned, ``quiets`` so far, would tell hardly more."""
    sure = found.error.uncertainty_arcsec <= ROUGH_SHARE * options.goal_arcsec
    return quiets >= (2 if sure else MOST_QUIET)


AGREE2 = 9.0  # squared distance in sigmas, two dimensions: one in 90 that agree are taken for others


def _agree(read: LiveError, found: PolarError) -> bool:
    """Whether two frames find the axis where an earlier measurement reads it: alone they could not show a slip."""
    gap = np.stack(tangents(found.axis)) @ (read.error.axis - found.axis)
    chi2 = float(gap @ np.linalg.solve(read.error.covariance + found.covariance, gap))
    return chi2 <= AGREE2 and not any(finding.spoils for finding in read.findings)


def _seconded(read: PolarError, measured: Measured) -> Measured:
    """The measurement with no more creep than two sweeps allow that went opposite ways: half of what they differ by."""
    found, error = measured.measurement, measured.measurement.error
    gap = np.stack(tangents(error.axis)) @ (read.axis - error.axis)
    creep = (np.outer(gap, gap) + read.covariance + error.covariance) / 4.0
    if np.trace(creep) < np.trace(error.creep):
        error = replace(error, creep=creep)
    kept, flexure_findings = (
        tuple(one for one in findings if one.kind is not PolarFindingKind.UNCHECKED)
        for findings in (found.findings, measured.findings)
    )
    return replace(measured, measurement=replace(found, error=error, findings=kept), findings=flexure_findings)


def _spoilt(measured: Measured, moves: int) -> PolarUpdate:
    words = next(finding.text for finding in measured.measurement.findings if finding.spoils)
    words += tr(" Don't turn a bolt: measuring again.")
    shown = measured.measurement
    return PolarUpdate("measure", None, words, measurement=shown, findings=measured.findings, moves=moves)


def _once_more(measured: Measured, moves: int) -> PolarUpdate:
    error = measured.measurement.error
    words = tr(
        "{angle} is within the goal, but the uncertainty is {angle2}. Don't touch the bolts: measuring once more.",
        angle=angle_in_words(error.total_arcsec),
        angle2=angle_in_words(error.sigma_total_arcsec),
    )
    return PolarUpdate(
        "measure", None, words, measurement=measured.measurement, findings=measured.findings, moves=moves
    )


def _done(measured: Measured, good: bool, moves: int) -> PolarUpdate:
    error = measured.measurement.error
    words = tr("Polar alignment error: {total_in_words}.", total_in_words=total_in_words(error))
    if measured.measurement.spoilt:
        words = tr(
            "Unusable: don't adjust. {findings}",
            findings=next(f.text for f in measured.measurement.findings if f.spoils),
        )
    elif not good:
        words += tr(" Not good yet: find the cause and start again.")
    words += tr(" Uncertainty: {split_in_words}.", split_in_words=split_in_words(error))
    if len(measured.measurement.results) == 1 and measured.measurement.before == UNKNOWN:
        words += tr(" Sweep again at another declination to measure flexure.")
    return PolarUpdate("done", 1.0, words, measurement=measured.measurement, findings=measured.findings, moves=moves)
