"""A camera behind a server that takes one exposure at a time: its exposures, its limits."""

from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from time import monotonic

from kochab.core.capture import CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import DeviceError, LineLostError, RefusedError
from kochab.core.values import frozen
from kochab.gear.servers.address import making_sense
from kochab.text.translation import tr

# An exposure under way on a camera that begins the next one when its picture has arrived.

DOWNLOAD_S = 30.0  # how long after an exposure a picture may be under way before the line counts as lost


@frozen
class Exposure:
    """``begun_s`` on :func:`time.monotonic`, the same in UTC, and how long it is."""

    begun_s: float
    begun_utc: datetime
    seconds: float

    def check_overdue(self, camera: str) -> None:
        """Raise LineLostError when its picture should have been here long ago."""
        if monotonic() > self.begun_s + self.seconds + DOWNLOAD_S:
            raise LineLostError("{camera} sent no image after its exposure.", camera=camera)


# -- Settings against what a camera allows, before it is asked ---------------------------------


def check_within(settings: CaptureSettings, limits: CaptureLimits) -> None:
    """Raise RefusedError with the range when a wish is outside it or cannot be had."""
    wishes = (
        ("exposure", settings.exposure_s, limits.exposure_s, " s"),
        ("gain", settings.gain, limits.gain, ""),
        ("binning", settings.binning, limits.binning, ""),
    )
    for what, value, bounds, unit in wishes:
        if value is None:
            continue
        if bounds is None:
            raise RefusedError("The {what} of this camera cannot be set.", what=tr(what))
        if not bounds[0] <= value <= bounds[1]:
            raise RefusedError(
                "A {what} of {value:g}{unit} is not within {bounds:g} to {bounds2:g}{unit}.",
                what=tr(what),
                value=value,
                unit=unit,
                bounds=bounds[0],
                bounds2=bounds[1],
            )


class ExposingCamera(CameraSource):
    """One that exposes again as soon as a picture has arrived; a subclass has its server's words.

    ``exposure_s`` is what it will expose next; ``hang_up`` lets the server go.
    """

    def __init__(self, name: str, hang_up: Callable[[], None]) -> None:
        self.name = name
        self.exposure_s = 1.0
        self._hang_up = hang_up
        self._exposing: Exposure | None = None
        self._count = 0

    @making_sense()
    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Set exposure, gain and binning; an exposure under way is begun anew."""
        check_within(settings, self.limits)
        if settings != CaptureSettings():
            self._end_exposure()
        if settings.exposure_s is not None:
            self.exposure_s = settings.exposure_s
        if settings.gain is not None:
            self._set_gain(settings.gain)
        if settings.binning is not None:
            self._set_binning(settings.binning)
        return self._settings()

    def close(self) -> None:
        """End the exposure and let the server go; the camera stays connected to it."""
        with suppress(DeviceError):
            self._end_exposure()
        self._hang_up()

    def _expose(self) -> Exposure:
        self._start()
        return Exposure(monotonic(), datetime.now(UTC), self.exposure_s)

    def _end_exposure(self) -> None:
        if self._exposing is not None:
            # Forgotten first: when aborting fails, nobody waits for this picture.
            self._exposing = None
            self._abort()

    # In the words of its server's protocol.

    def _settings(self) -> CaptureSettings:
        """What is set now."""
        raise NotImplementedError

    def _set_gain(self, gain: float) -> None:
        raise NotImplementedError

    def _set_binning(self, binning: int) -> None:
        raise NotImplementedError

    def _start(self) -> None:
        """Begin an exposure of ``exposure_s``."""
        raise NotImplementedError

    def _abort(self) -> None:
        """End the exposure under way."""
        raise NotImplementedError
