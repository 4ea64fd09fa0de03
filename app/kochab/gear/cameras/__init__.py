"""Devices that give frames, behind one small interface (:mod:`kochab.core.capture`)."""

from typing import Protocol

from kochab.core.capture import CameraDevice, CameraSource, CaptureSettings
from kochab.core.errors import PortError
from kochab.core.registry import Registry


class SourceKind(Protocol):
    """What a class named in :data:`SOURCES` offers before anything is opened."""

    @classmethod
    def missing(cls) -> str | None:
        """How to get what it needs and is not installed, one sentence; None when all is there."""

    @classmethod
    def devices(cls, address: str = "") -> list[CameraDevice]:
        """What can be opened now, at ``address`` where a kind needs to know where to look."""

    @classmethod
    def open(cls, address: str, settings: CaptureSettings) -> CameraSource:
        """The camera at ``address``, set up; DeviceError when that is not possible."""


SOURCES: Registry[CameraSource] = Registry(
    "camera source",
    "kochab.cameras",
    {
        "simulated": "kochab.simulate.camera_source:SimulatedCamera",
        "folder": "kochab.gear.cameras.folder:FolderCamera",
        "indi": "kochab.gear.cameras.indi:IndiCamera",
        "alpaca": "kochab.gear.cameras.alpaca:AlpacaCamera",
        "webcam": "kochab.gear.cameras.uvc:Webcam",
    },
)
"""Each names a :class:`SourceKind` that derives from :class:`~kochab.core.capture.CameraSource`."""


def missing(name: str) -> str | None:
    """How to get what a kind of camera needs, None when it can be used now."""
    kind: SourceKind = SOURCES.load(name)
    return kind.missing()


def list_devices(name: str, address: str = "") -> list[CameraDevice]:
    """What can be opened of one kind; DeviceError with a sentence when asking fails."""
    return _usable(name).devices(address)


def open_camera(name: str, address: str, settings: CaptureSettings | None = None) -> CameraSource:
    """Open one camera; DeviceError says what to install, plug in or type when that fails."""
    return _usable(name).open(address, settings or CaptureSettings())


def _usable(name: str) -> SourceKind:
    kind: SourceKind = SOURCES.load(name)
    absent = kind.missing()
    if absent is not None:
        raise PortError(absent)
    return kind
