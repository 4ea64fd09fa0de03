"""A Sky-Watcher motor board, which knows steps and no sky: INDI's eqmod, `mount-transcripts.md`, 8."""

from .board import Board
from .mechanics import HOME_DEG
from .sky import SIDEREAL_DEG_S

ZERO = 0x800000
UNKNOWN, LENGTH, RUNNING, NOT_INITIALISED = b"!0\r", b"!1\r", b"!2\r", b"!4\r"


def revolution_24(number):
    """Six hexadecimal digits, the low byte first."""
    return (number & 0xFFFFFF).to_bytes(3, "little").hex().upper().encode()


class SkyWatcher(Board):
    """An EQ6: its counters begin at 0x800000 on both axes wherever the tube is when it gets its power.

    It has no limits, no clock and no belief about the sky, so it is never ``false``; :attr:`initialised` is what it can
    tell of a restart. Steps grow as axis 1 turns with the sky, and as the tube leaves the pole towards the east.
    """

    boot_s = 1.0
    per_turn, frequency, fast = 9024000, 64935, 16
    code = 0x00

    def __init__(self, **settings):
        super().__init__(**settings)
        self.initialised = [False, False]
        self.at_zero = list(HOME_DEG)  # where the axes were when the counters were at zero
        self._forget()

    signs = (1.0, -1.0)

    def _forget(self):
        self.mode, self.high, self.backward = ["slew", "slew"], [False, False], [False, False]
        self.period, self.steps_to_go = [1, 1], [0, 0]

    def wake(self, was):
        self.initialised = [False, False]
        self.at_zero = [axis.at_deg for axis in self.tube.axes]
        self.at_home = self.parked = False
        self._forget()

    def false_by_deg(self):
        return 0.0

    def lost_by_deg(self):
        return 0.0

    # -- framing -------------------------------------------------------------------------------------

    def next_command(self, buffer):
        start = buffer.find(b":")
        if start < 0 or (end := buffer.find(b"\r", start)) < 0:
            return None
        return buffer[buffer.rfind(b":", start, end) : end], buffer[end + 1 :]

    def is_stop(self, command):
        return command[1:2] in (b"K", b"L")

    def answer(self, command):
        letter, which, data = command[1:2].decode(), command[2:3], command[3:].decode("latin1")
        method = getattr(self, f"_{'big' if letter.isupper() else 'small'}_{letter.lower()}", None)
        if method is None or which not in (b"1", b"2", b"3"):
            return UNKNOWN
        axes = {b"1": (0,), b"2": (1,), b"3": (0, 1)}[which]
        answers = [method(axis, data) for axis in axes]
        found = answers[0]
        return found if found.startswith(b"!") else b"=" + found + b"\r"

    # -- questions -----------------------------------------------------------------------------------

    def _small_e(self, _axis, _data):
        return b"0204" + f"{self.code:02X}".encode()

    def _small_a(self, _axis, _data):
        return revolution_24(self.per_turn)

    def _small_b(self, _axis, _data):
        return revolution_24(self.frequency)

    def _small_g(self, _axis, _data):
        return f"{self.fast:02X}".encode()

    def _small_s(self, _axis, _data):
        return revolution_24(self.per_turn // 180)

    def _small_d(self, _axis, _data):
        return revolution_24(round(self.frequency * 360.0 / self.per_turn / SIDEREAL_DEG_S))

    def _small_i(self, axis, _data):
        return revolution_24(self.period[axis])

    def _small_j(self, axis, _data):
        return revolution_24(self.steps(axis))

    def _small_f(self, axis, _data):
        first = (self.mode[axis] == "slew") | self.backward[axis] << 1 | self.high[axis] << 2
        return f"{first:X}{int(self._runs(axis)):X}{int(self.initialised[axis]):X}".encode()

    def steps(self, axis):
        """What the counter says."""
        away = self.tube.axes[axis].at_deg - self.at_zero[axis]
        return ZERO + round(self.signs[axis] * away / 360.0 * self.per_turn)

    def _runs(self, axis):
        a = self.tube.axes[axis]
        return a.target_deg is not None or a.rate_deg_s != 0.0 or a.by_hand_deg_s != 0.0 or a.follows_deg_s != 0.0

    # -- orders --------------------------------------------------------------------------------------

    @staticmethod
    def _number(data):
        return int.from_bytes(bytes.fromhex(data), "little")

    def _big_f(self, axis, _data):
        self.initialised[axis] = True
        return b""

    def _big_e(self, axis, data):
        if self._runs(axis):
            return RUNNING
        away = self.signs[axis] * (self._number(data) - ZERO) / self.per_turn * 360.0
        self.at_zero[axis] = self.tube.axes[axis].at_deg - away
        return b""

    def _big_g(self, axis, data):
        if self._runs(axis):
            return RUNNING
        kind, way = data[0], int(data[1], 16)
        self.mode[axis] = "goto" if kind in "02" else "slew"
        self.high[axis] = kind in "03"
        self.backward[axis] = bool(way & 1)
        return b""

    def _big_h(self, axis, data):
        if self._runs(axis):
            return RUNNING
        self.steps_to_go[axis] = self._number(data)
        return b""

    def _big_i(self, axis, data):
        if len(data) != 6:
            return LENGTH
        self.period[axis] = max(1, self._number(data))
        if self._runs(axis) and self.mode[axis] == "slew":
            self._run_at_rate(axis)
        return b""

    def _big_m(self, _axis, _data):
        return b""  # where it begins to slow down is its own affair here

    _big_p = _big_o = _big_w = _big_v = _big_m

    def _big_j(self, axis, _data):
        if not self.initialised[axis]:
            return NOT_INITIALISED
        if self.mode[axis] == "slew":
            self._run_at_rate(axis)
            return b""
        way = -self.signs[axis] if self.backward[axis] else self.signs[axis]
        self._write("turn", None)
        self.tube.axes[axis].follows_deg_s = 0.0
        self.tube.axes[axis].target_deg = (
            self.tube.axes[axis].at_deg + way * self.steps_to_go[axis] * 360.0 / self.per_turn
        )
        return b""

    def _run_at_rate(self, axis):
        rate = self.frequency / self.period[axis] * 360.0 / self.per_turn * (self.fast if self.high[axis] else 1.0)
        rate = min(rate, self.tube.axes[axis].top_deg_s) * (-1.0 if self.backward[axis] else 1.0)
        if axis == 0 and 0.0 < rate < 1.95 * SIDEREAL_DEG_S:  # it follows the sky, and guides by that
            self.tube.axes[0].follows_deg_s, self.tube.axes[0].by_hand_deg_s = rate, 0.0
            return
        self._write("run", None)
        self.tube.axes[axis].follows_deg_s = 0.0
        self.tube.axes[axis].by_hand_deg_s = self.signs[axis] * rate

    def _big_k(self, axis, _data):
        self.tube.axes[axis].follows_deg_s = 0.0
        self.tube.axes[axis].stop()
        return b""

    def _big_l(self, axis, _data):
        self.tube.axes[axis].lose_power()
        return b""
