"""The alignment as one task: everything is opened, used and given back in the job's own thread."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, TypeVar

from app.core.capture import CameraSource, CaptureSettings
from app.core.errors import KochabError, UsageError
from app.core.frame import Frame
from app.core.hint import Site
from app.core.progress import Progress, Task
from app.core.solution import NoSolution
from app.polar.history import History
from app.polar.measure import NoAxis, Settings, measure
from app.polar.plan import more_turn_deg
from app.polar.words import angle_in_words
from app.solve.options import SolveOptions
from app.ui.polar.turning import Asking, Holding, mount_turner
from app.ui.polar.wish import AlignWish, Hand, Source
from app.ui.wiring import Practice, StartPractice
from app.workflows.polar_align import AlignOptions, align
from app.workflows.polar_measure import Sweep, optics_of
from app.workflows.polar_sources import CameraSightings, sightings_of, site_of, solve_polar_file
from app.workflows.polar_turners import Turner
from app.workflows.polar_update import PolarControls, PolarUpdate

PRACTICE_FOV_DEG = 4.0  # wide enough for the patterns that are shipped
FIRST_FRAME_S = 60.0
SOLVE_S = 5.0  # a frame that was exposed while a hand turned the axis must not hold up the next
SLICE_S = 1.0
LEAST_TURN_DEG = 30.0
SHARE_OF_GOAL = 0.25  # of the uncertainty that a measurement aims at
MOST_FRAMES = 9

T = TypeVar("T")
Tell = Callable[[Progress], None]


@dataclass(frozen=True, slots=True)
class Tools:
    """What an alignment is given by the window; ``tell`` and the others run in its thread."""

    controls: PolarControls
    tell: Tell
    keep: Callable[[History], None]
    holding: Holding
    practising: Callable[[Practice], None] = lambda practice: None
    practice: StartPractice | None = None


def told(task: Task[T], tell: Tell) -> Task[T]:
    """The same task, every step of which is told: a job passes on only the newest."""
    while True:
        try:
            step = next(task)
        except StopIteration as end:
            result: T = end.value
            return result
        tell(step)
        yield step


def working(wish: AlignWish, tools: Tools) -> Task[History]:
    """What ``wish`` says, from the first frame to the last.

    Raises
    ------
    KochabError
        One sentence with what to do.

    """
    if wish.source is Source.FILES:
        return (yield from told(measure_files(wish, tools), tools.tell))
    return (yield from told(align_camera(wish, tools), tools.tell))


# files ----------------------------------------------------------------------------------------


def measure_files(wish: AlignWish, tools: Tools) -> Task[History]:
    """One measurement from files."""
    if len(wish.files) < 2:
        raise UsageError("Polar alignment needs two frames or more: add another.")
    options = SolveOptions(fov_deg=wish.fov_deg)
    solved = []
    files = (*wish.files, *wish.check)
    sweeps = [0] * len(wish.files) + [1] * len(wish.check)
    for number, path in enumerate(files):
        told_of = f"{path.name}, {number + 1} of {len(files)}"
        yield PolarUpdate("measure", number / len(files), told_of, frames=number)
        one = yield from _quietly(solve_polar_file(path, options))
        if isinstance(one.result, NoSolution):
            raise KochabError(
                f"{path.name} has no solution, {one.result.reason}: {one.result.advice}"
            )
        solved.append(one)
    try:
        site = site_of(solved, wish.site)
    except UsageError as error:
        raise UsageError(str(error).replace("give --site", "fill in “Your site”")) from None
    result = measure(sightings_of(solved, sweeps), Settings(site, wish.pole))
    if isinstance(result, NoAxis):
        raise KochabError(f"{result.reason[0].upper()}{result.reason[1:]}. {result.advice}")
    history = History()
    history.measured(result)
    tools.keep(history)
    axis = result.error
    more = more_turn_deg(
        optics_of(result.attitudes[0]), result.rho_deg, result.fit.turns_rad, wish.goal_arcsec
    )
    yield PolarUpdate(
        "done", 1.0,
        f"The axis is {angle_in_words(axis.total_arcsec)} ±"
        f" {angle_in_words(axis.sigma_total_arcsec)} from the pole.",
        measurement=result, findings=result.findings, more_turn_deg=more, frames=len(solved),
    )  # fmt: skip
    return history


def _quietly(task: Task[Any]) -> Task[Any]:
    """Its steps as cancel points only: what they say is of one frame, not of the alignment."""
    while True:
        try:
            next(task)
        except StopIteration as end:
            return end.value
        yield Progress("solve")


# a camera -------------------------------------------------------------------------------------


def align_camera(wish: AlignWish, tools: Tools) -> Task[History]:
    """Measure, adjust, measure again with a camera, a practice telescope's or a real one."""
    with ExitStack() as opened:
        yield Progress("opening", None, "Opening the camera…")
        site, clock = wish.site, _computer_clock
        camera_wish = wish.camera
        mount = wish.mount
        if wish.source is Source.PRACTICE:
            practice = _practice(tools)
            opened.callback(practice.stop)
            camera_wish, mount, site, clock = _of_practice(practice, wish)
            tools.practising(practice)
        if camera_wish is None:
            raise UsageError("Choose a camera.")
        camera = _camera(camera_wish)
        opened.callback(camera.close)
        if site is None:
            site = yield from _site_of_frames(camera)
        turner: Turner = Asking()
        if wish.hand is Hand.MOUNT:
            turner = _mount(mount, site, clock, camera, tools, opened)
        source = CameraSightings(
            camera, SolveOptions(timeout_s=SOLVE_S, fov_deg=wish.fov_deg), clock
        )
        task = align(
            source, turner, Settings(site, wish.pole), options_of(wish), tools.controls,
            keep=tools.keep,
        )  # fmt: skip
        done = yield from task
        return done.history


def options_of(wish: AlignWish) -> AlignOptions:
    """How it is measured, from what the person chose."""
    sweep = Sweep(
        wish.turn_deg, wish.frames, max(wish.frames, MOST_FRAMES),
        SHARE_OF_GOAL * wish.goal_arcsec, LEAST_TURN_DEG,
    )  # fmt: skip
    return AlignOptions(wish.goal_arcsec, sweep=sweep)


def _practice(tools: Tools) -> Practice:
    if tools.practice is None:
        raise UsageError("No simulated telescope is part of this program.")
    return tools.practice(fov_deg=PRACTICE_FOV_DEG)


def _of_practice(
    practice: Practice, wish: AlignWish
) -> tuple[Any, Any, Site, Callable[[], datetime]]:
    from app.ui.mount.eye import CameraWish
    from app.ui.mount.wishes import MountWish

    exposure = 2.0 if wish.camera is None else wish.camera.exposure_s
    clock: Callable[[], datetime] = practice.rig.clock.now_utc
    site: Site = practice.rig.config.site
    camera = CameraWish("simulated", practice.camera, exposure)
    return camera, MountWish(practice.port, practice.driver), site, clock


def _camera(wish: Any) -> CameraSource:
    from app.cameras import open_camera

    return open_camera(wish.source, wish.address, CaptureSettings(exposure_s=wish.exposure_s))


def _mount(
    wish: Any,
    site: Site,
    clock: Callable[[], datetime],
    camera: CameraSource,
    tools: Tools,
    opened: ExitStack,
) -> Turner:
    from app.ui.mount.opening import guarded

    if wish is None or not wish.port:
        raise UsageError("No mount is known yet: connect it once in the Mount view.")
    guard = guarded(wish, site, clock)
    opened.callback(guard.close)
    tools.holding.guard = guard
    opened.callback(_let_go, tools.holding)
    return mount_turner(guard, camera)


def _let_go(holding: Holding) -> None:
    holding.guard = None


def _site_of_frames(camera: CameraSource) -> Task[Site]:
    """What the first frame says of its place."""
    for _ in range(round(FIRST_FRAME_S / SLICE_S)):
        yield Progress("opening", None, "Waiting for the first frame…")
        frame: Frame | None = camera.next_frame(SLICE_S)
        if frame is None:
            continue
        if frame.hint.site is None:
            raise UsageError(
                "The camera's frames do not say where they are taken: fill in “Your site”."
            )
        return frame.hint.site
    raise KochabError("No frames come from the camera.")


def _computer_clock() -> datetime:
    return datetime.now(UTC)
