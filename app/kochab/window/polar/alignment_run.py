"""One alignment from start to end: in a job, or in the mount's thread when the mount turns the axis."""

import random

from PySide6.QtCore import QObject, Signal

from kochab.core.errors import UsageError
from kochab.core.mount import Direction, PierSide
from kochab.core.progress import Progress, Task
from kochab.gear.actions import BUSY, POLAR, action
from kochab.gear.mounts.guard import Guard
from kochab.gear.session import Practice
from kochab.polar.bolts import WHOLE_TURN_ARCSEC
from kochab.polar.error import Knob
from kochab.polar.report import History
from kochab.polar.tutor import Instruction
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_control import PRACTISE_LATER
from kochab.window.devices.mount_task import MountTask
from kochab.window.job import Job
from kochab.window.services import Services
from kochab.workflows.polar.sources import SolvedFile
from kochab.workflows.polar.update import PolarControls, TurnInstruction
from kochab.workflows.session.alignment import (
    AlignmentRequest,
    AlignmentTools,
    AxisTurnedBy,
    FrameSource,
    alignment_task,
)
from kochab.workflows.session.alignment_state import AlignmentState

NO_MOUNT = tr_noop("No mount set up. Connect it once in the Mount view (F3), or turn by hand.")
SLEWING = tr_noop("The mount is slewing. Wait, or stop it.")
MOVING = ("opening", "turn", "settle")  # stages of the alignment
OTHER_SKY = tr_noop("The practice telescope is connected. Choose it above, or end the practice in the Mount view (F3).")


def mount_is_still(progress: Progress) -> bool:
    """Whether the alignment does not move the mount: it then survives a loose cable."""
    return progress.stage not in MOVING


class AlignmentRun(QObject):
    """Carries the steps of the alignment's thread into the window's."""

    step = Signal(object)  # Progress
    kept = Signal(object)  # History
    practising = Signal(object)  # Practice
    seen = Signal(object, object)  # Frame, Solution or None

    def __init__(
        self,
        services: Services,
        request: AlignmentRequest,
        solved: dict[tuple[object, ...], list[SolvedFile]],
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self.controls = PolarControls()
        self._services, self._request = services, request
        self._mount = mount = services.mount
        signals, start = (self.step.emit, self.kept.emit, self.practising.emit), services.wiring.practice
        self._tools = AlignmentTools(
            self.controls, *signals, start, lambda: mount.practice, services.cameras.open, solved, self.seen.emit
        )

    def start(self) -> Job | MountTask:
        """Start; the job returned tells of its end and can be cancelled. KochabError says why it cannot start now."""
        request = self._request
        if request.source is FrameSource.FILES:
            return self._services.jobs.run(alignment_task(request, self._tools), POLAR)
        if request.hand is not AxisTurnedBy.MOUNT:
            return self._by_hand()
        started = self._connect()
        # A line that is still being opened begins it once it is open.
        task = self._mount.order(POLAR, self._on_line, mount_is_still)
        if started:  # a practice telescope started for this ends with it
            task.finished.connect(self._mount.disconnect_mount)
        return task

    def _by_hand(self) -> Job:
        """A person turns the axis, or nobody: meanwhile the mount may not slew."""
        mount = self._mount
        if action(mount.known.busy).may_move:
            raise UsageError(tr(BUSY).format(mount.known.user))
        if mount.known.slewing:
            raise UsageError(SLEWING)
        job = self._services.jobs.run(alignment_task(self._request, self._tools), POLAR)
        mount.set_by_hand(True)
        job.finished.connect(lambda: mount.set_by_hand(False))
        return job

    def _connect(self) -> bool:
        """Connect the right mount; whether that started a practice telescope."""
        mount, request = self._mount, self._request
        practise = request.source is FrameSource.PRACTICE
        if mount.known.phase == "off":
            if practise:
                mount.practise()
            elif request.mount is None:
                raise UsageError(NO_MOUNT)
            else:
                mount.connect_mount(request.mount)
            return practise
        if practise != mount.known.practice:
            raise UsageError(PRACTISE_LATER if practise else OTHER_SKY)
        if request.site is not None:
            mount.use_site(request.site)
        return False

    def _on_line(self, guard: Guard) -> Task[History]:
        """Run in the mount's thread; closes the Mount view's camera, which the alignment may need."""
        self._mount.telescope.close()
        return alignment_task(self._request, self._tools, guard)


ARCMIN_A_TURN = (15.0, 60.0)
TURN_SIGMA = 0.05  # of every turn: a person does not turn exactly
SLACK_TURNS = 1.0 / 360.0


TURNED = {Knob.ALTITUDE: tr_noop("Adjusted altitude."), Knob.AZIMUTH: tr_noop("Adjusted azimuth.")}


def _motion(asked: Instruction) -> tuple[Knob | None, bool]:
    """What a hand does: at which bolt, and whether clockwise."""
    return asked.knob, asked.turns > 0.0


class PracticeAdjuster:
    """Turns what the screen asks for on the practice telescope.

    How far a turn of a bolt moves the axis, and which way, is random, as at an unknown mount.
    """

    def __init__(self, practice: Practice) -> None:
        self._practice = practice
        self._random = random.Random()
        self._arcmin = {knob: self._random.uniform(*ARCMIN_A_TURN) * self._random.choice((-1.0, 1.0)) for knob in Knob}
        self._at: tuple[Knob | None, bool] | None = None  # the bolt that the hand is at, and whether clockwise

    def goes_on(self, state: AlignmentState) -> bool:
        """Whether the hand is asked to go on at the bolt that it is at, the same way.

        Nobody at a real mount says again and again that a bolt was turned: one turns on and watches the number.
        """
        asked = state.instruction
        return state.hand_needed and asked is not None and not asked.stray and self._at == _motion(asked)

    def turn(self, state: AlignmentState) -> str:
        """Make the turn that is asked for, and say what was turned; empty where nothing is asked for."""
        if state.turn_instruction is not None:
            self._at = None
            return self._turn_axis(state.turn_instruction)
        if state.instruction is None or state.instruction.knob is None:
            return ""
        self._at = _motion(state.instruction)
        return self._turn_bolt(state.instruction, state.instruction.knob)

    def _turn_axis(self, asked: TurnInstruction) -> str:
        axis = "dec" if asked.direction.in_dec else "ra"
        sign = 1.0 if asked.direction in (Direction.WEST, Direction.NORTH) else -1.0
        if asked.direction.in_dec and self._practice.rig.mount.pier_side is PierSide.WEST:
            sign = -sign  # declination runs the other way on that side of the pier
        degrees = sign * asked.degrees * self._random.gauss(1.0, TURN_SIGMA)
        self._practice.do(f"{axis} {degrees:.3f} asked")
        if asked.direction.in_dec:
            return tr("Turned declination by {degrees:.0f}°.", degrees=abs(degrees))
        return tr("Turned RA by {degrees:.0f}°.", degrees=abs(degrees))

    def _turn_bolt(self, instruction: Instruction, knob: Knob) -> str:
        slack = 0.0 if instruction.by_hand else self._random.gauss(0.0, SLACK_TURNS)
        turns = instruction.turns * self._random.gauss(1.0, TURN_SIGMA) + slack
        name = "alt" if knob is Knob.ALTITUDE else "az"
        arcmin = WHOLE_TURN_ARCSEC / 60.0 if instruction.by_hand else self._arcmin[knob]
        self._practice.do(f"{name} {turns * arcmin:.5f}")
        return tr(TURNED[knob])
