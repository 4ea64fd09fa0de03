"""A camera behind an ASCOM Alpaca server, here or on another computer."""

from contextlib import ExitStack, suppress
from datetime import UTC, datetime, timedelta
from time import monotonic, sleep
from typing import Any

from app.cameras.address import NetAddress, net_address
from app.cameras.alpaca_image import ACCEPT, image_of, sensor_numbers
from app.cameras.alpaca_link import AlpacaLink, NotOfferedError, discover
from app.cameras.sense import making_sense
from app.cameras.within import check_within
from app.core.capture import CameraDevice, CaptureLimits, CaptureSettings
from app.core.errors import DeviceError, LineLostError, PortError, RefusedError
from app.core.frame import Frame
from app.core.hint import Hint

PORT = 11111
POLL_S = 0.05
POWER_UP_S = 20.0
DOWNLOAD_S = 30.0
"""How long a picture may be under way before the line counts as lost."""
_COLOUR, _RGGB, _BROKEN = 1, 2, 5  # SensorType Color, SensorType RGGB, CameraState Error


class AlpacaCamera:
    """One Alpaca camera that exposes again as soon as a picture has arrived."""

    def __init__(self, link: AlpacaLink, number: int) -> None:
        self._link = link
        self._path = f"camera/{number}/"
        self._begun: tuple[float, datetime] | None = None
        self._count = 0
        link.put(f"{self._path}connected", {"Connected": True}, POWER_UP_S)
        self.name = str(self._get("name", "camera"))
        self._sensor = int(self._get("sensortype", 0))
        self._binned = 1
        self._mosaic = int(self._get("bayeroffsetx", 0)), int(self._get("bayeroffsety", 0))
        self._most = int(self._get("maxadu", 0)) or None
        self.limits = self._limits()
        low, high = self.limits.exposure_s or (0.0, 3600.0)
        self._exposure_s = min(max(1.0, low), high)

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
            camera = cls(link, _chosen(link.cameras(), where))
            camera._whole_sensor(1)
            camera.configure(settings)
            failing.pop_all()
        return camera

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
        if settings.gain is not None:
            self._put("gain", Gain=round(settings.gain))
        if settings.binning is not None:
            self._whole_sensor(settings.binning)
        gain = self._get("gain", None)
        return CaptureSettings(
            self._exposure_s, None if gain is None else float(gain), self._binned
        )

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
        begun_s, begun_utc = self._begun or self._expose()
        while not self._link.get(self._path + "imageready"):  # it tells of a failed exposure here
            now = monotonic()
            if now > begun_s + self._exposure_s + DOWNLOAD_S:
                raise LineLostError(f"{self.name} began an exposure and no picture came of it.")
            if now >= deadline:
                self._check()
                return None
            sleep(min(POLL_S, deadline - now))
        data, kind = self._link.fetch(f"/api/v1/{self._path}imagearray", DOWNLOAD_S, ACCEPT)
        hint = self._hint(begun_utc)
        self._expose()  # the next one, while this is looked at
        return self._frame(data, kind, hint)

    def close(self) -> None:
        """End the exposure and let the server go; the camera stays connected to it."""
        with suppress(DeviceError):
            self._abort()
        self._link.close()

    def _frame(self, data: bytes, kind: str, hint: Hint) -> Frame:
        from app.frames.planes import split

        self._count += 1
        pixels, colour, clips = split(sensor_numbers(image_of(data, kind), self._most))
        bayer, warnings = self._pattern() if colour is None else (None, ())
        return Frame(
            pixels, colour, bayer, float(self._most) if self._most and colour is None else clips,
            f"{self.name} {self._count}", hint, warnings, {"XBINNING": self._binned},
        )  # fmt: skip

    def _pattern(self) -> tuple[str | None, tuple[str, ...]]:
        """The mosaic's pattern from the picture's first pixel."""
        from app.frames.bayer import shifted

        if self._sensor <= _COLOUR or self._binned > 1:
            return None, ()
        if self._sensor != _RGGB:
            return None, (f"{self.name} has a colour pattern that is not read: colours are mixed.",)
        return shifted("RGGB", *self._mosaic), ()

    def _hint(self, begun: datetime) -> Hint:
        """When it was exposed by the server's clock, else by ours."""
        seconds = float(self._get("lastexposureduration", self._exposure_s))
        told = str(self._get("lastexposurestarttime", ""))
        with suppress(ValueError):
            begun = datetime.fromisoformat(told.strip().rstrip("Z")).replace(tzinfo=UTC)
        middle = begun + timedelta(seconds=seconds / 2.0)
        return Hint(time_utc=middle, exposure_s=seconds, camera=self.name)

    def _expose(self) -> tuple[float, datetime]:
        self._put("startexposure", Duration=f"{self._exposure_s:.6f}", Light=True)
        self._begun = monotonic(), datetime.now(UTC)
        return self._begun

    def _abort(self) -> None:
        if self._begun is None:
            return
        self._begun = None
        try:
            self._put("abortexposure")
        except (NotOfferedError, RefusedError):
            # Then it has to be waited for; a camera that cannot abort has short exposures.
            deadline = monotonic() + self._exposure_s + DOWNLOAD_S
            while not self._get("imageready", False) and monotonic() < deadline:
                sleep(POLL_S)

    def _check(self) -> None:
        if int(self._get("camerastate", 0)) == _BROKEN:
            raise LineLostError(f"{self.name} reports a fault; is it plugged in and on?")

    def _whole_sensor(self, binning: int) -> None:
        """All of the chip, ``binning`` pixels a side together."""
        with suppress(NotOfferedError):
            self._put("binx", BinX=binning)
            self._put("biny", BinY=binning)
        self._binned = int(self._get("binx", 1))
        for axis in ("X", "Y"):
            size = int(self._get(f"camera{axis.lower()}size", 0)) // self._binned
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
            return self._link.get(self._path + name)
        except RefusedError:
            return default

    def _put(self, name: str, **values: object) -> None:
        self._link.put(self._path + name, values)


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


def _chosen(cameras: list[tuple[int, str]], where: NetAddress) -> int:
    there = ", ".join(f"{number} ({name})" for number, name in cameras)
    for number, name in cameras:
        if where.rest in (str(number), name):
            return number
    if where.rest:
        others = f"; there is {there}" if cameras else ""
        raise PortError(f"{where.server} has no camera {where.rest}{others}.")
    if not cameras:
        raise PortError(f"The Alpaca server {where.server} has no camera.")
    if len(cameras) > 1:
        raise PortError(
            f"{where.server} has several cameras: {there}. Write {where.server}/{cameras[0][0]}."
        )
    return cameras[0][0]
