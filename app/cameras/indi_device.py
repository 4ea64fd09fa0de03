"""A camera of an INDI server by the names of INDI's standard properties."""

from app.cameras.exposure import Exposure
from app.cameras.indi_link import IndiLink
from app.core.capture import CaptureLimits, CaptureSettings
from app.core.errors import LineLostError, PortError, RefusedError

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
        return CaptureSettings(
            self.exposure_s, float(told) if told else None, int(float(bins)) if bins else None
        )

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
            why = "its driver ended" if connected is None else "it was disconnected"
            raise LineLostError(f"{self.name} is gone from the INDI server: {why}.")
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
            raise PortError(f"{name} does not connect{self._said()}; is it plugged in and on?")
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
        return told is not None and abs(float(told) - float(meant)) < 1e-6 + 1e-4 * abs(
            float(meant)
        )
    except ValueError:
        return told == meant
