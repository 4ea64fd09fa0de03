"""Webcams and other video cameras: V4L2, DirectShow, AVFoundation, and streams over a network.

FFmpeg's input devices are read through PyAV. A camera of this kind streams whether anybody looks
or not, so a thread of its own reads it and keeps the newest picture alone.
"""

import re
import sys
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from importlib.util import find_spec
from pathlib import Path
from threading import Condition, Thread
from time import monotonic
from typing import Any

from kochab.core.capture import CameraDevice, CameraSource, CaptureLimits, CaptureSettings
from kochab.core.errors import LineLostError, PortError, RefusedError
from kochab.core.frame import Frame, Hint
from kochab.gear.cameras.server_camera import check_within
from kochab.text.translation import tr

# Exposure and gain of a video camera, where its driver offers them: V4L2 through linuxpy.

UNIT_S = 1e-4  # of V4L2_CID_EXPOSURE_ABSOLUTE
MANUAL = 1  # V4L2_EXPOSURE_MANUAL
GAINS = ("GAIN", "ANALOGUE_GAIN")


class Controls:
    """What can be set, from a driver's controls by the names of V4L2's constants.

    Each control has ``value``, ``minimum`` and ``maximum``.
    """

    def __init__(self, controls: Mapping[str, Any]) -> None:
        self._automatic = controls.get("EXPOSURE_AUTO")
        self._exposure = controls.get("EXPOSURE_ABSOLUTE")
        self._gain = next((controls[name] for name in GAINS if name in controls), None)
        self.exposure_s: float | None = None

    @property
    def limits(self) -> CaptureLimits:
        """The driver's ranges."""
        exposure = _range(self._exposure)
        return CaptureLimits(exposure and (exposure[0] * UNIT_S, exposure[1] * UNIT_S), _range(self._gain))

    def apply(self, settings: CaptureSettings) -> CaptureSettings:
        """Set what is told and return what is in force; RefusedError when the driver says no."""
        try:
            if settings.exposure_s is not None and self._exposure is not None:
                if self._automatic is not None:
                    self._automatic.value = MANUAL
                self._exposure.value = max(1, round(settings.exposure_s / UNIT_S))
                self.exposure_s = self._exposure.value * UNIT_S
            if settings.gain is not None and self._gain is not None:
                self._gain.value = round(settings.gain)
            gain = None if self._gain is None else float(self._gain.value)
        except (OSError, ValueError, AttributeError) as error:
            raise RefusedError("The camera does not take this setting: {error}.", error=error) from None
        return CaptureSettings(self.exposure_s, gain)


def controls_of(device: str) -> Controls:
    """The controls of a device file; none where there is no such thing to ask."""
    if not device.startswith("/dev/") or sys.platform != "linux" or find_spec("linuxpy") is None:
        return Controls({})
    from linuxpy.video.device import Device, V4L2Error

    found: dict[str, Any] = {}
    try:
        driver = Device(device)
        driver.open()
        for control in driver.controls.values():
            if control.standard is not None:
                found[control.standard.name] = control
    except (OSError, V4L2Error):
        return Controls({})
    return Controls(found)


def _range(control: Any) -> tuple[float, float] | None:
    return None if control is None else (float(control.minimum), float(control.maximum))


OPEN_S = 5.0
SILENCE_S = 10.0  # a camera that streams and gives nothing for so long (and its exposure) is lost
JOIN_S = 2.0
_DRIVERS = {"linux": "v4l2", "win32": "dshow", "darwin": "avfoundation"}
_EAGER = {"fflags": "nobuffer", "flags": "low_delay"}
"""Nothing is held back in FFmpeg: a picture is told as new when it is handed over."""
_BAYER = re.compile(r"bayer_(rggb|bggr|grbg|gbrg)(8|16[lb]e)")


class Webcam(CameraSource):
    """One video camera, or a stream at a URL."""

    def __init__(self, address: str, container: Any, controls: Controls) -> None:
        self.name, self._container, self._controls = address, container, controls
        self._news = Condition()
        self._newest: tuple[Any, float] | None = None
        self._lost: str | None = None
        self._stop = False
        self._last_s = monotonic()
        self._count = 0
        self._thread = Thread(target=self._read, name="kochab-webcam", daemon=True)
        self._thread.start()

    @classmethod
    def missing(cls) -> str | None:
        """The video library is an extra."""
        return None if find_spec("av") else tr("Webcams need one more package: pip install 'kochab-astro[webcam]'.")

    @classmethod
    def devices(cls, address: str = "") -> list[CameraDevice]:
        """Video cameras of this computer."""
        found = _linux() if sys.platform == "linux" else _elsewhere()
        return [CameraDevice("webcam", where, text) for where, text in found]

    @classmethod
    def open(cls, address: str, settings: CaptureSettings) -> "Webcam":
        """The camera at ``/dev/video0`` (or 0, a name on Windows), or the stream at a URL."""
        target, driver = _target(address)
        container = _opened(address or target, target, driver)
        if not container.streams.video:
            container.close()
            raise PortError("{address} sends no video.", address=address)
        camera = cls(address or target, container, controls_of(target if driver else ""))
        try:
            camera.configure(settings)
        except BaseException:
            camera.close()
            raise
        return camera

    @property
    def limits(self) -> CaptureLimits:
        """What the driver lets be set; nothing on a stream."""
        return self._controls.limits

    def configure(self, settings: CaptureSettings) -> CaptureSettings:
        """Set exposure and gain, where the driver offers them."""
        check_within(settings, self.limits)
        return self._controls.apply(settings)

    def next_frame(self, timeout_s: float) -> Frame | None:
        """The newest picture of the stream."""
        with self._news:
            self._news.wait_for(lambda: self._newest is not None or self._lost, timeout_s)
            newest, self._newest = self._newest, None
        if newest is not None:
            self._last_s = newest[1]
            return self._frame(*newest)
        if self._lost is not None:
            raise LineLostError(self._lost)
        if monotonic() - self._last_s > SILENCE_S + (self._controls.exposure_s or 0.0):
            raise LineLostError("{name} stopped sending frames. Check its cable.", name=self.name)
        return None

    def close(self) -> None:
        """Ask the reader to end; it gives the camera back."""
        self._stop = True
        self._thread.join(JOIN_S)

    def _read(self) -> None:
        from av.error import FFmpegError

        try:
            for picture in self._container.decode(video=0):
                with self._news:
                    self._newest = picture, monotonic()
                    self._news.notify()
                if self._stop:
                    break
            why = tr("its stream ended")
        except (FFmpegError, OSError) as error:
            why = (error.strerror or str(error)).rstrip(".")
        finally:
            self._container.close()
        with self._news:
            self._lost = tr("{name} stopped sending frames: {why}. Check its cable.", name=self.name, why=why)
            self._news.notify()

    def _frame(self, picture: Any, arrived_s: float) -> Frame:
        from kochab.frames import split

        self._count += 1
        exposure_s = self._controls.exposure_s
        # The picture arrives at the end of its exposure: mid-exposure is half of it earlier.
        ago_s = monotonic() - arrived_s + (exposure_s or 0.0) / 2.0
        hint = Hint(time_utc=datetime.now(UTC) - timedelta(seconds=ago_s), exposure_s=exposure_s, camera=self.name)
        samples, bayer = _samples(picture)
        pixels, colour, clips = split(samples)
        return Frame(pixels, colour, bayer, clips, f"{self.name} {self._count}", hint)


def _samples(picture: Any) -> tuple[Any, str | None]:
    """Grey or mosaic (H, W), or (H, W, 3) red, green, blue; and the mosaic's pattern."""
    kind = str(picture.format.name)
    mosaic = _BAYER.fullmatch(kind)
    if mosaic:
        return picture.to_ndarray(), mosaic[1].upper()
    if kind.startswith("gray"):
        return picture.to_ndarray(format="gray" if kind == "gray" else "gray16le"), None
    return picture.to_ndarray(format="rgb24"), None


def _target(address: str) -> tuple[str, str | None]:
    """What FFmpeg is to open, and with which of its devices; None for files and URLs."""
    driver = _DRIVERS.get(sys.platform)
    if "://" in address or (not address.startswith("/dev/") and Path(address).is_file()):
        return address, None
    if sys.platform == "linux":
        number = address or "0"
        return (f"/dev/video{number}" if number.isdigit() else number), driver
    if sys.platform == "win32":
        return (address if address.startswith("video=") else f"video={address}"), driver
    return address or "0", driver


def _opened(name: str, target: str, driver: str | None) -> Any:
    import av
    from av.error import FFmpegError

    try:
        return av.open(target, format=driver, options=_EAGER, timeout=(OPEN_S, SILENCE_S))
    except FileNotFoundError:
        raise PortError("No camera {name}. List cameras with: kochab camera list.", name=name) from None
    except PermissionError:
        raise PortError(
            "No permission to open {name}. On Linux, run sudo usermod -aG video $USER, then log in again.", name=name
        ) from None
    except (FFmpegError, OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).rstrip(".")
        raise PortError("{name} cannot be opened as a video camera: {why}.", name=name, why=why) from None


def _linux() -> list[tuple[str, str]]:
    """Device files and names as the kernel tells them; the first node of each camera."""
    found = []
    for folder in sorted(Path("/sys/class/video4linux").glob("video*")):
        try:
            first = (folder / "index").read_text().strip() == "0"
            name = (folder / "name").read_text().strip()
        except OSError:
            continue
        if first:
            found.append((f"/dev/{folder.name}", name))
    return found


def _elsewhere() -> list[tuple[str, str]]:
    import av

    driver = _DRIVERS.get(sys.platform)
    if driver is None:
        return []
    try:
        cameras = av.enumerate_input_devices(driver)
    except (ValueError, OSError):
        return []
    return [(str(c.name), str(c.description)) for c in cameras if "video" in (c.media_types or ["video"])]
