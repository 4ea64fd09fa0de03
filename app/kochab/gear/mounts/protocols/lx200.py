"""Meade's LX200 language and its dialects.

Source: Meade Telescope Serial Command Protocol (2010); those of the dialects are named in their table.
"""

import re
from collections.abc import Mapping
from datetime import datetime, timedelta
from functools import reduce
from operator import xor

from kochab.core.attitude import wrapped
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, MountState, PierSide, TrackingRate
from kochab.gear.mounts.protocols import code_table, match, require

ALIGNMENT = b"\x06"
GET_RA, GET_DEC, PRODUCT, VERSION = b":GR#", b":GD#", b":GVP#", b":GVN#"
GET_TARGET_RA, GET_TARGET_DEC = b":Gr#", b":Gd#"
SLEW, SYNC, BARS, STATUS = b":MS#", b":CM#", b":D#", b":GU#"
STOP, TOGGLE_PRECISION = b":Q#", b":U#"

# -- To track, park and go home. ``:hF#`` aligns a Meade anew, and resets an OnStep as if it stood at home: never sent.

# Never :AP# or :AA#: an aligned alt-azimuth Autostar switched to polar by :AP# fails every later goto.
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
ZWO_COMMANDS = {
    Ability.TRACKING: b":Td#",
    Ability.SIDEREAL: b":TQ#:Te#",
    Ability.LUNAR: b":TL#:Te#",
    Ability.SOLAR: b":TS#:Te#",
    Ability.HOME: b":hC#",
}
GTO_COMMANDS = {
    Ability.TRACKING: b":RT9#",
    Ability.SIDEREAL: b":RT2#",
    Ability.LUNAR: b":RT0#",
    Ability.SOLAR: b":RT1#",
    Ability.PARK: b":KA#",
    Ability.UNPARK: b":PO#",
}
RAINBOW_COMMANDS = {
    Ability.TRACKING: b":CtL#",
    Ability.SIDEREAL: b":CtR#:CtA#",
    Ability.LUNAR: b":CtM#:CtA#",
    Ability.SOLAR: b":CtS#:CtA#",
}


def native(number: int) -> bytes:
    """A setting of Gemini's own language: the checksum is the exclusive or of all before it."""
    text = b">%d:" % number
    return text + bytes([reduce(xor, text) % 128 + 64]) + b"#"


GEMINI_COMMANDS = {
    Ability.TRACKING: native(191),
    Ability.SIDEREAL: native(131) + native(192),
    Ability.KING: native(132) + native(192),
    Ability.LUNAR: native(133) + native(192),
    Ability.SOLAR: native(134) + native(192),
    Ability.PARK: b":hP#",
    Ability.UNPARK: b":hW#",
}

# Low precision has tenths of a minute, high has seconds, and OnStepX up to four decimals of them.
_RA = rb"\s*(\d{1,2}):(\d{2})(?:\.(\d)|:(\d{2})(?:[.,](\d{1,4}))?)#"
# The separator may be *, : or ', or a degree sign: 0xDF on an LX200GPS, 0xB0 in Latin-1.
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
TEENASTRO_REFUSALS = REFUSALS | code_table(
    "2 no target, 4 the mount is parked, 5 a goto is under way, 6 outside the mount's limits, 7 it is guiding, "
    "8 above the overhead limit, 9 a fault of its motors"
)
FAULTS = code_table(
    "1 a fault of its motors, 2 the horizon limit, 3 a limit switch, 4 the limit of declination, 5 the limit of "
    "azimuth, 6 the limit below the pole, 7 the meridian limit, 8 a sync too far away, 9 its park failed"
)
"""Why an OnStep or a TeenAstro stopped, by the last digit of its status."""
NOT_TAKEN = ("match fail", "no object")  # 10micron, Gemini


def set_ra(ra_deg: float, space: bool = False, decimals: int = 0) -> bytes:
    """``:SrHH:MM:SS#``, ``:SrHH:MM:SS.SSSS#``: to the nearest second of time, or part of it."""
    # Round once, before splitting, so that no field becomes 60 and the hour never 24.
    ticks = round(ra_deg % 360.0 * 240.0 * 10**decimals) % (86400 * 10**decimals)
    return f":Sr{' ' * space}{_sixtieths(ticks, decimals, ':')}#".encode()


def set_dec(dec_deg: float, space: bool = False, decimals: int = 0) -> bytes:
    """``:SdsDD*MM:SS#``, to the nearest arcsecond, or part of it."""
    ticks = round(abs(dec_deg) * 3600.0 * 10**decimals)
    sign = "-" if dec_deg < 0 and ticks else "+"  # no -00*00:00
    return f":Sd{' ' * space}{sign}{_sixtieths(ticks, decimals, '*')}#".encode()


def _sixtieths(ticks: int, decimals: int, mark: str) -> str:
    """Seconds, in parts of ``decimals`` digits, as ``12:34:56.78``."""
    seconds, part = divmod(ticks, 10**decimals)
    text = f"{seconds // 3600:02d}{mark}{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return f"{text}.{part:0{decimals}d}" if decimals else text


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


def parse_echoed(reply: bytes) -> bool:
    """Whether an answer to ``:GD#`` begins with its question, as a Rainbow's does."""
    parse_dec(reply.removeprefix(b":GD"))
    return reply.startswith(b":GD")


def _fraction(digits: bytes | None) -> float:
    return int(digits) / 10.0 ** len(digits) if digits else 0.0


def parse_coarse(reply: bytes) -> bool:
    """Whether a right ascension is in low precision, ``HH:MM.T#``."""
    parse_ra(reply)
    return match(_RA, reply, "right ascension")[3] is not None


def parse_aligned(reply: bytes) -> MountState:
    """The letter after ``0x06``: L is a mount that is not aligned."""
    return MountState(aligned=match(rb"[APLDG]", reply, "alignment of a Meade mount")[0] != b"L")


def parse_text(reply: bytes) -> str:
    """Printable text up to ``#``."""
    return match(rb"([ -~]*)#", reply, "text")[1].decode("ascii").strip()


def version_of(text: str) -> tuple[int, ...]:
    """The numbers of ``10.24i`` or ``1.32.1``; none where there is none."""
    return tuple(int(part) for part in re.findall(r"\d+", text))


def parse_slewing(reply: bytes) -> bool:
    """Bars of ``:D#``: anything but blanks before ``#`` means that it slews."""
    # printable text other than | belongs to another command
    bars = match(rb"([^!-{}~]{0,39})#", reply, "distance bar")[1]
    return any(byte not in (0x00, 0x20) for byte in bars)


def parse_bars(reply: bytes) -> MountState:
    """What the bars of ``:D#`` say."""
    return MountState(slewing=parse_slewing(reply))


def parse_slew(reply: bytes, refusals: Mapping[int, str] = REFUSALS) -> str:
    """Empty when ``:MS#`` was accepted, else why not: ``1text#``, ``2text#``, a digit or ``e7#``."""
    if reply in (b"0", b"0#"):
        return ""
    found = match(rb"([1-9])([ -~]*?)#?|e(\d{1,2})#", reply, "answer to a slew")
    code = int(found[1] or found[3])
    return (found[2] or b"").decode("ascii").strip() or refusals.get(code, f"code {code}")


def parse_set(reply: bytes) -> bool:
    """Whether a target was taken: ``1``, or else ``0`` or ZWO's ``e2#``."""
    return match(rb"[01]|e\d{1,2}#", reply, "0 or 1")[0] == b"1"


def parse_sync(reply: bytes, refusals: Mapping[int, str] = REFUSALS) -> str:
    """Empty when ``:CM#`` was accepted, else why not."""
    text = parse_text(reply)
    if text.lower().startswith(NOT_TAKEN):
        return text.partition(":")[2].strip() or text
    # Any other text means yes: a Meade names an object, an OnStepX says N/A.
    found = re.fullmatch("[eE]([0-9]{1,2})", text)
    return refusals.get(int(found[1]), f"code {int(found[1])}") if found else ""


def parse_flags(reply: bytes) -> MountState:
    """OnStep's ``:GU#``: n not tracking, N no goto, P parked, I parking, H at home, h on the way, T and W the side.

    On its way to park or home it may say that there is no goto; g without G is a move, with it a pulse (OnStepX,
    Status.command.cpp). Of its rates all but the sidereal one have a letter.
    """
    flags = parse_text(reply)
    require(re.fullmatch(r"[A-Za-z0-9/*+()&@^~\-_.'!<>:;,=?\"%$| ]+", flags) is not None, reply, "status")
    # E is a German mount, not a side.
    side = {"T": PierSide.EAST, "W": PierSide.WEST}
    rates = {"(": TrackingRate.LUNAR, "O": TrackingRate.SOLAR, "k": TrackingRate.KING}
    return MountState(
        slewing="N" not in flags or "I" in flags or "h" in flags or ("g" in flags and "G" not in flags),
        parked="P" in flags,
        tracking="n" not in flags,
        pier_side=next((side[f] for f in flags if f in side), None),
        at_home="H" in flags and "h" not in flags,
        rate=next((rates[f] for f in flags if f in rates), TrackingRate.SIDEREAL),
        # Of the three digits at the end the last is the fault; the other two are guide rates.
        fault=FAULTS.get(int(flags[-1]), "") if flags[-1].isdigit() else None,
    )


def parse_date_missing(reply: bytes) -> str:
    """OnStep's ``:GX89#``: 0 when it knows its date, as a restarted one does not that has no battery."""
    return "" if reply.startswith(b"0") else "no date"


SIDES = {b"E": PierSide.EAST, b"W": PierSide.WEST}
GTO_RATES = {b"0": TrackingRate.LUNAR, b"1": TrackingRate.SOLAR, b"2": TrackingRate.SIDEREAL}


def parse_side(reply: bytes) -> MountState:
    """``E#``, ``West#``; ``N#`` where it has none."""
    return MountState(pier_side=SIDES.get(match(rb"(?i:(E|W)(?:ast|est)?|N)#", reply, "side of the pier")[1]))


def parse_zwo_status(reply: bytes) -> MountState:
    """``NGM011000211#``: n not tracking, H at home, Z alt-azimuth; the last digit 2 goto, 3 move, 4 home, 5 park."""
    # Neither pier side nor parked is in it; :Gm# asks for the side.
    flags, state = match(rb"([A-Za-z]*)\d*(\d)#", reply, "status").groups()
    return MountState(
        slewing=state in b"2345", tracking=b"n" not in flags, at_home=b"H" in flags, alt_azimuth=b"Z" in flags
    )


def parse_gto(reply: bytes) -> MountState:
    """``:GOS#``: P parked, the rate (9 none), that of Dec, S slewing; then the moves, and a fault at the eleventh."""
    parked, rate, slewing = match(rb"([P01])([0-9A-Za-z]).([S0])[ -~]{6,12}#", reply, "status").groups()
    return MountState(slewing=slewing == b"S", parked=parked == b"P", tracking=rate != b"9", rate=GTO_RATES.get(rate))


def parse_gemini(reply: bytes) -> MountState:
    """``:Gv#``: N no movement, T tracking, G guiding, C centering, S slewing, ! stalled."""
    letter = match(rb"[NTGCS!]", reply, "state of a Gemini")[0]
    if letter == b"N":  # standing or parked: the next question tells which
        return MountState(slewing=False, tracking=False)
    fault = "its motors have stalled" if letter == b"!" else ""
    return MountState(slewing=letter in b"CS", parked=False, tracking=letter in b"TG", fault=fault)


def parse_gemini_parked(reply: bytes) -> MountState:
    """``:h?#``: 1 parked, and also later while it moves; 2 on its way."""
    digit = match(rb"[012]", reply, "state of a Gemini's park")[0]
    return MountState(slewing=digit == b"2", parked=digit == b"1")


def parse_teenastro(reply: bytes) -> MountState:
    """``:GXI#``: 0 idle, 1 tracking, 2 and 3 slewing; third P parked, I parking; then H home; the side; a fault."""
    found = match(rb"([0-3])[ -~]([ -~])([ -~])[ -~]{9}([EW ])[ -~]([0-9])[ -~]*#", reply, "status")
    motion, park, home, side, fault = found.groups()
    return MountState(
        slewing=motion in b"23" or park == b"I",
        parked=park == b"P",
        tracking=motion == b"1",
        pier_side=SIDES.get(side),
        at_home=home == b"H",
        fault=FAULTS.get(int(fault), ""),
    )


def parse_rainbow(reply: bytes) -> MountState:
    """``:CL1#`` while it slews."""
    return MountState(slewing=match(rb"([01])#", reply, "state of a slew")[1] == b"1")


def parse_rainbow_tracking(reply: bytes) -> MountState:
    """``:AT1#`` while it tracks."""
    return MountState(tracking=match(rb"([01])#", reply, "state of the tracking")[1] == b"1")


def move(direction: Direction) -> bytes:
    """``:Mn#`` and its like."""
    return f":M{direction.value[0]}#".encode()


def halt(direction: Direction) -> bytes:
    """``:Qn#`` and its like."""
    return f":Q{direction.value[0]}#".encode()


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
    # A Meade reports 0 to 360 west, an OnStep -180 to 180.
    angle = parse_angle(reply)
    require(abs(angle) <= 360.0, reply, "longitude")
    return wrapped(-angle)


def parse_azimuth(reply: bytes) -> float:
    """Degrees of ``DDD*MM#`` or ``DDD*MM'SS#``."""
    angle = parse_angle(reply)
    require(0.0 <= angle <= 360.0, reply, "azimuth")
    return angle


def parse_zone(reply: bytes) -> float:
    """Hours, east positive, of ``sHH#``, ``sHH.H#`` or ``sHH:MM:SS.S#``, which the mount adds to get UTC."""
    pattern = rb"\s*([+-]?)(\d{1,2})(?:\.(\d)|:([0-5]\d)(?:[:.]\d+)*)?#"
    sign, hours, tenths, minutes = match(pattern, reply, "time zone").groups()
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
    """Year, month and day of ``MM/DD/YY#``, ``MM:DD:YY#`` or ``YYYY-MM-DD#``."""
    # The last form is a 10micron's in ultra precision.
    found = match(rb"(\d{2})[/:](\d{2})[/:](\d{2})(?:\.\d+)?#|20(\d{2})-(\d{2})-(\d{2})#", reply, "date")
    month, day, year = (int(part) for part in (found.group(1, 2, 3) if found[1] else found.group(5, 6, 4)))
    require(1 <= month <= 12 and 1 <= day <= 31, reply, "date")
    return 2000 + year, month, day


def set_clock(now: datetime) -> tuple[bytes, bytes, bytes]:
    """``:SGsHH#``, ``:SLHH:MM:SS#`` and ``:SCMM/DD/YY#`` of a local time in a zone of whole hours."""
    west = -round((now.utcoffset() or timedelta()) / timedelta(hours=1))
    return f":SG{west:+03d}#".encode(), f":SL{now:%H:%M:%S}#".encode(), f":SC{now:%m/%d/%y}#".encode()


def set_site(site: Site) -> tuple[bytes, bytes]:
    """``:StsDD*MM#`` and ``:SgDDD*MM#``, to the nearest arcminute."""
    # Arcminutes; 21600 are a full turn, which rounding may reach.
    north, west = round(site.latitude_deg * 60.0), round(-site.longitude_deg % 360.0 * 60.0) % 21600
    latitude = f"{'-' if north < 0 else '+'}{abs(north) // 60:02d}*{abs(north) % 60:02d}"
    return f":St{latitude}#".encode(), f":Sg{west // 60:03d}*{west % 60:02d}#".encode()
