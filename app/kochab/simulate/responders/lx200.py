"""LX200 mounts: Meade's classic, OnStep and OnStepX."""

import re

from kochab.core.mount import SIDEREAL_DEG_S, Direction, PierSide, TrackingRate
from kochab.simulate.mechanics.mount import EquatorialMount
from kochab.simulate.responders import HOME_DEG, Controller, LocalSettings, horizontal_deg

# -- Angles as old hand controllers write them, and as they read them --------------------------

_NUMBERS = re.compile(rb"\s*([+-]?)(\d{1,3})(?:[^0-9.+-](\d{1,2})(?:\.(\d)|[^0-9.+-](\d{1,2}(?:\.\d*)?))?)?")


def hours(ra_deg: float, precise: bool, decimals: int = 0) -> bytes:
    """``HH:MM:SS`` or, not precise, ``HH:MM.T``."""
    if not precise:
        # rounded first, then taken apart: never 60 seconds, and 24 h is 0 h
        tenths = round(ra_deg % 360.0 * 40.0) % 14400
        return b"%02d:%02d.%d" % (tenths // 600, tenths // 10 % 60, tenths % 10)
    unit = 10**decimals
    ticks = round(ra_deg % 360.0 * 240.0 * unit) % (86400 * unit)
    return b"%02d:%02d:" % (ticks // unit // 3600, ticks // unit // 60 % 60) + _seconds(ticks, decimals)


def degrees(
    angle_deg: float, precise: bool, mark: bytes = b"*", width: int = 2, signed: bool = True, decimals: int = 0
) -> bytes:
    """``sDD*MM:SS`` or, not precise, ``sDD*MM``; ``mark`` stands after the degrees.

    Parameters
    ----------
    angle_deg : float
        The angle.
    precise : bool
        Whether seconds follow.
    mark : bytes
        Stands after the degrees.
    width : int
        Digits of the degrees.
    signed : bool
        Whether a sign comes first.
    decimals : int
        Of the seconds.
    """
    unit = 10**decimals if precise else 1
    ticks = round(abs(angle_deg) * (3600 * unit if precise else 60))
    minutes = ticks // unit // 60 if precise else ticks
    # no minus before an angle that rounds to zero
    sign = (b"-" if angle_deg < 0 and ticks else b"+") if signed else b""
    text = sign + b"%0*d" % (width, minutes // 60) + mark + b"%02d" % (minutes % 60)
    return text + b":" + _seconds(ticks, decimals) if precise else text


def _seconds(ticks: int, decimals: int) -> bytes:
    seconds, part = divmod(ticks, 10**decimals)
    return b"%02d" % (seconds % 60) + (b".%0*d" % (decimals, part) if decimals else b"")


def parse(text: bytes, most: float) -> float:
    """``sDD*MM``, ``sDD*MM:SS``, ``HH:MM.T`` ... as a number of the first unit.

    ValueError where it is none, its size is beyond ``most`` or a part is 60 or more.
    """
    found = _NUMBERS.fullmatch(text.rstrip())
    if found is None:
        raise ValueError("no number")
    sign, whole, minutes, tenths, seconds = found.groups()
    m = float(minutes or 0) + (float(tenths) / 10.0 if tenths else 0.0)
    s = float(seconds or 0)
    value = float(whole) + m / 60.0 + s / 3600.0
    if m >= 60 or s >= 60 or value > most:
        raise ValueError("too large")
    return -value if sign == b"-" else value


TIME = re.compile(rb"(?P<hour>\d\d?):(?P<minute>\d\d?):(?P<second>\d\d?)")
DATE = re.compile(rb"(?P<month>\d\d?)/(?P<day>\d\d?)/(?P<year>\d\d?)")
DATE_TEXT = b"1Updating Planetary Data#" + b" " * 30 + b"#"
DIRECTIONS = {b"n": Direction.NORTH, b"s": Direction.SOUTH, b"e": Direction.EAST, b"w": Direction.WEST}


class Lx200Responder(Controller):
    """The classic: imprecise when switched on, silent to guide pulses and to product names.

    What a Meade does not know it does not answer, and ``:CM#`` has no word for a refusal.
    Longitudes and the hours of the zone grow westward.
    """

    # 0x06, the question for the alignment, is the one command without colon and #
    command = re.compile(rb"\x06|:+([^#]*)#")
    begins = b"\x06:"
    wrong = b"0"
    # the degree sign of the hand controller's display, which classic Meades send
    mark = b"\xdf"
    decimals = 0
    precise = False
    rates_deg_s = {b"G": 2 * SIDEREAL_DEG_S, b"C": 32 * SIDEREAL_DEG_S, b"M": 2.0, b"S": 6.0}  # noqa: RUF012

    def __init__(self, telescope: EquatorialMount) -> None:
        super().__init__(telescope)
        self.rate_deg_s = self.rates_deg_s[b"S"]
        self.target_deg = [0.0, 0.0]
        self.settings = settings = LocalSettings(telescope)
        self.words = {
            b"\x06": self.alignment,
            b"GR": lambda: self.written_ra(telescope.believed_deg()[0]),
            b"GD": lambda: self.written_dec(telescope.believed_deg()[1]),
            b"D": self.distance_bars,
            b"GA": lambda: self.level()[0],
            b"GZ": lambda: self.level()[1],
            b"Gr": lambda: self.written_ra(self.target_deg[0]),
            b"Gd": lambda: self.written_dec(self.target_deg[1]),
            b"MS": self.slew,
            b"CM": self.sync,
            b"U": self.toggle_precision,
            b"Q": telescope.stop,
            b"GT": lambda: b"60.1#",
            b"G([MNOP])": lambda site: b"SITE %d#" % (b"MNOP".index(site) + 1),
            b"Gt": lambda: degrees(settings.latitude_deg, False, self.mark) + b"#",
            b"Gg": lambda: degrees(-settings.longitude_deg % 360.0, False, self.mark, width=3, signed=False) + b"#",
            b"GG": self.zone,
            b"GL": lambda: settings.local().strftime("%H:%M:%S#").encode(),
            b"GC": lambda: settings.local().strftime("%m/%d/%y#").encode(),
            b"GS": lambda: hours(telescope.sidereal_deg(), True, self.decimals) + b"#",
            b"Gc": lambda: b"24#",
            b"Sr(.*)": self.set_ra,
            b"Sd(.*)": self.set_dec,
            b"St(.*)": self.set_latitude,
            b"Sg(.*)": self.set_longitude,
            b"SG(.*)": self.set_zone,
            b"SL(.*)": lambda text: self.set_clock(TIME, text, b"1"),
            b"SC(.*)": lambda text: self.set_clock(DATE, text, DATE_TEXT),
            b"M([nsew])": self.move,
            b"Q([nsew])": self.halt,
            b"R(.*)": self.set_rate,
        }

    def alignment(self) -> bytes:
        """``P`` aligned on an equatorial wedge, ``L`` not aligned: a land scope. No #."""
        return b"P" if self.telescope.aligned else b"L"

    def written_ra(self, ra_deg: float) -> bytes:
        """With its #."""
        return hours(ra_deg, self.precise, self.decimals) + b"#"

    def written_dec(self, dec_deg: float) -> bytes:
        """With its #."""
        return degrees(dec_deg, self.precise, self.mark) + b"#"

    def level(self) -> tuple[bytes, bytes]:
        """Altitude, and azimuth from north."""
        altitude, azimuth = horizontal_deg(self.telescope, self.settings.latitude_deg)
        return (self.written_dec(altitude), degrees(azimuth, self.precise, self.mark, width=3, signed=False) + b"#")

    def distance_bars(self) -> bytes:
        """The two rows of the hand controller's display: 32 places, full while it slews."""
        return (b"\x7f" if self.telescope.slewing else b" ") * 32 + b"#"

    def zone(self) -> bytes:
        """``sHH#``, or ``sHH.H#`` where it is no whole hour."""
        west = -self.settings.utc_offset_h
        return b"%+03d#" % west if west == int(west) else b"%+05.1f#" % west

    def set_ra(self, text: bytes) -> bytes:
        """Hours, of the target."""
        if (hour := parse(text, 24.0)) < 0:
            return self.wrong
        self.target_deg[0] = hour * 15.0 % 360.0
        return b"1"

    def set_dec(self, text: bytes) -> bytes:
        """Of the target."""
        self.target_deg[1] = parse(text, 90.0)
        return b"1"

    def set_latitude(self, text: bytes) -> bytes:
        """North positive."""
        self.settings.latitude_deg = parse(text, 90.0)
        return b"1"

    def set_longitude(self, text: bytes) -> bytes:
        """West positive."""
        self.settings.longitude_deg = (180.0 - parse(text, 360.0)) % 360.0 - 180.0
        return b"1"

    def set_zone(self, text: bytes) -> bytes:
        """Hours west of Greenwich."""
        west = float(text) if b":" not in text else parse(text, 14.0)
        if not abs(west) <= 14.0:
            return self.wrong
        self.settings.utc_offset_h = -west
        return b"1"

    def set_clock(self, pattern: re.Pattern[bytes], text: bytes, taken: bytes) -> bytes:
        """Set the date or the time of day; the answer is ``taken`` where it is one."""
        if (found := pattern.fullmatch(text.strip())) is None:
            return self.wrong
        parts = {name: int(digits) for name, digits in found.groupdict().items()}
        if "year" in parts:
            parts["year"] += 2000
        self.settings.set_local(**parts)
        return taken

    def slew(self) -> bytes:
        """``0``, or the reason: 1 is the horizon, 2 any other, its text ended by #."""
        reason = self._goto(*self.target_deg)
        if reason is None:
            return b"0"
        code, text = (b"1", "object below horizon") if "horizon" in reason else (b"2", reason)
        return code + text.capitalize().encode("ascii", "replace") + b".#"

    def sync(self) -> bytes:
        """The same words whether it did or not."""
        self._sync(*self.target_deg)
        return b"Coordinates     matched.        #"

    def toggle_precision(self) -> None:
        """Long and short in turns; nothing tells which, but the next position."""
        self.precise = not self.precise

    def move(self, text: bytes) -> None:
        """``:Mn#``: nothing is answered."""
        self.telescope.move(DIRECTIONS[text], self.rate_deg_s)

    def halt(self, text: bytes) -> None:
        """``:Qn#``."""
        self.telescope.halt(DIRECTIONS[text])

    def set_rate(self, text: bytes) -> None:
        """``:RG#`` ``:RC#`` ``:RM#`` ``:RS#``."""
        self.rate_deg_s = self.rates_deg_s.get(text, self.rate_deg_s)


# -- OnStep and OnStepX: the LX200 language with digits for reasons and flags for the state ----

RATES = tuple(k * SIDEREAL_DEG_S for k in (0.25, 0.5, 1, 2, 4, 8, 20, 48, 240, 480))
UNSPECIFIED = 9
RATES_BY_LETTER = {
    b"Q": TrackingRate.SIDEREAL,
    b"L": TrackingRate.LUNAR,
    b"S": TrackingRate.SOLAR,
    b"K": TrackingRate.KING,
}
REASONS = {"below horizon": 1, "overhead": 2, "parked": 4, "in goto": 5, "limits": 6, "moving": 8}


class OnStepResponder(Lx200Responder):
    """Precise from the start, with guide pulses; an unknown command is answered by a bare ``0``."""

    unknown = b"0"
    precise = True
    mark = b"*"
    rates_deg_s = {b"G": RATES[2], b"C": RATES[5], b"M": RATES[6], b"F": RATES[7], b"S": RATES[8]} | {
        b"%d" % k: rate for k, rate in enumerate(RATES)
    }

    def __init__(self, telescope: EquatorialMount) -> None:
        super().__init__(telescope)
        self.tracking_rate, self.parking = TrackingRate.SIDEREAL, False

        def fine(angle_deg: float) -> bytes:
            return degrees(angle_deg, True, decimals=3) + b"#"

        self.words |= {
            b"GVP": lambda: b"On-Step#",
            b"GVN": lambda: b"10.24i#",
            b"GVD": lambda: b"Jan 01 2025#",
            b"GVT": lambda: b"00:00:00#",
            b"GU": self.flags,
            b"Gm": self.side,
            b"GE": lambda: b"00#",
            b"GR[aH]": lambda: hours(telescope.believed_deg()[0], True, 4) + b"#",
            b"GD[eH]": lambda: fine(telescope.believed_deg()[1]),
            b"GT": lambda: b"%.5f#" % (telescope.tracking_deg_s * 14400.0) if telescope.tracking else b"0#",
            b"GtH": lambda: fine(self.settings.latitude_deg),
            b"GX98": lambda: b"N#",
            b"%B[DR]": lambda: b"0#",
            b"Gh": lambda: b"-10*#",
            b"Go": lambda: b"85*#",
            rb"Mg([nsew])(\d{1,5})": self.pulse,
            b"CS": self.silent_sync,
            b"hR": self.unpark,
            b"hP": self.park,
            b"Te": lambda: self.track(True),
            b"Td": lambda: self.track(False),
            b"T([QSLK])": self.set_tracking_rate,
            b"hC": self.go_home,
        }

    def distance_bars(self) -> bytes:
        """One bar while it slews."""
        return b"\x7f#" if self.telescope.slewing else b"#"

    def pulse(self, direction: bytes, milliseconds: bytes) -> None:
        """``:Mgn0500#``: nothing is answered."""
        self.telescope.pulse(DIRECTIONS[direction], float(milliseconds))

    def slew(self) -> bytes:
        """One digit, without text and without #."""
        return b"%d" % self._code(self._goto(*self.target_deg))

    def sync(self) -> bytes:
        """``N/A#`` when done, ``E1#`` to ``E9#`` when not."""
        code = self._code(self._sync(*self.target_deg))
        return b"E%d#" % code if code else b"N/A#"

    def silent_sync(self) -> None:
        """``:CS#`` fails without a word."""
        self._sync(*self.target_deg)

    def _goto(self, ra_deg: float, dec_deg: float) -> str | None:
        return "in goto" if self.telescope.slewing else super()._goto(ra_deg, dec_deg)

    def _code(self, reason: str | None) -> int:
        return 0 if reason is None else REASONS.get(reason, UNSPECIFIED)

    def flags(self) -> bytes:
        """``:GU#``: what is not so has a letter too."""
        t = self.telescope
        out = (b"" if t.tracking else b"n") + (b"" if t.slewing else b"N")
        # parking ends when the motion does, by arrival or by a stop
        self.parking &= t.slewing
        out += (b"I" if self.parking else b"P" if t.parked else b"p") + b"E"
        out += b"H" if not t.tracking and max(map(abs, t.from_home_deg())) < HOME_DEG else b""
        out += {TrackingRate.LUNAR: b"(", TrackingRate.SOLAR: b"O", TrackingRate.KING: b"k"}.get(
            self.tracking_rate, b""
        )
        return out + (b"T" if t.pier_side is PierSide.EAST else b"W") + b"120#"

    def side(self) -> bytes:
        """``E#`` or ``W#``."""
        return b"E#" if self.telescope.pier_side is PierSide.EAST else b"W#"

    def track(self, on: bool) -> bytes:
        """``1``, or ``0`` when parked."""
        if self.telescope.parked:
            return b"0"
        self.telescope.tracking_deg_s = self.tracking_rate.deg_s if on else 0.0
        return b"1"

    def set_tracking_rate(self, letter: bytes) -> None:
        """``:TQ#`` ``:TL#`` ``:TS#`` ``:TK#``: nothing is answered."""
        self.tracking_rate = RATES_BY_LETTER[letter]
        self.track(self.telescope.tracking)

    def go_home(self) -> None:
        """``:hC#``: nothing is answered."""
        self.telescope.go_home()

    def park(self) -> bytes:
        """``1``: it begins."""
        self.telescope.stop()
        self.telescope.parked = self.parking = True
        return b"1"

    def unpark(self) -> bytes:
        """``1``."""
        self.telescope.parked = False
        self.telescope.tracking = True
        return b"1"
