"""A camera behind an INDI server, here or on another computer."""

from contextlib import ExitStack, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from importlib.util import find_spec
from time import monotonic

from app.cameras.address import net_address
from app.cameras.blob import frame_of
from app.cameras.indi_link import IndiLink
from app.cameras.sense import making_sense
from app.cameras.within import check_within
from app.core.capture import CameraDevice, CaptureLimits, CaptureSettings
from app.core.errors import DeviceError, FrameError, LineLostError, PortError, RefusedError
from app.core.frame import Frame

PORT = 7624
TELL_S = 5.0
"""How long a server may take to tell what it has."""
MORE_S = 0.5
"""How long after its first camera it may take to tell of another."""
POWER_UP_S = 20.0
"""How long a camera may take to connect to its driver."""
SET_S = 5.0
DOWNLOAD_S = 30.0
"""How long after an exposure a picture may be under way before the line counts as lost."""
PICTURE = "CCD1"
GAINS = (("CCD_GAIN", "GAIN"), ("CCD_CONTROLS", "Gain"))


class IndiCamera:
    """One INDI camera that exposes again as soon as a picture has arrived."""

    def __init__(self, link: IndiLink, device: str) -> None:
        self.name = device
        self._link = link
        self._exposure_s = 1.0
        self._begun: tuple[float, datetime] | None = None
        self._count = 0
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
            camera = cls(link, _chosen(_told(link, where.rest), where.rest, where.server))
            camera._power_up()
            camera.configure(settings)
            failing.pop_all()
        return camera

    @property
    def limits(self) -> CaptureLimits:
        """As the driver tells them."""
        bins = self._link.bounds(self.name, "CCD_BINNING", "HOR_BIN")
        gain = self._gain()
        return CaptureLimits(
            self._link.bounds(self.name, "CCD_EXPOSURE", "CCD_EXPOSURE_VALUE"),
            gain and self._link.bounds(self.name, *gain),
            bins and (int(bins[0]), int(bins[1])),
        )

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
        if settings.exposure_s is not None:
            self._exposure_s = settings.exposure_s
        if settings.gain is not None and (gain := self._gain()) is not None:
            self._set(gain[0], {gain[1]: f"{settings.gain:g}"}, "gain")
        if settings.binning is not None:
            side = str(settings.binning)
            self._set("CCD_BINNING", {"HOR_BIN": side, "VER_BIN": side}, "binning")
        return self._in_force()

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
        self._check()
        begun_s, begun_utc = self._begun or self._expose()
        blob = self._link.take_blob(timeout_s)
        if blob is None:
            if monotonic() > begun_s + self._exposure_s + DOWNLOAD_S:
                raise LineLostError(f"{self.name} began an exposure and no picture came of it.")
            return None
        exposure_s = self._exposure_s
        self._expose()  # the next one, while this is looked at
        return self._frame(*blob, begun_utc, exposure_s)

    def close(self) -> None:
        """End the exposure and leave the server; the camera stays connected to its driver."""
        with suppress(DeviceError):
            self._abort()
        self._link.close()

    def _frame(self, data: bytes, suffix: str, begun: datetime, exposure_s: float) -> Frame | None:
        self._count += 1
        try:
            frame = frame_of(data, suffix, f"{self.name} {self._count}")
        except FrameError as error:
            self._complaints.append(f"A picture was left out: {error}")
            return None
        hint = frame.hint
        if hint.time_utc is None:
            hint = replace(hint, time_utc=begun + timedelta(seconds=exposure_s / 2.0))
        if hint.exposure_s is None:
            hint = replace(hint, exposure_s=exposure_s)
        return replace(frame, hint=hint)

    def _expose(self) -> tuple[float, datetime]:
        value = {"CCD_EXPOSURE_VALUE": f"{self._exposure_s:.6g}"}
        self._link.send(self.name, "CCD_EXPOSURE", value)
        self._begun = monotonic(), datetime.now(UTC)
        return self._begun

    def _abort(self) -> None:
        if self._begun is None:
            return
        self._begun = None
        self._link.send(self.name, "CCD_ABORT_EXPOSURE", {"ABORT": "On"})
        self._link.wait(lambda: self._link.state(self.name, "CCD_EXPOSURE") != "Busy", SET_S)
        self._link.take_blob(0.0)

    def _check(self) -> None:
        """Raise when the camera is no longer connected, or has refused."""
        self._link.check()
        connected = self._link.value(self.name, "CONNECTION", "CONNECT")
        if connected != "On":
            why = "its driver ended" if connected is None else "it was disconnected"
            raise LineLostError(f"{self.name} is gone from the INDI server: {why}.")
        if self._begun and self._link.state(self.name, "CCD_EXPOSURE") == "Alert":
            raise RefusedError(f"{self.name} refused to expose{self._said()}.")

    def _power_up(self) -> None:
        """Connect the camera to its driver and have its pictures sent here as FITS."""
        link, name = self._link, self.name
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
            raise PortError(f"{name} does not connect{self._said()}; is it plugged in and on?")
        if link.value(name, "UPLOAD_MODE", "UPLOAD_LOCAL") == "On":
            self._set("UPLOAD_MODE", {"UPLOAD_BOTH": "On"}, "sending pictures")
        if link.value(name, "CCD_TRANSFER_FORMAT", "FORMAT_FITS") == "Off":
            self._set("CCD_TRANSFER_FORMAT", {"FORMAT_FITS": "On"}, "FITS")
        told = link.value(name, "CCD_EXPOSURE", "CCD_EXPOSURE_VALUE")
        self._exposure_s = float(told or 0.0) or 1.0
        link.want_blobs(name, PICTURE)

    def _set(self, vector: str, members: dict[str, str], what: str) -> None:
        link, name = self._link, self.name
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
        return next((g for g in GAINS if self._link.value(self.name, *g) is not None), None)

    def _in_force(self) -> CaptureSettings:
        gain, bins = self._gain(), self._link.value(self.name, "CCD_BINNING", "HOR_BIN")
        told = gain and self._link.value(self.name, *gain)
        return CaptureSettings(
            self._exposure_s, float(told) if told else None, int(float(bins)) if bins else None
        )

    def _said(self) -> str:
        return f" ({self._link.message.rstrip('.')})" if self._link.message else ""


def _told(link: IndiLink, wanted: str = "") -> list[str]:
    """The server's cameras: they are told one after another, and nobody says which is the last."""
    if link.wait(lambda: bool(link.cameras()), TELL_S):
        link.wait(lambda: wanted in link.cameras(), MORE_S)
    return link.cameras()


def _chosen(names: list[str], wanted: str, server: str) -> str:
    there = ", ".join(names)
    if wanted in names:
        return wanted
    if wanted:
        others = f"; there is {there}" if names else ""
        raise PortError(f"{server} has no camera called {wanted}{others}.")
    if not names:
        raise PortError(f"The INDI server {server} has no camera.")
    if len(names) > 1:
        raise PortError(f"{server} has several cameras: {there}. Write {server}/{names[0]}.")
    return names[0]


def _same(told: str | None, meant: str) -> bool:
    try:
        return told is not None and abs(float(told) - float(meant)) < 1e-6 + 1e-4 * abs(
            float(meant)
        )
    except ValueError:
        return told == meant
