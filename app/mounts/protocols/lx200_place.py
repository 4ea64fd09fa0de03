"""Place and time in the LX200 language: longitudes and hours of the zone grow westward."""

import re

from app.mounts.conversation import ProtocolError

LATITUDE, LONGITUDE, ZONE = b":Gt#", b":Gg#", b":GG#"
TIME, DATE = b":GL#", b":GC#"
ALTITUDE, AZIMUTH = b":GA#", b":GZ#"
_ANGLE = re.compile(rb"\s*([+-]?)(\d{1,3})[*:\xdf\xb0](\d{2})(?:[:'](\d{2})(?:\.\d+)?)?#")


def parse_latitude(reply: bytes) -> float:
    """Degrees of ``sDD*MM#``, of an altitude too."""
    angle = _angle(reply)
    if abs(angle) > 90.0:
        raise ProtocolError(f"{reply!r} is no latitude.")
    return angle


def parse_longitude(reply: bytes) -> float:
    """Degrees, east positive, of ``DDD*MM#``."""
    angle = _angle(reply)
    if abs(angle) > 360.0:
        raise ProtocolError(f"{reply!r} is no longitude.")
    return (180.0 - angle) % 360.0 - 180.0


def parse_azimuth(reply: bytes) -> float:
    """Degrees of ``DDD*MM#`` or ``DDD*MM'SS#``."""
    angle = _angle(reply)
    if not 0.0 <= angle <= 360.0:
        raise ProtocolError(f"{reply!r} is no azimuth.")
    return angle


def parse_zone(reply: bytes) -> float:
    """Hours, east positive, of ``sHH#``, ``sHH.H#`` or ``sHH:MM#``, what is added to get UTC."""
    found = re.fullmatch(rb"\s*([+-]?)(\d{1,2})(?:\.(\d)|:(\d{2}))?#", reply)
    if found is None or int(found[2]) > 14 or int(found[4] or 0) > 59:
        raise ProtocolError(f"{reply!r} is no time zone.")
    hours = int(found[2]) + int(found[3] or 0) / 10.0 + int(found[4] or 0) / 60.0
    return hours if found[1] == b"-" else -hours


def parse_time(reply: bytes) -> tuple[int, int, int]:
    """Hour, minute and second of ``HH:MM:SS#``."""
    hour, minute, second = _three(reply, b":")
    if hour > 23 or minute > 59 or second > 59:
        raise ProtocolError(f"{reply!r} is no time.")
    return hour, minute, second


def parse_date(reply: bytes) -> tuple[int, int, int]:
    """Year, month and day of ``MM/DD/YY#``."""
    month, day, year = _three(reply, b"/")
    if not 1 <= month <= 12 or not 1 <= day <= 31:
        raise ProtocolError(f"{reply!r} is no date.")
    return 2000 + year, month, day


def _angle(reply: bytes) -> float:
    found = _ANGLE.fullmatch(reply)
    if found is None or int(found[3]) > 59 or int(found[4] or 0) > 59:
        raise ProtocolError(f"{reply!r} is no angle.")
    angle = int(found[2]) + int(found[3]) / 60.0 + int(found[4] or 0) / 3600.0
    return -angle if found[1] == b"-" else angle


def _three(reply: bytes, mark: bytes) -> tuple[int, int, int]:
    found = re.fullmatch(rb"(\d{2})%b(\d{2})%b(\d{2})(?:\.\d+)?#" % (mark, mark), reply)
    if found is None:
        raise ProtocolError(f"{reply!r} is neither a time nor a date.")
    return int(found[1]), int(found[2]), int(found[3])
