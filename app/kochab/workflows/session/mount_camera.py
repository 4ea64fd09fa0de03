"""The camera on the mount: opened by the thread of the mount's line when first needed."""

from collections.abc import Callable
from contextlib import suppress
from datetime import datetime

from kochab.core.capture import CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError
from kochab.core.frame import Frame
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution, SolveNow
from kochab.gear.mount_events import FrameTaken, SolvedPosition
from kochab.gear.mounts.guard import Guard
from kochab.gear.session import CameraSelection, OpenCamera
from kochab.solver import SolveOptions
from kochab.text.translation import tr
from kochab.workflows.fresh_frame import fresh_frame, lost_in_space
from kochab.workflows.goto_target import with_retries
from kochab.workflows.solve_frame import solve_open_frame

LIMIT_S = 40.0


class MountCamera(CameraSource):
    """A camera that opens itself and survives its cable.

    A camera that goes is told as silence, so that nobody takes it for the mount's line. One that others use already
    keeps the exposure they have set unless this one ``insists``: then its own holds for all, until it is closed.
    """

    name = "camera"

    def __init__(
        self, selection: CameraSelection, open_camera: OpenCamera | None = None, insists: bool = False
    ) -> None:
        self.selection, self.insists = selection, insists
        self._open_camera = open_camera
        self._camera: CameraSource | None = None

    @property
    def limits(self) -> CaptureLimits:
        """Of the camera, once it is open."""
        return CaptureLimits() if self._camera is None else self._camera.limits

    @property
    def exposure_note(self) -> str:
        """What is to be known of an exposure that is not the one asked for; empty when it is."""
        camera = self._camera
        settings = None if camera is None else camera.in_force
        if camera is None or settings is None or settings.exposure_s is None:
            return ""
        now_s, asked_s = settings.exposure_s, self.selection.exposure_s
        if abs(now_s - asked_s) <= 0.01 * asked_s:
            return ""
        if camera.alone:
            return tr("The camera uses {now_s:g} s exposures.", now_s=now_s)
        return tr("Another view uses this camera at {now_s:g} s. A new exposure applies to both.", now_s=now_s)

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Set the camera."""
        return self._opened().configure(settings)

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The newest frame, None when none came in time."""
        camera = self._opened()
        try:
            return camera.next_frame(timeout_s)
        except LineLostError as error:
            self.close()  # the next frame that is asked for opens it anew
            raise NoAnswerError(str(error)) from error

    def now_utc(self) -> datetime:
        """By the camera's clock."""
        return self._opened().now_utc()

    def close(self) -> None:
        """Give the camera back; it opens again when it is asked for."""
        camera, self._camera = self._camera, None  # forgotten first: close may raise
        if camera is not None:
            camera.close()

    def _opened(self) -> CameraSource:
        if self._camera is None:
            from kochab.gear import cameras

            opened = self._open_camera or cameras.open_camera
            settings = CaptureSettings(exposure_s=self.selection.exposure_s)
            self._camera = opened(self.selection.source, self.selection.address, settings)
            self.name = self._camera.name
            if self.insists and self.exposure_note:
                self._camera.configure(settings)
        return self._camera


def close_camera(camera: MountCamera) -> Task[None]:
    """Close a camera in the thread that opened it."""
    yield Progress("camera")
    camera.close()


def frame_solver(camera: MountCamera, guard: Guard, tell: Callable[[object], None]) -> SolveNow:
    """What takes a fresh frame, shows it, solves it, and tells what was seen."""

    def solve_now() -> Task[Solution | NoSolution]:
        frame = lost_in_space((yield from fresh_frame(camera)))
        tell(FrameTaken(frame))
        # Asked before the solve: afterwards the mount would report where it is by then.
        reported = None
        with suppress(DeviceError):
            reported = with_retries(guard.position_icrs)
        yield Progress("solving")
        solved = yield from solve_open_frame(frame, SolveOptions(timeout_s=LIMIT_S))
        if isinstance(solved.result, Solution) and reported is not None:
            tell(SolvedPosition(solved.result, reported, guard.clock()))
        tell(solved)
        return solved.result

    return solve_now
