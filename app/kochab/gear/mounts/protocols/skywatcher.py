"""Sky-Watcher's motor board language: encoders and periods, and nothing about the sky.

Source: Sky-Watcher Motor Controller Command Set (2014). 24-bit numbers travel as six hexadecimal
digits, the low byte first.
"""

import re

from kochab.core.values import frozen
from kochab.gear.mounts.protocols import code_table, match, require
from kochab.gear.mounts.serial_line import Reader, SerialLink

ZERO = 0x800000
EQUATORIAL = code_table(
    "00 EQ6, 01 HEQ5, 02 EQ5, 03 EQ3, 04 EQ8, 05 AZ-EQ6, 06 AZ-EQ5, 0A Star Adventurer 2i, "
    "0C Star Adventurer GTi, 20 EQ8-R, 22 AZ-EQ6, 23 EQ6-R, 44 Wave 100i, 45 Wave 150i",
    base=16,
)
"""Mount code -> equatorial mount: INDI's skywatcher.cpp, and the newer boards of owners' logs."""
ALT_AZIMUTH = range(0x80, 0x91)  # GT, MF, 114GT, StarSeeker, Dobsonians
AZ_GTI = 0xA5  # alt-azimuth or, on a wedge, equatorial: the code does not show which
FOREIGN_LINES = 4  # echoes and chatter to skip before an answer
FEATURES, INDEX, RESET_INDEX = "010000", "000000", "080000"  # of ``q``, ``q`` and ``W`` (INDI's skywatcher.h)
HAS_INDEX = 0x000004  # the feature: a home sensor on the axis
BELOW, ABOVE = 0, 0xFFFFFF  # the index, while the axis has not come over it since it was reset
ERRORS = code_table(
    "0 an unknown command, 1 a command of the wrong length, 2 the motor is not stopped, "
    "3 an invalid character, 4 not initialised, 5 the driver sleeps, "
    "7 the training of the periodic error runs, 8 no valid data of the periodic error"
)


@frozen
class AxisStatus:
    """The reply to ``f`` for one axis."""

    running: bool
    goto: bool
    backwards: bool
    fast: bool
    blocked: bool
    initialised: bool


def reader(timeout_s: float) -> Reader:
    """Read the line of the answer: some cables echo the command first, and a Wi-Fi module may chatter between."""

    def read(link: SerialLink) -> bytes:
        for _ in range(FOREIGN_LINES):
            line = link.read_until(b"\r", 16, timeout_s)
            if line[:1] in (b"=", b"!"):
                break
        return line

    return read


def command(letter: str, axis: int, data: str = "") -> bytes:
    """``:<letter><1|2><data>`` and a carriage return; axes are counted from 0 here."""
    return f":{letter}{axis + 1}{data}\r".encode()


def low_first(value: int) -> str:
    """24 bits as six digits: 0x123456 is ``563412``."""
    return (value & 0xFFFFFF).to_bytes(3, "little").hex().upper()


def parse_number(reply: bytes) -> int:
    """The 24 bits of ``=563412`` and a carriage return."""
    digits = match(rb"=([0-9A-Fa-f]{6})\r", reply, "number of 24 bits")[1].decode()
    return int.from_bytes(bytes.fromhex(digits), "little")


def parse_data(reply: bytes) -> str:
    """The digits between ``=`` and the carriage return; `ProtocolError` for a refusal, ``!``."""
    return match(rb"=([0-9A-Fa-f]{0,8})\r", reply, "answer of a motor board")[1].decode().upper()


def parse_mount_code(version: str) -> int:
    """Which mount the board drives: the third byte of the reply to ``e``."""
    require(len(version) == 6, version.encode(), "version of a motor board")
    return int(version[4:6], 16)


def parse_refusal(reply: bytes) -> str:
    """Why the board refused with ``!``; empty when it did not."""
    found = re.fullmatch(rb"!([0-9A-Fa-f]{1,2})\r", reply)
    return ERRORS.get(int(found[1], 16), f"error {found[1].decode()}") if found else ""


def parse_features(reply: bytes) -> int:
    """The bits of ``q``; 0 of a board that does not know the question."""
    return 0 if parse_refusal(reply) else parse_number(reply)


def parse_position(reply: bytes) -> int:
    """Steps from the middle of the counter."""
    return parse_number(reply) - ZERO


def parse_status(reply: bytes) -> AxisStatus:
    """``=XYZ``: mode, direction and speed; running and blocked; initialised."""
    digits = match(rb"=([0-9A-Fa-f]{3})\r", reply, "status of a motor")[1].decode()
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


def step_period(rate_deg_s: float, steps_turn: int, timer_hz: int) -> int:
    """Timer ticks a step at a rate."""
    # The period is in ticks of the board's timer: one step each.
    steps_s = abs(rate_deg_s) / 360.0 * steps_turn
    if steps_s <= 0.0:
        return 0xFFFFFF
    return min(max(round(timer_hz / steps_s), 6), 0xFFFFFF)
