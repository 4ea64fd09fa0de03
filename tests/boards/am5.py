"""ZWO AM5 from the protocol observed in firmware 1.8.8 (`mount-transcripts.md`, 3) and INDI's lx200am5.cpp."""

from types import MappingProxyType

from .lx200 import Lx200Board
from .sky import SIDEREAL_DEG_S

RATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0, 60.0, 720.0, 1440.0)  # `:R0#` to `:R9#`, in sidereal
NAMED = {"G": 1, "C": 2, "M": 8, "S": 9}
POWER_ON, BROWNOUT = 1, 9  # ESP-IDF's reasons of a reset
IDLE, TRACKING, GOTO, MANUAL, HOMING, PARKING = range(6)


class Am5(Lx200Board):
    """``insists_on_clock``: it refuses gotos with e7 until its clock is set, as protocol 1.7 has it.

    Its clock wakes on 1 January 2000. ``GRR`` tells why it last started, and so reads 1 from its first start on.
    """

    boot_s = 2.0

    def __init__(self, insists_on_clock=False, **settings):
        super().__init__(**settings)
        self.insists_on_clock = insists_on_clock
        self.reset_reason = POWER_ON
        self.rate_sidereal = [RATES[9], RATES[9]]
        self.guide_sidereal = 0.5
        self.rate_kind = 0
        self.homed = False  # it knows its home

    def wake(self, was):
        super().wake(was)
        self.homed = self.claims_home
        self.reset_reason = POWER_ON
        self.rate_sidereal = [RATES[9], RATES[9]]
        self.rate_kind, self.rate_deg_s = 0, SIDEREAL_DEG_S

    # -- motion --------------------------------------------------------------------------------------

    def _state(self):
        if self.going:
            return {"goto": GOTO, "home": HOMING, "park": PARKING}[self.going]
        return MANUAL if self.by_hand and not self.guiding else TRACKING if self.tracking else IDLE

    def _wrong(self, sync=False):
        if self._state() in (GOTO, HOMING, PARKING):
            return b"e3#"
        if self._state() == MANUAL:
            return b"e4#"
        if self.insists_on_clock and not self.clock_set:
            return b"e7#"
        if not sync and self.target_altitude_deg() < 0.0:
            return b"e5#"
        return b"e11#" if sync and abs(self.target_deg[1]) > 89.0 else b""

    def slew(self, _):
        if wrong := self._wrong():
            return wrong
        self.goto()
        return b"0"

    def match(self, _):
        if wrong := self._wrong(sync=True):
            return wrong
        self.sync()
        return b"N/A#"

    def home(self, _):
        if self._state() in (IDLE, TRACKING):
            self.go_home()
        return b""

    def park(self, _):
        if self._state() not in (IDLE, TRACKING):
            return b"0"
        self.go_park()
        return b"1"

    def arrived(self, what):
        super().arrived(what)
        self.homed = self.homed or what == "home"

    def goto(self):
        self.parked = False
        super().goto()

    def move_to(self, direction):
        if self._state() in (IDLE, TRACKING, MANUAL):
            axis, sign = self.signed(direction)
            self.parked = False
            wanted = self.rate_sidereal[axis] * SIDEREAL_DEG_S
            self.move(axis, sign * min(wanted, self.tube.axes[axis].top_deg_s))
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
        """0 to 3000 ms."""
        if text[:1] in self.directions and text[1:].isdigit() and int(text[1:]) <= 3000 and not self.going:
            axis, sign = self.signed(text[0])
            self.pulse(axis, sign * self.guide_sidereal * SIDEREAL_DEG_S, int(text[1:]) / 1000.0)
        return b""

    def select_rate(self, text):
        number = NAMED.get(text, int(text) if text.isdigit() else None)
        if number is not None and number < len(RATES):
            self.rate_sidereal = [RATES[number]] * 2
        return b""

    def variable(self, text):
        axes, value = {"r": ((0,), text[1:]), "d": ((1,), text[1:])}.get(text[:1], ((0, 1), text))
        for axis in axes:
            self.rate_sidereal[axis] = max(0.0, min(1440.0, float(value)))
        return b""

    def set_guide_rate(self, text):
        self.guide_sidereal = max(0.1, min(0.9, float(text)))
        return b""

    def track_on(self, _):
        if self.going:
            return b"0"
        self.parked = False
        self.track(True)
        return b"1"

    def track_off(self, _):
        self.track(False)
        return b"1"

    def track_rate(self, text):
        kinds = {"Q": (0, 1.0), "L": (1, 57.9 / 60.16427), "S": (2, 60.0 / 60.16427)}
        if text in kinds:
            self.rate_kind, factor = kinds[text]
            self.rate_deg_s = factor * SIDEREAL_DEG_S
            if self.tracking:
                self.track(True)
        return b""

    # -- questions -----------------------------------------------------------------------------------

    def status(self, _):
        state = self._state()
        text = ("n" if state != TRACKING else "") + ("N" if state in (IDLE, TRACKING) else "")
        text += ("H" if self.at_home else "") + "G" + ("t" if self.guiding else "")
        flags = [int(axis.runs or (self.tracking and k == 0)) for k, axis in enumerate(self.tube.axes)]
        flags = [flag | (4 if self.homed else 0) for flag in flags]
        return f"{text}{flags[0]:02x}{flags[1]:02x}0021{state}#".encode()

    def side(self, _):
        return b"N#" if self.at_home else b"W#" if self.beyond() else b"E#"

    def parked_state(self, _):
        return b"2#" if self.parked else b"1#" if self.going == "park" else b"0#"

    def home_known(self, _):
        return b"1#" if self.homed else b"0#"

    def is_tracking(self, _):
        return b"1#" if self.tracking else b"0#"

    def rate_type(self, _):
        return f"{self.rate_kind}#".encode()

    def why_started(self, _):
        return f"{self.reset_reason}#".encode()

    def guide_rate(self, _):
        return f"{self.guide_sidereal:.2f}#".encode()

    def product(self, _):
        return b"AM5#"

    def firmware(self, _):
        return b"1.8.8#"

    def firmware_date(self, _):
        return b"Jan 25 2026#"

    def firmware_time(self, _):
        return b"14:01:29#"

    def serial_name(self, _):
        return b"AM5_609611#"

    def zero(self, _):
        return b"0#"

    def one(self, _):
        return b"1#"

    def ninety(self, _):
        return b"90#"

    def nothing(self, _):
        return b"#"

    def park_table(self, _):
        return b"1:[0,default,0,-1920000]#"

    def both(self, _):
        return f"{self.ra('')[:-1].decode()}&{self.dec('').decode()}".encode()

    def site_both(self, _):
        return f"{self.latitude('')[:-1].decode()}&{self.longitude('').decode()}".encode()

    def time_both(self, _):
        return b"&".join([self.date("")[:-1], self.time("")[:-1], self.zone("")])

    def everything(self, _):
        return self.time_both("") + self.ra("")[:-1] + b"&" + self.dec("") + self.status("")

    commands = MappingProxyType(
        {
            "GR": "ra",
            "GRr": "ra",
            "GD": "dec",
            "GDr": "dec",
            "GA": "altitude",
            "GZ": "azimuth",
            "GS": "sidereal",
            "Gr": "target_ra",
            "Gd": "target_dec",
            "Sr": "set_ra",
            "Sd": "set_dec",
            "MS": "slew",
            "CM": "match",
            "hC": "home",
            "hP": "park",
            "Mn": "north",
            "Ms": "south",
            "Me": "east",
            "Mw": "west",
            "Mg": "guide",
            "Q": "quit",
            "R": "select_rate",
            "Rv": "variable",
            "Rg": "set_guide_rate",
            "Te": "track_on",
            "Td": "track_off",
            "T": "track_rate",
            "GU": "status",
            "Gm": "side",
            "Gps": "parked_state",
            "Gpa": "park_table",
            "Gh": "home_known",
            "GAT": "is_tracking",
            "GAST": "everything",
            "GT": "rate_type",
            "GRR": "why_started",
            "Ggr": "guide_rate",
            "GBu": "one",
            "GLH": "ninety",
            "GLL": "zero",
            "GLC": "one",
            "GVP": "product",
            "GV": "firmware",
            "GVD": "firmware_date",
            "GVT": "firmware_time",
            "GMB": "serial_name",
            "GMEQ": "both",
            "GMGE": "site_both",
            "GMTI": "time_both",
            "GC": "date",
            "GL": "time",
            "GG": "zone",
            "GH": "zero",
            "Gt": "latitude",
            "Gg": "longitude",
            "GKEY": "nothing",
            "GSN": "silent",
            "GX": "silent",
            "SC": "set_date",
            "SL": "set_time",
            "SG": "set_zone",
            "St": "set_latitude",
            "Sg": "set_longitude",
            "SH": "yes",
            "SBu": "silent",
            "AP": "silent",
            "AA": "silent",
        }
    )
