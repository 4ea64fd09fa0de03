"""Sky-Watcher motor boards, without a hand control.

INDI's EQMod sets the Dec axis to 0x800000 and a quarter turn at the pole (skywatcher.cpp, ``Init``).
"""

from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import ClassVar, NoReturn, TypeVar

from kochab.core.attitude import Degrees
from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.mount import Home, MountState, TrackingRate
from kochab.gear.mounts.drivers.motor_mount import MotorMount
from kochab.gear.mounts.protocols import skywatcher as protocol
from kochab.gear.mounts.serial_line import LOSSY_TRIES, Command, Conversation, ProtocolError
from kochab.text.translation import tr

T = TypeVar("T")
TRIES = 5  # as INDI's driver
REPLY = protocol.reader(0.3)  # a healthy EQ8-R took 0.27 s for a status
BREAK_STEPS = 3500  # a goto slows down this far from its target
STOPPING_S = 3.0  # how long a motor may run out
STILL_STEPS = 3  # the counter of a standing motor may vary by


class BoardMotor:
    """One axis, 0 or 1; angles in degrees from its home.

    ``on_power_cycle`` is called by a motor that was initialised and is not any more: its counter has begun anew.
    """

    def __init__(self, talk: Conversation, axis: int, on_power_cycle: Callable[[], None]) -> None:
        self.talk = talk
        self.axis = axis
        self.initialised, self.on_power_cycle = False, on_power_cycle
        self.tries = LOSSY_TRIES if talk.link.lossy else TRIES
        self.seen_steps = 0
        self.steps_turn = self.number("a")
        self.timer_hz = self.number("b")

    def query(self, letter: str, parse: Callable[[bytes], T], data: str = "") -> T:
        """Ask, and repeat the question when its answer is lost, as the maker's programs do."""
        return self.talk.query(protocol.command(letter, self.axis, data), REPLY, parse, self.tries, NoAnswerError)

    def angle_deg(self) -> float:
        """The encoder's angle."""
        self.seen_steps = self.query("j", protocol.parse_position)
        return self.seen_deg

    @property
    def seen_deg(self) -> float:
        """The encoder's angle when it was read last."""
        return self.seen_steps / self.steps_turn * 360.0

    def watch_index(self) -> bool:
        """Begin to wait for the axis to come over its home index; whether it has one."""
        if not self.query("q", protocol.parse_features, protocol.FEATURES) & protocol.HAS_INDEX:
            return False
        self.order("W", protocol.RESET_INDEX)  # the index it holds may predate a change of the counter
        return True

    def index_deg(self) -> float | None:
        """Where the axis came over its home index; None when it has not."""
        steps = self.query("q", protocol.parse_number, protocol.INDEX)
        if steps in (protocol.BELOW, protocol.ABOVE):
            return None
        return (steps - protocol.ZERO) / self.steps_turn * 360.0

    def status(self) -> protocol.AxisStatus:
        """The motor's status."""
        status = self.query("f", protocol.parse_status)
        before, self.initialised = self.initialised, status.initialised
        if before and not status.initialised:
            self.on_power_cycle()
        return status

    def running(self) -> bool:
        """Whether it turns."""
        return self.status().running

    def number(self, letter: str) -> int:
        """A parameter of 24 bits, which must not be 0."""
        value = self.query(letter, protocol.parse_number)
        if value == 0:
            raise ProtocolError("The motor board answers 0 to {letter}.", letter=letter)
        return value

    def order(self, letter: str, data: str = "", since: int | None = None) -> None:
        """Send a command that changes something; ``!`` is the board's refusal.

        A setting whose answer is lost is repeated, which changes nothing. A start is not.
        """
        command = protocol.command(letter, self.axis, data)
        # Never repeat a start blindly: begin() first checks whether the motor turns.
        tries = 1 if letter == "J" else self.tries
        refusal = self.talk.query(command, REPLY, _parse_order, tries, NoAnswerError, since)
        if refusal:
            raise RefusedError("The motor board refuses: {why}.", why=tr(refusal))

    def begin(self, since: int, may_repeat: bool) -> None:
        """Start the motor; when the answer is lost, check whether it turns.

        Only a turn whose encoder was read after the motor had stopped may be repeated, and only
        when it has not moved.
        """
        before = self.seen_steps
        try:
            self.order("J", since=since)
        except NoAnswerError:
            # The order arrived; only its answer was lost.
            if self.status().running:
                return
            if not may_repeat:
                raise
            self.angle_deg()
            if abs(self.seen_steps - before) <= STILL_STEPS:
                self.order("J", since=since)

    def turn_by(self, angle_deg: float, since: int) -> None:
        """A goto by so much; the motor must stand."""
        steps = round(angle_deg / 360.0 * self.steps_turn)
        if steps == 0:
            return
        fast = abs(angle_deg) > 1.0
        # Mode, steps, where to brake, start: as the maker's app orders them.
        self.order("G", protocol.motion_mode(goto=True, fast=fast, backwards=steps < 0))
        self.order("H", protocol.low_first(abs(steps)))
        self.order("M", protocol.low_first(min(abs(steps) // 10 + 1, BREAK_STEPS)))
        self.begin(since, may_repeat=True)

    def run(self, rate: TrackingRate, backwards: bool, since: int) -> None:
        """Follow the sky until stopped; the motor must stand."""
        self.order("G", protocol.motion_mode(goto=False, fast=False, backwards=backwards))
        self.order("I", protocol.low_first(protocol.step_period(rate.deg_s, self.steps_turn, self.timer_hz)))
        self.begin(since, may_repeat=False)

    def halt_command(self, now: bool = False) -> Command:
        """The bytes that stop it, at once or with a ramp."""
        return protocol.command("L" if now else "K", self.axis), (REPLY,)

    def ensure_stopped(self) -> None:
        """Stop it if it runs, so that it takes another mode."""
        status = self.status()
        if not status.initialised:
            self.order("F")
            self.initialised = True
        if not status.running:
            return
        self.order("K")  # K only begins to brake, and until the motor stands G is refused
        end = monotonic() + STOPPING_S
        while self.status().running:
            if monotonic() > end:
                raise NoAnswerError("The motor does not stop.")


def _parse_order(reply: bytes) -> str:
    refusal = protocol.parse_refusal(reply)
    if not refusal:
        protocol.parse_data(reply)
    return refusal


class SkyWatcher(MotorMount):
    """An equatorial mount over an EQDIR cable or USB."""

    name = "skywatcher"
    title = "Sky-Watcher motor board (EQMOD, EQDIR)"
    blind_stop = b":L1\r:L2\r"
    bauds = (9600, 115200)
    timeout_s = 1.5
    zeros_at: ClassVar[dict[Home, Degrees]] = {Home.POWER_ON: (0.0, 0.0), Home.EQMOD: (0.0, -90.0)}
    motors: tuple[BoardMotor, BoardMotor]

    def start(self) -> None:
        """Beside the motors' parameters look for home sensors."""
        super().start()
        self.has_index = False
        if not self.home_confirmed:
            with suppress(RefusedError):  # a board may have sensors but refuse to reset them
                self.has_index = all(motor.watch_index() for motor in self.motors)

    def find_motors(self) -> bool:
        """By the code of the mount, an alt-azimuth board is refused."""
        self.motors = BoardMotor(self.talk, 0, self.lost_power), BoardMotor(self.talk, 1, self.lost_power)
        self.version = self.motors[0].query("e", protocol.parse_data)
        objection = altaz_objection(protocol.parse_mount_code(self.version), self.equatorial)
        if objection:
            raise RefusedError(objection)
        first = self.motors[0].status()
        return first.running and not first.goto and not first.fast  # slow and open-ended: it tracks

    def same_power(self) -> bool:
        """A board that was switched on is not initialised."""
        return self.motors[0].initialised and self.motors[1].status().initialised

    def board_id(self) -> str:
        """Its version and its gears."""
        return "-".join((self.version, *(str(motor.steps_turn) for motor in self.motors)))

    def lost_power(self) -> NoReturn:
        """The same; the motors must be initialised again."""
        for motor in self.motors:
            motor.initialised = False
        super().lost_power()

    def state(self) -> MountState:
        """The same, and home where both axes came over their indexes."""
        if self.has_index and not self.home_confirmed:
            self.continue_motion()
            self.find_index()
        return super().state()

    def find_index(self) -> None:
        """Both axes have been nudged over their home indexes: home is where they are."""
        # The indexes are in the same steps as the counters: their places become the zero of both axes.
        first, second = (motor.index_deg() for motor in self.motors)
        if first is not None and second is not None:
            self.offset_deg, self.home_confirmed = (-first, -second), True
            self.keep()

    def identify(self) -> str:
        """The board's version."""
        major, minor = int(self.version[:2], 16), int(self.version[2:4], 16)
        return tr("Sky-Watcher motor board, version {version}", version=f"{major}.{minor:02d}")


def altaz_objection(code: int, equatorial: bool) -> str:
    """Why this board must not be driven as an equatorial mount; empty when it may.

    ``equatorial`` is the user's word for a board whose code does not show it.
    """
    if code in protocol.ALT_AZIMUTH:
        return tr(
            "Kochab can't slew this alt-azimuth mount (code {code}) directly: use its hand control (--driver synscan).",
            code=f"0x{code:02X}",
        )
    if code in protocol.EQUATORIAL or equatorial:
        return ""
    if code == protocol.AZ_GTI:
        return tr(
            "Kochab slews an AZ-GTi only in equatorial mode. If yours is on a wedge, connect as equatorial"
            " (--equatorial)."
        )
    return tr(
        "Unknown Sky-Watcher mount (code {code}). If it is an equatorial mount, connect as equatorial (--equatorial).",
        code=f"0x{code:02X}",
    )
