"""Celestron's NexStar hand control language, which SynScan shares.

Source: NexStar Communication Protocol 1.2 (2006); SynScan serial protocol 3.3. Every answer ends
in ``#``, but a data byte may be ``#`` as well: answers are read by their length.
"""

import re
from datetime import datetime

from app.core.hint import Site
from app.core.mount import PierSide
from app.mounts.beliefs import utc_of
from app.mounts.conversation import ProtocolError

TURN = 1 << 32
GET_PRECISE, GET_COARSE = b"e", b"E"
LEVEL_PRECISE, LEVEL_COARSE = b"z", b"Z"
VERSION, MODEL, ALIGNED, SLEWING = b"V", b"m", b"J", b"L"
TRACKING, CANCEL, PIER = b"t", b"M", b"p"
AZM, ALT = 16, 17  # the motor boards: RA or azimuth, Dec or altitude
POSITIVE, NEGATIVE = 36, 37  # move at a fixed rate, 0 to 9

MODELS = {
    1: "NexStar GPS", 3: "NexStar i-Series", 4: "NexStar i-Series SE", 5: "CGE",
    6: "Advanced GT", 7: "SLT", 9: "CPC", 10: "GT", 11: "NexStar 4/5 SE", 12: "NexStar 6/8 SE",
    13: "CGE Pro", 14: "CGEM DX", 15: "LCM", 16: "Sky Prodigy", 17: "CPC Deluxe", 18: "GT 16",
    19: "StarSeeker", 20: "AVX", 21: "Cosmos", 22: "Evolution", 23: "CGX", 24: "CGXL",
    25: "Astro Fi", 26: "SkyWatcher",
}  # fmt: skip


def angle_hex(angle_deg: float) -> str:
    """Eight digits of an angle, two's complement in 2^32 parts of a turn."""
    return f"{round(angle_deg / 360.0 * TURN) % TURN:08X}"


def goto(ra_deg: float, dec_deg: float) -> bytes:
    """``rXXXXXXXX,XXXXXXXX``."""
    return f"r{angle_hex(ra_deg)},{angle_hex(dec_deg)}".encode()


def goto_coarse(ra_deg: float, dec_deg: float) -> bytes:
    """``RXXXX,XXXX``, for versions before 1.6."""
    return f"R{angle_hex(ra_deg)[:4]},{angle_hex(dec_deg)[:4]}".encode()


def sync(ra_deg: float, dec_deg: float) -> bytes:
    """``sXXXXXXXX,XXXXXXXX``."""
    return f"s{angle_hex(ra_deg)},{angle_hex(dec_deg)}".encode()


def parse_position(reply: bytes) -> tuple[float, float]:
    """RA and Dec (azimuth and altitude), degrees, of ``34AB0500,12CE0500#`` or ``34AB,12CE#``."""
    found = re.fullmatch(
        rb"([0-9A-Fa-f]{8}|[0-9A-Fa-f]{4}),([0-9A-Fa-f]{4}|[0-9A-Fa-f]{8})#", reply
    )
    if found is None or len(found[1]) != len(found[2]):
        raise ProtocolError(f"{reply!r} is no position.")
    turn = 16 ** len(found[1])
    ra, dec = (int(part, 16) / turn * 360.0 for part in found.groups())
    dec = dec - 360.0 if dec >= 180.0 else dec
    if abs(dec) > 90.0:  # the far side of a declination axis
        dec = (180.0 - abs(dec)) * (1.0 if dec > 0 else -1.0)
        ra = (ra + 180.0) % 360.0
    return ra, dec


def parse_done(reply: bytes) -> None:
    """The bare ``#``."""
    if reply != b"#":
        raise ProtocolError(f"{reply!r} is not the # that was due.")


def parse_echo(reply: bytes, sent: bytes) -> None:
    """The answer to ``K`` and one byte."""
    if reply != sent + b"#":
        raise ProtocolError(f"{reply!r} is not the echo of {sent!r}.")


def parse_byte(reply: bytes) -> int:
    """One binary byte and ``#``."""
    if len(reply) != 2 or reply[1:] != b"#":
        raise ProtocolError(f"{reply!r} is not one byte and #.")
    return reply[0]


def parse_flag(reply: bytes) -> bool:
    """The binary 0 or 1 of ``J``."""
    value = parse_byte(reply)
    if value not in (0, 1):
        raise ProtocolError(f"{reply!r} is neither 0 nor 1.")
    return value == 1


def parse_digit(reply: bytes) -> bool:
    """The ASCII ``0`` or ``1`` of ``L``."""
    value = parse_byte(reply)
    if value not in (0x30, 0x31):
        raise ProtocolError(f"{reply!r} is neither 0 nor 1.")
    return value == 0x31


def parse_version(reply: bytes) -> tuple[int, ...]:
    """Two bytes and ``#``, or SynScan's six digits and ``#``: (4, 37, 7)."""
    if len(reply) == 3 and reply[2:] == b"#":
        return reply[0], reply[1]
    if re.fullmatch(rb"[0-9A-Fa-f]{6}#", reply):
        return tuple(int(reply[i : i + 2], 16) for i in (0, 2, 4))
    raise ProtocolError(f"{reply!r} is no version.")


def parse_pier(reply: bytes) -> PierSide:
    """``E#`` or ``W#``: the side the telescope is on."""
    sides = {b"E#": PierSide.EAST, b"W#": PierSide.WEST}
    if reply not in sides:
        raise ProtocolError(f"{reply!r} is no side of the pier.")
    return sides[reply]


def pass_through(board: int, command: int, *data: int, answer: int = 0) -> bytes:
    """``50 len board command d1 d2 d3 n``: eight bytes through the hand control to a motor."""
    padded = (*data, 0, 0, 0)[:3]
    return bytes([0x50, 1 + len(data), board, command, *padded, answer])


def move_fixed(board: int, positive: bool, rate: int) -> bytes:
    """Move at a rate from 0, which stops, to 9."""
    return pass_through(board, POSITIVE if positive else NEGATIVE, rate)


def parse_passed(reply: bytes, answer: int = 0) -> bytes:
    """The ``answer`` bytes of a pass-through; a failure has one 0 more before ``#``."""
    if len(reply) == answer + 2 and reply[-2:] == b"\x00#":
        raise ProtocolError("The hand control could not reach the motor board.")
    if len(reply) != answer + 1 or reply[-1:] != b"#":
        raise ProtocolError(f"{reply!r} is no answer of a motor board.")
    return reply[:-1]


SITE, TIME = b"w", b"h"
GUIDE = 0x26


def guide(board: int, percent: int, hundredths: int) -> bytes:
    """A pulse of so many hundredths of a second (1 to 255) at a signed percentage of sidereal."""
    return pass_through(board, GUIDE, percent % 256, hundredths)


def track(mode: int) -> bytes:
    """0 off, 1 altitude and azimuth, 2 equatorial north, 3 equatorial south."""
    return b"T" + bytes([mode])


def parse_south(reply: bytes) -> bool:
    """Whether the site the hand control knows is in the south."""
    return parse_site(reply).latitude_deg < 0.0


def parse_site(reply: bytes) -> Site:
    """The nine bytes of ``w``: degrees, minutes, seconds, 1 for south or west, of both angles."""
    if len(reply) != 9 or reply[8:] != b"#" or reply[3] > 1 or reply[7] > 1:
        raise ProtocolError(f"{reply!r} is no site.")
    latitude, longitude = (
        (d + m / 60.0 + s / 3600.0) * (-1.0 if minus else 1.0)
        for d, m, s, minus in (reply[:4], reply[4:8])
    )
    if abs(latitude) > 90.0 or abs(longitude) > 180.0 or max(reply[1:3] + reply[5:7]) > 59:
        raise ProtocolError(f"{reply!r} is no site.")
    return Site(latitude, longitude)


def parse_time(reply: bytes) -> tuple[datetime, float]:
    """Universal time and the hours of the zone from the nine bytes of ``h``."""
    if len(reply) != 9 or reply[8:] != b"#" or reply[7] > 1:
        raise ProtocolError(f"{reply!r} is no time.")
    hour, minute, second, month, day, year, zone, summer = reply[:8]
    offset = float((zone - 256 if zone > 127 else zone) + summer)
    if abs(offset) > 15.0:
        raise ProtocolError(f"{reply!r} is no time.")
    try:
        return utc_of(2000 + year, month, day, hour, minute, second, offset), offset
    except ValueError:
        raise ProtocolError(f"{reply!r} is no time.") from None
