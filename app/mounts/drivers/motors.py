"""The two motors behind a Sky-Watcher board, each by its orders."""

from collections.abc import Callable
from time import monotonic
from typing import TypeVar

from app.core.errors import NoAnswerError, RefusedError
from app.mounts.conversation import Conversation, ProtocolError, Reader, until
from app.mounts.protocols import skywatcher as words

T = TypeVar("T")
TIMEOUT_S, TRIES = 0.3, 5
REPLY = until(b"\r", 16, TIMEOUT_S)
FAST_DEG_S = 0.5  # above this the board's fast mode is used
BREAK_STEPS = 3500
STOPPING_S = 3.0
STILL_STEPS = 3


class Motor:
    """One axis, 0 or 1; angles in degrees from its home."""

    def __init__(self, talk: Conversation, axis: int) -> None:
        self.talk = talk
        self.axis = axis
        self.seen_steps = 0
        self.steps_turn = self.number("a")
        self.timer_hz = self.number("b")
        self.ratio = max(1, int(self.query("g")[:2] or "1", 16))

    def angle_deg(self) -> float:
        """Where the encoder is."""
        self.seen_steps = self._asked(words.command("j", self.axis), words.parse_position)
        return self.seen_steps / self.steps_turn * 360.0

    def status(self) -> words.AxisStatus:
        """How the motor is."""
        return self._asked(words.command("f", self.axis), words.parse_status)

    def number(self, letter: str) -> int:
        """24 bits of a question."""
        value = self._asked(words.command(letter, self.axis), words.parse_number)
        if value == 0:
            raise ProtocolError(f"The motor board answers 0 to {letter}.")
        return value

    def query(self, letter: str) -> str:
        """The digits of a question."""
        return self._asked(words.command(letter, self.axis), words.parse_data)

    def order(self, letter: str, data: str = "", since: int | None = None) -> None:
        """What changes something; ``!`` is the board's refusal.

        A setting whose answer is lost is said again: it comes to the same. A start is not.
        """
        command = words.command(letter, self.axis, data)
        for left in range(1 if letter == "J" else TRIES, 0, -1):
            try:
                said = self.talk.ask(command, REPLY, _answered, since)
                break
            except NoAnswerError:
                if left == 1:
                    raise
        if said:
            raise RefusedError(f"The motor board refuses: {said}.")

    def begin(self, since: int, may_ask_again: bool) -> None:
        """Start the motor; when the answer is lost, look whether it turns.

        Only a turn whose encoder was read since the motor stands may be asked for again, and only
        when it has not moved.
        """
        before = self.seen_steps
        try:
            self.order("J", since=since)
        except NoAnswerError:
            if self.status().running:
                return
            if not may_ask_again:
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
        self.order("G", words.motion_mode(goto=True, fast=fast, backwards=steps < 0))
        self.order("H", words.low_first(abs(steps)))
        self.order("M", words.low_first(min(abs(steps) // 10 + 1, BREAK_STEPS)))
        self.begin(since, may_ask_again=True)

    def run(self, rate_deg_s: float, since: int) -> None:
        """Turn at a rate until stopped; the motor must stand."""
        fast = abs(rate_deg_s) > FAST_DEG_S
        self.order("G", words.motion_mode(goto=False, fast=fast, backwards=rate_deg_s < 0))
        self.order("I", words.low_first(self.period(rate_deg_s)))
        self.begin(since, may_ask_again=False)

    def period(self, rate_deg_s: float) -> int:
        """Timer ticks a step."""
        ratio = self.ratio if abs(rate_deg_s) > FAST_DEG_S else 1
        return words.step_period(rate_deg_s, self.steps_turn, self.timer_hz, ratio)

    def rate_words(self, rate_deg_s: float) -> tuple[bytes, tuple[Reader, ...]]:
        """The bytes of another rate while it turns the same way, for :meth:`Conversation.urge`."""
        data = words.low_first(self.period(rate_deg_s))
        return words.command("I", self.axis, data), (REPLY,)

    def halt_words(self, now: bool = False) -> tuple[bytes, tuple[Reader, ...]]:
        """The bytes that stop it, at once or with a ramp."""
        return words.command("L" if now else "K", self.axis), (REPLY,)

    def stand(self) -> None:
        """Make sure that it stands, so that it takes another mode."""
        status = self.status()
        if not status.initialised:
            self.order("F")
        if not status.running:
            return
        self.order("K")
        end = monotonic() + STOPPING_S
        while self.status().running:
            if monotonic() > end:
                raise NoAnswerError("The motor does not come to a stop.")

    def _asked(self, command: bytes, parse: Callable[[bytes], T]) -> T:
        """A question: a lost answer is asked for again, as the board's own programs do."""
        for _ in range(TRIES - 1):
            try:
                return self.talk.ask(command, REPLY, parse)
            except NoAnswerError:
                continue
        return self.talk.ask(command, REPLY, parse)


def _answered(reply: bytes) -> str:
    refusal = words.parse_refusal(reply)
    if not refusal:
        words.parse_data(reply)
    return refusal
