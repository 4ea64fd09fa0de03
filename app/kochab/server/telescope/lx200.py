"""Meade's LX200 protocol over TCP, as SkySafari, KStars, Cartes du Ciel and INDI speak it to a telescope.

Coordinates are of date: true equator and equinox, as the makers have it. What would move the mount by hand (``:Mn#``)
or set its clock and site is taken without effect, as the protocol answers nothing there. Facts: Meade Telescope
Protocol, revision 2010.10; INDI's lx200driver; what SkySafari sends.
"""

import re
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import field

from kochab.core import __version__
from kochab.core.attitude import Degrees
from kochab.core.errors import NoAnswerError
from kochab.core.mount import Epoch, Pointing
from kochab.core.values import mutable
from kochab.gear.mounts.coordinates import from_mount_epoch, to_mount_epoch
from kochab.gear.mounts.protocols import lx200
from kochab.server.telescope.listening import Line, NotTheProtocol, Ports, verdict_of
from kochab.workflows.telescope.offered import OfferedTelescope, Seen

PORT = 4030
QUIET_S = 600.0
LONGEST_COMMAND, MOST_NOISE = 64, 4096  # bytes
ACK, BAR = ord("\x06"), b"\x7f"
FIXED = {
    b"GVP": b"Kochab#",
    b"GVN": f"{__version__}#".encode(),
    b"GVF": f"Kochab {__version__}#".encode(),
    b"GW": b"PT2#",
    b"GT": b"60.1#",
    b"Gc": b"24#",
    # Kochab goes by the computer's clock and its own site: what a program sets is taken and not used.
    b"SG": b"1", b"SL": b"1", b"St": b"1", b"Sg": b"1",
    b"SC": b"1Updating Planetary Data#" + b" " * 32 + b"#",
}  # fmt: skip
"""Command, or its first letters where a value follows, to what is always answered."""

Order = Callable[[Degrees, str], "Future[str]"]


@mutable(eq=False)
class Commands:
    """Cuts a stream of bytes into commands; what stands between them is passed over, as telescopes do."""

    _held: bytearray = field(default_factory=bytearray)
    _noise: int = 0

    def feed(self, data: bytes) -> list[bytes]:
        """The commands that are whole, ``:`` and ``#`` taken off; ``ACK`` is one of its own.

        Raises NotTheProtocol when a command never ends, or only noise comes.
        """
        whole: list[bytes] = []
        for byte in data:
            if self._held:
                if byte == ord("#"):
                    whole.append(bytes(self._held[1:]))
                    self._held.clear()
                    self._noise = 0
                elif len(self._held) > LONGEST_COMMAND:
                    raise NotTheProtocol
                else:
                    self._held.append(byte)
            elif byte == ord(":"):
                self._held.append(byte)
            elif byte == ACK:
                whole.append(bytes([ACK]))
            else:
                self._noise += 1
                if self._noise > MOST_NOISE:
                    raise NotTheProtocol
        return whole


@mutable(eq=False)
class Handset:
    """What one program has set on its line: a target of date, and the precision."""

    telescope: OfferedTelescope
    who: str
    ra_deg: float | None = None
    dec_deg: float | None = None
    high: bool = True

    async def answer(self, command: bytes) -> bytes:
        """What the telescope says to one command; nothing to what it does not know."""
        match command:
            case b"GR" | b"GD":
                return self._coordinate(command, self.telescope.seen)
            case b"Gr" | b"Gd":
                return self._target(command)
            case b"D":
                seen = self.telescope.seen
                return BAR + b"#" if seen is not None and seen.slewing else b"#"
            case b"U":
                self.high = not self.high
            case b"P":
                self.high = not self.high
                return b"HIGH PRECISION" if self.high else b"LOW  PRECISION"
            case b"MS":
                why = await self._ordered(self.telescope.goto)
                return f"1{_ascii(why)}#".encode() if why else b"0"
            case b"CM" | b"CMR":
                why = await self._ordered(self.telescope.sync)
                return f"Match fail: {_ascii(why)}#".encode() if why else b"Coordinates matched.        #"
            case b"Q" | b"Qn" | b"Qs" | b"Qe" | b"Qw":
                self.telescope.stop(self.who)
            case b"\x06":
                return b"P"
            case _ if command[:2] in (b"Sr", b"Sd"):
                return self._set(command)
            case _:
                return next((reply for known, reply in FIXED.items() if _means(known, command)), b"")
        return b""

    def _coordinate(self, command: bytes, seen: Seen | None) -> bytes:
        # The protocol has no word for a place that is not known yet.
        place = (0.0, 0.0) if seen is None else to_mount_epoch(*seen.icrs_deg, Epoch.DATE, self.telescope.now())
        return self._written(command[1:], place)

    def _target(self, command: bytes) -> bytes:
        return self._written(command[1:].upper(), (self.ra_deg or 0.0, self.dec_deg or 0.0))

    def _written(self, which: bytes, place: Degrees) -> bytes:
        if which == b"D":
            text = lx200.set_dec(place[1])[3:]
            return text if self.high else lx200.set_dec(round(place[1] * 60.0) / 60.0)[3:].rpartition(b":")[0] + b"#"
        if self.high:
            return lx200.set_ra(place[0])[3:]
        tenths = round(place[0] % 360.0 * 40.0) % 14400  # of a minute of time
        return f"{tenths // 600:02d}:{tenths // 10 % 60:02d}.{tenths % 10}#".encode()

    def _set(self, command: bytes) -> bytes:
        """Take half of a target; programs write it in any of the formats that the telescope itself has."""
        text = command[2:] + b"#"
        try:
            if command[:2] == b"Sr":
                self.ra_deg = lx200.parse_ra(text)
            else:
                self.dec_deg = lx200.parse_dec(text)
        except NoAnswerError:
            return b"0"
        return b"1"

    async def _ordered(self, order: Order) -> str:
        if self.ra_deg is None or self.dec_deg is None:
            return "no target was set"
        place = from_mount_epoch(Pointing(self.ra_deg, self.dec_deg, Epoch.DATE), self.telescope.now())
        return await verdict_of(order(place, self.who))


def listen(ports: Ports, port: int) -> int:
    """Offer it at a port, 0 for any, and return that; PortError when it cannot be had."""
    return ports.listen("LX200", talk, port)


async def talk(line: Line) -> None:
    """Answer one program until it goes, falls silent or speaks no sense."""
    commands, handset = Commands(), Handset(line.telescope, line.who)
    while data := await line.read(QUIET_S):
        for command in commands.feed(data):
            if reply := await handset.answer(command):
                await line.send(reply)


def _means(known: bytes, command: bytes) -> bool:
    return command.startswith(known) if known.startswith(b"S") else command == known


def _ascii(sentence: str) -> str:
    """For a hand control's display: no sign of the protocol's own, nothing it cannot show."""
    return re.sub(r"[^ -~]|[#:]", " ", sentence)[:120]
