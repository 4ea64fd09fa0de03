"""A camera whose frames are seen on their way to the solver, so that none waits to be shown."""

from collections.abc import Callable
from typing import Any

from app.core.capture import CameraSource, CaptureLimits, CaptureSettings
from app.core.frame import Frame


class Tapped:
    """The camera ``source`` itself, with ``see`` called on each frame in the camera's thread."""

    def __init__(self, source: CameraSource, see: Callable[[Frame], None]) -> None:
        self._source, self._see = source, see
        self.name = source.name

    @property
    def limits(self) -> CaptureLimits:
        """Of the camera."""
        return self._source.limits

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Set the camera."""
        return self._source.configure(settings)

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The camera's newest frame."""
        frame = self._source.next_frame(timeout_s)
        if frame is not None:
            self._see(frame)
        return frame

    def close(self) -> None:
        """Give the camera back."""
        self._source.close()

    def __getattr__(self, name: str) -> Any:
        """Complaints and a clock of its own, where the camera has them."""
        return getattr(self._source, name)
