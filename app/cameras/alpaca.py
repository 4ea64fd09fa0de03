"""A camera behind an ASCOM Alpaca server, here or on another computer."""

from contextlib import ExitStack, suppress
from time import monotonic, sleep

from app.cameras.address import NetAddress, chosen, net_address
from app.cameras.alpaca_device import POLL_S, AlpacaDevice
from app.cameras.alpaca_image import image_of, sensor_numbers
from app.cameras.alpaca_link import AlpacaLink, discover
from app.cameras.exposure import Exposure
from app.cameras.sense import making_sense
from app.cameras.within import check_within
from app.core.capture import CameraDevice, CaptureLimits, CaptureSettings
from app.core.errors import DeviceError
from app.core.frame import Frame
from app.core.hint import Hint

PORT = 11111


class AlpacaCamera:
    """One Alpaca camera that exposes again as soon as a picture has arrived."""

    def __init__(self, device: AlpacaDevice) -> None:
        self.name = device.name
        self._device = device
        self._exposing: Exposure | None = None
        self._count = 0

    @classmethod
    def missing(cls) -> str | None:
        """Nothing needs to be installed."""
        return None

    @classmethod
    def devices(cls, address: str = "") -> list[CameraDevice]:
        """Cameras of the server at ``host:port``, or of all that answer on the local network."""
        if address:
            return _listed(net_address(address, PORT))
        found: list[CameraDevice] = []
        for server in discover():
            with suppress(DeviceError):  # it called, and is gone or is none after all
                found += _listed(net_address(server, PORT))
        return found

    @classmethod
    @making_sense()
    def open(cls, address: str, settings: CaptureSettings) -> "AlpacaCamera":
        """The camera at ``host:port/number``; without a number, the server's only one."""
        where = net_address(address, PORT)
        link = AlpacaLink(where)
        with ExitStack() as failing:
            failing.callback(link.close)
            cameras = [(str(number), name) for number, name in link.cameras()]
            device = AlpacaDevice(link, int(chosen(cameras, where, "Alpaca")))
            camera = cls(device)
            camera.configure(settings)
            failing.pop_all()
        return camera

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

    @making_sense()
    def next_frame(self, timeout_s: float) -> Frame | None:
        """The picture of the exposure under way, when it arrives in time.

        Raises
        ------
        LineLostError
            The server or the camera went away, or a picture is overdue.
        RefusedError
            The camera refused to expose.

        """
        deadline = monotonic() + timeout_s
        exposing = self._exposing = self._exposing or self._device.expose()
        while not self._device.ready:
            exposing.check_overdue(self.name)
            left = deadline - monotonic()
            if left <= 0:
                self._device.check()
                return None
            sleep(min(POLL_S, left))
        data, kind = self._device.picture()
        hint = self._device.hint(exposing)
        self._exposing = self._device.expose()  # the next one, while this is looked at
        return self._frame(data, kind, hint)

    def close(self) -> None:
        """End the exposure and let the server go; the camera stays connected to it."""
        with suppress(DeviceError):
            self._abort()
        self._device.link.close()

    def _frame(self, data: bytes, kind: str, hint: Hint) -> Frame:
        from app.frames.planes import split

        self._count += 1
        most, binned = self._device.most, self._device.binned
        pixels, colour, clips = split(sensor_numbers(image_of(data, kind), most))
        bayer, warnings = self._device.pattern() if colour is None else (None, ())
        full = float(most) if most and colour is None else clips
        return Frame(
            pixels, colour, bayer, full, f"{self.name} {self._count}", hint, warnings,
            {"XBINNING": binned},
        )  # fmt: skip

    def _abort(self) -> None:
        if self._exposing is not None:
            self._exposing = None
            self._device.abort()


def _listed(where: NetAddress) -> list[CameraDevice]:
    link = AlpacaLink(where)
    try:
        cameras = link.cameras()
    finally:
        link.close()
    return [
        CameraDevice("alpaca", f"{where.server}/{number}", f"{name} on {where.host}")
        for number, name in cameras
    ]
