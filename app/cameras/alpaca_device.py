"""A camera of an ASCOM Alpaca server by the names of its properties."""

from contextlib import suppress
from datetime import UTC, datetime, timedelta
from time import monotonic, sleep
from typing import Any

from app.cameras.alpaca_image import ACCEPT
from app.cameras.alpaca_link import AlpacaLink, NotOfferedError
from app.cameras.exposure import DOWNLOAD_S, Exposure
from app.core.capture import CaptureLimits, CaptureSettings
from app.core.errors import LineLostError, RefusedError
from app.core.hint import Hint

POLL_S = 0.05
POWER_UP_S = 20.0
_COLOUR, _RGGB, _BROKEN = 1, 2, 5  # SensorType Color, SensorType RGGB, CameraState Error


class AlpacaDevice:
    """What one camera tells and takes; ``exposure_s`` is what it will expose next.

    ``most`` is the level at which it clips, None when it does not say; ``binned`` pixels a side are
    one.
    """

    def __init__(self, link: AlpacaLink, number: int) -> None:
        self.link = link
        self._path = f"camera/{number}/"
        link.put(f"{self._path}connected", {"Connected": True}, POWER_UP_S)
        self.name = str(self._get("name", "camera"))
        self._sensor = int(self._get("sensortype", 0))
        self.binned = 1
        self._mosaic = int(self._get("bayeroffsetx", 0)), int(self._get("bayeroffsety", 0))
        self.most = int(self._get("maxadu", 0)) or None
        self.limits = self._limits()
        low, high = self.limits.exposure_s or (0.0, 3600.0)
        self.exposure_s = min(max(1.0, low), high)
        self._whole_sensor(1)

    def apply(self, settings: CaptureSettings) -> None:
        """Set what is told."""
        if settings.exposure_s is not None:
            self.exposure_s = settings.exposure_s
        if settings.gain is not None:
            self._put("gain", Gain=round(settings.gain))
        if settings.binning is not None:
            self._whole_sensor(settings.binning)

    @property
    def in_force(self) -> CaptureSettings:
        """What is set now."""
        gain = self._get("gain", None)
        return CaptureSettings(self.exposure_s, None if gain is None else float(gain), self.binned)

    def expose(self) -> Exposure:
        """Begin an exposure."""
        self._put("startexposure", Duration=f"{self.exposure_s:.6f}", Light=True)
        return Exposure.now(self.exposure_s)

    @property
    def ready(self) -> bool:
        """Whether the picture can be fetched; a refusal tells that exposing has failed."""
        return bool(self.link.get(self._path + "imageready"))

    def picture(self) -> tuple[bytes, str]:
        """The picture's bytes and of what kind they are."""
        return self.link.fetch(f"/api/v1/{self._path}imagearray", DOWNLOAD_S, ACCEPT)

    def abort(self) -> None:
        """End the exposure under way."""
        try:
            self._put("abortexposure")
        except (NotOfferedError, RefusedError):
            # Then it has to be waited for; a camera that cannot abort has short exposures.
            deadline = monotonic() + self.exposure_s + DOWNLOAD_S
            while not self._get("imageready", False) and monotonic() < deadline:
                sleep(POLL_S)

    def pattern(self) -> tuple[str | None, tuple[str, ...]]:
        """The mosaic's pattern from the picture's first pixel."""
        from app.frames.bayer import shifted

        if self._sensor <= _COLOUR or self.binned > 1:
            return None, ()
        if self._sensor != _RGGB:
            return None, (f"{self.name} has a colour pattern that is not read: colours are mixed.",)
        return shifted("RGGB", *self._mosaic), ()

    def hint(self, exposed: Exposure) -> Hint:
        """When it was exposed by the server's clock, else by ours."""
        seconds = float(self._get("lastexposureduration", exposed.seconds))
        begun, told = exposed.begun_utc, str(self._get("lastexposurestarttime", ""))
        with suppress(ValueError):
            begun = datetime.fromisoformat(told.strip().rstrip("Z")).replace(tzinfo=UTC)
        middle = begun + timedelta(seconds=seconds / 2.0)
        return Hint(time_utc=middle, exposure_s=seconds, camera=self.name)

    def check(self) -> None:
        """Raise LineLostError when the camera says that it is broken."""
        if int(self._get("camerastate", 0)) == _BROKEN:
            raise LineLostError(f"{self.name} reports a fault; is it plugged in and on?")

    def _whole_sensor(self, binning: int) -> None:
        """All of the chip, ``binning`` pixels a side together."""
        with suppress(NotOfferedError):
            self._put("binx", BinX=binning)
            self._put("biny", BinY=binning)
        self.binned = int(self._get("binx", 1))
        for axis in ("X", "Y"):
            size = int(self._get(f"camera{axis.lower()}size", 0)) // self.binned
            self._put(f"start{axis.lower()}", **{f"Start{axis}": 0})
            self._put(f"num{axis.lower()}", **{f"Num{axis}": size})

    def _limits(self) -> CaptureLimits:
        low, high = self._get("exposuremin", None), self._get("exposuremax", None)
        gain = self._get("gainmin", None), self._get("gainmax", None)
        if None in gain:
            names = self._get("gains", None)
            gain = (0, len(names) - 1) if names else (None, None)
        most_bins = int(self._get("maxbinx", 1))
        return CaptureLimits(
            None if low is None or high is None else (float(low), float(high)),
            None if None in gain else (float(gain[0] or 0), float(gain[1] or 0)),
            (1, most_bins) if most_bins > 1 else None,
        )

    def _get(self, name: str, default: Any) -> Any:
        """A property, or ``default`` when the camera does not have it or not just now."""
        try:
            return self.link.get(self._path + name)
        except RefusedError:
            return default

    def _put(self, name: str, **values: object) -> None:
        self.link.put(self._path + name, values)
