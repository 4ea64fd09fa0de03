"""One motor of the board: its counter, its mode, and how it turns an axis of the telescope."""

from app.simulate.telescope import Telescope

MIDDLE = 0x800000
FAST_GOTO, SLOW_SLEW, SLOW_GOTO, FAST_SLEW = range(4)
ARRIVED_STEPS = 3.0


def low_first(value: int) -> bytes:
    """24 bits in hexadecimal, low byte first."""
    return (value & 0xFFFFFF).to_bytes(3, "little").hex().upper().encode()


def number(text: bytes) -> int:
    """The inverse of :func:`low_first`."""
    return int.from_bytes(bytes.fromhex(text.decode("ascii")), "little")


class Motor:
    """``steps_deg`` are steps a degree of the telescope's axis, negative where it counts down."""

    def __init__(self, telescope: Telescope, axis: int, steps_deg: float) -> None:
        self.telescope, self.axis, self.steps_deg = telescope, axis, steps_deg
        self.initialised = False
        self.mode = (SLOW_SLEW, 0)
        self.period = 620
        self.target = MIDDLE
        self._zero_deg = telescope.axes_deg()[axis]  # where the counter reads the middle
        self._slewing_to: float | None = None
        self._turning = False
        self._clock = (0, 1)

    def steps(self) -> int:
        """The counter."""
        return MIDDLE + round((self._angle() - self._zero_deg) * self.steps_deg)

    def set_steps(self, steps: int) -> None:
        """Let the counter read this where the axis is."""
        self._zero_deg = self._angle() - (steps - MIDDLE) / self.steps_deg

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
