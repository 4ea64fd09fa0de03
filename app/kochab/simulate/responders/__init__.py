"""The far end of the line: what each make of mount answers, byte for byte, over one mount.

A controller sees the mount as its own computer does: equatorial degrees of date as that believes
them, which is not where the telescope really points, and encoders that grow with hour angle on the
first axis and with declination on the second.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib import import_module
from typing import Any

from kochab.simulate.mechanics.mount import EquatorialMount

RESPONDERS: dict[str, str] = {
    "lx200": "kochab.simulate.responders.lx200:Lx200Responder",
    "onstep": "kochab.simulate.responders.lx200:OnStepResponder",
    "nexstar": "kochab.simulate.responders.nexstar:NexStarResponder",
    "synscan": "kochab.simulate.responders.nexstar:SynScanResponder",
    "ioptron": "kochab.simulate.responders.ioptron:IoptronResponder",
    "skywatcher": "kochab.simulate.responders.skywatcher:SkyWatcherResponder",
}


class Controller:
    """A byte machine: it neither waits, nor reads a clock, nor raises on any bytes.

    Here are the buffer for the unfinished command, and motions that can be refused.

    ``refusal`` is asked before every goto and sync; a reason refuses it, in the words each
    protocol has for that.
    """

    longest = 64  # bytes that are kept of an unfinished command

    def __init__(self, telescope: EquatorialMount) -> None:
        self.telescope = telescope
        self.refusal: Callable[[], str | None] = lambda: None
        self._pending = bytearray()

    def feed(self, data: bytes) -> bytes:
        """Answer every command that ``data``, whole commands or parts, completes, in order."""
        self._pending += data
        replies = bytearray()
        while (command := self._take()) is not None:
            replies += self._answer(command) or b""
        return bytes(replies)

    def idle(self) -> None:
        """The line has been quiet for long: forget half a command, as hand controllers do."""
        self._pending.clear()

    def _take(self) -> bytes | None:
        """Cut the next whole command off the buffer, or None until more has come."""
        raise NotImplementedError

    def _answer(self, command: bytes) -> bytes | None:
        raise NotImplementedError

    def _goto(self, ra_deg: float, dec_deg: float) -> str | None:
        return self.refusal() or self.telescope.goto(ra_deg % 360.0, dec_deg)

    def _sync(self, ra_deg: float, dec_deg: float) -> str | None:
        return self.refusal() or self.telescope.sync(ra_deg % 360.0, dec_deg)


def open_responder(name: str, telescope: EquatorialMount) -> Controller:
    """The simulated controller registered as ``name``, over ``telescope``."""
    module, _, cls = RESPONDERS[name].partition(":")
    responder: Controller = getattr(import_module(module), cls)(telescope)
    return responder


@dataclass(slots=True)
class LocalSettings:
    """Site and clock as set on the controller; east longitudes and zones east are positive.

    Telling it another time moves only what it reports, by ``clock_error``.
    """

    telescope: EquatorialMount
    latitude_deg: float
    longitude_deg: float
    utc_offset_h: float = 0.0
    clock_error: timedelta = timedelta()

    @classmethod
    def of(cls, telescope: EquatorialMount) -> "LocalSettings":
        """Set right, in universal time."""
        return cls(telescope, telescope.latitude_deg, telescope.longitude_deg)

    def utc(self) -> datetime:
        """Its idea of universal time."""
        return datetime.fromtimestamp(self.telescope.now_unix(), UTC) + self.clock_error

    def local(self) -> datetime:
        """Its idea of the clock on the wall."""
        return self.utc() + timedelta(hours=self.utc_offset_h)

    def set_local(self, **parts: Any) -> bool:
        """Replace parts of the clock by ``datetime.replace``; False when there is no such time."""
        at = self.local()
        try:
            self.clock_error += at.replace(microsecond=0, **parts) - at
        except ValueError:
            return False
        return True


def horizontal_deg(telescope: EquatorialMount, latitude_deg: float) -> tuple[float, float]:
    """Altitude, and azimuth from north over east in [0, 360), degrees, without air."""
    ra_deg, dec_deg = telescope.believed_deg()
    hour = math.radians(telescope.sidereal_deg() - ra_deg)
    dec, p = math.radians(dec_deg), math.radians(latitude_deg)
    east = -math.cos(dec) * math.sin(hour)
    north = math.sin(dec) * math.cos(p) - math.cos(dec) * math.cos(hour) * math.sin(p)
    up = math.sin(dec) * math.sin(p) + math.cos(dec) * math.cos(hour) * math.cos(p)
    altitude = math.degrees(math.atan2(up, math.hypot(east, north)))
    return altitude, math.degrees(math.atan2(east, north)) % 360.0
