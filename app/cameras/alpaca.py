"""A camera behind an ASCOM Alpaca server, here or on another computer."""

from contextlib import ExitStack, suppress
from time import monotonic, sleep

from app.cameras.address import NetAddress, chosen, net_address
from app.cameras.alpaca_device import POLL_S, AlpacaDevice
from app.cameras.alpaca_image import image_of, sensor_numbers
from app.cameras.alpaca_link import AlpacaLink, discover
from app.cameras.exposing import ExposingCamera
from app.cameras.sense import making_sense
from app.core.capture import CameraDevice, CaptureSettings
from app.core.errors import DeviceError
from app.core.frame import Frame
from app.core.hint import Hint

PORT = 11111


class AlpacaCamera(ExposingCamera[AlpacaDevice]):
    """One Alpaca camera."""

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
