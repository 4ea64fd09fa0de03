"""What every camera that takes frames now offers: settings, limits, frames."""

from datetime import UTC, datetime
from typing import Protocol

from kochab.core.frame import Frame
from kochab.core.values import frozen


@frozen
class CaptureSettings:
    """What a person sets; None leaves it to the camera."""

    exposure_s: float | None = None
    gain: float | None = None
    binning: int | None = None


@frozen
class CaptureLimits:
    """The ranges a camera allows, (low, high); None where it does not say or cannot be set."""

    exposure_s: tuple[float, float] | None = None
    gain: tuple[float, float] | None = None
    binning: tuple[int, int] | None = None


class CameraSource(Protocol):
    """One opened camera, or a folder that stands for one. No two calls ever overlap.

    A camera derives from this class, so that it has an answer to what only some cameras offer.
    Every call raises :class:`~kochab.core.errors.DeviceError` with a sentence a person can act on.
    """

    name: str

    @classmethod
    def missing(cls) -> str | None:
        """How to get what it needs and is not installed, one sentence; None when all is there."""
        return None

    @property
    def limits(self) -> CaptureLimits:
        """What can be set, and how far."""

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Apply what can be applied and return what is in force.

        Raises `RefusedError` when a value is out of range, cannot be set on this camera, or was not accepted.
        """

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The newest frame not yet given out, or None when none came within ``timeout_s``.

        ``frame.hint.time_utc`` is mid-exposure as well as it is known. Older frames that were
        not fetched are dropped.

        Raises `LineLostError` when the camera, its server or its folder went away or has been silent for too long, and
        `RefusedError` when the camera refused to expose.
        """

    def close(self) -> None:
        """Give the camera back; never raises."""

    def complaints(self) -> tuple[str, ...]:
        """Sentences about frames that were left out since the last call."""
        return ()

    def now_utc(self) -> datetime:
        """The time by the clock that dates the frames; simulated time need not be ours."""
        return datetime.now(UTC)

    @property
    def in_force(self) -> CaptureSettings | None:
        """The settings now, where another view may change them; None where only one has the camera."""
        return None

    @property
    def alone(self) -> bool:
        """Whether no other view uses the camera."""
        return True


@frozen
class CameraDevice:
    """One thing that can be opened: its source's name, its address and words for a person."""

    source: str
    address: str
    description: str
