"""The alignment with a camera: opened, used and given back in the thread that runs it."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime

from app.core.capture import CameraSource
from app.core.errors import KochabError, UsageError
from app.core.frame import Frame
from app.core.hint import Site
from app.core.progress import Progress, Task
from app.mounts.guard import Guard
from app.polar.history import History
from app.polar.measure import Settings
from app.solve.options import SolveOptions
from app.ui.mount.eye import CameraWish, Eye
from app.ui.polar.tools import Tools
from app.ui.polar.turning import Asking, mount_turner
from app.ui.polar.wish import AlignWish, Source
from app.ui.wiring import Practice
from app.workflows.polar_align import AlignOptions, align
from app.workflows.polar_measure import Sweep
from app.workflows.polar_sources import CameraSightings
from app.workflows.polar_turners import Turner

PRACTICE_FOV_DEG = 4.0  # wide enough for the patterns that are shipped
FIRST_FRAME_S = 60.0
SOLVE_S = 5.0  # a frame that was exposed while a hand turned the axis must not hold up the next
SLICE_S = 1.0
LEAST_TURN_DEG = 30.0
SHARE_OF_GOAL = 0.25  # of the uncertainty that a measurement aims at
MOST_FRAMES = 9


@dataclass(frozen=True, slots=True)
class Place:
    """Which camera looks, from where, and what time it is there."""

    camera: CameraWish
    site: Site | None
    clock: Callable[[], datetime]


def align_camera(wish: AlignWish, tools: Tools, guard: Guard | None = None) -> Task[History]:
    """Measure, adjust, measure again with a camera, a practice telescope's or a real one.

    With a ``guard`` the mount turns the axis, and this runs in the thread of its line; without, a
    person is asked to.
    """
    with ExitStack() as opened:
        yield Progress("opening", None, "Opening the camera…")
        place = _place(wish, tools, opened)
        camera = Eye(place.camera, tools.open_camera, insists=True)
        opened.callback(camera.close)
        site = place.site
        if site is None:
            site = yield from _site_of_frames(camera)
        turner: Turner = Asking()
        if guard is not None:
            guard.site = guard.site or site
            turner = mount_turner(guard, camera)
        source = CameraSightings(
            camera, SolveOptions(timeout_s=SOLVE_S, fov_deg=wish.fov_deg), place.clock
        )
        done = yield from align(
            source, turner, Settings(site, wish.pole), options_of(wish), tools.controls,
            keep=tools.keep,
        )  # fmt: skip
        return done.history


def options_of(wish: AlignWish) -> AlignOptions:
    """How it is measured, from what the person chose."""
    sweep = Sweep(
        wish.turn_deg, wish.frames, max(wish.frames, MOST_FRAMES),
        SHARE_OF_GOAL * wish.goal_arcsec, LEAST_TURN_DEG,
    )  # fmt: skip
    return AlignOptions(wish.goal_arcsec, sweep=sweep, second_sweep=wish.second_sweep)


def _place(wish: AlignWish, tools: Tools, opened: ExitStack) -> Place:
    if wish.source is Source.PRACTICE:
        return _of_practice(_practice(tools, opened), wish)
    if wish.camera is None:
        raise UsageError("Choose a camera.")
    return Place(wish.camera, wish.site, _computer_clock)


def _practice(tools: Tools, opened: ExitStack) -> Practice:
    """The practice night under way, or one that ends with the alignment."""
    practice = tools.there()
    if practice is None:
        if tools.practice is None:
            raise UsageError("No simulated telescope is part of this program.")
        practice = tools.practice(fov_deg=PRACTICE_FOV_DEG)
        opened.callback(practice.stop)
    tools.practising(practice)
    return practice


def _of_practice(practice: Practice, wish: AlignWish) -> Place:
    exposure_s = 2.0 if wish.camera is None else wish.camera.exposure_s
    camera = CameraWish("simulated", practice.camera, exposure_s)
    return Place(camera, practice.rig.config.site, practice.rig.clock.now_utc)


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
