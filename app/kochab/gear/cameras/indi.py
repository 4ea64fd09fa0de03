"""A camera behind an INDI server, here or on another computer."""

import re
import tempfile
import zlib
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

from kochab.core.capture import CameraDevice, CaptureLimits, CaptureSettings
from kochab.core.errors import FrameError, PortError, RefusedError
from kochab.core.frame import Frame
from kochab.gear.cameras.server_camera import ExposingCamera, Exposure
from kochab.gear.servers.address import chosen, making_sense, net_address
from kochab.gear.servers.indi_link import CCD_INTERFACE, PORT, SET_S, IndiDevice, IndiLink, missing
from kochab.text.translation import tr

# -- Bytes that came over a line to a frame ----------------------------------------------------

LARGEST_BYTES = 1_200_000_000


def frame_of(data: bytes, suffix: str, name: str) -> Frame:
    """The picture in ``data``; ``suffix`` (".fits", ".jpg", ".cr2") says of what kind it is.

    FITS never touches the disk; ".fits.z" is unpacked first, as older INDI drivers pack it.
    ``name`` stands for the file's in sentences.

    Raises `FrameError` when the bytes are no picture, or are cut short.
    """
    from kochab.frames import read_fits_bytes, read_frame

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
        raise FrameError("{name} is damaged and can't be decompressed.", name=name) from None
    if not stream.eof:
        raise FrameError("{name} is cut short, or too large.", name=name)
    return out


# -- A camera of an INDI server by the names of INDI's standard properties ---------------------

PICTURE = "CCD1"
GAINS = (("CCD_GAIN", "GAIN"), ("CCD_CONTROLS", "Gain"))


class IndiCamera(ExposingCamera):
    """One INDI camera."""

    def __init__(self, link: IndiLink, name: str) -> None:
        super().__init__(name, link.close)
        self._link = link
        self._device = IndiDevice(link, name)
        self._complaints: list[str] = []
        self._aborted = False  # since the last picture
        self._power_up()

    @classmethod
    def missing(cls) -> str | None:
        """The client library is an extra."""
        return missing()

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
        with closing(link):
            names = link.named(CCD_INTERFACE)
        return [
            CameraDevice("indi", f"{where.server}/{n}", tr("{name} on {host}", name=n, host=where.host)) for n in names
        ]

    @classmethod
    @making_sense()
    def open(cls, address: str, settings: CaptureSettings) -> "IndiCamera":
        """The camera at ``host:port/name``; the name may be left out when there is one only."""
        where = net_address(address, PORT)
        link = IndiLink(where)
        with ExitStack() as failing:
            failing.callback(link.close)
            camera = cls(link, chosen([(name, name) for name in link.named(CCD_INTERFACE, where.rest)], where, "INDI"))
            # Without the wait a gain that the driver defines last would be refused as one that cannot be set.
            link.wait(lambda: settings.gain is None or camera._gain() is not None, SET_S)  # told one by one
            camera.configure(settings)
            failing.pop_all()
        return camera

    @property
    def limits(self) -> CaptureLimits:
        """As the driver tells them."""
        # Asked each time: drivers define their vectors one by one.
        bins = self._link.bounds(self.name, "CCD_BINNING", "HOR_BIN")
        gain = self._gain()
        return CaptureLimits(
            self._link.bounds(self.name, "CCD_EXPOSURE", "CCD_EXPOSURE_VALUE"),
            gain and self._link.bounds(self.name, *gain),
            bins and (int(bins[0]), int(bins[1])),
        )

    def complaints(self) -> tuple[str, ...]:
        """Sentences about pictures that were left out since the last call."""
        complaints, self._complaints = tuple(self._complaints), []
        return complaints

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The picture of the exposure under way, when it arrives in time."""
        self._check()
        exposing = self._exposing = self._exposing or self._expose()
        blob = self._link.take_blob(timeout_s)
        if blob is None or self._is_late(*blob):
            exposing.check_overdue(self.name)
            return None
        self._exposing = self._expose()  # the next one, while this is looked at
        return self._frame(*blob, exposing)

    def _is_late(self, data: bytes, suffix: str) -> bool:
        """Whether the first picture since an exposure was aborted tells of the binning before: it was under way."""
        aborted, self._aborted = self._aborted, False
        if aborted:
            with suppress(FrameError):
                binning = frame_of(data, suffix, self.name).header.get("XBINNING")
                return binning is not None and binning != self._settings().binning
        return False

    def _frame(self, data: bytes, suffix: str, exposed: Exposure) -> Frame | None:
        self._count += 1
        try:
            frame = frame_of(data, suffix, f"{self.name} {self._count}")
        except FrameError as error:
            self._complaints.append(f"Frame skipped: {error}")
            return None
        hint = frame.hint
        if hint.time_utc is None:
            hint = replace(hint, time_utc=exposed.begun_utc + timedelta(seconds=exposed.seconds / 2.0))
        if hint.exposure_s is None:
            hint = replace(hint, exposure_s=exposed.seconds)
        return replace(frame, hint=hint)

    def _check(self) -> None:
        """Raise when the camera is no longer connected, or has refused to expose."""
        self._device.check()
        if self._exposing is not None and self._device.state("CCD_EXPOSURE") == "Alert":
            # gPhoto's driver says what it lacks, the size of the pixels, as no error.
            why = self._device.message(any_kind=True)
            raise RefusedError("{name} refused to expose{message}.", name=self.name, message=why)

    def _power_up(self) -> None:
        """Connect the camera to its driver and have its pictures sent here as FITS."""
        self._device.power_up("CCD_EXPOSURE", PICTURE)
        if self._device.value("UPLOAD_MODE", "UPLOAD_LOCAL") == "On":
            self._device.set("UPLOAD_MODE", {"UPLOAD_BOTH": "On"}, "sending pictures")
        if self._device.value("CCD_TRANSFER_FORMAT", "FORMAT_FITS") == "Off":
            self._device.set("CCD_TRANSFER_FORMAT", {"FORMAT_FITS": "On"}, "FITS")
        self.exposure_s = float(self._device.value("CCD_EXPOSURE", "CCD_EXPOSURE_VALUE") or 0.0) or 1.0
        self._link.want_blobs(self.name, PICTURE)

    def _settings(self) -> CaptureSettings:
        gain, bins = self._gain(), self._device.value("CCD_BINNING", "HOR_BIN")
        gain_text = gain and self._device.value(*gain)
        return CaptureSettings(
            self.exposure_s, float(gain_text) if gain_text else None, int(float(bins)) if bins else None
        )

    def _set_gain(self, gain: float) -> None:
        if (place := self._gain()) is not None:
            self._device.set(place[0], {place[1]: f"{gain:g}"}, "gain")

    def _set_binning(self, binning: int) -> None:
        self._device.set("CCD_BINNING", {"HOR_BIN": str(binning), "VER_BIN": str(binning)}, "binning")

    def _start(self) -> None:
        self._device.send("CCD_EXPOSURE", {"CCD_EXPOSURE_VALUE": f"{self.exposure_s:.6g}"})

    def _abort(self) -> None:
        self._device.send("CCD_ABORT_EXPOSURE", {"ABORT": "On"})
        self._link.wait(lambda: self._device.state("CCD_EXPOSURE") != "Busy", SET_S)
        done = self._device.state("CCD_EXPOSURE") == "Ok"  # before it was aborted: its picture comes, and is dropped
        self._aborted = self._link.take_blob(SET_S if done else 0.0) is None

    def _gain(self) -> tuple[str, str] | None:
        """Where its gain stands, which differs from driver to driver."""
        return next((g for g in GAINS if self._device.value(*g) is not None), None)
