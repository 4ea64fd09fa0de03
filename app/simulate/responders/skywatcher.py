"""A Sky-Watcher motor board: two motors that count steps and know nothing of the sky.

It is switched on at home, weights down and the tube on the pole, where both counters read
0x800000. Counting up, the first motor turns counter-clockwise seen from below the pole, which is
with the stars in the north and against them in the south; the second turns the tube over the pole
from the east side of the sky to the west in the north.
"""

import re
from collections.abc import Callable

from app.core.earth import SIDEREAL_DAY_S
from app.simulate.responders.base import Controller
from app.simulate.responders.skywatcher_motor import MIDDLE, Motor, low_first, number
from app.simulate.telescope import Telescope

UNKNOWN, LENGTH, NOT_STOPPED, CHARACTER, NOT_INITIALISED, ASLEEP = (b"!%d\r" % k for k in range(6))
TIMER_HZ = 64935
FAST_RATIO = 16
STEPS_TURN = 9024000
STEPS_WORM = 50133
VERSION = b"020300"  # 2.3 of an EQ6
_SIZES = {b"G": 2, b"H": 6, b"M": 6, b"S": 6, b"U": 6, b"I": 6, b"E": 6, b"P": 1, b"V": 2, b"O": 1}
_SIZES |= {b"F": 0, b"J": 0, b"K": 0, b"L": 0}


class SkyWatcher(Controller):
    """An EQ6's board: no home sensors, no encoders, no features to ask for (``q``)."""

    longest = 16

    def __init__(self, telescope: Telescope) -> None:
        super().__init__(telescope)
        north = telescope.latitude_deg >= 0.0
        self.motors = (
            Motor(telescope, 0, STEPS_TURN * (1.0 if north else -1.0) / 360.0),
            Motor(telescope, 1, -STEPS_TURN / 360.0),
        )
        self.asked: dict[bytes, Callable[[Motor], bytes]] = {
            b"e": lambda _: VERSION,
            b"a": lambda _: low_first(STEPS_TURN),
            b"b": lambda _: low_first(TIMER_HZ),
            b"g": lambda _: b"%02X" % FAST_RATIO,
            b"s": lambda _: low_first(STEPS_WORM),
            b"j": lambda motor: low_first(motor.steps()),
            b"h": lambda motor: low_first(motor.target),
            b"i": lambda motor: low_first(motor.period),
            b"D": lambda _: low_first(round(TIMER_HZ * SIDEREAL_DAY_S / STEPS_TURN)),
            b"f": lambda motor: motor.status(),
        }

    def count_from_home(self, from_home_deg: tuple[float, float]) -> None:
        """Let the counters read as if it had been switched on at home and turned so far since."""
        for motor, angle in zip(self.motors, from_home_deg, strict=True):
            motor.set_steps(MIDDLE + round(angle * motor.steps_deg))

    def _take(self) -> bytes | None:
        """``:`` up to a carriage return; a new colon begins anew."""
        pending = self._pending
        end = pending.find(b"\r")
        if end < 0:
            start = pending.rfind(b":")
            del pending[: start if start >= 0 else len(pending)]
            if len(pending) > self.longest:
                pending.clear()
            return None
        line = bytes(pending[:end])
        del pending[: end + 1]
        return line

    def _answer(self, line: bytes) -> bytes:
        start = line.rfind(b":")
        if start < 0:
            return b""
        order, channel = line[start + 1 : start + 2], line[start + 2 : start + 3]
        data = line[start + 3 :]
        if channel not in (b"1", b"2", b"3"):
            return LENGTH if not channel else CHARACTER
        motors = self.motors if channel == b"3" else (self.motors[int(channel) - 1],)
        if order in self.asked and channel != b"3":
            return b"=" + self.asked[order](motors[0]) + b"\r"
        if order not in _SIZES:
            return UNKNOWN
        if len(data) != _SIZES[order]:
            return LENGTH
        if not re.fullmatch(rb"[0-9A-F]*", data):
            return CHARACTER
        for motor in motors:
            wrong = self.obey(order, motor, data)
            if wrong:
                return wrong
        return b"=\r"

    def obey(self, order: bytes, motor: Motor, data: bytes) -> bytes:
        """Do it, or give the error it deserves."""
        if order in (b"P", b"V", b"O", b"M", b"U"):  # guide port, lamp, shutter, braking points
            return b""
        if order == b"F":
            motor.initialised = True
        elif order in (b"K", b"L"):
            motor.stop()
        elif order in (b"E", b"G", b"H", b"S") and self._must_wait(order, motor, data):
            return NOT_STOPPED
        elif order == b"E":
            motor.set_steps(number(data))
        elif order == b"G":
            motor.mode = int(data[:1], 16), int(data[1:], 16)
        elif order == b"H":
            motor.target_by(number(data))
        elif order == b"S":
            motor.target = number(data)
        elif order == b"I":
            motor.set_period(number(data))
        elif order == b"J":
            return self._start(motor)
        return b""

    def _must_wait(self, order: bytes, motor: Motor, data: bytes) -> bool:
        """Not while it turns; only the mode that it is in may be sent again."""
        same = order == b"G" and motor.mode == (int(data[:1], 16), int(data[1:], 16))
        return motor.running() and not same

    def _start(self, motor: Motor) -> bytes:
        if not motor.initialised:
            return NOT_INITIALISED
        if self.telescope.parked or self.refusal():
            return ASLEEP
        motor.start(TIMER_HZ, FAST_RATIO)
        return b""
