"""Meade's LX200 language and its dialects (classic, Autostar, OnStep, 10micron).

Source: Meade Telescope Serial Command Protocol (2010), OnStepX's command list, 10micron's command
protocol 2.x.
"""

import re

from app.core.mount import Direction, MountState, PierSide
from app.mounts.conversation import ProtocolError

ALIGNMENT = b"\x06"
GET_RA, GET_DEC, PRODUCT = b":GR#", b":GD#", b":GVP#"
SLEW, SYNC, BARS, STATUS = b":MS#", b":CM#", b":D#", b":GU#"
STOP, TOGGLE_PRECISION = b":Q#", b":U#"

RATES = {b":RG#": "guide", b":RC#": "centre", b":RM#": "find", b":RS#": "slew"}

_RA = re.compile(rb"\s*(\d{1,2}):(\d{2})(?:\.(\d)|:(\d{2})(?:[.,](\d{1,4}))?)#")
_DEC = re.compile(rb"\s*([+-]?)(\d{1,2})[*:'\xdf\xb0](\d{2})(?:[:'](\d{2})(?:[.,](\d{1,3}))?'?)?#")


def set_ra(ra_deg: float, space: bool = False) -> bytes:
    """``:SrHH:MM:SS#``, to the nearest second of time."""
    seconds = round(ra_deg % 360.0 * 240.0) % 86400
    text = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return f":Sr{' ' * space}{text}#".encode()


def set_dec(dec_deg: float, space: bool = False) -> bytes:
    """``:SdsDD*MM:SS#``, to the nearest arcsecond."""
    seconds = round(abs(dec_deg) * 3600.0)
    sign = "-" if dec_deg < 0 and seconds else "+"
    text = f"{sign}{seconds // 3600:02d}*{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return f":Sd{' ' * space}{text}#".encode()


def parse_ra(reply: bytes) -> float:
    """Degrees of ``HH:MM.T#``, ``HH:MM:SS#`` or ``HH:MM:SS.SS#``."""
    found = _RA.fullmatch(reply)
    if found is None:
        raise ProtocolError(f"{reply!r} is no right ascension.")
    hours, minutes, tenth, seconds, parts = found.groups()
    total = int(minutes) * 60.0 + int(hours) * 3600.0
    total += int(tenth) * 6.0 if tenth else int(seconds) + _fraction(parts)
    if int(hours) > 23 or int(minutes) > 59 or int(seconds or 0) > 59:
        raise ProtocolError(f"{reply!r} is no right ascension.")
    return total / 240.0


def parse_dec(reply: bytes) -> float:
    """Degrees of ``sDD*MM#``, ``sDD*MM:SS#`` or ``sDD*MM:SS.S#``, whatever the separators."""
    found = _DEC.fullmatch(reply)
    if found is None:
        raise ProtocolError(f"{reply!r} is no declination.")
    sign, degrees, minutes, seconds, parts = found.groups()
    total = int(degrees) * 3600.0 + int(minutes) * 60.0 + int(seconds or 0) + _fraction(parts)
    if total > 324000.0 or int(minutes) > 59 or int(seconds or 0) > 59:
        raise ProtocolError(f"{reply!r} is no declination.")
    return (-total if sign == b"-" else total) / 3600.0


def _fraction(digits: bytes | None) -> float:
    return int(digits) / 10.0 ** len(digits) if digits else 0.0


def is_coarse(ra_reply: bytes) -> bool:
    """Whether the mount is in low precision, ``HH:MM.T#``."""
    return re.fullmatch(rb"\s*\d{1,2}:\d{2}\.\d#", ra_reply) is not None


def parse_accepted(reply: bytes) -> bool:
    """The bare ``1`` or ``0`` after a ``:S`` command."""
    if reply not in (b"0", b"1"):
        raise ProtocolError(f"{reply!r} is neither 0 nor 1.")
    return reply == b"1"


def parse_alignment(reply: bytes) -> str:
    """The letter after ``0x06``."""
    if reply not in (b"A", b"P", b"L", b"D", b"G"):
        raise ProtocolError(f"{reply!r} is no alignment of a Meade mount.")
    return reply.decode()


def parse_text(reply: bytes) -> str:
    """Printable text up to ``#``."""
    text = reply.removesuffix(b"#")
    if not reply.endswith(b"#") or any(not 32 <= byte < 127 for byte in text):
        raise ProtocolError(f"{reply!r} is no text.")
    return text.decode("ascii").strip()


def parse_slewing(reply: bytes) -> bool:
    """Bars of ``:D#``: anything but blanks before ``#`` means that it slews."""
    if not reply.endswith(b"#") or len(reply) > 40:
        raise ProtocolError(f"{reply!r} is no distance bar.")
    bars = reply[:-1]
    if any(32 < byte < 127 and byte != 0x7C for byte in bars):  # text belongs to another command
        raise ProtocolError(f"{reply!r} is no distance bar.")
    return any(byte not in (0x00, 0x20) for byte in bars)


def parse_slew(reply: bytes) -> str:
    """Nothing when ``:MS#`` was accepted, else why not: ``1text#``, ``2text#`` or a digit."""
    if reply[:1] == b"0" and reply in (b"0", b"0#"):
        return ""
    code, text = reply[:1], reply[1:].removesuffix(b"#")
    if not code.isdigit() or code == b"0" or any(not 32 <= byte < 127 for byte in text):
        raise ProtocolError(f"{reply!r} is no answer to a slew.")
    said = text.decode("ascii").strip()
    return said or REFUSALS.get(int(code), f"code {int(code)}")


REFUSALS = {
    1: "below the horizon",
    2: "above the overhead limit",
    3: "the mount is in standby",
    4: "the mount is parked",
    5: "a goto is under way",
    6: "outside the mount's limits",
    7: "a fault of the hardware",
    8: "already in motion",
}
"""OnStepX's codes; the first two are Meade's as well."""

SYNC_ERRORS = {
    b"E1": "below the horizon",
    b"E2": "above the overhead limit",
    b"E3": "the mount is in standby",
    b"E4": "the mount is parked",
    b"E5": "a goto is under way",
    b"E6": "outside the mount's limits",
    b"E7": "a fault of the hardware",
    b"E8": "in motion",
    b"E9": "unspecified",
}


def parse_sync(reply: bytes) -> str:
    """Nothing when ``:CM#`` was accepted, else why not."""
    text = parse_text(reply)
    if text.lower().startswith("match fail"):  # 10micron
        return text.partition(":")[2].strip() or text
    return SYNC_ERRORS.get(text.encode(), "")


def parse_flags(reply: bytes) -> MountState:
    """OnStep's ``:GU#``: n not tracking, N no goto, P parked, T and W the pier side."""
    flags = parse_text(reply)
    if not flags or not re.fullmatch(r"[A-Za-z0-9/*+()&@^~\-_.'!<>:;,=?\"%$| ]+", flags):
        raise ProtocolError(f"{reply!r} is no status.")
    side = {"T": PierSide.EAST, "W": PierSide.WEST}
    return MountState(
        slewing="N" not in flags,
        parked="P" in flags,
        tracking="n" not in flags,
        pier_side=next((side[f] for f in flags if f in side), None),
    )


def move(direction: Direction) -> bytes:
    """``:Mn#`` and its like."""
    return f":M{direction.value[0]}#".encode()


def halt(direction: Direction) -> bytes:
    """``:Qn#`` and its like."""
    return f":Q{direction.value[0]}#".encode()


def pulse(direction: Direction, milliseconds: int) -> bytes:
    """``:MgnDDDD#``; four digits are all there is."""
    return f":Mg{direction.value[0]}{min(max(milliseconds, 0), 9999):04d}#".encode()


def parse_scope_status(reply: bytes) -> tuple[bool, bool]:
    """Tracking and aligned from Autostar's ``:GW#``: mounting, T or N, stars aligned on."""
    found = re.fullmatch(rb"[AGPL]([TN])([0-3HP])#", reply)
    if found is None:
        raise ProtocolError(f"{reply!r} is no status.")
    return found[1] == b"T", found[2] != b"0"
