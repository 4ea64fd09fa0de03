"""A Sky-Watcher motor board: two motors that count steps and know nothing of the sky.

It is switched on at home, weights down and the tube on the pole, where both counters read 0x800000; INDI's EQMod
sets the second to 0x800000 and a quarter turn there. Counting up, the first motor turns counter-clockwise seen from
below the pole, which is with the stars in the north and against them in the south; the second turns the tube over
the pole from the east side of the sky to the west in the north.
"""

import re
from collections.abc import Callable

from kochab.core.mount import SIDEREAL_DAY_S
from kochab.simulate.mechanics.mount import EquatorialMount
from kochab.simulate.responders import Controller

MIDDLE = 0x800000
FAST_GOTO, SLOW_SLEW, SLOW_GOTO, FAST_SLEW = range(4)
ARRIVED_STEPS = 3.0


def low_first(value: int) -> bytes:
    """24 bits in hexadecimal, low byte first."""
    return (value & 0xFFFFFF).to_bytes(3, "little").hex().upper().encode()


def number(text: bytes) -> int:
    """The inverse of :func:`low_first`."""
    return int.from_bytes(bytes.fromhex(text.decode("ascii")), "little")


class BoardMotor:
    """One motor: its counter, its mode, and how it turns an axis of the telescope.

    ``steps_deg`` are steps a degree of the telescope's axis, negative where it counts down.
    """

    def __init__(self, telescope: EquatorialMount, axis: int, steps_deg: float) -> None:
        self.telescope, self.axis, self.steps_deg = telescope, axis, steps_deg
        self.initialised = False
        self.mode = (SLOW_SLEW, 0)
        self.period = 620
        self.target = MIDDLE
        # where the counter reads the middle: as if switched on at home, where its computer believes that to be
        self._zero_deg = telescope.axes_deg()[axis] - telescope.from_home_deg()[axis]
        self._slewing_to: float | None = None
        self._turning = False
        self._clock = (0, 1)
        self.reset_index()

    def steps(self) -> int:
        """The counter."""
        return MIDDLE + round((self._angle() - self._zero_deg) * self.steps_deg)

    def set_steps(self, steps: int) -> None:
        """Let the counter read this where the axis is."""
        self._zero_deg = self._angle() - (steps - MIDDLE) / self.steps_deg

    def _from_index(self) -> int:
        """Steps from the home index, which is where the axis truly is at home."""
        return round(self.telescope.from_home_deg()[self.axis] * self.steps_deg)

    def reset_index(self) -> None:
        """Forget where the index was passed."""
        self._index_from, self._passed = self._from_index(), 0

    def index(self) -> int:
        """Where the counter was when the axis came over the index; 0 still below, all ones still above it."""
        now = self._from_index()
        if not self._passed and (now < 0) != (self._index_from < 0):
            self._passed = self.steps() - now
        return self._passed or (0 if now < 0 else 0xFFFFFF)

    def target_by(self, increment: int) -> None:
        """A target relative to here, in the direction of the mode."""
        self.target = self.steps() + (-increment if self._backwards else increment)

    def running(self) -> bool:
        """Whether it turns."""
        if self._slewing_to is not None:
            if abs(self._angle() - self._slewing_to) * abs(self.steps_deg) > ARRIVED_STEPS:
                return True
            self._slewing_to = None
        return self._turning

    def status(self) -> bytes:
        """Three digits: goto or not, which way and how fast; running; initialised."""
        mode, backwards = self.mode
        first = (mode in (SLOW_SLEW, FAST_SLEW)) | (backwards & 1) << 1
        first |= (mode in (FAST_GOTO, FAST_SLEW)) << 2
        return b"%X%X%X" % (first, self.running(), self.initialised)

    def set_period(self, period: int) -> None:
        """Timer ticks a step; heeded at once by a motor that turns."""
        self.period = max(1, period)
        if self._turning:
            self.start(*self._clock)

    def start(self, timer_hz: int, fast_ratio: int) -> None:
        """Begin what mode, target and period say."""
        self._clock = (timer_hz, fast_ratio)
        if self.mode[0] in (FAST_GOTO, SLOW_GOTO):
            self._turning = False
            self._slewing_to = self._zero_deg + (self.target - MIDDLE) / self.steps_deg
            self.telescope.turn_axis_to(self.axis, self._slewing_to)
            return
        self._slewing_to, self._turning = None, True
        # the timer gives one step each period; a fast slew makes fast_ratio steps of it
        steps_s = timer_hz / self.period * (fast_ratio if self.mode[0] == FAST_SLEW else 1)
        rate = steps_s / self.steps_deg
        self.telescope.turn_axis(self.axis, -rate if self._backwards else rate)

    def stop(self) -> None:
        """At once, as far as the board is concerned."""
        if self.running():
            self.telescope.turn_axis(self.axis, 0.0)
        self._slewing_to, self._turning = None, False

    @property
    def _backwards(self) -> bool:
        return bool(self.mode[1] & 1)

    def _angle(self) -> float:
        return self.telescope.axes_deg()[self.axis]


UNKNOWN, LENGTH, NOT_STOPPED, CHARACTER, NOT_INITIALISED, ASLEEP = (b"!%d\r" % k for k in range(6))
TIMER_HZ = 64935
FAST_RATIO = 16
STEPS_TURN = 9024000
STEPS_WORM = 50133
VERSION = b"0203"
_SIZES = {b"G": 2, b"H": 6, b"M": 6, b"S": 6, b"U": 6, b"I": 6, b"E": 6, b"P": 1, b"V": 2, b"O": 1}
_SIZES |= {b"F": 0, b"J": 0, b"K": 0, b"L": 0}


class SkyWatcherResponder(Controller):
    """An EQ6's board: no home sensors, no encoders, no ``features`` to ask for (``q``), until some are given to it."""

    # a second colon before the CR begins anew: what stood before it is lost
    command = re.compile(rb":(?:[^\r]*:)?([^:\r]*)\r")
    begins = b":"
    longest = 16

    def __init__(self, telescope: EquatorialMount) -> None:
        super().__init__(telescope)
        self.mount_code = 0x00  # an EQ6
        self.features = 0
        north = telescope.latitude_deg >= 0.0
        self.motors = (
            # in the south the axis turns the other way for the same counter
            BoardMotor(telescope, 0, STEPS_TURN * (1.0 if north else -1.0) / 360.0),
            BoardMotor(telescope, 1, -STEPS_TURN / 360.0),
        )
        self.asked: dict[bytes, Callable[[BoardMotor], bytes]] = {
            b"e": lambda _: b"%s%02X" % (VERSION, self.mount_code),
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

    def _answer(self, command: bytes) -> bytes:
        order, channel, data = command[:1], command[1:2], command[2:]
        if channel not in (b"1", b"2", b"3"):
            return LENGTH if not channel else CHARACTER
        motors = self.motors if channel == b"3" else (self.motors[int(channel) - 1],)
        if order in self.asked and channel != b"3":
            return b"=" + self.asked[order](motors[0]) + b"\r"
        if self.features and order == b"q" and data in (b"010000", b"000000"):
            return b"=" + low_first(self.features if data == b"010000" else motors[0].index()) + b"\r"
        if self.features and order == b"W" and data == b"080000":
            motors[0].reset_index()
            return b"=\r"
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

    def obey(self, order: bytes, motor: BoardMotor, data: bytes) -> bytes:
        """Do it, or give the error it deserves."""
        if order in (b"P", b"V", b"O", b"M", b"U"):  # guide port, lamp, shutter, braking points
            return b""
        # While it turns, only the mode that it is in may be sent again.
        same_mode = order == b"G" and motor.mode == (int(data[:1], 16), int(data[1:], 16))
        if order == b"F":
            motor.initialised = True
        elif order in (b"K", b"L"):
            motor.stop()
        elif order in (b"E", b"G", b"H", b"S") and motor.running() and not same_mode:
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
            if not motor.initialised:
                return NOT_INITIALISED
            if self.telescope.parked or self.refusal():
                return ASLEEP
            motor.start(TIMER_HZ, FAST_RATIO)
        return b""
