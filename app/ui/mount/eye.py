"""The camera on the mount: opened by the thread of the mount's line when it is first needed."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime

from app.core.capture import CameraSource, CaptureLimits, CaptureSettings
from app.core.errors import DeviceError, LineLostError, NoAnswerError
from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.mounts.guard import Guard
from app.solve.options import SolveOptions
from app.ui.mount.words import Seen, Shown, Sight, Word
from app.workflows.fresh_frame import SolveNow, fresh_frame, lost_in_space
from app.workflows.goto_target import answered
from app.workflows.solve_frame import solve_open_frame

LIMIT_S = 40.0

OpenCamera = Callable[[str, str, CaptureSettings], CameraSource]


@dataclass(frozen=True, slots=True)
class CameraWish:
    """Which camera: a name of :data:`app.cameras.SOURCES`, its address, and the exposure."""

    source: str
    address: str = ""
    exposure_s: float = 2.0

    @property
    def camera(self) -> tuple[str, str]:
        """Which one, whatever its exposure."""
        return self.source, self.address


class Eye:
    """A :class:`~app.core.capture.CameraSource` that opens itself and survives its cable.

    A camera that goes is told as silence, so that nobody takes it for the mount's line. One that
    others use already keeps the exposure they have set unless this one ``insists``: then its own
    holds for all, until it is closed.
    """

    name = "camera"

    def __init__(
        self, wish: CameraWish, open_camera: OpenCamera | None = None, insists: bool = False
    ) -> None:
        self.wish, self.insists = wish, insists
        self._open_camera = open_camera
        self._camera: CameraSource | None = None

    @property
    def limits(self) -> CaptureLimits:
        """Of the camera, once it is open."""
        return CaptureLimits() if self._camera is None else self._camera.limits

    @property
    def exposure_told(self) -> str:
        """What is to be known of an exposure that is not the one wished for; empty when it is."""
        camera = self._camera
        now_s = getattr(camera, "in_force", CaptureSettings()).exposure_s
        if now_s is None or abs(now_s - self.wish.exposure_s) <= 0.01 * self.wish.exposure_s:
            return ""
        if getattr(camera, "alone", True):
            return f"The camera exposes {now_s:g} s."
        return (
            f"Another view uses this camera, and it exposes {now_s:g} s: an exposure set here is"
            " for both."
        )

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Set the camera."""
        return self._opened().configure(settings)

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The newest frame, None when none came in time."""
        camera = self._opened()
        try:
            return camera.next_frame(timeout_s)
        except LineLostError as error:
            self.close()
            raise NoAnswerError(str(error)) from error

    def now_utc(self) -> datetime:
        """The camera's own time, where it has one."""
        clock: Callable[[], datetime] | None = getattr(self._opened(), "now_utc", None)
        return datetime.now(UTC) if clock is None else clock()

    def close(self) -> None:
        """Give the camera back; it opens again when it is asked for."""
        camera, self._camera = self._camera, None
        if camera is not None:
            camera.close()

    def _opened(self) -> CameraSource:
        if self._camera is None:
            from app import cameras

            opened = self._open_camera or cameras.open_camera
            settings = CaptureSettings(exposure_s=self.wish.exposure_s)
            self._camera = opened(self.wish.source, self.wish.address, settings)
            self.name = self._camera.name
            if self.insists and self.exposure_told:
                self._camera.configure(settings)
        return self._camera


def looking(
    eye: Eye,
    guard: Guard,
    tell: Callable[[Word], None],
) -> SolveNow:
    """What takes a fresh frame, shows it, solves it, and tells what was seen."""

    def solve_now() -> Task[Solution | NoSolution]:
        frame = lost_in_space((yield from fresh_frame(eye)))
        tell(Shown(frame))
        said = None
        with suppress(DeviceError):
            said = answered(guard.position_icrs)
        yield Progress("solving")
        solved = yield from solve_open_frame(frame, SolveOptions(timeout_s=LIMIT_S))
        sight = None
        if isinstance(solved.result, Solution):
            solved.result.attitude.quaternion  # noqa: B018  (its library loads slowly)
            if said is not None:
                sight = Sight(solved.result, said, guard.clock())
        tell(Seen(solved, sight))
        return solved.result

    return solve_now
