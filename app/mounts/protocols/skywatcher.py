"""Sky-Watcher's motor board language: encoders and periods, and nothing about the sky.

Source: Sky-Watcher Motor Controller Command Set (2014). 24-bit numbers travel as six hexadecimal
digits, the low byte first.
"""

import re
from dataclasses import dataclass

from app.mounts.conversation import ProtocolError

ZERO = 0x800000
ERRORS = {
    0: "an unknown command", 1: "a command of the wrong length", 2: "the motor is not stopped",
    3: "an invalid character", 4: "not initialised", 5: "the driver sleeps",
    7: "the training of the periodic error runs", 8: "no valid data of the periodic error",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """What ``f`` tells of one axis."""

    running: bool
    goto: bool
    backwards: bool
    fast: bool
    blocked: bool
    initialised: bool


def command(letter: str, axis: int, data: str = "") -> bytes:
    """``:<letter><1|2><data>`` and a carriage return; axes are counted from 0 here."""
    return f":{letter}{axis + 1}{data}\r".encode()


def low_first(value: int) -> str:
    """24 bits as six digits: 0x123456 is ``563412``."""
    value &= 0xFFFFFF
    return f"{value & 255:02X}{value >> 8 & 255:02X}{value >> 16:02X}"


def parse_number(reply: bytes) -> int:
    """The 24 bits of ``=563412`` and a carriage return."""
    digits = parse_data(reply)
    if not re.fullmatch(r"[0-9A-F]{6}", digits):
        raise ProtocolError(f"{reply!r} is no number of 24 bits.")
    return int(digits[4:6] + digits[2:4] + digits[0:2], 16)


def parse_data(reply: bytes) -> str:
    """What stands between ``=`` and the carriage return; ``!`` is refused by `ProtocolError`."""
    found = re.fullmatch(rb"=([0-9A-Fa-f]{0,8})\r", reply)
    if found is None:
        raise ProtocolError(f"{reply!r} is no answer of a motor board.")
    return found[1].decode().upper()


def parse_refusal(reply: bytes) -> str:
    """Why the board said ``!``, or nothing when it did not."""
    found = re.fullmatch(rb"!([0-9A-Fa-f]{1,2})\r", reply)
    if found is None:
        return ""
    return ERRORS.get(int(found[1], 16), f"error {found[1].decode()}")


def parse_position(reply: bytes) -> int:
    """Steps from the middle of the counter."""
    return parse_number(reply) - ZERO


def parse_status(reply: bytes) -> AxisStatus:
    """``=XYZ``: mode, direction and speed; running and blocked; initialised."""
    digits = parse_data(reply)
    if len(digits) != 3:
        raise ProtocolError(f"{reply!r} is no status of a motor.")
    mode, motion, ready = (int(digit, 16) for digit in digits)
    return AxisStatus(
        running=bool(motion & 1),
        goto=not mode & 1,
        backwards=bool(mode & 2),
        fast=bool(mode & 4),
        blocked=bool(motion & 2),
        initialised=bool(ready & 1),
    )


def motion_mode(goto: bool, fast: bool, backwards: bool) -> str:
    """The two digits of ``G``: 0 fast goto, 1 slow slew, 2 slow goto, 3 fast slew; then which way.

    ``backwards`` lets the encoder count down.
    """
    mode = (0 if fast else 2) if goto else (3 if fast else 1)
    return f"{mode}{int(backwards)}"


def step_period(rate_deg_s: float, steps_turn: int, timer_hz: int, ratio: int = 1) -> int:
    """Timer ticks a step at a rate; ``ratio`` is that of the fast mode, else 1."""
    steps_s = abs(rate_deg_s) / 360.0 * steps_turn / ratio
    if steps_s <= 0.0:
        return 0xFFFFFF
    return min(max(round(timer_hz / steps_s), 6), 0xFFFFFF)
