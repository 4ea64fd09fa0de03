"""An Avalon StarGO: INDI's lx200stargo.cpp, and INDIGO's table of LX200 dialects, whose replies were recorded.

It has neither clock nor calendar: it counts the sidereal time that it was given. It answers in its own time, among
reports of its motors that nobody asked for (``:Z1mts#``, and ``ge#`` at the end of a goto).
"""

from types import MappingProxyType

from .lx200 import Lx200Board
from .mechanics import HOME_DEG
from .sky import SIDEREAL_DEG_S, half_turn, sidereal_deg

STOPPED, TRACKING, FAST = 0, 1, 5  # of `:X34#`
BUTTON_RATES = {"G": 0.5, "C": 8.0, "M": 70.0}  # of `:RG#` to `:RM#`, in sidereal; `:RS#` is the fastest
FACTORS = {"Q": 1.0, "S": 60.0 / 60.16427, "L": 57.9 / 60.16427}  # of `:TQ#`, `:TS#`, `:TL#`
MODES = {"L": 1, "S": 2, "Q": 3}


class StarGo(Lx200Board):
    """An M-Uno on its controller; its sidereal time is told by whoever connects, and kept by nobody without power."""

    boot_s = 3.0

    def __init__(self, **settings):
        super().__init__(**settings)
        self.select, self.rate_kind = "S", "Q"
        self.park_at = HOME_DEG
        self.lst_error_deg = 0.0
        self.aligned = True  # what ":X39#" tells nothing without
        self.guide_percent = [50, 50]
        self._moves = None

    def wake(self, was):
        super().wake(was)
        self.aligned, self._moves = self.claims_home, None
        self.rate_kind, self.rate_deg_s, self.select = "Q", SIDEREAL_DEG_S, "S"
        self.lst_error_deg = -sidereal_deg(self.tube.now, self.site_deg[1])  # it begins at 0 h

    def align(self, *place, **how):
        self.lst_error_deg, self.aligned = 0.0, True
        return super().align(*place, **how)

    def sidereal_deg(self):
        return (sidereal_deg(self.tube.now, self.site_deg[1]) + self.lst_error_deg) % 360.0

    # -- what it says by itself ----------------------------------------------------------------------

    def _motor(self, axis):
        runs = self.tube.axes[axis].runs
        return FAST if runs else TRACKING if axis == 0 and self.tracking else STOPPED

    def advance(self):
        super().advance()
        moves = self._motion()
        if self._moves is not None and moves != self._moves:
            self._answers.append((self.clock.unix(), moves))
        self._moves = moves

    def arrived(self, what):
        super().arrived(what)
        if what == "goto":
            self._answers.append((self.clock.unix(), b"ge#"))

    def _motion(self):
        motors = 2 * (self._motor(0) != STOPPED) + (self._motor(1) != STOPPED)
        speed = "GCMS".index(self.select)
        return f":Z1{motors}{MODES[self.rate_kind] if self.tracking else 0}{speed}#".encode()

    # -- questions -----------------------------------------------------------------------------------

    def mount_type(self, _):
        return b"PT0#"

    def product(self, _):
        return b"Avalon#"

    def firmware(self, _):
        return b"56.6#"

    def firmware_date(self, _):
        return b"d01102017#"

    def place(self, _):
        ra, dec = self.believed_deg()
        return f"RD{round(ra / 15.0 * 1e6) % 24000000:08d}{round(dec * 1e5):+08d}#".encode()

    def motors(self, _):
        return f"m{self._motor(0)}{self._motor(1)}#".encode()

    def motion(self, _):
        return self._motion()

    def rest(self, _):
        state = {"home": "A", "park": "B"}.get(self.going, "2" if self.parked else "1" if self.at_home else "0")
        return f"p{state}#".encode()

    def looks(self, _):
        """Which side of the meridian it looks to."""
        return b"PX#" if not self.aligned else b"PE#" if self.beyond() else b"PW#"

    def flag(self, text):
        return f"v{text[:1]}{int(text[:1] == 'h')}#".encode()

    def top_speeds(self, _):
        return b"09a09#"

    def guide_rates(self, _):
        return f"{self.guide_percent[0]:02d}b{self.guide_percent[1]:02d}#".encode()

    def correction(self, _):
        return b"or+000#"

    def latitude(self, _):
        return f"{self.sexagesimal(self.site_deg[0], sign=True, marks='t:')}#".encode()

    def longitude(self, _):
        """East is positive here."""
        return f"{self.sexagesimal(self.site_deg[1], 3, sign=True, marks='g:')}#".encode()

    # -- orders --------------------------------------------------------------------------------------

    def set_latitude(self, text):
        return super().set_latitude(text) + b"#"

    def set_longitude(self, text):
        value = self.number(text)
        if value is None:
            return b"0#"
        self.site_deg = (self.site_deg[0], half_turn(value))
        return b"1#"

    def set_sidereal(self, text):
        hours = int(text[:2]) + int(text[2:4]) / 60.0 + int(text[4:6]) / 3600.0
        self.lst_error_deg = 15.0 * hours - sidereal_deg(self.tube.now, self.site_deg[1])
        return b""

    def home_here(self, text):
        if len(text) == 6:
            self.set_sidereal(text)
        self.set_counters(HOME_DEG)
        self.at_home = self.aligned = True
        return b"p1#"

    def slew(self, _):
        if self.parked or self.going in ("home", "park"):
            return b"1"
        self.aligned = True
        self.goto()
        return b"0"

    def match(self, _):
        if self.parked or self.going:
            return b"0#"
        self.sync()
        self.aligned = True
        return b"M31 EX GAL MAG 3.5 SZ178.0'#"

    def home(self, _):
        self.parked = False
        self.go_home()
        return b"pA#"

    def park(self, _):
        self.go_park(self.park_at)
        return b"pB#"

    def unpark(self, _):
        self.parked = False
        self.track(True)
        return b"p0#"

    def park_here(self, _):
        self.park_at = tuple(self.believed_axes_deg())
        return b""

    def tracking_on(self, _):
        if not self.parked:
            self.track(True)
        return b""

    def tracking_off(self, _):
        self.track(False)
        return b""

    def kind_of_tracking(self, text):
        self.rate_kind = text[:1]
        self.rate_deg_s = FACTORS[self.rate_kind] * SIDEREAL_DEG_S
        if self.tracking:
            self.track(True)
        return b""

    def sidereal_rate(self, _):
        return self.kind_of_tracking("Q")

    def solar_rate(self, _):
        return self.kind_of_tracking("S")

    def lunar_rate(self, _):
        return self.kind_of_tracking("L")

    def select_rate(self, text):
        self.select = text[:1]
        return b""

    def key(self, text):
        if self.parked or self.going:
            return b""
        axis, sign = self.signed(text[:1])
        top = self.tube.axes[axis].top_deg_s
        self.move(axis, sign * min(top, BUTTON_RATES.get(self.select, 1e9) * SIDEREAL_DEG_S))
        return b""

    def guide(self, text):
        axis, sign = self.signed(text[:1])
        rate = self.guide_percent[axis] / 100.0 * SIDEREAL_DEG_S
        self.pulse(axis, sign * rate, int(text[1:]) / 1000.0)
        return b""

    def guide_rate_ra(self, text):
        self.guide_percent[0] = int(text)
        return b""

    def guide_rate_dec(self, text):
        self.guide_percent[1] = int(text)
        return b""

    commands = MappingProxyType(
        {
            "GW": "mount_type",
            "GVP": "product",
            "GVN": "firmware",
            "GVD": "firmware_date",
            "GR": "ra",
            "GD": "dec",
            "GS": "sidereal",
            "Gt": "latitude",
            "Gg": "longitude",
            "St": "set_latitude",
            "Sg": "set_longitude",
            "Sr": "set_ra",
            "Sd": "set_dec",
            "MS": "slew",
            "CM": "match",
            "Mn": "north",
            "Ms": "south",
            "Me": "east",
            "Mw": "west",
            "Mg": "guide",
            "Q": "quit",
            "RG": "rate_g",
            "RC": "rate_c",
            "RM": "rate_m",
            "RS": "rate_s",
            "TQ": "sidereal_rate",
            "TS": "solar_rate",
            "TL": "lunar_rate",
            "TTG": "flag",
            "TTGF": "flag",
            "TTGMX": "top_speeds",
            "X120": "tracking_off",
            "X122": "tracking_on",
            "X20": "guide_rate_ra",
            "X21": "guide_rate_dec",
            "X22": "guide_rates",
            "X31": "home_here",
            "X351": "home_here",
            "X32": "set_sidereal",
            "X34": "motors",
            "X352": "park_here",
            "X361": "home",
            "X362": "park",
            "X370": "unpark",
            "X38": "rest",
            "X39": "looks",
            "X3C": "motion",
            "X42": "correction",
            "X590": "place",
        }
    )

    def north(self, _):
        return self.key("n")

    def south(self, _):
        return self.key("s")

    def east(self, _):
        return self.key("e")

    def west(self, _):
        return self.key("w")

    def rate_g(self, _):
        return self.select_rate("G")

    def rate_c(self, _):
        return self.select_rate("C")

    def rate_m(self, _):
        return self.select_rate("M")

    def rate_s(self, _):
        return self.select_rate("S")
