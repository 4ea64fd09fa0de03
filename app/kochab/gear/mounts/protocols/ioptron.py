"""iOptron's RS-232 command language, version 3 (2016 and later mounts)."""

from datetime import UTC, datetime, timedelta

from kochab.core.attitude import wrapped
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, MountState, PierSide, TrackingRate
from kochab.core.values import frozen
from kochab.gear.mounts.protocols import code_table, match, require

J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
TIME, ALTAZ, PARK_PLACE = b":GUT#", b":GAC#", b":GPC#"
MOUNT_INFO, POSITION, STATUS = b":MountInfo#", b":GEP#", b":GLS#"
SYNC, SLEW = b":CM#", b":MS1#"
TRACK_ON = b":ST1#"
COMMANDS = {
    Ability.TRACKING: b":ST0#",
    Ability.SIDEREAL: b":RT0#",
    Ability.LUNAR: b":RT1#",
    Ability.SOLAR: b":RT2#",
    Ability.KING: b":RT3#",
    Ability.PARK: b":MP1#",
    Ability.UNPARK: b":MP0#",
    Ability.HOME: b":MH#",
}
RATES = (TrackingRate.SIDEREAL, TrackingRate.LUNAR, TrackingRate.SOLAR, TrackingRate.KING, None)  # 4: a custom rate
HALT_DEC, HALT_RA = b":qD#", b":qR#"
# :Q# ends a slew, not a move, which may be from before the line broke: no timer knows of it.
STOPS = b":Q#", HALT_RA, HALT_DEC
PARTS_DEG = 360000.0  # 0.01 arcsec

MODELS = code_table(
    "0010 SkyHunter EQ or Cube II, 0011 SkyHunter AA or SmartEQ Pro+, 0012 HAE16 EQ, 0013 HAE16 AA, 0014 HAE18 EQ, "
    "0015 HEM15, 0022 HAE18 AA, 0025 HEM27 or CEM25, 0026 CEM26 or CEM25-EC, 0027 CEM26-EC, 0028 GEM28, 0029 GEM28-EC, "
    "0030 HEM27-EC or iEQ30 Pro, 0031 HAE29 EQ, 0032 HAE29-EC EQ, 0033 HAE29 AA, 0034 HAE29-EC AA, 0035 HAZ31, "
    "0036 HAE29C EQ, 0037 HAE29C-EC EQ, 0038 HAE29C AA, 0039 HAE29C-EC AA, 0040 CEM40, 0041 CEM40-EC, 0043 GEM45, "
    "0044 GEM45-EC, 0045 HEM44-EC or iEQ45 Pro EQ, 0046 HEM44A or iEQ45 Pro AA, 0047 HEM44A-EC, 0048 HAE43 EQ, "
    "0049 HAE43-EC EQ, 0050 HAE43 AA, 0051 HAE43-EC AA, 0052 HAZ46, 0053 HAE43C EQ, 0054 HAE43C-EC EQ, 0055 HAE43C AA, "
    "0056 HAE43C-EC AA, 0060 CEM60, 0061 CEM60-EC, 0062 HAE69 EQ, 0063 HAE69-EC EQ, 0064 HAE69 AA, 0065 HAE69-EC AA, "
    "0066 HAE69C EQ, 0067 HAE69C-EC EQ, 0068 HAE69C AA, 0069 HAE69C-EC AA, 0070 CEM70, 0071 CEM70-EC, 0072 CEM70-EC2, "
    "0073 HAZ71, 0120 CEM120, 0121 CEM120-EC, 0122 CEM120-EC2, 5010 Cube II AA, 5035 AZ Mount Pro, 5045 iEQ45 Pro AA"
)
"""Some numbers were given again to newer mounts; AA and HAZ are alt-azimuth. Source: INDI's ioptronv3driver.cpp."""
ALT_AZIMUTH = ("AA", "HAZ", "AZ Mount")


def is_alt_azimuth(model: str) -> bool | None:
    """Whether a model is alt-azimuth; None when its number is unknown or shared by two mounts."""
    return None if " or " in model or model.startswith("model") else any(word in model for word in ALT_AZIMUTH)


@frozen
class PositionReply:
    """Reply to ``:GEP#``: degrees of date, and the side of the pier when it is sure."""

    ra_deg: float
    dec_deg: float
    pier_side: PierSide | None


def set_ra(ra_deg: float) -> bytes:
    """``:SRA%09d#`` in 0.01 arcsec."""
    return b":SRA%09d#" % (round(ra_deg % 360.0 * PARTS_DEG) % 129600000)  # 359.9999999 rounds to a full turn


def set_dec(dec_deg: float) -> bytes:
    """``:Sds%08d#`` in 0.01 arcsec."""
    parts = round(dec_deg * PARTS_DEG)
    return b":Sd%s%08d#" % (b"-" if parts < 0 else b"+", abs(parts))


def parse_model(reply: bytes) -> str:
    """The maker's name of a mount, from four digits without ``#``."""
    code = match(rb"\d{4}", reply, "model of iOptron's")[0].decode()
    return MODELS.get(int(code), f"model {code}")


def parse_position(reply: bytes) -> PositionReply:
    """``sDDDDDDDDRRRRRRRRRpc#``: Dec, RA, pier side (0 east, 1 west, 2 unsure), counterweight."""
    found = match(rb"([+-]\d{8})(\d{9})([012])[01]#", reply, "position")
    dec, ra = int(found[1]) / PARTS_DEG, int(found[2]) / PARTS_DEG
    require(abs(dec) <= 90.0 and ra <= 360.0, reply, "position on the sky")
    return PositionReply(ra % 360.0, dec, {b"0": PierSide.EAST, b"1": PierSide.WEST}.get(found[3]))


def parse_altaz(reply: bytes) -> tuple[float, float]:
    """Altitude and azimuth, degrees, of ``sAAAAAAAAZZZZZZZZZ#`` in 0.01 arcsec."""
    found = match(rb"([+-]\d{8})(\d{9})#", reply, "altitude and azimuth")
    altitude, azimuth = (int(part) / PARTS_DEG for part in found.groups())
    require(abs(altitude) <= 90.0 and azimuth <= 360.0, reply, "altitude and azimuth")
    return altitude, azimuth


def parse_park_altitude(reply: bytes) -> float:
    """Altitude of the park position, degrees: ``AAAAAAAAZZZZZZZZZ#``, which has no sign."""
    return parse_altaz(b"+" + reply)[0]


def parse_status(reply: bytes) -> MountState:
    """``:GLS#``: sign, longitude 8, latitude 8, then six digits; the second is the status, the third the rate."""
    # The 17th digit is the GPS's. A CEM25P sends only 19 characters, which don't match.
    found = match(rb"[+-]\d{17}([0-7])([0-4])\d{3}#", reply, "status")
    status = int(found[1])
    return MountState(
        slewing=status in (2, 4),  # 4: a meridian flip
        parked=status == 6,
        tracking=status in (1, 3, 5),  # PEC off, guiding, PEC on
        at_home=status == 7,
        rate=RATES[int(found[2])],
    )


def parse_site(reply: bytes) -> Site:
    """The site at the beginning of ``:GLS#``; its latitude is 90 deg too great."""
    parse_status(reply)
    latitude = int(reply[9:17]) / PARTS_DEG - 90.0
    longitude = int(reply[:9]) / PARTS_DEG
    require(abs(latitude) <= 90.0 and abs(longitude) <= 360.0, reply, "site")
    return Site(latitude, wrapped(longitude))


def parse_time(reply: bytes) -> tuple[datetime, float]:
    """``:GUT#``: minutes of the zone, summer time, milliseconds of UTC since J2000 (JD 2451545)."""
    found = match(rb"([+-]\d{3})([01])(\d{13})#", reply, "time")
    require(abs(int(found[1])) <= 840, reply, "time")
    time_utc = J2000 + timedelta(milliseconds=int(found[3]))  # 13 digits reach the year 2316
    return time_utc, int(found[1]) / 60.0 + int(found[2])


def set_clock(now: datetime) -> tuple[bytes, bytes, bytes]:
    """``:SGsMMM#``, ``:SDS0#`` and ``:SUT%013d#``: minutes of the zone, summer time in them, and :func:`parse_time`."""
    # utcoffset() already includes summer time.
    minutes = round((now.utcoffset() or timedelta()) / timedelta(minutes=1))
    return b":SG%+04d#" % minutes, b":SDS0#", b":SUT%013d#" % round((now - J2000) / timedelta(milliseconds=1))


def set_site(site: Site) -> tuple[bytes, bytes]:
    """``:SLAsTTTTTTTT#`` and ``:SLOsTTTTTTTT#`` in 0.01 arcsec, north and east positive."""
    return b":SLA%+09d#" % round(site.latitude_deg * PARTS_DEG), b":SLO%+09d#" % round(site.longitude_deg * PARTS_DEG)


def move_rate(step: int) -> bytes:
    """Rate 1 to 9 for the four arrows."""
    return b":SR%d#" % min(max(step, 1), 9)


def move(direction: Direction) -> bytes:
    """Move until stopped: the letters name keys of the hand control, ``w`` to greater RA."""
    return {"north": b":mn#", "south": b":ms#", "east": b":mw#", "west": b":me#"}[direction.value]


def pulse(direction: Direction, milliseconds: int) -> bytes:
    """``:ZS00500#``: S and Q are RA plus and minus, E and C Dec plus and minus."""
    # Always five digits: an older iOptron ran a pulse of four for many times as long.
    letter = {"north": b"E", "south": b"C", "east": b"S", "west": b"Q"}[direction.value]
    return b":Z%s%05d#" % (letter, min(max(milliseconds, 0), 99999))
