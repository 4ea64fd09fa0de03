"""OnStep and OnStepX, from hjd1964/OnStepX's sources and what real boards answered (`mount-transcripts.md`, 2)."""

from datetime import UTC, datetime
from types import MappingProxyType

from .lx200 import Lx200Board
from .mechanics import HOME_DEG
from .sky import SIDEREAL_DEG_S

RATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0, 48.0)  # of `:R0#` to `:R7#`, in sidereal; R8 is half a slew, R9 a slew
NAMED = {"G": 2, "C": 5, "M": 6, "F": 7, "S": 8}
HORIZON_DEG = -10.0
TRACKING_HZ = {"Q": 60.16427, "S": 60.0, "L": 57.9, "K": 60.136}


class OnStep(Lx200Board):
    """OnStep before X: its board boots for 2.5 s; without a clock's battery it wakes on 1 January 2013."""

    version = "4.24g"
    wakes_at = datetime(2013, 1, 1, tzinfo=UTC)
    marks = "*'"
    unknown = b"0"
    # `:MS#`: below the horizon, parked or not ready ("position unreachable"), in a goto, beside the limits
    refusals = MappingProxyType({"low": 1, "parked": 4, "goto": 4, "moving": 4})

    def __init__(self, **settings):
        super().__init__(**settings)
        self.select = [5, 5]
        self.custom_deg_s = [0.0, 0.0]
        self.hz = TRACKING_HZ["Q"]
        self.saved = {"parked": False, "parking": False}  # in its non-volatile memory
        self.park_at = HOME_DEG
        self.error = 0

    def wake(self, was):
        super().wake(was)
        self.at_home = True  # a reset leaves it at home
        self.saved["parking"] = was == "park"
        self.parked = self.saved["parked"]
        self.hz = TRACKING_HZ["Q"]
        self.rate_deg_s = SIDEREAL_DEG_S
        self.error = 0

    def align(self, *place, **how):
        self.saved = {"parked": False, "parking": False}
        return super().align(*place, **how)

    # -- motion --------------------------------------------------------------------------------------

    def _wrong(self):
        if self.parked:
            return "parked"
        if self.going:
            return "goto"
        return "moving" if self.tube.runs else "low" if self.target_altitude_deg() < HORIZON_DEG else ""

    def slew(self, _):
        if wrong := self._wrong():
            if wrong == "goto":
                self.stop()
            return str(self.refusals[wrong]).encode()
        self.goto()
        return b"0"

    def match(self, _):
        if wrong := self._wrong():
            return f"E{self.refusals[wrong]}#".encode()
        self.sync()
        return b"N/A#"

    def match_silently(self, _):
        self.match("")
        return b""

    def home(self, _):
        if not self.parked and not self.going and not self.tube.runs:
            self.go_home()
        return b""

    def reset(self, _):
        """`:hF#` finds no home: the controller takes where it is for home."""
        if not self.going and not self.tube.runs:
            self.track(False)
            self.set_counters(HOME_DEG)
            self.at_home = True
        return b""

    def park(self, _):
        if self.parked:
            return b"1"
        if self.saved["parking"] or self.going or self.tube.runs:
            return b"0"
        self.saved["parking"] = True
        self.go_park(self.park_at)
        return b"1"

    def set_park(self, _):
        if self.parked or self.going or self.tube.runs:
            return b"0"
        self.park_at = tuple(self.believed_axes_deg())
        return b"1"

    def unpark(self, _):
        if not (self.parked or self.at_home) or self.going or not self.clock_set:
            return b"0"
        self.set_counters(self.park_at)  # it believes to stand where it parked
        self.parked = self.at_home = False
        self.saved = {"parked": False, "parking": False}
        self.track(True)
        return b"1"

    def stop(self, axes=(0, 1)):
        super().stop(axes)
        self.saved["parking"] = False

    def arrived(self, what):
        super().arrived(what)
        self.saved = {"parked": self.parked, "parking": False}
        if what == "home":
            self.set_counters(HOME_DEG)

    def _rate(self, axis):
        if self.select[axis] is None:
            return self.custom_deg_s[axis]
        top = self.tube.axes[axis].top_deg_s
        return (*(r * SIDEREAL_DEG_S for r in RATES), top / 2.0, top)[self.select[axis]]

    def move_to(self, direction):
        if not self.parked and not self.going:
            axis, sign = self.signed(direction)
            self.move(axis, sign * self._rate(axis))
        return b""

    def north(self, _):
        return self.move_to("n")

    def south(self, _):
        return self.move_to("s")

    def east(self, _):
        return self.move_to("e")

    def west(self, _):
        return self.move_to("w")

    def guide(self, text):
        """At the rate of pulses, for at most 16 s."""
        if text[:1] in self.directions and text[1:].isdigit() and not self.parked and not self.going:
            axis, sign = self.signed(text[0])
            self.pulse(axis, sign * 0.5 * SIDEREAL_DEG_S, min(int(text[1:]), 16399) / 1000.0)
        return b""

    def select_rate(self, text):
        rate = NAMED.get(text, int(text) if text.isdigit() else None)
        if rate is not None:
            self.select = [rate, rate]
        return b""

    def custom_1(self, text):
        return self._custom(0, text)

    def custom_2(self, text):
        return self._custom(1, text)

    def _custom(self, axis, text):
        self.custom_deg_s[axis] = max(0.0, min(self.tube.axes[axis].top_deg_s, float(text)))
        self.select[axis] = None
        return b""

    def track_on(self, _):
        if self.parked or self.going in ("home", "park"):
            return b"0"
        self.track(True)
        return b"1"

    def track_off(self, _):
        self.track(False)
        return b"1"

    def track_rate(self, text):
        if text in TRACKING_HZ:
            self.hz = TRACKING_HZ[text]
            self.rate_deg_s = SIDEREAL_DEG_S * self.hz / TRACKING_HZ["Q"]
            if self.tracking:
                self.track(True)
        return b""

    # -- questions -----------------------------------------------------------------------------------

    def ra_precise(self, _):
        return f"{self.hours(self.believed_deg()[0], places=4)}#".encode()

    def dec_precise(self, _):
        return f"{self.sexagesimal(self.believed_deg()[1], sign=True, marks=self.marks, places=3)}#".encode()

    def bar(self, _):
        return b"\x7f#" if self.going in ("goto", "home", "park") else b"#"

    def side(self, _):
        return b"N#" if self.at_home else b"W#" if self.beyond() else b"E#"

    def _park_letter(self):
        return "P" if self.parked else "I" if self.saved["parking"] else "p"

    def status(self, _):
        text = "" if self.tracking else "n"
        text += "" if self.going else "N"
        text += self._park_letter() + "e" + ("H" if self.at_home else "")
        text += self._guide_letters()
        text += {57.9: "(", 60.0: "O", 60.136: "k"}.get(self.hz, "")
        text += "E" + ("o" if self.at_home else "W" if self.beyond() else "T")
        return f"{text}2{self.select[0] or 0}{self.error}#".encode()

    def _guide_letters(self):
        """Nothing of a move: OnStep 4's Command.ino tells of pulses alone."""
        return "G" if self.guiding else ""

    def tracking_hz(self, _):
        return f"{self.hz:.5f}#".encode() if self.tracking else b"0#"

    def product(self, _):
        return b"On-Step#"

    def firmware(self, _):
        return f"{self.version}#".encode()

    def firmware_date(self, _):
        return b"Feb 29 2024#"

    def firmware_time(self, _):
        return b"12:00:00#"

    def format_24(self, _):
        return b"24#"

    def low_limit(self, _):
        return f"{HORIZON_DEG:+03.0f}*#".encode()

    def high_limit(self, _):
        return b"90*#"

    def date_not_ready(self, _):
        return b"0" if self.clock_set else b"1"

    def site_name(self, _):
        return b"None#"

    def latitude(self, _):
        return f"{self.sexagesimal(self.site_deg[0], sign=True, marks='*:')[:6]}#".encode()

    def longitude(self, _):
        return f"{self.sexagesimal(-self.site_deg[1], 3, sign=True, marks='*:')[:7]}#".encode()

    commands = MappingProxyType(
        {
            "GR": "ra",
            "GRa": "ra_precise",
            "GRH": "ra_precise",
            "GD": "dec",
            "GDe": "dec_precise",
            "GDH": "dec_precise",
            "GA": "altitude",
            "GZ": "azimuth",
            "GS": "sidereal",
            "Gr": "target_ra",
            "Gd": "target_dec",
            "Sr": "set_ra",
            "Sd": "set_dec",
            "MS": "slew",
            "CM": "match",
            "CS": "match_silently",
            "hC": "home",
            "hF": "reset",
            "hP": "park",
            "hR": "unpark",
            "hQ": "set_park",
            "Mn": "north",
            "Ms": "south",
            "Me": "east",
            "Mw": "west",
            "Mg": "guide",
            "Q": "quit",
            "R": "select_rate",
            "RA": "custom_1",
            "RE": "custom_2",
            "Te": "track_on",
            "Td": "track_off",
            "T": "track_rate",
            "D": "bar",
            "Gm": "side",
            "GU": "status",
            "GT": "tracking_hz",
            "GVP": "product",
            "GVN": "firmware",
            "GVD": "firmware_date",
            "GVT": "firmware_time",
            "Gc": "format_24",
            "GC": "date",
            "GL": "time",
            "GG": "zone",
            "Gt": "latitude",
            "Gg": "longitude",
            "Gh": "low_limit",
            "Go": "high_limit",
            "GX89": "date_not_ready",
            "GM": "site_name",
            "GN": "site_name",
            "GO": "site_name",
            "GP": "site_name",
            "SC": "set_date",
            "SL": "set_time",
            "SG": "set_zone",
            "St": "set_latitude",
            "Sg": "set_longitude",
            "SX": "yes",
            "U": "silent",
        }
    )


class OnStepX(OnStep):
    """OnStepX: without a battery it wakes with the date that was last set; a goto before a date is set is taken."""

    version = "10.23a"
    marks = "*:"
    refusals = MappingProxyType({"low": 1, "parked": 4, "goto": 5, "moving": 8})

    def __init__(self, **settings):
        super().__init__(**settings)
        self.wakes_at = datetime.fromtimestamp(self.clock.unix(), UTC)  # the clock was set as the evening began

    def _guide_letters(self):
        return super()._guide_letters() + ("g" if self.by_hand else "")

    def set_time(self, text):
        answer = super().set_time(text)
        self.wakes_at = datetime.fromtimestamp(self.believed_unix(), UTC)
        return answer

    def ut_time(self, _):
        return f"{datetime.fromtimestamp(self.believed_unix(), UTC):%H:%M:%S}#".encode()

    def ut_date(self, _):
        return f"{datetime.fromtimestamp(self.believed_unix(), UTC):%m/%d/%y}#".encode()

    def latitude_precise(self, _):
        return f"{self.sexagesimal(self.site_deg[0], sign=True, marks='*:', places=3)}#".encode()

    def longitude_precise(self, _):
        return f"{self.sexagesimal(-self.site_deg[1], 3, sign=True, marks='*:', places=3)}#".encode()

    commands = OnStep.commands | {
        "GX80": "ut_time",
        "GX81": "ut_date",
        "GtH": "latitude_precise",
        "GgH": "longitude_precise",
    }
