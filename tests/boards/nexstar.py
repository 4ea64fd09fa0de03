"""A Celestron German mount behind its NexStar+ hand control: INDI's celestrondriver.cpp, `mount-transcripts.md`, 6."""

from datetime import UTC, datetime, timedelta

from .board import Board
from .sky import SIDEREAL_DEG_S

LENGTHS = {"K": 2, "T": 2, "P": 8, "W": 9, "H": 9, "r": 18, "s": 18, "b": 18, "R": 10, "S": 10, "B": 10}  # others are 1
RA_MOTOR, DEC_MOTOR = 16, 17
SET_POSITIVE, SET_NEGATIVE, MOVE_POSITIVE, MOVE_NEGATIVE = 0x06, 0x07, 0x24, 0x25
PULSE, PULSING, SET_GUIDE, GET_GUIDE, VERSION = 0x26, 0x27, 0x46, 0x47, 0xFE
SLOW = (0.0, 2.0, 4.0, 8.0, 16.0, 64.0)  # of keys 0 to 5, in sidereal; 6 to 9 are parts of a slew
FAST = {6: 0.125, 7: 0.25, 8: 0.5, 9: 1.0}
FASTEST_KEY_DEG_S = 16319.0 / 3600.0
"""Of key 9: 4 by Celestron's manual of the hand control (page 20: 6 to 9 are 0.5, 1, 2 and 4 deg/s), and so much as a
program that tracks satellites measured at a NexStar 130SLT; whatever a board of this kind is made to slew at."""
EQ_NORTH = 2


class NexStar(Board):
    """Without power it loses alignment and clock; ``claims_home``: its owner takes the last alignment again at once."""

    boot_s = 3.0
    version, variant, model = (5, 31), 0x11, 20  # an AVX

    def __init__(self, **settings):
        super().__init__(**settings)
        self.aligned = True
        self.guide = 0x80

    def wake(self, was):
        super().wake(was)
        self.aligned = self.claims_home
        self.at_home = False

    def align(self, *place, **how):
        self.aligned = True
        return super().align(*place, **how)

    # -- framing -------------------------------------------------------------------------------------

    def next_command(self, buffer):
        if not buffer:
            return None
        length = LENGTHS.get(chr(buffer[0]), 1)
        return (buffer[:length], buffer[length:]) if len(buffer) >= length else None

    def is_stop(self, command):
        stops = command[:1] == b"P" and command[3] in (MOVE_POSITIVE, MOVE_NEGATIVE) and command[4] == 0
        return stops or command == b"M"

    def answer(self, command):
        method = self._methods().get(chr(command[0]))
        return method(command[1:]) if method else b""

    def _methods(self):
        return {
            "K": lambda rest: rest + b"#",
            "V": lambda _: bytes(self.version) + b"#",
            "v": lambda _: bytes([self.variant]) + b"#",
            "m": lambda _: bytes([self.model]) + b"#",
            "e": lambda _: self._angles(self.believed_deg(), 32),
            "E": lambda _: self._angles(self.believed_deg(), 16),
            "z": lambda _: self._angles(self.believed_altaz_deg()[::-1], 32),
            "Z": lambda _: self._angles(self.believed_altaz_deg()[::-1], 16),
            "r": lambda rest: self._goto(rest, 32),
            "R": lambda rest: self._goto(rest, 16),
            "s": lambda rest: self._sync(rest, 32),
            "S": lambda rest: self._sync(rest, 16),
            "L": lambda _: b"1#" if self.going else b"0#",
            "J": lambda _: bytes([self.aligned]) + b"#",
            "M": lambda _: self._cancel(),
            "t": lambda _: bytes([EQ_NORTH if self.tracking else 0]) + b"#",
            "T": lambda rest: self._track(rest[0]),
            "p": lambda _: b"E#" if self.beyond() else b"W#",  # the opposite of INDI, as celestrongps.cpp has it
            "w": lambda _: self._site(),
            "W": self._set_site,
            "h": lambda _: self._time(),
            "H": self._set_time,
            "P": self._pass_through,
        }

    # -- pointing ------------------------------------------------------------------------------------

    @staticmethod
    def _angles(pair_deg, bits):
        digits = bits // 4
        turns = [round(angle % 360.0 / 360.0 * 2**bits) % 2**bits for angle in pair_deg]
        return f"{turns[0]:0{digits}X},{turns[1]:0{digits}X}#".encode()

    def _take(self, rest, bits):
        ra, dec = (int(part, 16) * 360.0 / 2**bits for part in rest.split(b","))
        self.target_deg = [ra, dec - 360.0 if dec > 180.0 else dec]

    def _goto(self, rest, bits):
        self._take(rest, bits)
        if self.aligned and self.target_altitude_deg() > -5.0:  # an unaligned one says "#" and stays
            self.goto()
        return b"#"

    def _sync(self, rest, bits):
        self._take(rest, bits)
        if self.aligned and not self.going:
            self.sync()
        return b"#"

    def _cancel(self):
        self.stop()
        return b"#"

    def _track(self, mode):
        self.track(mode != 0)
        return b"#"

    # -- the motors, past the hand control -----------------------------------------------------------

    def _pass_through(self, rest):
        _, device, what, one, two, _, wanted = rest
        if device not in (RA_MOTOR, DEC_MOTOR):
            return bytes(wanted + 1) + b"#"  # nothing there: garbage, and one byte more
        axis = device - RA_MOTOR
        if what in (MOVE_POSITIVE, MOVE_NEGATIVE):
            top = min(FASTEST_KEY_DEG_S, self.tube.axes[axis].top_deg_s)
            rate = FAST[one] * top if one in FAST else SLOW[min(one, 5)] * SIDEREAL_DEG_S
            self._move(axis, rate if what == MOVE_POSITIVE else -rate)
        elif what in (SET_POSITIVE, SET_NEGATIVE):
            rate = (256 * one + two) / 4.0 / 3600.0
            self._move(axis, rate if what == SET_POSITIVE else -rate)
        elif what == PULSE:
            percent = one - 256 if one > 127 else one
            self.pulse(axis, self._turned(axis, percent / 100.0 * SIDEREAL_DEG_S), two / 100.0)
        elif what == SET_GUIDE:
            self.guide = one
        answers = {PULSING: [int(axis in self._pulses)], GET_GUIDE: [self.guide], VERSION: [7, 11]}
        return bytes(answers.get(what, [0] * wanted)[:wanted]).ljust(wanted, b"\0") + b"#"

    def _move(self, axis, rate_deg_s):
        if rate_deg_s == 0.0:
            self.stop((axis,))
        else:
            self.move(axis, self._turned(axis, rate_deg_s))

    def _turned(self, axis, rate_deg_s):
        """Positive is north and west on either side of the pier."""
        return -rate_deg_s if axis == 1 and self.beyond() else rate_deg_s

    # -- clock and site ------------------------------------------------------------------------------

    def _site(self):
        parts = []
        for degrees in self.site_deg:
            seconds = round(abs(degrees) * 3600.0)
            parts += [seconds // 3600, seconds // 60 % 60, seconds % 60, int(degrees < 0.0)]
        return bytes(parts) + b"#"

    def _set_site(self, rest):
        found = []
        for k in (0, 4):
            degrees = rest[k] + rest[k + 1] / 60.0 + rest[k + 2] / 3600.0
            found.append(-degrees if rest[k + 3] else degrees)
        self.site_deg = tuple(found)
        return b"#"

    def _time(self):
        local = datetime.fromtimestamp(self.believed_unix(), UTC) + timedelta(hours=self.zone_h)
        day = [local.month, local.day, local.year - 2000]
        return bytes([local.hour, local.minute, local.second, *day, round(self.zone_h) % 256, 0]) + b"#"

    def _set_time(self, rest):
        hour, minute, second, month, day, year, zone, summer = rest
        self.zone_h = (zone - 256 if zone > 127 else zone) + summer
        local = datetime(2000 + year, month, day, hour, minute, second, tzinfo=UTC)
        self.clock_error_s = (local - timedelta(hours=self.zone_h)).timestamp() - self.clock.unix()
        self.clock_set = True
        return b"#"
