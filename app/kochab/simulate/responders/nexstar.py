"""NexStar hand controls (Celestron), and SynScan (Sky-Watcher), byte for byte."""

import re

import erfa
import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import apart_deg, radec_deg, unit_vectors, wrapped
from kochab.core.mount import SIDEREAL_DEG_S, Direction, PierSide
from kochab.simulate.mechanics.mount import EquatorialMount
from kochab.simulate.responders import Controller, LocalSettings, horizontal_deg
from kochab.sky.apparent import JD_UNIX

# -- Angles in the NexStar language: a turn is 2^16 or 2^32, in capital hexadecimal digits -----

_HEX = re.compile(rb"[0-9A-Fa-f]+")
Place = tuple[float, float]


def written_angle(angle_deg: float, digits: int) -> bytes:
    """Four digits, or eight of which the last two are zero as on the real ones."""
    if digits == 4:
        return b"%04X" % (round(angle_deg / 360.0 * 65536.0) % 65536)
    # 24 bits: 0.08 arcsec
    return b"%06X00" % (round(angle_deg / 360.0 * 16777216.0) % 16777216)


def written_pair(first_deg: float, second_deg: float, digits: int) -> bytes:
    """Two angles with a comma between, and the #."""
    return written_angle(first_deg, digits) + b"," + written_angle(second_deg, digits) + b"#"


def read_pair(text: bytes, digits: int) -> Place:
    """Two angles in degrees, the first in [0, 360), the second a declination; else ValueError."""
    first, second = text[:digits], text[digits + 1 :]
    if not (_HEX.fullmatch(first) and _HEX.fullmatch(second) and text[digits : digits + 1] == b","):
        raise ValueError("no pair of angles")
    turn = 16.0**digits
    around, dec = int(first, 16) / turn * 360.0, wrapped(int(second, 16) / turn * 360.0)
    if abs(dec) > 90.0:
        raise ValueError("no declination")
    return around, dec


RATES_DEG_S = (0.0, *(k * SIDEREAL_DEG_S for k in (0.5, 1.0, 4.0, 8.0, 16.0, 64.0)), 0.5, 2.0, 4.0)
RA_MOTOR, DEC_MOTOR = 16, 17
FASTER, SLOWER, MOVE_UP, MOVE_DOWN = 6, 7, 36, 37  # the first two in quarters of an arcsec/s
MOVES = {
    (RA_MOTOR, MOVE_UP): Direction.WEST,
    (RA_MOTOR, MOVE_DOWN): Direction.EAST,
    (DEC_MOTOR, MOVE_UP): Direction.NORTH,
    (DEC_MOTOR, MOVE_DOWN): Direction.SOUTH,
}
GUIDE = 0x26
GUIDE_PERCENT = 50.0  # of sidereal: what a telescope's own pulse is
TRACKING_OFF, TRACKING_EQ_NORTH, TRACKING_EQ_SOUTH = 0, 2, 3


class NexStarResponder(Controller):
    """Version 4.21 on an Advanced VX. Before an alignment it says ``#`` to a goto and stays."""

    # A command is known by its first byte and cut by its length: any byte may be a #.
    command = re.compile(rb"[VvmeEzZtJLMwhp]|[KT].|[WH].{8}|P.{7}|[rs].{17}|[RS].{9}", re.DOTALL)
    begins = b"VvmeEzZtJLMwhpKTWHPrsRS"
    done = b"#"
    version = (4, 21)
    model = 20

    def __init__(self, telescope: EquatorialMount) -> None:
        super().__init__(telescope)
        self.settings = LocalSettings(telescope)
        self.words = {
            b"K(.)": lambda text: text + b"#",
            b"V": lambda: bytes(self.version) + b"#",
            b"v": lambda: b"\x11#",
            b"m": lambda: bytes([self.model]) + b"#",
            b"e": lambda: self.position(8),
            b"E": lambda: self.position(4),
            b"z": lambda: self.horizontal(8),
            b"Z": lambda: self.horizontal(4),
            b"r(.*)": lambda text: self.goto(text, 8),
            b"R(.*)": lambda text: self.goto(text, 4),
            b"s(.*)": lambda text: self.sync(text, 8),
            b"S(.*)": lambda text: self.sync(text, 4),
            b"J": lambda: bytes([telescope.aligned]) + b"#",
            b"L": lambda: b"1#" if telescope.slewing else b"0#",
            b"M": self.cancel,
            b"t": lambda: bytes([self.tracking_mode()]) + b"#",
            b"T(.)": self.set_tracking,
            b"p": lambda: b"E#" if (telescope.pier_side is PierSide.WEST) is (telescope.latitude_deg >= 0.0) else b"W#",
            b"w": lambda: self.site() + b"#",
            b"W(.*)": self.set_site,
            b"h": lambda: self.time() + b"#",
            b"H(.*)": self.set_time,
            b"P(.*)": self.pass_on,
        }

    def position(self, digits: int) -> bytes:
        """RA and Dec as it believes."""
        return written_pair(*self.from_date(*self.telescope.believed_deg()), digits)

    def from_date(self, ra_deg: float, dec_deg: float) -> Place:
        """Equatorial degrees of date as this controller writes them."""
        return ra_deg, dec_deg

    def to_date(self, ra_deg: float, dec_deg: float) -> Place:
        """The inverse."""
        return ra_deg, dec_deg

    def horizontal(self, digits: int) -> bytes:
        """Azimuth and altitude as it believes."""
        altitude, azimuth = horizontal_deg(self.telescope, self.settings.latitude_deg)
        return written_pair(azimuth, altitude, digits)

    def goto(self, text: bytes, digits: int) -> None:
        """Always ``#``: what it will not do it does not say."""
        pair = read_pair(text, digits)
        if self.telescope.aligned:
            self._goto(*self.to_date(*pair))

    def sync(self, text: bytes, digits: int) -> bytes | None:
        """``#``; a controller before 4.10 does not know the word and is silent."""
        pair = read_pair(text, digits)
        if self.version < (4, 10):
            return b""
        if self.telescope.aligned:
            self._sync(*pair)
        return None

    def cancel(self) -> None:
        """Ends a goto, and no move."""
        self.telescope.stop(moves=False)

    def tracking_mode(self) -> int:
        """0 is off; an equatorial mount has one for each hemisphere."""
        if not self.telescope.tracking:
            return TRACKING_OFF
        return TRACKING_EQ_NORTH if self.settings.latitude_deg >= 0 else TRACKING_EQ_SOUTH

    def set_tracking(self, mode: bytes) -> None:
        """Any mode but 0 tracks."""
        if mode[0] > 3:
            raise ValueError("no mode")
        self.telescope.tracking = mode[0] != TRACKING_OFF

    def site(self) -> bytes:
        """Degrees, minutes, seconds and 1 for south or west, of each."""
        out = bytearray()
        for angle in (self.settings.latitude_deg, self.settings.longitude_deg):
            seconds = round(abs(angle) * 3600.0)
            out += bytes([seconds // 3600, seconds // 60 % 60, seconds % 60, angle < 0])
        return bytes(out)

    def set_site(self, text: bytes) -> None:
        """The eight bytes of :meth:`site`."""
        angles = [
            (d + m / 60.0 + s / 3600.0) * (-1.0 if negative else 1.0) for d, m, s, negative in (text[:4], text[4:])
        ]
        if abs(angles[0]) > 90.0 or abs(angles[1]) > 180.0:
            raise ValueError("no place")
        self.settings.latitude_deg, self.settings.longitude_deg = angles

    def time(self) -> bytes:
        """Hour, minute, second, month, day, year - 2000, zone east in two's complement, summer."""
        t = self.settings.local()
        # the protocol has whole hours only: a zone of 5.5 h is told as 5
        zone = int(self.settings.utc_offset_h) % 256
        return bytes([t.hour, t.minute, t.second, t.month, t.day, t.year - 2000, zone, 0])

    def set_time(self, text: bytes) -> None:
        """The eight bytes of :meth:`time`."""
        hour, minute, second, month, day, year, zone, summer = text
        offset = (zone - 256 if zone > 127 else zone) + (1 if summer == 1 else 0)
        if not -12 <= offset <= 15:
            raise ValueError("no zone")
        self.settings.utc_offset_h = float(offset)
        self.settings.set_local(year=2000 + year, month=month, day=day, hour=hour, minute=minute, second=second)

    def pass_on(self, text: bytes) -> bytes:
        """A motor's own answer and ``#``; with no such device an extra 0 stands before the #."""
        size, device, order, *values, count = text
        reply = self.motor(device, order, bytes(values[: max(0, size - 1)]))
        # zeros to the length asked for and one more: no such device
        if reply is None:
            return bytes(count % 16 + 1) + b"#"
        return (reply + bytes(16))[: count % 16] + b"#"

    def motor(self, device: int, order: int, values: bytes) -> bytes | None:
        """What the motor ``device`` gives back, None when there is none or it does not know."""
        if device not in (RA_MOTOR, DEC_MOTOR):
            return None
        if (device, order) in MOVES and values and values[0] < len(RATES_DEG_S):
            self.move(device, order == MOVE_UP, RATES_DEG_S[values[0]])
            return b""
        if order in (FASTER, SLOWER) and len(values) == 2:
            rate = (values[0] * 256 + values[1]) / 4.0 / 3600.0
            self.move(device, order == FASTER, rate)
            return b""
        if order == GUIDE and len(values) == 2:
            signed = values[0] - 256 if values[0] > 127 else values[0]  # percent of sidereal
            direction = MOVES[device, MOVE_UP if signed >= 0 else MOVE_DOWN]
            # hundredths of a second at a percentage: a pulse at the own 50 % that moves it as far
            self.telescope.pulse(direction, values[1] * 10.0 * abs(signed) / GUIDE_PERCENT)
            return b""
        known = {0xFE: bytes(self.version), 0x27: b"\x00", 0x47: b"\x80", 0x46: b""}
        return known.get(order)

    def move(self, device: int, up: bool, rate_deg_s: float) -> None:
        """On top of tracking; 0 ends both ways, whichever was asked."""
        if rate_deg_s:
            self.telescope.move(MOVES[device, MOVE_UP if up else MOVE_DOWN], rate_deg_s)
        else:
            self.telescope.halt(MOVES[device, MOVE_UP])
            self.telescope.halt(MOVES[device, MOVE_DOWN])


SYNC_LIMIT_DEG = 6.0


class SynScanResponder(NexStarResponder):
    """Firmware 4.39.05 on an EQ6. Too far a sync is answered like a good one, and not done.

    The first ``M`` while it slews only begins to brake; the second ends the goto.
    """

    firmware = b"042705"
    model = 0

    def __init__(self, telescope: EquatorialMount) -> None:
        super().__init__(telescope)
        self._braking = False
        self.words[b"V"] = lambda: self.firmware + b"#"
        self.words[b"p"] = self.pointing_state
        del self.words[b"v"]  # Celestron's alone

    def from_date(self, ra_deg: float, dec_deg: float) -> Place:
        """J2000."""
        return radec_deg(self._precession().T @ unit_vectors(ra_deg, dec_deg))

    def to_date(self, ra_deg: float, dec_deg: float) -> Place:
        """The inverse."""
        return radec_deg(self._precession() @ unit_vectors(ra_deg, dec_deg))

    def sync(self, text: bytes, digits: int) -> None:
        """Always ``#``, and nothing done beyond some six degrees."""
        there = self.to_date(*read_pair(text, digits))
        if apart_deg(there, self.telescope.believed_deg()) <= SYNC_LIMIT_DEG:
            self._sync(*there)

    def cancel(self) -> None:
        """The first of two only brakes."""
        self._braking = self.telescope.slewing and not self._braking
        if not self._braking:
            super().cancel()

    def pointing_state(self) -> bytes:
        """Where the counterweights look: the other side than the tube's."""
        return b"E#" if self.telescope.pier_side is PierSide.WEST else b"W#"

    def _precession(self) -> Floats:
        """Mean equator of J2000 to that of date (IAU 2006), which is all that a hand controller does."""
        _bias, precession, _ = erfa.bp06(JD_UNIX, self.telescope.now_unix() / 86400.0)
        return np.asarray(precession)
