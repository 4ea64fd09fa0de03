"""Two motor boards of a Celestron on its AUX bus, written from what others found, never from the driver.

Frames, commands and the rates of tracking: A. Paquette's document and INDI's celestronaux. The way the axes count:
INDI's ``RADEToEncoders``. What is sent back, refusals, versions: captures of real mounts (L101 to L111). One speed an
axis that tracking, moves and gotos share, rates of a move, gotos that end early and say that they are done: INDIGO's
record of a NexStar SE.
"""

from kochab.core.mount import SIDEREAL_DEG_S, TrackingRate
from kochab.simulate.responders import Controller
from kochab.simulate.responders.skywatcher import MIDDLE, SLOW_SLEW, BoardMotor

TURN = 1 << 24
RATES_DEG_S = (0.0, *(k * SIDEREAL_DEG_S for k in (0.5, 1, 4, 8, 16, 32, 64)), 1.5, 4.0)
TRACKS = {b"\xff\xff": TrackingRate.SIDEREAL, b"\xff\xfe": TrackingRate.SOLAR, b"\xff\xfd": TrackingRate.LUNAR}
AVX, EVOLUTION = b"\x14\x85", b"\x16\x87"


def frame(sender: int, to: int, command: int, data: bytes = b"") -> bytes:
    body = bytes([len(data) + 3, sender, to, command]) + data
    return b";" + body + bytes([(~sum(body) + 1) & 0xFF])


class AuxMotorBoard(BoardMotor):
    """Counts a turn in 24 bits, and begins at nothing when it is switched on."""

    def count(self) -> int:
        return (self.steps() - MIDDLE) % TURN

    def set_count(self, count: int) -> None:
        self.set_steps(MIDDLE + count)

    def go(self, count: int) -> None:
        """The short way round."""
        away = (count - self.count() + TURN // 2) % TURN - TURN // 2
        self._turning = False
        self._slewing_to = self._angle() + away / self.steps_deg
        self.telescope.turn_axis_to(self.axis, self._slewing_to)

    def run(self, counted_deg_s: float) -> None:
        """At a rate in the direction in which it counts."""
        self._slewing_to, self._turning, self.mode = None, counted_deg_s != 0.0, (SLOW_SLEW, 0)
        self.telescope.turn_axis(self.axis, counted_deg_s if self.steps_deg > 0 else -counted_deg_s)

    def done(self) -> bool:
        return not self.running() or self._slewing_to is None


class CelestronAuxResponder(Controller):
    """A GEM behind its Wi-Fi, which sends everything back."""

    begins = b";"
    command = None

    def __init__(self, telescope) -> None:
        super().__init__(telescope)
        self.model, self.version, self.echoes = AVX, b"\x07\x0f\x20\x4e", True
        telescope.tracking = False
        north = telescope.latitude_deg >= 0.0
        turn = TURN / 360.0
        self.motors = AuxMotorBoard(telescope, 0, turn if north else -turn), AuxMotorBoard(telescope, 1, -turn)

    def feed(self, data: bytes) -> bytes:
        self._pending += data
        replies = b""
        while (at := self._pending.find(b";")) >= 0:
            self._pending = self._pending[at:]
            if len(self._pending) < 2 or len(self._pending) < self._pending[1] + 3:
                break
            end = self._pending[1] + 3
            asked, good = self._pending[:end], end >= 6 and sum(self._pending[1:end]) % 256 == 0
            self._pending = self._pending[end if good else 1 :]
            if good:
                replies += (asked if self.echoes else b"") + self.reply(asked)
        return replies

    def reply(self, asked: bytes) -> bytes:
        sender, to, command, data = asked[2], asked[3], asked[4], asked[5:-1]
        if to not in (0x10, 0x11):
            return b""
        answer = self.obeyed(self.motors[to - 0x10], command, data)
        return frame(to, sender, 0xF0, bytes([command])) if answer is None else frame(to, sender, command, answer)

    def obeyed(self, motor: AuxMotorBoard, command: int, data: bytes) -> bytes | None:
        """The data of the answer; None for what it does not know."""
        match command, len(data):
            case 0x01, 0:
                return motor.count().to_bytes(3, "big")
            case 0x02 | 0x17, 3:
                motor.go(int.from_bytes(data, "big"))
            case 0x04, 3:
                motor.set_count(int.from_bytes(data, "big"))
            case 0x05, 0:
                return self.model
            case 0x06 | 0x07, 2 if data in TRACKS:
                motor.run(TRACKS[data].deg_s * (1.0 if command == 0x06 else -1.0))
            case 0x06 | 0x07, 3:
                motor.run(int.from_bytes(data, "big") / 1024.0 / 3600.0 * (1.0 if command == 0x06 else -1.0))
            case 0x13, 0:
                return b"\xff" if motor.done() else b"\x00"
            case 0x24 | 0x25, 1 if data[0] < len(RATES_DEG_S):
                motor.run(RATES_DEG_S[data[0]] * (1.0 if command == 0x24 else -1.0))
            case 0xFE, 0:
                return self.version
            case _:
                return None
        return b""

    def power_on(self) -> None:
        """Both count from nothing where they stand."""
        for motor in self.motors:
            motor.run(0.0)
            motor.set_count(0)
