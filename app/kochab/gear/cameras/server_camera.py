"""A camera behind a server that takes one exposure at a time: its address, its exposures, its limits."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from socket import gaierror
from time import monotonic

from kochab.core.angle_text import short_name
from kochab.core.capture import CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, PortError, RefusedError

# An exposure under way on a camera that begins the next one when its picture has arrived.

DOWNLOAD_S = 30.0  # how long after an exposure a picture may be under way before the line counts as lost


@dataclass(frozen=True, slots=True)
class Exposure:
    """``begun_s`` on :func:`time.monotonic`, the same in UTC, and how long it is."""

    begun_s: float
    begun_utc: datetime
    seconds: float

    def check_overdue(self, camera: str) -> None:
        """Raise LineLostError when its picture should have been here long ago."""
        if monotonic() > self.begun_s + self.seconds + DOWNLOAD_S:
            raise LineLostError(f"{camera} sent no image after its exposure.")


# -- What a person types to name a camera on another computer: ``host:port/camera`` ------------


@dataclass(frozen=True, slots=True)
class NetAddress:
    """A server and what is wanted of it; ``rest`` is empty when nothing was named."""

    host: str
    port: int
    rest: str = ""

    @property
    def server(self) -> str:
        """Host and port as they are typed."""
        return f"{self.host}:{self.port}"


def net_address(text: str, default_port: int) -> NetAddress:
    """``text`` taken apart; nothing means this computer.

    An IPv6 host stands in brackets: ``[fe80::1]:7624/Camera``.

    Raises `PortError` when the port is not a number from 1 to 65535.
    """
    server, _, rest = text.strip().removeprefix("http://").partition("/")
    host, port = server, ""
    if server.startswith("["):
        host, _, port = server.partition("]")
        host, port = host + "]", port.removeprefix(":")
    elif ":" in server:
        host, _, port = server.partition(":")
    number = int(port) if port.isascii() and port.isdigit() else (0 if port else default_port)
    if not 1 <= number <= 65535:
        raise PortError(f"'{short_name(port)}' is not a port; write the address as host:{default_port}.")
    return NetAddress(host or "localhost", number, rest.strip("/"))


def unreachable(where: NetAddress, kind: str, error: Exception, program: str = "it") -> PortError:
    """Why nobody at an address could be asked; ``kind`` is the protocol, ``program`` what is to be started."""
    if isinstance(error, ConnectionRefusedError):
        return PortError(f"No {kind} server at {where.server}. Start {program} there.")
    if isinstance(error, gaierror):
        return PortError(f"No computer named {where.host} on this network.")
    return PortError(f"{where.server} does not answer. Check its power and network.")


def chosen(cameras: Sequence[tuple[str, str]], where: NetAddress, kind: str) -> str:
    """Which of a server's ``cameras``, each its address there and its name, ``where.rest`` names.

    The only one need not be named. ``kind`` says of what protocol the server is.

    Raises `PortError` when there is no such camera, none, or one has to be named: with those that there are.
    """
    for address, name in cameras:
        if where.rest in (address, name):
            return address
    there = ", ".join(a if a == name else f"{a} ({name})" for a, name in cameras)
    if where.rest:
        others = f"; there is {there}" if cameras else ""
        raise PortError(f"{where.server} has no camera {where.rest}{others}.")
    if not cameras:
        raise PortError(f"The {kind} server {where.server} has no camera.")
    if len(cameras) > 1:
        raise PortError(f"{where.server} has several cameras: {there}. Write {where.server}/{cameras[0][0]}.")
    return cameras[0][0]


# -- Values of a camera server that are not what they should be --------------------------------


@contextmanager
def making_sense() -> Iterator[None]:
    """Turn what comes of values of the wrong kind into one sentence: None, "x", 1e999, {}."""
    try:
        yield
    except (ValueError, TypeError, AttributeError, ArithmeticError, LookupError) as error:
        raise NoAnswerError("The camera's server reports invalid values.") from error


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
            raise RefusedError(f"The {what} of this camera cannot be set.")
        if not bounds[0] <= value <= bounds[1]:
            raise RefusedError(f"A {what} of {value:g}{unit} is not within {bounds[0]:g} to {bounds[1]:g}{unit}.")


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
