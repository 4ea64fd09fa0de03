"""The far end of the line: what each make of mount answers, byte for byte, over one mount.

A controller sees the mount as its own computer does: equatorial degrees of date as that believes
them, which is not where the telescope really points, and encoders that grow with hour angle on the
first axis and with declination on the second.
"""

import math
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pkgutil import resolve_name
from typing import Any, ClassVar

import erfa

from kochab.simulate.mechanics.mount import EquatorialMount

RESPONDERS: dict[str, str] = {
    "lx200": "kochab.simulate.responders.lx200:Lx200Responder",
    "onstep": "kochab.simulate.responders.lx200:OnStepResponder",
    "nexstar": "kochab.simulate.responders.nexstar:NexStarResponder",
    "synscan": "kochab.simulate.responders.nexstar:SynScanResponder",
    "ioptron": "kochab.simulate.responders.ioptron:IoptronResponder",
    "skywatcher": "kochab.simulate.responders.skywatcher:SkyWatcherResponder",
}

HOME_DEG = 0.01  # so near it counts as home


class Controller:
    """A byte machine: it neither waits, nor reads a clock, nor raises on any bytes.

    ``command`` matches a whole command; what is answered is its last group, or all of it. What
    cannot begin one (``begins``) is lost, as on the real line. ``words`` are the commands it knows,
    each a pattern whose groups go to the method beside it, which gives the reply or None for ``done``, and raises
    ValueError for ``wrong``: a value that is none.

    ``refusal`` is asked before every goto and sync; a reason refuses it, in the words each protocol has for that.
    """

    command: ClassVar[re.Pattern[bytes]]
    begins: ClassVar[bytes]
    longest = 64  # bytes that are kept of an unfinished command
    unknown = b""
    done = b""
    wrong = b""

    def __init__(self, telescope: EquatorialMount) -> None:
        self.telescope = telescope
        self.refusal: Callable[[], str | None] = lambda: None
        self.words: dict[bytes, Callable[..., bytes | None]] = {}
        self._pending = b""

    def feed(self, data: bytes) -> bytes:
        """Answer every command that ``data``, whole commands or parts, completes, in order."""
        # bytes come in any pieces: keep what is not yet a whole command
        self._pending += data
        replies = bytearray()
        while self._pending:
            if (found := self.command.match(self._pending)) is not None:
                self._pending = self._pending[found.end() :]
                replies += self._answer(found[found.lastindex or 0])
            elif self._pending[0] in self.begins and len(self._pending) <= self.longest:
                break
            else:
                # noise, or a command that has grown too long to be one: look again from the next byte
                self._pending = self._pending[1:]
        return bytes(replies)

    def idle(self) -> None:
        """The line has been quiet for long: forget half a command, as hand controllers do."""
        self._pending = b""

    def _answer(self, command: bytes) -> bytes:
        for pattern, method in self.words.items():
            if (found := re.fullmatch(pattern, command, re.DOTALL)) is not None:
                try:
                    reply = method(*found.groups())
                except ValueError:
                    return self.wrong
                return self.done if reply is None else reply
        return self.unknown

    def _goto(self, ra_deg: float, dec_deg: float) -> str | None:
        return self.refusal() or self.telescope.goto(ra_deg % 360.0, dec_deg)

    def _sync(self, ra_deg: float, dec_deg: float) -> str | None:
        return self.refusal() or self.telescope.sync(ra_deg % 360.0, dec_deg)


def open_responder(name: str, telescope: EquatorialMount) -> Controller:
    """The simulated controller registered as ``name``, over ``telescope``."""
    responder: Controller = resolve_name(RESPONDERS[name])(telescope)
    return responder


class LocalSettings:
    """Site and clock as set on the controller, at first right and in universal time.

    East longitudes and zones east are positive. Telling it another time moves only what it reports, by ``clock_error``.
    """

    def __init__(self, telescope: EquatorialMount) -> None:
        self.telescope = telescope
        self.latitude_deg, self.longitude_deg = telescope.latitude_deg, telescope.longitude_deg
        self.utc_offset_h, self.clock_error = 0.0, timedelta()

    def utc(self) -> datetime:
        """Its idea of universal time."""
        return datetime.fromtimestamp(self.telescope.now_unix(), UTC) + self.clock_error

    def local(self) -> datetime:
        """Its idea of the clock on the wall."""
        return self.utc() + timedelta(hours=self.utc_offset_h)

    def set_local(self, **parts: Any) -> None:
        """Replace parts of the clock by ``datetime.replace``; ValueError when there is no such time."""
        at = self.local()
        self.clock_error += at.replace(microsecond=0, **parts) - at


def horizontal_deg(telescope: EquatorialMount, latitude_deg: float) -> tuple[float, float]:
    """Altitude, and azimuth from north over east in [0, 360), degrees, without air."""
    ra_deg, dec_deg = telescope.believed_deg()
    hour = math.radians(telescope.sidereal_deg() - ra_deg)
    azimuth, altitude = erfa.hd2ae(hour, math.radians(dec_deg), math.radians(latitude_deg))
    return math.degrees(altitude), math.degrees(azimuth) % 360.0
