"""Angles in the NexStar language: a turn is 2^16 or 2^32, in capital hexadecimal digits."""

import re

_HEX = re.compile(rb"[0-9A-Fa-f]+")


def written_angle(angle_deg: float, digits: int) -> bytes:
    """Four digits, or eight of which the last two are zero as on the real ones."""
    if digits == 4:
        return b"%04X" % (round(angle_deg / 360.0 * 65536.0) % 65536)
    return b"%06X00" % (round(angle_deg / 360.0 * 16777216.0) % 16777216)


def written_pair(first_deg: float, second_deg: float, digits: int) -> bytes:
    """Two angles with a comma between, and the #."""
    return written_angle(first_deg, digits) + b"," + written_angle(second_deg, digits) + b"#"


def read_pair(text: bytes, digits: int) -> tuple[float, float] | None:
    """Two angles in degrees, the first in [0, 360), the second a declination; or None."""
    first, second = text[:digits], text[digits + 1 :]
    if not (_HEX.fullmatch(first) and _HEX.fullmatch(second) and text[digits : digits + 1] == b","):
        return None
    turn = 16.0**digits
    around, dec = int(first, 16) / turn * 360.0, int(second, 16) / turn * 360.0
    dec = (dec + 180.0) % 360.0 - 180.0
    return (around, dec) if abs(dec) <= 90.0 else None
