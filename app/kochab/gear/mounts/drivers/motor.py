"""One motor of a Sky-Watcher board: its parameters, its counter, and how it is turned."""

from collections.abc import Callable
from time import monotonic
from typing import TypeVar

from kochab.core.errors import NoAnswerError, RefusedError
from kochab.gear.mounts.protocols import skywatcher as protocol
from kochab.gear.mounts.serial_line import LOSSY_TRIES, Command, Conversation, ProtocolError

T = TypeVar("T")
TRIES = 5
REPLY = protocol.reader(0.3)
FAST_DEG_S = 0.5  # above this the board's fast mode is used
BREAK_STEPS = 3500
STOPPING_S = 3.0
STILL_STEPS = 3


class Motor:
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
        self.ratio = max(1, int(self.query("g", protocol.parse_data)[:2] or "1", 16))

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
        self.order("W", protocol.RESET_INDEX)  # what it kept may be of counters that were set since
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

    def number(self, letter: str) -> int:
        """A parameter of 24 bits, which must not be 0."""
        value = self.query(letter, protocol.parse_number)
        if value == 0:
            raise ProtocolError(f"The motor board answers 0 to {letter}.")
        return value

    def order(self, letter: str, data: str = "", since: int | None = None) -> None:
        """Send a command that changes something; ``!`` is the board's refusal.

        A setting whose answer is lost is repeated, which changes nothing. A start is not.
        """
        command = protocol.command(letter, self.axis, data)
        tries = 1 if letter == "J" else self.tries
        refusal = self.talk.query(command, REPLY, _parse_order, tries, NoAnswerError, since)
        if refusal:
            raise RefusedError(f"The motor board refuses: {refusal}.")

    def begin(self, since: int, may_repeat: bool) -> None:
        """Start the motor; when the answer is lost, check whether it turns.

        Only a turn whose encoder was read after the motor had stopped may be repeated, and only
        when it has not moved.
        """
        before = self.seen_steps
        try:
            self.order("J", since=since)
        except NoAnswerError:
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
        self.order("G", protocol.motion_mode(goto=True, fast=fast, backwards=steps < 0))
        self.order("H", protocol.low_first(abs(steps)))
        self.order("M", protocol.low_first(min(abs(steps) // 10 + 1, BREAK_STEPS)))
        self.begin(since, may_repeat=True)

    def run(self, rate_deg_s: float, since: int) -> None:
        """Turn at a rate until stopped; the motor must stand."""
        fast = abs(rate_deg_s) > FAST_DEG_S
        self.order("G", protocol.motion_mode(goto=False, fast=fast, backwards=rate_deg_s < 0))
        self.order("I", protocol.low_first(self.period(rate_deg_s)))
        self.begin(since, may_repeat=False)

    def period(self, rate_deg_s: float) -> int:
        """Timer ticks a step."""
        ratio = self.ratio if abs(rate_deg_s) > FAST_DEG_S else 1
        return protocol.step_period(rate_deg_s, self.steps_turn, self.timer_hz, ratio)

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
        self.order("K")
        end = monotonic() + STOPPING_S
        while self.status().running:
            if monotonic() > end:
                raise NoAnswerError("The motor does not stop.")


def _parse_order(reply: bytes) -> str:
    refusal = protocol.parse_refusal(reply)
    if not refusal:
        protocol.parse_data(reply)
    return refusal
