"""A Bresser EXOS-2 GoTo behind its hand control: frames of 13 bytes, as INDI's indi-bresserexos2 found them.

It answers nothing but a question for its site. After any command that it knows it reports its place once a second, in
hours and degrees of four bytes, and never whether it moves; without power it falls silent until it is asked again.
"""

import struct
from datetime import UTC, datetime
from math import inf

from .board import Board
from .mechanics import HOME_DEG

HEADER = b"\x55\xaa\x01\x09"
FRAME = 13
EAST, WEST, NORTH, SOUTH = 0x01, 0x02, 0x04, 0x08
STOP, PARK, ASK_SITE, HANG_UP, GOTO, SYNC, SITE, CLOCK = 0x1D, 0x1E, 0x1F, 0x22, 0x23, 0x24, 0x25, 0x26
SITE_REPORT, PLACE_REPORT = 0xFE, 0xFF
COUNT_DEG = 2.1 / 3600.0
"""Of the motors. From one report to the next, 1 to 1.1 s, the sky turns by 7.2 to 7.9 of them, never by a whole number of
them: INDI's driver takes a place that is told twice alike for that of a mount that stands."""
REPORT_S = 1.0
STEP_S, STEP_DEG_S = 0.2, 0.25  # of a step, which is what a message of motion is; a host sends ten a second
WAYS = {EAST: (0, -1.0), WEST: (0, 1.0), NORTH: (1, 1.0), SOUTH: (1, -1.0)}


def frame(command, first=0.0, second=0.0):
    """A whole message with two numbers."""
    return HEADER + bytes([command]) + struct.pack("<ff", first, second)


class Exos2(Board):
    """``needs_keys``: as its owners found, a sync counts only after the hand control's keys were used.

    Stop ends tracking, too; motion by a host is taken only while it tracks. It never flips by itself.
    """

    boot_s = 4.0

    def __init__(self, needs_keys=False, **settings):
        super().__init__(**settings)
        self.needs_keys, self.keys_used = needs_keys, False
        self.reports = False
        self.reports_left = inf  # a test may hold them back
        self._reported = 0.0

    def wake(self, was):
        super().wake(was)
        self.reports = self.keys_used = False

    def nudge_by_hand(self, axis, rate_deg_s):
        self.keys_used = True
        super().nudge_by_hand(axis, rate_deg_s)

    # -- framing -------------------------------------------------------------------------------------

    def next_command(self, buffer):
        start = buffer.find(HEADER)
        if start < 0 or len(buffer) < start + FRAME:
            return None
        return buffer[start : start + FRAME], buffer[start + FRAME :]

    def is_stop(self, command):
        return command[4] == STOP

    def answer(self, command):
        what, numbers = command[4], command[5:]
        method = {
            STOP: self._halt,
            PARK: self._park,
            ASK_SITE: self._tell_site,
            HANG_UP: self._hang_up,
            GOTO: self._goto,
            SYNC: self._sync,
            SITE: self._set_site,
            CLOCK: self._set_clock,
        }.get(what)
        if method is None and what not in WAYS:
            self.reports = False  # what it does not know silences it
            return b""
        self.reports = True
        return self._step(what) if method is None else method(numbers) or b""

    def advance(self):
        super().advance()
        due = self.reports and self.powered and self.clock.unix() - self._reported >= REPORT_S
        if due and self.reports_left > 0:
            self.reports_left -= 1
            self._reported = self.clock.unix()
            hour_angle, dec = (round(angle / COUNT_DEG) * COUNT_DEG for angle in self.believed_hour_angle_dec_deg())
            ra = (self.sidereal_deg() - hour_angle) % 360.0
            self._answers.append((self._reported, frame(PLACE_REPORT, ra / 15.0, dec)))

    # -- orders --------------------------------------------------------------------------------------

    def _take(self, numbers):
        ra, dec = struct.unpack("<ff", numbers)
        self.target_deg = [15.0 * ra, dec]

    def _goto(self, numbers):
        self._take(numbers)
        self.parked = False
        self.goto()

    def _sync(self, numbers):
        if not self.tracking or self.going or (self.needs_keys and not self.keys_used):
            return
        self._take(numbers)
        self.keys_used = False
        self.sync()

    def _halt(self, _):
        self.stop()
        self.track(False)

    def _park(self, _):
        self.go_park(HOME_DEG)

    def _hang_up(self, _):
        self.reports = False

    def _step(self, way):
        if self.tracking and not self.going:
            axis, sign = WAYS[way]
            sign = -sign if axis == 1 and self.beyond() else sign
            self.pulse(axis, sign * STEP_DEG_S, STEP_S)
        return b""

    def _tell_site(self, _):
        return frame(SITE_REPORT, *self.site_deg)

    def _set_site(self, numbers):
        longitude, latitude = struct.unpack("<ff", numbers)
        self.site_deg = (latitude, longitude)

    def _set_clock(self, numbers):
        century, year, month, day, hour, minute, second, _ = numbers
        told = datetime(100 * century + year, month, day, hour, minute, second, tzinfo=UTC)
        self.clock_error_s = told.timestamp() - self.clock.unix()
        self.clock_set = True
