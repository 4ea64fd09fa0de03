"""A camera behind a server that takes one exposure at a time."""

from contextlib import suppress
from typing import Generic, Protocol, TypeVar

from app.cameras.exposure import Exposure
from app.cameras.sense import making_sense
from app.cameras.within import check_within
from app.core.capture import CaptureLimits, CaptureSettings
from app.core.errors import DeviceError


class Link(Protocol):
    """The line to its server."""

    def close(self) -> None:
        """Let the server go; the camera stays connected to it."""


class ExposingDevice(Protocol):
    """The camera in the words of its server's protocol."""

    name: str

    @property
    def link(self) -> Link:
        """The line to its server."""

    @property
    def limits(self) -> CaptureLimits:
        """What can be set."""

    @property
    def in_force(self) -> CaptureSettings:
        """What is set."""

    def apply(self, settings: CaptureSettings) -> None:
        """Set what is given."""

    def abort(self) -> None:
        """End the exposure under way."""


D = TypeVar("D", bound=ExposingDevice)


class ExposingCamera(Generic[D]):
    """One that exposes again as soon as a picture has arrived."""

    def __init__(self, device: D) -> None:
        self.name = device.name
        self._device = device
        self._exposing: Exposure | None = None
        self._count = 0

    @property
    def limits(self) -> CaptureLimits:
        """As the camera tells them."""
        return self._device.limits

    @making_sense()
    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Set exposure, gain and binning; an exposure under way is begun anew.

        Raises
        ------
        RefusedError
            A value is out of range, cannot be set on this camera, or was not accepted.

        """
        check_within(settings, self.limits)
        if settings != CaptureSettings():
            self._abort()
        self._device.apply(settings)
        return self._device.in_force

    def close(self) -> None:
        """End the exposure and let the server go; the camera stays connected to it."""
        with suppress(DeviceError):
            self._abort()
        self._device.link.close()

    def _abort(self) -> None:
        if self._exposing is not None:
            self._exposing = None
            self._device.abort()
