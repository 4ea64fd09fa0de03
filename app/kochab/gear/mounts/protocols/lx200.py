"""Meade's LX200 language and its dialects (classic, Autostar, OnStep, 10micron).

Source: Meade Telescope Serial Command Protocol (2010), OnStepX's command list, 10micron's command protocol 2.x.
"""

import re
from datetime import datetime, timedelta

from kochab.core.attitude import wrapped
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, MountState, PierSide, TrackingRate
from kochab.gear.mounts.protocols import code_table, match, require

ALIGNMENT = b"\x06"
GET_RA, GET_DEC, PRODUCT = b":GR#", b":GD#", b":GVP#"
GET_TARGET_RA, GET_TARGET_DEC = b":Gr#", b":Gd#"
SLEW, SYNC, BARS, STATUS = b":MS#", b":CM#", b":D#", b":GU#"
STOP, TOGGLE_PRECISION = b":Q#", b":U#"

# -- To track, park and go home. ``:hF#`` aligns a Meade anew, and resets an OnStep as if it stood at home: never sent.

AUTOSTAR_COMMANDS = {Ability.SIDEREAL: b":TQ#", Ability.LUNAR: b":TL#", Ability.SOLAR: b":TS#", Ability.PARK: b":hP#"}
TEN_MICRON_COMMANDS = {
    Ability.TRACKING: b":AL#",
    Ability.SIDEREAL: b":TQ#:AP#",
    Ability.LUNAR: b":TL#:AP#",
    Ability.SOLAR: b":TSOLAR#:AP#",
    Ability.PARK: b":KA#",
    Ability.UNPARK: b":PO#",
}
ON_STEP_COMMANDS = {
    Ability.TRACKING: b":Td#",
    Ability.SIDEREAL: b":TQ#:Te#",
    Ability.LUNAR: b":TL#:Te#",
    Ability.SOLAR: b":TS#:Te#",
    Ability.KING: b":TK#:Te#",
    Ability.PARK: b":hP#",
    Ability.UNPARK: b":hR#",
    Ability.HOME: b":hC#",
}

_RA = rb"\s*(\d{1,2}):(\d{2})(?:\.(\d)|:(\d{2})(?:[.,](\d{1,4}))?)#"
_ANGLE = rb"\s*([+-]?)(\d{1,3})[*:'\xdf\xb0](\d{2})(?:[:'](\d{2})(?:[.,](\d{1,3}))?'?)?#"
REFUSALS = code_table(
    "1 below the horizon, 2 above the overhead limit, 3 the mount is in standby, "
    "4 the mount is parked or the target out of its reach, 5 a goto is under way or the mount is not aligned, "
    "6 outside the mount's limits or its site is not set, 7 a fault of the hardware, 8 already in motion, 9 unspecified"
)
"""OnStepX's codes, ``En`` after a sync, and OnStep's where they differ; the first two are Meade's as well."""
ZWO_REFUSALS = code_table(
    "1 out of range, 2 a wrong format, 3 a goto or homing is under way, 4 already in motion, 5 below the horizon, "
    "6 below the altitude limit, 7 its time or site is not set, 8 past the meridian, 9 across the meridian, "
    "10 the altitude is inverted, 11 so near the pole, 12 too far from where it points, 13 above the altitude limit"
)
"""``en`` of the AM3, AM5 and AM7, after a slew, a sync or a setting."""
NOT_TAKEN = ("match fail", "no object")  # 10micron, Gemini


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
    hours, minutes, tenth, seconds, parts = match(_RA, reply, "right ascension").groups()
    require(int(hours) <= 23 and int(minutes) <= 59 and int(seconds or 0) <= 59, reply, "right ascension")
    total = int(minutes) * 60.0 + int(hours) * 3600.0
    total += int(tenth) * 6.0 if tenth else int(seconds) + _fraction(parts)
    return total / 240.0


def parse_angle(reply: bytes) -> float:
    """Degrees of ``sDD*MM#``, ``sDD*MM:SS#`` or ``sDD*MM:SS.S#``, whatever the separators."""
    sign, degrees, minutes, seconds, parts = match(_ANGLE, reply, "angle").groups()
    require(int(minutes) <= 59 and int(seconds or 0) <= 59, reply, "angle")
    total = int(degrees) * 3600.0 + int(minutes) * 60.0 + int(seconds or 0) + _fraction(parts)
    return (-total if sign == b"-" else total) / 3600.0


def parse_dec(reply: bytes) -> float:
    """Degrees of a declination, latitude or altitude; see :func:`parse_angle`."""
    angle = parse_angle(reply)
    require(abs(angle) <= 90.0, reply, "declination, latitude or altitude")
    return angle


def _fraction(digits: bytes | None) -> float:
    return int(digits) / 10.0 ** len(digits) if digits else 0.0


def parse_coarse(reply: bytes) -> bool:
    """Whether a right ascension is in low precision, ``HH:MM.T#``."""
    parse_ra(reply)
    return match(_RA, reply, "right ascension")[3] is not None


def parse_alignment(reply: bytes) -> str:
    """The letter after ``0x06``."""
    return match(rb"[APLDG]", reply, "alignment of a Meade mount")[0].decode()


def parse_text(reply: bytes) -> str:
    """Printable text up to ``#``."""
    return match(rb"([ -~]*)#", reply, "text")[1].decode("ascii").strip()


def parse_slewing(reply: bytes) -> bool:
    """Bars of ``:D#``: anything but blanks before ``#`` means that it slews."""
    # printable text other than | belongs to another command
    bars = match(rb"([^!-{}~]{0,39})#", reply, "distance bar")[1]
    return any(byte not in (0x00, 0x20) for byte in bars)


def parse_slew(reply: bytes) -> str:
    """Empty when ``:MS#`` was accepted, else why not: ``1text#``, ``2text#`` or a digit."""
    if reply in (b"0", b"0#"):
        return ""
    if reply[:1] == b"e":
        return parse_zwo(reply)
    found = match(rb"([1-9])([ -~]*?)#?", reply, "answer to a slew")
    return found[2].decode("ascii").strip() or REFUSALS.get(int(found[1]), f"code {int(found[1])}")


def parse_sync(reply: bytes) -> str:
    """Empty when ``:CM#`` was accepted, else why not."""
    text = parse_text(reply)
    if text.lower().startswith(NOT_TAKEN):
        return text.partition(":")[2].strip() or text
    if re.fullmatch("e[0-9]+", text):
        return parse_zwo(reply)
    return REFUSALS[int(text[1])] if re.fullmatch("E[1-9]", text) else ""


def parse_zwo(reply: bytes) -> str:
    """Why a mount by ZWO refused, ``e7#``."""
    code = int(match(rb"e(\d{1,2})#", reply, "refusal")[1])
    return ZWO_REFUSALS.get(code, f"code {code}")


def parse_flags(reply: bytes) -> MountState:
    """OnStep's ``:GU#``: n not tracking, N no goto, P parked, I parking, H at home, h on the way, T and W the side.

    On its way to park or home it may say that there is no goto. Of its rates all but the sidereal one have a letter.
    """
    flags = parse_text(reply)
    require(re.fullmatch(r"[A-Za-z0-9/*+()&@^~\-_.'!<>:;,=?\"%$| ]+", flags) is not None, reply, "status")
    side = {"T": PierSide.EAST, "W": PierSide.WEST}
    rates = {"(": TrackingRate.LUNAR, "O": TrackingRate.SOLAR, "k": TrackingRate.KING}
    return MountState(
        slewing="N" not in flags or "I" in flags or "h" in flags,
        parked="P" in flags,
        tracking="n" not in flags,
        pier_side=next((side[f] for f in flags if f in side), None),
        at_home="H" in flags and "h" not in flags,
        rate=next((rates[f] for f in flags if f in rates), TrackingRate.SIDEREAL),
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


def parse_scope_status(reply: bytes) -> MountState:
    """Tracking and aligned from Autostar's ``:GW#``: mounting, T or N, stars aligned on."""
    found = match(rb"([AGPL])([TN])([0-3HP])#", reply, "status")
    altaz = None if found[1] == b"L" else found[1] == b"A"
    return MountState(tracking=found[2] == b"T", aligned=found[3] != b"0", alt_azimuth=altaz)


def parse_10micron(reply: bytes) -> MountState:
    """``:Gstat#``: 0 and 10 tracking, 2 parking, 3 unparking, 4 homing, 5 parked, 6 slewing, 7 not tracking."""
    code = int(match(rb"(\d{1,2})#", reply, "status")[1])
    return MountState(slewing=code in (2, 3, 4, 6), parked=code == 5, tracking=code in (0, 10))


# -- Site and time: longitudes and hours of the zone grow westward ------------------------------

LATITUDE, LONGITUDE, ZONE = b":Gt#", b":Gg#", b":GG#"
TIME, DATE = b":GL#", b":GC#"
ALTITUDE, AZIMUTH = b":GA#", b":GZ#"


def parse_longitude(reply: bytes) -> float:
    """Degrees, east positive, of ``DDD*MM#``."""
    angle = parse_angle(reply)
    require(abs(angle) <= 360.0, reply, "longitude")
    return wrapped(-angle)


def parse_azimuth(reply: bytes) -> float:
    """Degrees of ``DDD*MM#`` or ``DDD*MM'SS#``."""
    angle = parse_angle(reply)
    require(0.0 <= angle <= 360.0, reply, "azimuth")
    return angle


def parse_zone(reply: bytes) -> float:
    """Hours, east positive, of ``sHH#``, ``sHH.H#`` or ``sHH:MM#``, which the mount adds to get UTC."""
    sign, hours, tenths, minutes = match(rb"\s*([+-]?)(\d{1,2})(?:\.(\d)|:([0-5]\d))?#", reply, "time zone").groups()
    require(int(hours) <= 14, reply, "time zone")
    total = int(hours) + int(tenths or 0) / 10.0 + int(minutes or 0) / 60.0
    return total if sign == b"-" else -total


def parse_time(reply: bytes) -> tuple[int, int, int]:
    """Hour, minute and second of ``HH:MM:SS#``."""
    found = match(rb"(\d{2}):(\d{2}):(\d{2})(?:\.\d+)?#", reply, "time")
    hour, minute, second = (int(part) for part in found.groups())
    require(hour <= 23 and minute <= 59 and second <= 59, reply, "time")
    return hour, minute, second


def parse_date(reply: bytes) -> tuple[int, int, int]:
    """Year, month and day of ``MM/DD/YY#``."""
    found = match(rb"(\d{2})/(\d{2})/(\d{2})(?:\.\d+)?#", reply, "date")
    month, day, year = (int(part) for part in found.groups())
    require(1 <= month <= 12 and 1 <= day <= 31, reply, "date")
    return 2000 + year, month, day


def set_clock(now: datetime) -> tuple[bytes, bytes, bytes]:
    """``:SGsHH#``, ``:SLHH:MM:SS#`` and ``:SCMM/DD/YY#`` of a local time in a zone of whole hours."""
    west = -round((now.utcoffset() or timedelta()) / timedelta(hours=1))
    return f":SG{west:+03d}#".encode(), f":SL{now:%H:%M:%S}#".encode(), f":SC{now:%m/%d/%y}#".encode()


def set_site(site: Site) -> tuple[bytes, bytes]:
    """``:StsDD*MM#`` and ``:SgDDD*MM#``, to the nearest arcminute."""
    north, west = round(site.latitude_deg * 60.0), round(-site.longitude_deg % 360.0 * 60.0) % 21600
    latitude = f"{'-' if north < 0 else '+'}{abs(north) // 60:02d}*{abs(north) % 60:02d}"
    return f":St{latitude}#".encode(), f":Sg{west // 60:03d}*{west % 60:02d}#".encode()
