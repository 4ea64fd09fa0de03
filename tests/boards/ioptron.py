"""iOptron HEM and CEM of protocol 3, from INDI's ioptronv3driver.cpp and real logs (`mount-transcripts.md`, 5)."""

from datetime import UTC, datetime
from types import MappingProxyType

from .board import Board
from .mechanics import HOME_DEG
from .sky import SIDEREAL_DEG_S

J2000 = datetime(2000, 1, 1, 12, 0, tzinfo=UTC)
RATES = (1, 2, 8, 16, 64, 128, 256, 512)  # of `:SR1#` to `:SR8#`, in sidereal; `:SR9#` is the fastest
STOPPED, TRACKING, SLEWING, GUIDING, FLIPPING, TRACKING_PEC, PARKED, HOME = range(8)
RATE_FACTORS = (1.0, 57.9 / 60.16427, 60.0 / 60.16427, 60.136 / 60.16427, 1.0)


class Ioptron(Board):
    """``model`` is what `:MountInfo#` tells; most have a clock with a battery and remember that they are parked.

    ``home_sensors``: `:MSH#` finds the true home, as on a CEM; else it goes to the zero position it believes in.
    """

    boot_s = 3.0
    wakes_at = J2000

    def __init__(self, model="0070", home_sensors=False, keeps_clock=True, **settings):
        super().__init__(keeps_clock=keeps_clock, **settings)
        self.model, self.home_sensors = model, home_sensors
        self.select = 9
        self.rate_kind = 0
        self.guide_sidereal = 0.5
        self.park_at = HOME_DEG
        self.low_deg = 0
        self._seeking = False

    def wake(self, was):
        stands = self.believed_axes_deg()
        remembers = self.parked and was == ""
        super().wake(was)
        self.rate_kind, self.rate_deg_s, self.select = 0, SIDEREAL_DEG_S, 9
        if remembers:
            self.parked, self.at_home = True, False
            self.set_counters(stands)

    # -- framing -------------------------------------------------------------------------------------

    def next_command(self, buffer):
        start = buffer.find(b":")
        if start < 0 or (end := buffer.find(b"#", start)) < 0:
            return None
        start = buffer.rfind(b":", start, end)  # what was cut before is forgotten
        return buffer[start : end + 1], buffer[end + 1 :]

    def is_stop(self, command):
        return command[1:2].lower() == b"q"

    def answer(self, command):
        text = command[1:-1].decode("latin1")
        for length in range(len(text), 0, -1):
            if method := self.commands.get(text[:length]):
                return getattr(self, method)(text[length:])
        return b""

    # -- questions -----------------------------------------------------------------------------------

    def _status(self):
        if self.parked:
            return PARKED
        if self.going:
            return SLEWING
        if self.at_home and not self.tracking:
            return HOME
        return GUIDING if self.guiding else TRACKING if self.tracking else STOPPED

    def info(self, _):
        return self.model.encode()

    def status(self, _):
        longitude, latitude = round(self.site_deg[1] * 360000), round((self.site_deg[0] + 90.0) * 360000)
        north = int(self.site_deg[0] >= 0.0)
        rest = f"{latitude:08d}2{self._status()}{self.rate_kind}{self.select}1{north}#"
        return f"{longitude:+09d}{rest}".encode()

    def place(self, _):
        ra, dec = self.believed_deg()
        side = 2 if self.at_home else 1 if self.beyond() else 0
        units = round(ra * 360000) % (360 * 360000)
        return f"{round(dec * 360000):+09d}{units:09d}{side}1#".encode()

    def horizontal(self, _):
        altitude, azimuth = self.believed_altaz_deg()
        return f"{round(altitude * 360000):+09d}{round(azimuth * 360000) % (360 * 360000):09d}#".encode()

    def time(self, _):
        since = round(1000.0 * (self.believed_unix() - J2000.timestamp()))
        return f"{round(60 * self.zone_h):+04d}0{since:013d}#".encode()

    def firmware_1(self, _):
        return b"210420210420#"

    def firmware_2(self, _):
        return b"210420210420#"

    def guide_rates(self, _):
        return f"{round(100 * self.guide_sidereal):02d}{round(100 * self.guide_sidereal):02d}#".encode()

    def park_place(self, _):
        return f"{round(self.site_deg[0] * 360000):08d}{0:09d}#".encode()

    def low_limit(self, _):
        return f"{self.low_deg:+03d}#".encode()

    def meridian(self, _):
        return b"015#"

    def tracking_rate(self, _):
        return b"10000#"

    # -- orders --------------------------------------------------------------------------------------

    def yes(self, _):
        return b"1"

    def silent(self, _):
        return b""

    def set_ra(self, text):
        if len(text) != 9 or not text.isdigit():
            return b"0"
        self.target_deg[0] = int(text) / 360000.0
        return b"1"

    def set_dec(self, text):
        if len(text) != 9 or text[0] not in "+-" or not text[1:].isdigit():
            return b"0"
        self.target_deg[1] = int(text) / 360000.0
        return b"1"

    def slew(self, _):
        if self.parked or self.going or self.by_hand or self.target_altitude_deg() < self.low_deg:
            return b"0"
        self.goto()
        return b"1"

    def match(self, _):
        if self.parked or self.going:
            return b"0"
        self.sync()
        return b"1"

    def home(self, _):
        if self.parked or self.going:
            return b"0"
        self._seeking = False
        self.go_home()
        return b"1"

    def seek_home(self, _):
        if self.parked or self.going:
            return b"0"
        self._seeking = self.home_sensors
        self.go_home()
        if self._seeking:
            for axis, wanted in zip(self.tube.axes, HOME_DEG, strict=True):
                axis.target_deg = wanted
        return b"1"

    def zero_here(self, _):
        self.set_counters(HOME_DEG)
        return b"1"

    def park(self, _):
        if self.parked:
            return b"1"
        if self.going:
            return b"0"
        self.go_park(self.park_at)
        return b"1"

    def unpark(self, _):
        self.parked = False
        return b"1"

    def arrived(self, what):
        super().arrived(what)
        if what == "home" and self._seeking:
            self.set_counters(HOME_DEG)

    def stop_all(self, _):
        self.stop()
        return b"1"

    def stop_ra(self, _):
        self.stop((0,))
        return b"1"

    def stop_dec(self, _):
        self.stop((1,))
        return b"1"

    def tracking_on_off(self, text):
        if self.parked or self.going in ("home", "park"):
            return b"0"
        self.track(text == "1")
        return b"1"

    def tracking_kind(self, text):
        self.rate_kind = min(4, int(text))
        self.rate_deg_s = RATE_FACTORS[self.rate_kind] * SIDEREAL_DEG_S
        if self.tracking:
            self.track(True)
        return b"1"

    def select_rate(self, text):
        self.select = max(1, min(9, int(text)))
        return b"1"

    # INDI found that ":me#" lets RA fall and ":mw#" lets it rise; axis 1 turns with the sky, against RA.
    directions = MappingProxyType({"n": (1, 1.0), "s": (1, -1.0), "e": (0, 1.0), "w": (0, -1.0)})

    def _signed(self, direction):
        axis, sign = self.directions[direction]
        return axis, -sign if axis == 1 and self.beyond() else sign

    def _move(self, direction):
        if not self.parked and not self.going:
            axis, sign = self._signed(direction)
            top = self.tube.axes[axis].top_deg_s
            rate = top if self.select == 9 else min(top, RATES[self.select - 1] * SIDEREAL_DEG_S)
            self.move(axis, sign * rate)
        return b""

    def north(self, _):
        return self._move("n")

    def south(self, _):
        return self._move("s")

    def east(self, _):
        return self._move("e")

    def west(self, _):
        return self._move("w")

    def _guide(self, direction, text):
        """Exactly five digits; fewer run far too long (`mount-transcripts.md`, L55)."""
        if text.isdigit() and not self.parked and not self.going:
            axis, sign = self._signed(direction)
            if axis == 0:
                sign = -sign  # ":Mw#" is west, unlike ":mw#"
            seconds = int(text) / 1000.0 * (1.0 if len(text) == 5 else 10.0)
            self.pulse(axis, sign * self.guide_sidereal * SIDEREAL_DEG_S, seconds)
        return b""

    def guide_n(self, text):
        return self._guide("n", text)

    def guide_s(self, text):
        return self._guide("s", text)

    def guide_e(self, text):
        return self._guide("e", text)

    def guide_w(self, text):
        return self._guide("w", text)

    # -- clock and site ------------------------------------------------------------------------------

    def set_longitude(self, text):
        self.site_deg = (self.site_deg[0], int(text) / 360000.0)
        return b"1"

    def set_latitude(self, text):
        self.site_deg = (int(text) / 360000.0, self.site_deg[1])
        return b"1"

    def set_zone(self, text):
        self.zone_h = int(text) / 60.0
        return b"1"

    def set_time(self, text):
        self.clock_error_s = int(text) / 1000.0 + J2000.timestamp() - self.clock.unix()
        self.clock_set = True
        return b"1"

    commands = MappingProxyType(
        {
            "MountInfo": "info",
            "GLS": "status",
            "GEP": "place",
            "GAC": "horizontal",
            "GUT": "time",
            "FW1": "firmware_1",
            "FW2": "firmware_2",
            "AG": "guide_rates",
            "GPC": "park_place",
            "GAL": "low_limit",
            "GMT": "meridian",
            "GTR": "tracking_rate",
            "SRA": "set_ra",
            "Sd": "set_dec",
            "MS1": "slew",
            "MS2": "slew",
            "CM": "match",
            "MH": "home",
            "MSH": "seek_home",
            "SZP": "zero_here",
            "MP1": "park",
            "MP0": "unpark",
            "Q": "stop_all",
            "q": "stop_all",
            "qR": "stop_ra",
            "qD": "stop_dec",
            "ST": "tracking_on_off",
            "RT": "tracking_kind",
            "RR": "yes",
            "RG": "yes",
            "SR": "select_rate",
            "mn": "north",
            "ms": "south",
            "me": "east",
            "mw": "west",
            "Mn": "guide_n",
            "Ms": "guide_s",
            "Me": "guide_e",
            "Mw": "guide_w",
            "SLO": "set_longitude",
            "SLA": "set_latitude",
            "SG": "set_zone",
            "SDS": "yes",
            "SUT": "set_time",
            "SPA": "yes",
            "SPH": "yes",
            "SAL": "yes",
            "SMT": "yes",
        }
    )
