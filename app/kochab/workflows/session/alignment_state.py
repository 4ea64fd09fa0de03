"""The state of an alignment: one frozen value that every screen shows."""

from dataclasses import replace

from kochab.core.progress import Progress
from kochab.core.values import frozen
from kochab.polar.drift import Drift
from kochab.polar.error import Knob, PolarError, total_in_words
from kochab.polar.measure import PolarFinding, PolarFindingKind
from kochab.polar.plan import creep_to_show_arcsec
from kochab.polar.sighting import LocalAttitude
from kochab.polar.tutor import Instruction, TutorStep
from kochab.text.translation import number, tr, tr_noop
from kochab.workflows.polar.update import PolarUpdate, TurnInstruction

OLD_S = 6.0
HANDS_OFF = tr_noop("Measuring. Hands off the mount.")
LOCKED = tr_noop("Both axes locked? From here on adjust only altitude and azimuth.")
PAST = 400  # points of the trail that are kept

Point = tuple[float, float]  # azimuth on the sky, altitude; arcsec


@frozen
class AlignmentState:
    """``words`` say what to do, ``detail`` what goes on meanwhile.

    ``turn_instruction`` is the turn that a person is asked for, ``error_at_s`` when the newest error came,
    on the clock of whoever absorbs; ``trail`` are the
    axes seen while adjusting, ``measured`` the errors of the measurements. ``drift`` is what ``error`` is of, where
    nobody turned the axis. ``creep_arcsec`` is what one more frame where the sweep began would show; 0: nothing.
    ``attitude`` is of the newest frame while adjusting.
    """

    stage: str = "idle"
    words: str = ""
    detail: str = ""
    fraction: float | None = None
    error: PolarError | None = None
    live: bool = False
    solved: bool = True
    instruction: Instruction | None = None
    turn_instruction: TurnInstruction | None = None
    findings: tuple[PolarFinding, ...] = ()
    more_turn_deg: float | None = None
    error_at_s: float = 0.0
    trail: tuple[Point, ...] = ()
    measured: tuple[PolarError, ...] = ()
    drift: Drift | None = None
    creep_arcsec: float = 0.0
    attitude: LocalAttitude | None = None

    @property
    def running(self) -> bool:
        """Whether an alignment is under way."""
        return self.stage not in ("idle", "done", "ended")

    @property
    def bolt_error(self) -> PolarError | None:
        """The error that bolts may be turned by: none of a spoilt measurement, nor of two frames."""
        return self.known_error if self.checked and not self.spoilt else None

    @property
    def checked(self) -> bool:
        """Whether the frames could have shown that something moved."""
        return all(finding.kind is not PolarFindingKind.UNCHECKED for finding in self.findings)

    @property
    def flexure_measured(self) -> bool:
        """Whether the flexure in the uncertainty is more than assumed."""
        return all(finding.kind is not PolarFindingKind.FLEXURE_NOT_MEASURED for finding in self.findings)

    @property
    def spoilt(self) -> bool:
        """Whether no bolt is to be turned."""
        return any(finding.spoils for finding in self.findings)

    @property
    def clock_doubted(self) -> bool:
        """Whether another clock of the frames would give another axis."""
        return any(finding.kind is PolarFindingKind.CLOCK for finding in self.findings)

    @property
    def known_error(self) -> PolarError | None:
        """The error where both bolts are known: a drift may leave one open."""
        return self.error if self.drift is None or self.drift.known else None

    def tells(self, knob: Knob) -> bool:
        """Whether the error at a bolt is known."""
        return self.error is not None and (self.drift is None or self.drift.tells(knob))

    @property
    def total_words(self) -> str:
        """How far the axis is from the pole, with one sigma, or at least; empty before it is known."""
        if self.error is None:
            return ""
        return total_in_words(self.error) if self.drift is None else self.drift.words

    @property
    def hand_needed(self) -> bool:
        """Whether a person is asked to turn something and to say so."""
        waits = self.instruction is not None and self.instruction.knob is not None
        asked = self.stage == "turn" and self.turn_instruction is not None
        return asked or (self.stage == "adjust" and waits)

    @property
    def mount_turns(self) -> bool:
        """Whether it is the mount that turns the axis now, by itself."""
        return self.stage == "turn" and self.turn_instruction is None

    @property
    def stop(self) -> bool:
        """Whether the tutor says that it is enough."""
        return self.instruction is not None and self.instruction.step is TutorStep.STOP

    def old(self, now_s: float) -> bool:
        """Whether the number is not of just now: the mount may stand differently already."""
        return self.running and (not self.solved or now_s - self.error_at_s > OLD_S)

    def age_words(self, now_s: float) -> str:
        """The age of the number, the same on every screen; empty where there is none."""
        if self.error is None:
            return ""
        if not self.running:
            return tr("Last result; not live.")
        text = tr("live {seconds} s ago") if self.live else tr("measured {seconds} s ago")
        if not self.solved:
            text = tr("OLD: newest frame not solved, last result {seconds} s ago")
        elif self.old(now_s):
            text = tr("OLD: {seconds} s ago")
        return text.format(seconds=number(max(0.0, now_s - self.error_at_s), ".0f"))

    def waits(self, now_s: float) -> bool:
        """Whether another number is to come: this one is old, or the axis is being measured."""
        return self.old(now_s) or (self.running and self.stage != "adjust")

    @property
    def knob(self) -> Knob | None:
        """The axis to look at: the one that is being turned, else the worse of the two."""
        if self.instruction is not None and self.instruction.knob is not None:
            return self.instruction.knob
        if self.error is None:
            return None
        alt, az = abs(self.error.altitude_arcsec), abs(self.error.azimuth_on_sky_arcsec)
        return Knob.ALTITUDE if alt >= az else Knob.AZIMUTH


def absorb(state: AlignmentState, step: Progress, now_s: float) -> AlignmentState:
    """The state after one step of the task."""
    if isinstance(step, TurnInstruction):
        return replace(state, stage="turn", words=step.detail, detail="", turn_instruction=step, fraction=0.0)
    if not isinstance(step, PolarUpdate):
        detail = step.detail or state.detail
        return replace(state, detail=detail) if step.stage == "opening" else _plain(state, step)
    if step.stage == "measure" and not step.solved:
        # What was asked for still holds: frames are trailed while a hand turns the axis.
        return replace(state, solved=False, detail=step.detail)
    state = replace(state, stage=step.stage, solved=step.solved, fraction=step.fraction)
    if step.stage == "measure":
        state = _measuring(state, step)
    elif step.stage == "turn":
        state = replace(state, detail=step.detail)
    elif step.stage == "adjust":
        state = _adjusting(state, step)
    else:
        state = replace(state, words=step.detail, detail=step.notes, turn_instruction=None, instruction=None)
    return _with_error(state, step, now_s)


def _plain(state: AlignmentState, step: Progress) -> AlignmentState:
    """A mount that turns says how far; waiting for frames and solving say nothing new."""
    if step.stage == "turn" and step.detail:
        words = tr("The mount turns: {detail}. Keep clear of it.", detail=step.detail)
        return replace(state, stage="turn", words=words, fraction=step.fraction, turn_instruction=None)
    return state


def _measuring(state: AlignmentState, step: PolarUpdate) -> AlignmentState:
    return replace(
        state,
        words=tr(HANDS_OFF),
        detail=step.detail,
        turn_instruction=None,
        instruction=None,
        live=False,
        more_turn_deg=step.more_turn_deg if step.measurement is not None else state.more_turn_deg,
    )


def _adjusting(state: AlignmentState, step: PolarUpdate) -> AlignmentState:
    return replace(
        state,
        words=step.detail if step.solved else state.words,
        detail="" if step.solved else step.detail,
        instruction=step.instruction,
        turn_instruction=None,
    )


def _with_error(state: AlignmentState, step: PolarUpdate, now_s: float) -> AlignmentState:
    if step.findings:
        state = replace(state, findings=step.findings)
    if step.steady is not None:
        state = replace(state, error=step.steady.error, live=True)
        if step.live is not None:
            seen = step.live.error
            trail = (*state.trail[-PAST:], (seen.azimuth_on_sky_arcsec, seen.altitude_arcsec))
            return replace(state, trail=trail, error_at_s=now_s, findings=step.findings, attitude=step.live.attitude)
        return state
    shown = step.drift or step.measurement
    if shown is None:
        return state
    creep = creep_to_show_arcsec(step.measurement) if step.measurement is not None else 0.0
    state, error = replace(state, drift=step.drift, creep_arcsec=creep), shown.error
    if step.stage == "adjust" or step.stage == "done":
        fresh = not state.measured or state.measured[-1] is not error  # one measurement comes with many updates
        measured = (*state.measured, error) if fresh else state.measured
        # What follows begins a trail of its own.
        return replace(state, error=error, measured=measured, error_at_s=now_s, live=False, trail=())
    return replace(state, error=error, error_at_s=now_s, live=False, attitude=None)
