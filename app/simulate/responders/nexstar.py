"""A Celestron NexStar hand controller, and the motors behind it that it passes bytes on to."""

from collections.abc import Callable

from app.core.earth import SIDEREAL_DEG_S
from app.core.mount import Direction, PierSide
from app.simulate.responders.base import Controller
from app.simulate.responders.horizontal import horizontal_deg
from app.simulate.responders.local import LocalSettings
from app.simulate.responders.nexstar_words import read_pair, written_pair
from app.simulate.telescope import Telescope

LENGTHS = {
    b"K": 2, b"T": 2, b"W": 9, b"H": 9, b"P": 8, b"r": 18, b"s": 18, b"R": 10, b"S": 10,
} | {bytes([c]): 1 for c in b"VvmeEzZtJLMwhp"}  # fmt: skip
RATES_DEG_S = (
    0.0, *(k * SIDEREAL_DEG_S for k in (0.5, 1.0, 4.0, 8.0, 16.0, 64.0)), 0.5, 2.0, 4.0,
)  # fmt: skip
RA_MOTOR, DEC_MOTOR = 16, 17
FASTER, SLOWER, MOVE_UP, MOVE_DOWN = 6, 7, 36, 37  # the first two in quarters of an arcsec/s
MOVES = {
    (RA_MOTOR, MOVE_UP): Direction.WEST, (RA_MOTOR, MOVE_DOWN): Direction.EAST,
    (DEC_MOTOR, MOVE_UP): Direction.NORTH, (DEC_MOTOR, MOVE_DOWN): Direction.SOUTH,
}  # fmt: skip
GUIDE = 0x26
GUIDE_PERCENT = 50.0  # of sidereal: what a telescope's own pulse is
TRACKING_OFF, TRACKING_EQ_NORTH, TRACKING_EQ_SOUTH = 0, 2, 3


class NexStar(Controller):
    """Version 4.21 on an Advanced VX. Before an alignment it says ``#`` to a goto and stays."""

    version = (4, 21)
    model = 20

    def __init__(self, telescope: Telescope) -> None:
        super().__init__(telescope)
        self.settings = LocalSettings.of(telescope)
        self.commands: dict[bytes, Callable[[bytes], bytes]] = {
            b"K": lambda text: text + b"#",
            b"V": lambda _: bytes(self.version) + b"#",
            b"v": lambda _: b"\x11#",
            b"m": lambda _: bytes([self.model]) + b"#",
            b"e": lambda _: self.position(8),
            b"E": lambda _: self.position(4),
            b"z": lambda _: self.horizontal(8),
            b"Z": lambda _: self.horizontal(4),
            b"r": lambda text: self.goto(text, 8),
            b"R": lambda text: self.goto(text, 4),
            b"s": lambda text: self.sync(text, 8),
            b"S": lambda text: self.sync(text, 4),
            b"J": lambda _: bytes([telescope.aligned]) + b"#",
            b"L": lambda _: b"1#" if telescope.slewing else b"0#",
            b"M": self.cancel,
            b"t": lambda _: bytes([self.tracking_mode()]) + b"#",
            b"T": self.set_tracking,
            b"p": lambda _: b"W#" if telescope.pier_side is PierSide.WEST else b"E#",
            b"w": lambda _: self.site() + b"#",
            b"W": self.set_site,
            b"h": lambda _: self.time() + b"#",
            b"H": self.set_time,
            b"P": self.pass_on,
        }

    def _take(self) -> bytes | None:
        """A command is known by its first byte and cut by its length: any byte may be a #."""
        pending = self._pending
        while pending and bytes(pending[:1]) not in LENGTHS:
            del pending[0]
        length = LENGTHS[bytes(pending[:1])] if pending else 1
        if len(pending) < length:
            return None
        command = bytes(pending[:length])
        del pending[:length]
        return command

    def _answer(self, command: bytes) -> bytes:
        return self.commands[command[:1]](command[1:])

    def position(self, digits: int) -> bytes:
        """RA and Dec as it believes."""
        return written_pair(*self.telescope.believed_deg(), digits)

    def horizontal(self, digits: int) -> bytes:
        """Azimuth and altitude as it believes."""
        altitude, azimuth = horizontal_deg(self.telescope, self.settings.latitude_deg)
        return written_pair(azimuth, altitude, digits)

    def goto(self, text: bytes, digits: int) -> bytes:
        """Always ``#``: what it will not do it does not say."""
        pair = read_pair(text, digits)
        if pair is None:
            return b""
        if self.telescope.aligned:
            self._goto(*pair)
        return b"#"

    def sync(self, text: bytes, digits: int) -> bytes:
        """``#``; a controller before 4.10 does not know the word and is silent."""
        pair = read_pair(text, digits)
        if pair is None or self.version < (4, 10):
            return b""
        if self.telescope.aligned:
            self._sync(*pair)
        return b"#"

    def cancel(self, _: bytes = b"") -> bytes:
        """Ends a goto."""
        self.telescope.stop()
        return b"#"

    def tracking_mode(self) -> int:
        """0 is off; an equatorial mount has one for each hemisphere."""
        if not self.telescope.tracking:
            return TRACKING_OFF
        return TRACKING_EQ_NORTH if self.settings.latitude_deg >= 0 else TRACKING_EQ_SOUTH

    def set_tracking(self, mode: bytes) -> bytes:
        """Any mode but 0 tracks."""
        if mode[0] > 3:
            return b""
        self.telescope.tracking = mode[0] != TRACKING_OFF
        return b"#"

    def site(self) -> bytes:
        """Degrees, minutes, seconds and 1 for south or west, of each."""
        place = (self.settings.latitude_deg, self.settings.longitude_deg)
        out = bytearray()
        for angle in place:
            seconds = round(abs(angle) * 3600.0)
            out += bytes([seconds // 3600, seconds // 60 % 60, seconds % 60, angle < 0])
        return bytes(out)

    def set_site(self, text: bytes) -> bytes:
        """The eight bytes of :meth:`site`."""
        angles = [
            (d + m / 60.0 + s / 3600.0) * (-1.0 if negative else 1.0)
            for d, m, s, negative in (text[:4], text[4:])
        ]
        if abs(angles[0]) > 90.0 or abs(angles[1]) > 180.0:
            return b""
        self.settings.latitude_deg, self.settings.longitude_deg = angles
        return b"#"

    def time(self) -> bytes:
        """Hour, minute, second, month, day, year - 2000, zone east in two's complement, summer."""
        t = self.settings.local()
        zone = int(self.settings.utc_offset_h) % 256
        return bytes([t.hour, t.minute, t.second, t.month, t.day, t.year - 2000, zone, 0])

    def set_time(self, text: bytes) -> bytes:
        """The eight bytes of :meth:`time`."""
        hour, minute, second, month, day, year, zone, summer = text
        offset = (zone - 256 if zone > 127 else zone) + (1 if summer == 1 else 0)
        if not -12 <= offset <= 15:
            return b""
        self.settings.utc_offset_h = float(offset)
        good = self.settings.set_local(
            hour=hour, minute=minute, second=second, month=month, day=day, year=2000 + year
        )
        return b"#" if good else b""

    def pass_on(self, text: bytes) -> bytes:
        """A motor's own answer and ``#``; with no such device an extra 0 stands before the #."""
        size, device, order, *values, count = text
        reply = self.motor(device, order, bytes(values[: max(0, size - 1)]))
        if reply is None:
            return bytes(count % 16 + 1) + b"#"
        return (reply + bytes(16))[: count % 16] + b"#"

    def motor(self, device: int, order: int, values: bytes) -> bytes | None:
        """What the motor ``device`` gives back, None when there is none or it does not know."""
        if device not in (RA_MOTOR, DEC_MOTOR):
            return None
        if (device, order) in MOVES and values and values[0] < len(RATES_DEG_S):
            self.turn(device, order, values[0])
            return b""
        if order in (FASTER, SLOWER) and len(values) == 2:
            rate = (values[0] * 256 + values[1]) / 4.0 / 3600.0
            self.move(device, order == FASTER, rate)
            return b""
        if order == GUIDE and len(values) == 2:
            self.guide(device, values[0], values[1])
            return b""
        known = {0xFE: bytes(self.version), 0x27: b"\x00", 0x47: b"\x80", 0x46: b""}
        return known.get(order)

    def turn(self, device: int, order: int, rate: int) -> None:
        """A fixed rate, 0 to 9."""
        self.move(device, order == MOVE_UP, RATES_DEG_S[rate])

    def move(self, device: int, up: bool, rate_deg_s: float) -> None:
        """On top of tracking; 0 ends both ways, whichever was asked."""
        if rate_deg_s:
            self.telescope.move(MOVES[device, MOVE_UP if up else MOVE_DOWN], rate_deg_s)
        else:
            self.telescope.halt(MOVES[device, MOVE_UP])
            self.telescope.halt(MOVES[device, MOVE_DOWN])

    def guide(self, device: int, percent: int, centiseconds: int) -> None:
        """A pulse at ``percent`` of the sidereal rate, a signed byte."""
        signed = percent - 256 if percent > 127 else percent
        direction = MOVES[device, MOVE_UP if signed >= 0 else MOVE_DOWN]
        self.telescope.pulse(direction, centiseconds * 10.0 * abs(signed) / GUIDE_PERCENT)
