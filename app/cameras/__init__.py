"""Devices that give frames, behind one small interface (:mod:`app.core.capture`)."""

from importlib import import_module
from typing import Protocol

from app.core.capture import CameraDevice, CameraSource, CaptureSettings
from app.core.errors import PortError, UsageError

SOURCES: dict[str, str] = {
    "simulated": "app.simulate.source:SimulatedCamera",
    "folder": "app.cameras.folder:FolderCamera",
    "indi": "app.cameras.indi:IndiCamera",
    "alpaca": "app.cameras.alpaca:AlpacaCamera",
    "webcam": "app.cameras.uvc:Webcam",
}


class SourceKind(Protocol):
    """What a class named in :data:`SOURCES` offers before anything is opened."""

    @classmethod
    def missing(cls) -> str | None:
        """How to get what it needs and is not installed, one sentence; None when all is there."""
        ...

    @classmethod
    def devices(cls, address: str = "") -> list[CameraDevice]:
        """What can be opened now, at ``address`` where a kind needs to know where to look."""
        ...

    @classmethod
    def open(cls, address: str, settings: CaptureSettings) -> CameraSource:
        """The camera at ``address``, set up; DeviceError when that is not possible."""
        ...


def source_kind(name: str) -> SourceKind:
    """The class behind a name; UsageError, which lists the names, when there is none."""
    if name not in SOURCES:
        raise UsageError(f"There is no camera source '{name}'; choose one of {', '.join(SOURCES)}.")
    module, _, kind = SOURCES[name].partition(":")
    found: SourceKind = getattr(import_module(module), kind)
    return found


def missing(name: str) -> str | None:
    """How to get what a kind of camera needs, None when it can be used now."""
    return source_kind(name).missing()


def list_devices(name: str, address: str = "") -> list[CameraDevice]:
    """What can be opened of one kind; DeviceError with a sentence when asking fails."""
    kind = source_kind(name)
    absent = kind.missing()
    if absent is not None:
        raise PortError(absent)
    return kind.devices(address)


def open_camera(name: str, address: str, settings: CaptureSettings | None = None) -> CameraSource:
    """Open one camera; DeviceError says what to install, plug in or type when that fails."""
    kind = source_kind(name)
    absent = kind.missing()
    if absent is not None:
        raise PortError(absent)
    return kind.open(address, settings or CaptureSettings())
