"""A camera behind an INDI server, here or on another computer."""

from contextlib import ExitStack
from dataclasses import replace
from importlib.util import find_spec

from app.cameras.address import chosen, net_address
from app.cameras.blob import frame_of
from app.cameras.exposing import ExposingCamera
from app.cameras.exposure import Exposure
from app.cameras.indi_device import IndiDevice
from app.cameras.indi_link import IndiLink
from app.cameras.sense import making_sense
from app.core.capture import CameraDevice, CaptureSettings
from app.core.errors import FrameError, PortError
from app.core.frame import Frame

PORT = 7624
TELL_S = 5.0
"""How long a server may take to tell what it has."""
MORE_S = 0.5
"""How long after its first camera it may take to tell of another."""


class IndiCamera(ExposingCamera[IndiDevice]):
    """One INDI camera."""

    def __init__(self, device: IndiDevice) -> None:
        super().__init__(device)
        self._complaints: list[str] = []

    @classmethod
    def missing(cls) -> str | None:
        """The client library is an extra."""
        if find_spec("indipyclient") is not None:
            return None
        return "INDI cameras need one more package: pip install 'kochab[indi]'."

    @classmethod
    def devices(cls, address: str = "") -> list[CameraDevice]:
        """Cameras of the server at ``host:port``; with no address, of one on this computer."""
        where = net_address(address, PORT)
        try:
            link = IndiLink(where)
        except PortError:
            if address:
                raise
            return []
        try:
            names = _told(link)
        finally:
            link.close()
        return [CameraDevice("indi", f"{where.server}/{n}", f"{n} on {where.host}") for n in names]

    @classmethod
    @making_sense()
    def open(cls, address: str, settings: CaptureSettings) -> "IndiCamera":
        """The camera at ``host:port/name``; the name may be left out when there is one only."""
        where = net_address(address, PORT)
        link = IndiLink(where)
        with ExitStack() as failing:
            failing.callback(link.close)
            names = [(name, name) for name in _told(link, where.rest)]
            device = IndiDevice(link, chosen(names, where, "INDI"))
            device.power_up()
            camera = cls(device)
            camera.configure(settings)
            failing.pop_all()
        return camera

    def complaints(self) -> tuple[str, ...]:
        """Sentences about pictures that were left out since the last call."""
        told, self._complaints = tuple(self._complaints), []
        return told

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The picture of the exposure under way, when it arrives in time.

        Raises
        ------
        LineLostError
            The server, the driver or the camera went away, or a picture is overdue.
        RefusedError
            The camera refused to expose.

        """
        self._device.check(exposing=self._exposing is not None)
        exposing = self._exposing = self._exposing or self._device.expose()
        blob = self._device.link.take_blob(timeout_s)
        if blob is None:
            exposing.check_overdue(self.name)
            return None
        self._exposing = self._device.expose()  # the next one, while this is looked at
        return self._frame(*blob, exposing)

    def _frame(self, data: bytes, suffix: str, exposed: Exposure) -> Frame | None:
        self._count += 1
        try:
            frame = frame_of(data, suffix, f"{self.name} {self._count}")
        except FrameError as error:
            self._complaints.append(f"A picture was left out: {error}")
            return None
        hint = frame.hint
        if hint.time_utc is None:
            hint = replace(hint, time_utc=exposed.middle_utc)
        if hint.exposure_s is None:
            hint = replace(hint, exposure_s=exposed.seconds)
        return replace(frame, hint=hint)


def _told(link: IndiLink, wanted: str = "") -> list[str]:
    """The server's cameras: they are told one after another, and nobody says which is the last."""
    if link.wait(lambda: bool(link.cameras()), TELL_S):
        link.wait(lambda: wanted in link.cameras(), MORE_S)
    return link.cameras()
