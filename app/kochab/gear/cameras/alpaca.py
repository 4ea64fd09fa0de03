"""A camera behind an ASCOM Alpaca server, here or on another computer."""

import json
import math
import struct
from contextlib import ExitStack, closing, suppress
from datetime import UTC, datetime, timedelta
from time import monotonic, sleep
from typing import Any

import numpy as np

from kochab.core.arrays import Array
from kochab.core.capture import CameraDevice, CaptureLimits, CaptureSettings
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, RefusedError
from kochab.core.frame import Frame, Hint
from kochab.gear.cameras.server_camera import DOWNLOAD_S, ExposingCamera, Exposure
from kochab.gear.servers.address import NetAddress, chosen, making_sense, net_address, server_text
from kochab.gear.servers.alpaca_link import PORT, AlpacaLink, NotOfferedError, discover, raise_refusal
from kochab.text.translation import tr

# -- A picture as Alpaca sends it: ImageBytes, or JSON from servers that know no better --------
# ASCOM's arrays are [x][y] or [x][y][colour]; here they become rows.

ACCEPT = "application/imagebytes"
_HEADER = struct.Struct("<11i")
_TYPES = {1: "<i2", 2: "<i4", 3: "<f8", 4: "<f4", 5: "<u8", 6: "u1", 7: "<i8", 8: "<u2", 9: "<u4"}
_LARGEST = 300_000_000


def image_of(data: bytes, content_type: str) -> Array:
    """Rows (H, W) or (H, W, 3) of an answer, in the type it was sent in.

    Raises `NoAnswerError` when it is no picture, or cut short, or the `DeviceError` that the server sent in its place.
    """
    return _from_bytes(data) if ACCEPT in content_type else _from_json(data)


def _from_bytes(data: bytes) -> Array:
    if len(data) < _HEADER.size:
        raise NoAnswerError("The camera sent an incomplete image. Take another.")
    _, error, _, _, start, _, kind, rank, *sides = _HEADER.unpack_from(data)
    if error:
        raise_refusal(error, data[max(start, _HEADER.size) :].decode("utf-8", "replace"))
    shape = tuple(sides[:rank])
    if kind not in _TYPES or rank not in (2, 3) or min(shape, default=0) < 1 or start < 0:
        raise NoAnswerError("The camera sent an image in an unsupported format.")
    dtype = np.dtype(_TYPES[kind])
    size = math.prod(shape)
    if size > _LARGEST or len(data) - start < size * dtype.itemsize:
        raise NoAnswerError("The camera sent an incomplete image. Take another.")
    return np.frombuffer(data, dtype, size, start).reshape(shape).swapaxes(0, 1)


def _from_json(data: bytes) -> Array:
    try:
        reply = json.loads(data)
        raise_refusal(int(reply.get("ErrorNumber", 0)), str(reply.get("ErrorMessage", "")))
        array = np.asarray(reply["Value"], dtype=np.float64 if reply.get("Type") == 3 else np.int32)
        if array.ndim not in (2, 3) or not array.size:
            raise ValueError(array.shape)
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        raise NoAnswerError("The camera sent an image in an unsupported format.") from None
    return array.swapaxes(0, 1)


def sensor_numbers(rows: Array, most: int | None) -> Array:
    """The same as unsigned 8 or 16 bits where ``most`` (MaxADU) allows it, contiguous."""
    if rows.dtype.kind not in "iu" or most is None or most > 65535:
        wide = rows.dtype.newbyteorder("=")
        if wide.itemsize == 8:
            wide = np.dtype(np.float32)
        return np.ascontiguousarray(rows, dtype=wide)
    small: type[np.uint8] | type[np.uint16] = np.uint8 if rows.dtype == np.uint8 else np.uint16
    # ASCOM's arrays are int32 for 16-bit sensors too; what does not fit is clipped, not wrapped.
    if rows.dtype.kind == "i" or rows.dtype.itemsize > 2:
        rows = np.clip(rows, 0, 65535)
    return np.ascontiguousarray(rows, dtype=small)


# -- A camera of an ASCOM Alpaca server by the names of its properties -------------------------

POLL_S = 0.05
POWER_UP_S = 20.0
_COLOUR, _RGGB, _BROKEN = 1, 2, 5  # SensorType Color, SensorType RGGB, CameraState Error


class AlpacaCamera(ExposingCamera):
    """One Alpaca camera."""

    def __init__(self, link: AlpacaLink, number: int) -> None:
        self._link, self._path = link, f"camera/{number}/"
        link.put(f"{self._path}connected", {"Connected": True}, POWER_UP_S)
        super().__init__(server_text(str(self._get("name", "camera"))), link.close)
        self._sensor = int(self._get("sensortype", 0))
        self._binned = 1  # so many pixels a side are one
        self._mosaic = int(self._get("bayeroffsetx", 0)), int(self._get("bayeroffsety", 0))
        self._most = max(0, int(self._get("maxadu", 0))) or None  # the level at which it clips, where it says so
        self._limits = self._ranges()
        low, high = self._limits.exposure_s or (0.0, 3600.0)
        self.exposure_s = min(max(1.0, low), high)
        self._set_binning(1)

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
            camera = cls(link, int(chosen([(str(number), name) for number, name in link.devices()], where, "Alpaca")))
            camera.configure(settings)
            failing.pop_all()
        return camera

    @property
    def limits(self) -> CaptureLimits:
        """As the camera told them when it was opened."""
        return self._limits

    @making_sense()
    def next_frame(self, timeout_s: float) -> Frame | None:
        """The picture of the exposure under way, when it arrives in time."""
        deadline = monotonic() + timeout_s
        exposing = self._exposing = self._exposing or self._expose()
        while not self._link.get(self._path + "imageready"):  # a refusal tells that exposing has failed
            exposing.check_overdue(self.name)
            left = deadline - monotonic()
            if left <= 0:
                if int(self._get("camerastate", 0)) == _BROKEN:
                    raise LineLostError("{name} reports a fault. Check its cable and power.", name=self.name)
                return None
            sleep(min(POLL_S, left))
        data, kind = self._link.fetch(f"/api/v1/{self._path}imagearray", DOWNLOAD_S, ACCEPT, picture=True)
        hint = self._hint(exposing)
        self._exposing = self._expose()  # the next one, while this is looked at
        return self._frame(data, kind, hint)

    def _frame(self, data: bytes, kind: str, hint: Hint) -> Frame:
        from kochab.frames import split

        self._count += 1
        most, header = self._most, {"XBINNING": self._binned}
        pixels, colour, clips = split(sensor_numbers(image_of(data, kind), most))
        bayer, warnings = self._pattern() if colour is None else (None, ())
        full = float(most) if most and colour is None else clips
        return Frame(pixels, colour, bayer, full, f"{self.name} {self._count}", hint, warnings, header)

    def _pattern(self) -> tuple[str | None, tuple[str, ...]]:
        """The mosaic's pattern from the picture's first pixel."""
        from kochab.frames import shifted

        if self._sensor <= _COLOUR or self._binned > 1:
            return None, ()
        if self._sensor != _RGGB:
            return None, (tr("{name}: unsupported Bayer pattern. The frame is read as mono.", name=self.name),)
        return shifted("RGGB", *self._mosaic), ()

    def _hint(self, exposed: Exposure) -> Hint:
        """When it was exposed by the server's clock, else by ours."""
        seconds = float(self._get("lastexposureduration", exposed.seconds))
        if not 0.0 <= seconds < 1e6:
            seconds = exposed.seconds
        begun, reply = exposed.begun_utc, str(self._get("lastexposurestarttime", ""))
        with suppress(ValueError):
            begun = datetime.fromisoformat(reply.strip().rstrip("Z")).replace(tzinfo=UTC)
        return Hint(time_utc=begun + timedelta(seconds=seconds / 2.0), exposure_s=seconds, camera=self.name)

    def _settings(self) -> CaptureSettings:
        gain = self._get("gain", None)
        return CaptureSettings(self.exposure_s, None if gain is None else float(gain), self._binned)

    def _set_gain(self, gain: float) -> None:
        self._put("gain", Gain=round(gain))

    def _set_binning(self, binning: int) -> None:
        """Take all of the chip, ``binning`` pixels a side together."""
        # A camera without binning has no binx to set.
        with suppress(NotOfferedError):
            self._put("binx", BinX=binning)
            self._put("biny", BinY=binning)
        self._binned = int(self._get("binx", 1))
        for axis in ("X", "Y"):
            size = int(self._get(f"camera{axis.lower()}size", 0)) // self._binned
            self._put(f"start{axis.lower()}", **{f"Start{axis}": 0})
            self._put(f"num{axis.lower()}", **{f"Num{axis}": size})

    def _start(self) -> None:
        self._put("startexposure", Duration=f"{self.exposure_s:.6f}", Light=True)

    def _abort(self) -> None:
        try:
            self._put("abortexposure")
        except RefusedError:
            # Then it has to be waited for; a camera that cannot abort has short exposures.
            deadline = monotonic() + self.exposure_s + DOWNLOAD_S
            while not self._get("imageready", False) and monotonic() < deadline:
                sleep(POLL_S)

    def _ranges(self) -> CaptureLimits:
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
    with closing(AlpacaLink(where)) as link:
        cameras = link.devices()
    named = [(number, tr("{name} on {host}", name=name, host=where.host)) for number, name in cameras]
    return [CameraDevice("alpaca", f"{where.server}/{number}", name) for number, name in named]
