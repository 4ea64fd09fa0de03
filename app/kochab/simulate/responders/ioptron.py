"""An iOptron mount in the command language of version 3, a CEM40.

``:mw#`` goes to greater right ascension and ``:me#`` to smaller, as the maker's page says and
INDI found: the letters name the keys of the hand controller, not the sky.
"""

import re
from datetime import UTC, datetime, timedelta

from kochab.core.mount import SIDEREAL_DEG_S, Direction, PierSide, TrackingRate
from kochab.simulate.mechanics.mount import EquatorialMount
from kochab.simulate.responders import HOME_DEG, Controller, LocalSettings, horizontal_deg

PARTS_DEG = 360000.0  # 0.01 arcsec
J2000_UNIX = 946728000.0
MOVES = {b"mn": Direction.NORTH, b"ms": Direction.SOUTH, b"mw": Direction.EAST, b"me": Direction.WEST}
PULSES = {b"ZS": Direction.EAST, b"ZQ": Direction.WEST, b"ZE": Direction.NORTH, b"ZC": Direction.SOUTH}
PULSES |= {b"Mn": Direction.NORTH, b"Ms": Direction.SOUTH, b"Me": Direction.EAST, b"Mw": Direction.WEST}
RATES_DEG_S = tuple(k * SIDEREAL_DEG_S for k in (1, 2, 8, 16, 64, 128, 256, 512, 960))
RATES = (TrackingRate.SIDEREAL, TrackingRate.LUNAR, TrackingRate.SOLAR, TrackingRate.KING)
SIDES = {PierSide.EAST: 0, PierSide.WEST: 1}
TAKEN = (
    rb"SGF[01]|SHE[01]|MSR[789]|SAL[+-]\d\d|RG\d{4}|SMT\d{3}|SP[PR][01]|RR\d{5}|SDS[01]"
    rb"|SPA\d{9}|SPH\d{8}|SZP|MSH"
)


class IoptronResponder(Controller):
    """What is not known is not answered, ``:Q#`` ends no move. A sync while it slews is answered and ignored."""

    # a second colon before the # begins anew: what stood before it is lost
    command = re.compile(rb":(?:[^#]*:)?([^:#]*)#")
    begins = b":"
    done = b"1"
    wrong = b"0"

    def __init__(self, telescope: EquatorialMount) -> None:
        super().__init__(telescope)
        self.settings = LocalSettings(telescope)
        self.rate = 5
        self.tracking_rate = TrackingRate.SIDEREAL
        self.target_deg = [0.0, 0.0]
        self.words = {
            b"MountInfo": lambda: b"0040",
            b"FW[12]": lambda: b"210105210105#",
            b"GEP": self.position,
            b"GLS": self.status,
            b"GUT": self.time,
            b"GAC": self.altitude,
            b"GPC": self.park_place,
            b"GSR": lambda: b"9#",
            b"GAL": lambda: b"+00#",
            b"AG": lambda: b"5050#",
            b"GMT": lambda: b"010#",
            b"GTR": lambda: b"10000#",
            b"GP[ER]": lambda: b"0",
            b"CM": self.sync,
            b"MS[12]": self.slew,
            b"Q": lambda: telescope.stop(moves=False),
            b"MH": self.go_home,
            b"RT([0-3])": self.set_tracking_rate,
            b"qR": lambda: self.halt(Direction.EAST, Direction.WEST),
            b"qD": lambda: self.halt(Direction.NORTH, Direction.SOUTH),
            b"ST0": lambda: self.track(False),
            b"ST1": lambda: self.track(True),
            b"MP0": lambda: self.park(False),
            b"MP1": lambda: self.park(True),
            rb"SRA(\d{9})": lambda text: self.set_target(0, text, 129600000),
            rb"Sd([+-]\d{8})": lambda text: self.set_target(1, text, 32400000),
            b"SR([1-9])": self.set_rate,
            b"(m[nsew])": self.move,
            rb"((?:Z[SQEC]|M[nsew])\d{5})": self.pulse,
            rb"SLO([+-]\d{8})": self.set_longitude,
            rb"SLA([+-]\d{8})": self.set_latitude,
            rb"SG([+-]\d{3})": self.set_zone,
            rb"SUT(\d{13})": self.set_time,
            TAKEN: lambda: None,
        }

    def position(self) -> bytes:
        """Declination, right ascension, side of the pier, weights down."""
        ra, dec = self.telescope.believed_deg()
        parts = round(ra * PARTS_DEG) % 129600000
        return b"%+09d%09d%d1#" % (round(dec * PARTS_DEG), parts, SIDES[self.telescope.pier_side])

    def status(self) -> bytes:
        """Place; GPS; status; sidereal; speed of the keys; time from RS-232; hemisphere."""
        place = self.settings
        return b"%+09d%08d0%d%d%d1%d#" % (
            round(place.longitude_deg * PARTS_DEG),
            round((place.latitude_deg + 90.0) * PARTS_DEG),
            self.state(),
            RATES.index(self.tracking_rate),
            self.rate,
            place.latitude_deg >= 0,
        )

    def state(self) -> int:
        """0 stopped, 1 tracking, 2 slewing, 6 parked, 7 at the zero position."""
        if self.telescope.slewing:
            return 2
        if self.telescope.parked:
            return 6
        if self.telescope.tracking:
            return 1
        return 7 if max(map(abs, self.telescope.from_home_deg())) < HOME_DEG else 0

    def time(self) -> bytes:
        """Minutes of the zone, summer time or not, milliseconds since J2000."""
        milliseconds = round((self.settings.utc().timestamp() - J2000_UNIX) * 1000.0)
        return b"%+04d0%013d#" % (round(self.settings.utc_offset_h * 60.0), max(0, milliseconds))

    def altitude(self) -> bytes:
        """Altitude and azimuth."""
        altitude, azimuth = horizontal_deg(self.telescope, self.settings.latitude_deg)
        return b"%+09d%09d#" % (round(altitude * PARTS_DEG), round(azimuth * PARTS_DEG) % 129600000)

    def set_target(self, axis: int, text: bytes, most: int) -> None:
        """``1``, or ``0`` beyond a turn or a pole."""
        if abs(int(text)) > most:
            raise ValueError("no place")
        self.target_deg[axis] = int(text) / PARTS_DEG

    def slew(self) -> bytes:
        """``0`` below the altitude limit or beyond the mechanical ones."""
        return b"0" if self._goto(*self.target_deg) else b"1"

    def sync(self) -> None:
        """``1`` in any case."""
        # it answers 1 all the same, so only reading back tells
        if not self.telescope.slewing:
            self._sync(*self.target_deg)

    def halt(self, *directions: Direction) -> None:
        """What the keys of one axis began."""
        for direction in directions:
            self.telescope.halt(direction)

    def track(self, on: bool) -> None:
        """At the rate that is set, on or off."""
        self.telescope.tracking_deg_s = self.tracking_rate.deg_s if on else 0.0

    def set_tracking_rate(self, digit: bytes) -> None:
        """Sidereal, lunar, solar, King."""
        self.tracking_rate = RATES[int(digit)]
        self.track(self.telescope.tracking)

    def go_home(self) -> None:
        """To the zero position."""
        self.telescope.go_home()

    def park_place(self) -> bytes:
        """Altitude and azimuth, until others are set those of the zero position: the pole."""
        latitude = self.settings.latitude_deg
        return b"%08d%09d#" % (round(abs(latitude) * PARTS_DEG), 0 if latitude >= 0.0 else round(180 * PARTS_DEG))

    def park(self, on: bool) -> None:
        """At the zero position, until another is set."""
        self.telescope.stop()
        self.telescope.parked = on

    def set_rate(self, text: bytes) -> None:
        """Of the keys, 1 to 9."""
        self.rate = int(text)

    def move(self, text: bytes) -> bytes:
        """Nothing is answered."""
        self.telescope.move(MOVES[text], RATES_DEG_S[self.rate - 1])
        return b""

    def pulse(self, text: bytes) -> bytes:
        """Nothing is answered."""
        self.telescope.pulse(PULSES[text[:2]], float(text[2:]))
        return b""

    def set_longitude(self, text: bytes) -> None:
        """East positive."""
        self.settings.longitude_deg = int(text) / PARTS_DEG

    def set_latitude(self, text: bytes) -> None:
        """North positive."""
        self.settings.latitude_deg = max(-90.0, min(90.0, int(text) / PARTS_DEG))

    def set_zone(self, text: bytes) -> None:
        """Minutes east of Greenwich."""
        self.settings.utc_offset_h = int(text) / 60.0

    def set_time(self, text: bytes) -> None:
        """Milliseconds since J2000; 13 digits of them end in the year 2316."""
        wanted = datetime.fromtimestamp(int(text) / 1000.0 + J2000_UNIX, UTC)
        self.settings.clock_error += wanted - self.settings.utc()
        # no earlier than 9000 days ago: the reply counts from J2000 and has no sign
        self.settings.clock_error = max(self.settings.clock_error, timedelta(days=-9000))
