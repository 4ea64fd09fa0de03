"""A polar alignment as one task: what was chosen, who turns the axis, from a camera or from files."""

import logging
import random
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import field, replace
from datetime import UTC, datetime
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TypeVar

from kochab.core.capture import CameraSource
from kochab.core.errors import FrameError, KochabError, RefusedError, UsageError
from kochab.core.frame import Frame, Hint, Site
from kochab.core.mount import Ability
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.frames.hints import NO_ZONE
from kochab.gear.adjusters import AdjusterAxis, Adjusters
from kochab.gear.mounts.guard import Guard
from kochab.gear.session import (
    EXPOSURE_S,
    PRACTICE_FOV_DEG,
    CameraSelection,
    MountSelection,
    OpenCamera,
    Practice,
    StartPractice,
)
from kochab.polar.bolts import HAND_ARCSEC, Base, Pitches, bolts_of
from kochab.polar.drift import Drift
from kochab.polar.error import Knob, total_in_words
from kochab.polar.measure import Measurement, MeasureSettings, NoAxis, PolarFinding, PolarFindingKind
from kochab.polar.plan import more_turn_deg
from kochab.polar.pole import Pole
from kochab.polar.report import History
from kochab.polar.tutor import BoltTutor
from kochab.solver import SolveOptions
from kochab.text.translation import tr, tr_n, tr_noop
from kochab.workflows.polar.align import AlignOptions, Motors, align
from kochab.workflows.polar.measure import (
    RATE_DEG_S,
    HandTurner,
    MountTurner,
    Sweep,
    Turner,
    drifted,
    measure_drifting,
    optics_of,
)
from kochab.workflows.polar.site_and_clock import clock_doubts
from kochab.workflows.polar.solutions import (
    FilesAxis,
    FilesRequest,
    axis_of,
    changed_ns,
    guide_logs_of,
    is_complete,
    remember_axis,
    solutions_of,
    unsolved_of,
)
from kochab.workflows.polar.sources import CameraSightings, SolvedFile, last_night
from kochab.workflows.polar.update import PolarButton, PolarControls, PolarUpdate
from kochab.workflows.session.mount_camera import MountCamera

# What a person wants aligned, and with what; plain values that are remembered between starts.


class FrameSource(StrEnum):
    """Where the frames come from; the texts are on the screen."""

    PRACTICE = tr_noop("Practice telescope (simulated)")
    CAMERA = tr_noop("Camera")
    FILES = tr_noop("Files")


class AxisTurnedBy(StrEnum):
    """Who turns the RA axis between the frames."""

    PERSON = tr_noop("I turn it by hand")
    MOUNT = tr_noop("The mount turns it, within its limits")
    NOBODY = tr_noop("Nobody: measure drift while tracking")


@frozen
class AlignmentRequest:
    """Everything an alignment needs to begin.

    ``check`` are files of a second sweep, at another declination: it shows flexure. ``site`` None takes it from the
    frames. ``turn_deg`` None plans the turn. ``mount`` is asked only when ``hand`` is the mount and the frames come
    from a camera. With ``second_sweep`` nothing is called good before a sweep at another declination. ``hint`` is what
    is known of the camera's frames. ``utc_offset_h`` is how far the files' clock is ahead of UTC, ``guided`` whether a
    guider held what tracked; None: as it shows. ``profile`` is the equipment's, "" for none. ``mount_doubt`` says what
    the connected mount contradicts of clock and site. ``follow`` measures files again while they grow.
    ``adjusters`` is the port of motorised ones, "" for hands; a practice telescope has its own. ``base`` is what the
    hands turn. ``dec_sign`` says which way north pulses of a guide log move the mount; 0: as the log says.
    """

    source: FrameSource
    pole: Pole = Pole.REFRACTED
    site: Site | None = None
    files: tuple[Path, ...] = ()
    check: tuple[Path, ...] = ()
    camera: CameraSelection | None = None
    hand: AxisTurnedBy = AxisTurnedBy.PERSON
    mount: MountSelection | None = None
    goal_arcsec: float = 30.0
    turn_deg: float | None = None
    frames: int = 5
    fov_deg: float | None = None
    second_sweep: bool = False
    hint: Hint | None = None
    utc_offset_h: float | None = None
    guided: bool | None = None
    profile: str = ""
    mount_doubt: str = ""
    follow: bool = False
    adjusters: str = ""
    base: Base = Base.BOLTS
    dec_sign: int = 0

    @property
    def with_mount(self) -> bool:
        """Whether it ends with the mount's connection: the mount turns the axis, or its telescope is a practice one."""
        turned = self.source is FrameSource.CAMERA and self.hand is AxisTurnedBy.MOUNT
        return turned or self.source is FrameSource.PRACTICE


# -- What an alignment is given by the window, and how its steps come there; nothing of Qt -----

T = TypeVar("T")
Tell = Callable[[Progress], None]


@frozen
class AlignmentTools:
    """``tell`` and the others run in the alignment's thread.

    ``practice`` starts a practice night; ``practising`` hears of the one that is used. ``there``
    gives the one that is under way already, if any: it goes on when the alignment is over.
    ``open_camera`` opens a camera that other views may use too. ``solved`` keeps what files gave, for another try.
    ``seen`` hears of every frame of a camera, with its solution or None.
    """

    controls: PolarControls
    tell: Tell
    keep: Callable[[History], None]
    practising: Callable[[Practice], None] = lambda practice: None
    practice: StartPractice | None = None
    there: Callable[[], Practice | None] = lambda: None
    open_camera: OpenCamera | None = None
    solved: "dict[tuple[object, ...], list[SolvedFile]]" = field(default_factory=dict)
    seen: Callable[[Frame, Solution | None], None] = lambda frame, solution: None


def _with_each_step(task: Task[T], change: Callable[[Progress], Progress]) -> Task[T]:
    """The same task with ``change`` of each of its steps."""
    while True:
        try:
            step = next(task)
        except StopIteration as end:
            result: T = end.value
            return result
        yield change(step)


# -- Who turns the RA axis: a hand that is asked in words, or a mount at a rate of its own -----

SLICE_S = 1.0
SLOWEST_DEG_S = 0.1  # a sweep at less would take a quarter of an hour


def mount_turner(guard: Guard, camera: CameraSource) -> MountTurner:
    """Turns at the mount's own rate nearest to two degrees a second.

    Raises RefusedError when the mount cannot be moved at a rate, or by none that is fast enough.
    """
    lacking = guard.lacks.get(Ability.MOVE)
    if lacking is not None:
        raise RefusedError("{lacking} Turn the RA axis by hand instead.", lacking=lacking)
    rate = min(guard.rates_deg_s, key=lambda r: abs(r - RATE_DEG_S), default=RATE_DEG_S)
    if rate < SLOWEST_DEG_S:
        raise RefusedError("The mount has no rate fast enough: turn the RA axis by hand instead.")
    return MountTurner(guard, rate, camera=camera)


# -- The alignment with a camera: opened, used and given back in the thread that runs it -------

FIRST_FRAME_S = 60.0
SOLVE_S = 5.0  # a frame that was exposed while a hand turned the axis must not hold up the next
LEAST_TURN_DEG = 30.0
SHARE_OF_GOAL, SHARE_AT_BOLTS = 0.25, 0.5  # for the uncertainty that a measurement aims at, and at the bolts
MOST_FRAMES = 9


def align_camera(request: AlignmentRequest, tools: AlignmentTools, guard: Guard | None = None) -> Task[History]:
    """Measure, adjust, measure again with a camera, a practice telescope's or a real one.

    With a ``guard`` the mount turns the axis, and this runs in the thread of its line; without, a person is asked to.
    """
    with ExitStack() as opened:
        yield Progress("opening", None, tr("Opening the camera…"))
        selection, site, clock, practice = _place(request, tools, opened)
        camera = MountCamera(selection, tools.open_camera, insists=True)
        opened.callback(camera.close)  # however this ends
        if site is None:
            site = yield from _site_of_frames(camera)
        turner: Turner = HandTurner()
        if guard is not None:
            guard.site = guard.site or site
            turner = mount_turner(guard, camera)
        hint = request.hint if request.source is FrameSource.CAMERA else None
        options = SolveOptions(timeout_s=SOLVE_S, fov_deg=request.fov_deg, hint=hint)
        source = CameraSightings(camera, options, clock, tools.seen)
        settings = MeasureSettings(site, request.pole)

        def with_clock_doubts(step: Progress) -> Progress:
            shown = None if not isinstance(step, PolarUpdate) else step.drift or step.measurement
            if not isinstance(step, PolarUpdate) or shown is None:
                return step
            doubts = clock_doubts(source.ahead_s, request.mount_doubt, shown.error, settings.site)
            return replace(step, findings=(*doubts, *step.findings)) if doubts else step

        if request.hand is AxisTurnedBy.NOBODY:
            drifting = measure_drifting(source, settings, tools.controls, request.guided)
            drift = yield from _with_each_step(drifting, with_clock_doubts)
            yield with_clock_doubts(_final_update(drift, request, ""))
            return _kept(drift, request, tools)
        motors, tutor = (yield from _motors(request, practice, opened)), _tutor(request, site)
        task = align(source, turner, settings, options_of(request), tools.controls, tutor, tools.keep, motors)
        done = yield from _with_each_step(task, with_clock_doubts)
        bolts = (tutor.bolts[Knob.ALTITUDE], tutor.bolts[Knob.AZIMUTH])
        known = [None if bolt.by_hand or motors is not None else bolt.arcsec_a_turn for bolt in bolts]
        _remember(done.last, request, (known[0], known[1]))
        return done.history


def _tutor(request: AlignmentRequest, site: Site) -> BoltTutor:
    """It knows the bolts from another night here, but neither a simulated telescope's nor what motors turn."""
    unknown = request.source is FrameSource.PRACTICE or request.adjusters
    night = None if unknown else last_night(site, request.profile)
    bolts = bolts_of(
        Base.BOLTS if request.adjusters else request.base, (None, None) if night is None else night.bolts_arcsec
    )
    return BoltTutor(SHARE_AT_BOLTS * options_of(request).goal_arcsec, bolts)


def _motors(request: AlignmentRequest, practice: Practice | None, opened: ExitStack) -> Task[Motors | None]:
    """What turns the bolts, if not a person."""
    if not request.adjusters:
        return None
    if practice is not None:
        return PracticeMotors(practice)
    yield Progress("opening", None, tr("Looking for the motorised adjusters…"))
    adjusters = Adjusters(request.adjusters)
    opened.callback(adjusters.close)
    return adjusters


class PracticeMotors:
    """Motors at the bolts of a practice telescope, of a pitch and sense that nobody knows."""

    def __init__(self, practice: Practice) -> None:
        self._practice = practice
        self._arcmin = {axis: random.uniform(0.002, 0.02) * random.choice((-1.0, 1.0)) for axis in AdjusterAxis}

    def move(self, axis: AdjusterAxis, amount: float) -> Task[None]:
        """At once."""
        yield Progress("turn", 0.0)
        self._practice.do(f"{'az' if axis is AdjusterAxis.AZIMUTH else 'alt'} {amount * self._arcmin[axis]:.5f}")


def options_of(request: AlignmentRequest) -> AlignOptions:
    """How it is measured, from what the person chose: by hand with as few turns as reach it."""
    least, goal = 2 if request.hand is AxisTurnedBy.PERSON else request.frames, request.goal_arcsec
    if not request.adjusters and any(bolt.by_hand for bolt in bolts_of(request.base)):
        goal = max(goal, HAND_ARCSEC)
    sweep = Sweep(request.turn_deg, least, max(least, MOST_FRAMES), SHARE_OF_GOAL * goal, LEAST_TURN_DEG)
    return AlignOptions(goal, sweep=sweep, second_sweep=request.second_sweep)


def _place(
    request: AlignmentRequest, tools: AlignmentTools, opened: ExitStack
) -> tuple[CameraSelection, Site | None, Callable[[], datetime], Practice | None]:
    """Which camera looks, from where, what time it is there, and whose telescope it is if a practice one's."""
    if request.source is FrameSource.PRACTICE:
        practice = _practice(tools, opened)
        exposure_s = EXPOSURE_S if request.camera is None else request.camera.exposure_s
        camera = CameraSelection("simulated", practice.camera, exposure_s)
        return camera, practice.rig.config.site, practice.rig.clock.now_utc, practice
    if request.camera is None:
        raise UsageError("Choose a camera.")
    return request.camera, request.site, partial(datetime.now, UTC), None


def _practice(tools: AlignmentTools, opened: ExitStack) -> Practice:
    """The practice night under way, or one that ends with the alignment."""
    practice = tools.there()
    if practice is None:
        if tools.practice is None:
            raise UsageError("No simulated telescope is part of this program.")
        practice = tools.practice(fov_deg=PRACTICE_FOV_DEG)
        opened.callback(practice.stop)
    tools.practising(practice)
    return practice


def _site_of_frames(camera: CameraSource) -> Task[Site]:
    """What the first frame says of its place."""
    for _ in range(round(FIRST_FRAME_S / SLICE_S)):
        yield Progress("opening", None, tr("Waiting for the first frame…"))
        frame: Frame | None = camera.next_frame(SLICE_S)
        if frame is None:
            continue
        if frame.hint.site is None:
            raise UsageError("The camera's frames have no site: fill in “Your site”.")
        return frame.hint.site
    raise KochabError("The camera sends no frames.")


# -- One measurement from frames on disk -------------------------------------------------------

NOT_TURNED = {
    PolarFindingKind.FIXED_TRIPOD: tr_noop("Fixed tripod: there is no axis to align."),
    PolarFindingKind.TOO_FEW: tr_noop("No axis yet: more frames are needed."),
}


def measure_files(request: AlignmentRequest, tools: AlignmentTools) -> Task[History]:
    """Solve every file, then measure, by drift where nobody turned the axis; again while they grow, if so wished.

    Raises KochabError with one sentence on what to do.
    """
    axis = yield from (_followed(request, tools) if request.follow else _axis_of_files(request, tools))
    result = axis.result
    if isinstance(result, NoAxis):
        finding = PolarFinding(result.kind, result.sentence, spoils=True)
        yield PolarUpdate("done", 1.0, tr(NOT_TURNED.get(result.kind, NO_AXIS)), findings=(finding,))
        return History()
    history = _kept(result, request, tools)
    warnings = Counter(warning for _, warning in axis.warnings if warning != NO_ZONE)  # of that there is a finding
    notes = {tr_n("{n} frame: {warning}", "{n} frames: {warning}", n, warning=w): None for w, n in warnings.items()}
    if axis.last is not None and request.site is None:  # the set-up did not know the site
        notes[tr("Last measured here, {night}.", night=axis.last)] = None
    yield _final_update(result, request, "\n".join(notes))
    return history


def _followed(request: AlignmentRequest, tools: AlignmentTools) -> Task[FilesAxis]:
    """The axis of files that grow, once it is known or somebody says that it is enough."""
    while True:
        enough, seen = tools.controls.take(PolarButton.ENOUGH), [changed_ns(path) for path in request.files]
        try:
            axis = yield from _axis_of_files(request, tools)
        except FrameError as error:  # as of a log that has just begun
            if enough:
                raise
            yield PolarUpdate("measure", None, str(error))
        else:
            if enough or is_complete(axis.result):
                return axis
            if isinstance(axis.result, Drift):
                yield drifted(axis.result)
            elif isinstance(axis.result, NoAxis):
                yield PolarUpdate("measure", None, axis.result.sentence)
        while not tools.controls.pressed(PolarButton.ENOUGH) and [changed_ns(path) for path in request.files] == seen:
            yield Progress("wait for a frame")
            time.sleep(SLICE_S)


def _axis_of_files(request: AlignmentRequest, tools: AlignmentTools) -> Task[FilesAxis]:
    paths = [str(path) for path in request.files]
    logs = guide_logs_of(paths)
    frames = [(path, 0) for path in paths if path not in logs] + [(str(path), 1) for path in request.check]
    solved = yield from _solved(frames, request, tools)
    files, sweeps = [file for file, _ in solved], [sweep for _, sweep in solved]
    request_files = FilesRequest(
        request.site,
        request.pole,
        utc_offset_h=request.utc_offset_h,
        guided=request.guided,
        dec_sign=request.dec_sign,
        profile=request.profile,
        how=tr_noop("fill in “Your site”"),
    )
    return axis_of(files, sweeps, logs, request_files)


NO_AXIS = tr_noop("No axis measured.")


def _kept(result: Measurement | Drift, request: AlignmentRequest, tools: AlignmentTools) -> History:
    """The history of one measurement, unless it leaves a bolt open; kept for another night as well."""
    history = History()
    if isinstance(result, Measurement) or result.known:
        history.measured(result)
        tools.keep(history)
    _remember(result, request)
    return history


def _remember(result: Measurement | Drift, request: AlignmentRequest, bolts: Pitches = (None, None)) -> None:
    """For another night, but not of a simulated telescope."""
    if request.source is not FrameSource.PRACTICE:
        try:
            remember_axis(result, request.profile, bolts)
        except OSError as error:
            logging.getLogger(__name__).warning("The polar error can't be kept for another night: %s", error)


def _solved(
    frames: list[tuple[str, int]], request: AlignmentRequest, tools: AlignmentTools
) -> Task[list[tuple[SolvedFile, int]]]:
    """What every file gives, with its sweep; each is solved once, however often it is measured."""
    options, solved = SolveOptions(fov_deg=request.fov_deg), []
    for number, (path, sweep) in enumerate(frames):
        name = Path(path).name
        yield PolarUpdate("measure", number / len(frames), f"{name}, {number + 1} of {len(frames)}")
        key = (path, changed_ns(path), request.fov_deg)
        if key not in tools.solved:
            # Its steps are cancel points only: what they say is of one frame, not of the alignment.
            found = yield from _with_each_step(solutions_of(path, options), lambda _: Progress("solve"))
            tools.solved[key] = found
        solved += [(one, sweep) for one in tools.solved[key]]
    for one in unsolved_of([file for file, _ in solved], [sweep for _, sweep in solved]):
        if isinstance(one.result, NoSolution):
            raise KochabError(
                "{name} has no solution, {reason}: {advice}",
                name=Path(one.path).name,
                reason=tr(one.result.reason),
                advice=one.result.advice,
            )
    return solved


def _final_update(result: Measurement | Drift, request: AlignmentRequest, notes: str) -> PolarUpdate:
    findings = tuple(sorted(result.findings, key=lambda finding: not finding.spoils))
    spoilt = tr("Unusable: don't adjust. {findings}", findings=findings[0].text) if result.spoilt else ""
    if isinstance(result, Drift):
        words = tr_n(
            "Polar alignment error: {angle}, from {n} minute of drift.",
            "Polar alignment error: {angle}, from {n} minutes of drift.",
            round(result.minutes),
            angle=result.words,
        )
        return PolarUpdate("done", 1.0, spoilt or words, findings=findings, drift=result, notes=notes)
    more = more_turn_deg(optics_of(result.attitudes[0]), result.rho_deg, result.fit.turns_rad, request.goal_arcsec)
    words = tr("Polar alignment error: {angle}.", angle=total_in_words(result.error))
    return PolarUpdate("done", 1.0, spoilt or words, result, findings=findings, more_turn_deg=more, notes=notes)


def alignment_task(request: AlignmentRequest, tools: AlignmentTools, guard: Guard | None = None) -> Task[History]:
    """What ``request`` says, from the first frame to the last; with a ``guard`` the mount turns.

    Raises KochabError with one sentence on what to do.
    """

    def passed_on(step: Progress) -> Progress:
        tools.tell(step)  # each, for a job passes on only the newest
        return step

    files = request.source is FrameSource.FILES
    task = measure_files(request, tools) if files else align_camera(request, tools, guard)
    return (yield from _with_each_step(task, passed_on))
