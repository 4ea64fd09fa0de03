"""A camera behind an INDI server, here or on another computer."""

import re
import tempfile
import zlib
from contextlib import ExitStack
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from kochab.core.capture import CameraDevice, CaptureLimits, CaptureSettings
from kochab.core.errors import FrameError, LineLostError, PortError, RefusedError
from kochab.core.frame import Frame
from kochab.gear.cameras.indi_link import IndiLink
from kochab.gear.cameras.server_camera import ExposingCamera, Exposure, chosen, making_sense, net_address

# -- A camera of an INDI server by the names of INDI's standard properties ---------------------

POWER_UP_S = 20.0
"""How long a camera may take to connect to its driver."""
SET_S = 5.0
PICTURE = "CCD1"
GAINS = (("CCD_GAIN", "GAIN"), ("CCD_CONTROLS", "Gain"))


class IndiDevice:
    """What one camera's driver tells and takes; ``exposure_s`` is what it will expose next."""

    def __init__(self, link: IndiLink, name: str) -> None:
        self.name, self.link = name, link
        self.exposure_s = 1.0

    @property
    def limits(self) -> CaptureLimits:
        """As the driver tells them."""
        bins = self.link.bounds(self.name, "CCD_BINNING", "HOR_BIN")
        gain = self._gain()
        return CaptureLimits(
            self.link.bounds(self.name, "CCD_EXPOSURE", "CCD_EXPOSURE_VALUE"),
            gain and self.link.bounds(self.name, *gain),
            bins and (int(bins[0]), int(bins[1])),
        )

    @property
    def in_force(self) -> CaptureSettings:
        """What is set now."""
        gain, bins = self._gain(), self.link.value(self.name, "CCD_BINNING", "HOR_BIN")
        told = gain and self.link.value(self.name, *gain)
        return CaptureSettings(self.exposure_s, float(told) if told else None, int(float(bins)) if bins else None)

    def apply(self, settings: CaptureSettings) -> None:
        """Set what is told; RefusedError when the driver does not take it."""
        if settings.exposure_s is not None:
            self.exposure_s = settings.exposure_s
        if settings.gain is not None and (gain := self._gain()) is not None:
            self._set(gain[0], {gain[1]: f"{settings.gain:g}"}, "gain")
        if settings.binning is not None:
            side = str(settings.binning)
            self._set("CCD_BINNING", {"HOR_BIN": side, "VER_BIN": side}, "binning")

    def expose(self) -> Exposure:
        """Begin an exposure."""
        value = {"CCD_EXPOSURE_VALUE": f"{self.exposure_s:.6g}"}
        self.link.send(self.name, "CCD_EXPOSURE", value)
        return Exposure.now(self.exposure_s)

    def abort(self) -> None:
        """End the exposure under way; its picture, if it comes, is dropped."""
        self.link.send(self.name, "CCD_ABORT_EXPOSURE", {"ABORT": "On"})
        self.link.wait(lambda: self.link.state(self.name, "CCD_EXPOSURE") != "Busy", SET_S)
        self.link.take_blob(0.0)

    def check(self, exposing: bool) -> None:
        """Raise when the camera is no longer connected, or has refused to expose."""
        self.link.check()
        connected = self.link.value(self.name, "CONNECTION", "CONNECT")
        if connected != "On":
            why = "its driver stopped" if connected is None else "it was disconnected"
            raise LineLostError(f"Lost {self.name} on the INDI server: {why}.")
        if exposing and self.link.state(self.name, "CCD_EXPOSURE") == "Alert":
            raise RefusedError(f"{self.name} refused to expose{self._said()}.")

    def power_up(self) -> None:
        """Connect the camera to its driver and have its pictures sent here as FITS."""
        link, name = self.link, self.name
        if link.value(name, "CONNECTION", "CONNECT") != "On":
            link.send(name, "CONNECTION", {"CONNECT": "On"})
        ready = link.wait(
            lambda: (
                link.value(name, "CONNECTION", "CONNECT") == "On"
                and link.state(name, "CONNECTION") != "Busy"
                and link.state(name, "CCD_EXPOSURE") is not None
                and link.state(name, PICTURE) is not None
            ),
            POWER_UP_S,
        )
        if not ready:
            raise PortError(f"Can't connect {name}{self._said()}. Check its cable and power.")
        if link.value(name, "UPLOAD_MODE", "UPLOAD_LOCAL") == "On":
            self._set("UPLOAD_MODE", {"UPLOAD_BOTH": "On"}, "sending pictures")
        if link.value(name, "CCD_TRANSFER_FORMAT", "FORMAT_FITS") == "Off":
            self._set("CCD_TRANSFER_FORMAT", {"FORMAT_FITS": "On"}, "FITS")
        told = link.value(name, "CCD_EXPOSURE", "CCD_EXPOSURE_VALUE")
        self.exposure_s = float(told or 0.0) or 1.0
        link.want_blobs(name, PICTURE)

    def _set(self, vector: str, members: dict[str, str], what: str) -> None:
        link, name = self.link, self.name
        link.send(name, vector, members)
        done = link.wait(
            lambda: (
                link.state(name, vector) != "Busy"
                and all(_same(link.value(name, vector, m), v) for m, v in members.items())
            ),
            SET_S,
        )
        if not done:
            raise RefusedError(f"{name} does not accept this {what}{self._said()}.")

    def _gain(self) -> tuple[str, str] | None:
        return next((g for g in GAINS if self.link.value(self.name, *g) is not None), None)

    def _said(self) -> str:
        return f" ({self.link.message.rstrip('.')})" if self.link.message else ""


def _same(told: str | None, meant: str) -> bool:
    try:
        return told is not None and abs(float(told) - float(meant)) < 1e-6 + 1e-4 * abs(float(meant))
    except ValueError:
        return told == meant


# -- Bytes that came over a line to a frame ----------------------------------------------------

LARGEST_BYTES = 1_200_000_000


def frame_of(data: bytes, suffix: str, name: str) -> Frame:
    """The picture in ``data``; ``suffix`` (".fits", ".jpg", ".cr2") says of what kind it is.

    FITS never touches the disk; ".fits.z" is unpacked first, as older INDI drivers pack it.
    ``name`` stands for the file's in sentences.

    Raises
    ------
    FrameError
        The bytes are no picture, or are cut short.

    """
    from kochab.frames import read_frame
    from kochab.frames.fits import read_fits_bytes

    suffix = re.sub(r"[^A-Za-z0-9.]", "", suffix)[-12:]  # a server's word becomes a file's name
    if suffix.endswith(".z"):
        data, suffix = _unpacked(data, name), suffix.removesuffix(".z")
    if data.startswith(b"SIMPLE  ="):
        return read_fits_bytes(data, name)
    with tempfile.TemporaryDirectory(prefix="kochab-", ignore_cleanup_errors=True) as folder:
        path = Path(folder, f"frame{suffix}")
        path.write_bytes(data)
        try:
            return replace(read_frame(path), path=name)
        except FrameError as error:
            raise FrameError(str(error).replace(path.name, name)) from None


def _unpacked(data: bytes, name: str) -> bytes:
    stream = zlib.decompressobj()
    try:
        out = stream.decompress(data, LARGEST_BYTES)
    except zlib.error:
        raise FrameError(f"{name} is damaged and can't be decompressed.") from None
    if not stream.eof:
        raise FrameError(f"{name} is cut short, or too large.")
    return out


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
            self._complaints.append(f"Frame skipped: {error}")
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
