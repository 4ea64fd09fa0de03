"""What every mount reports and can do: pointing, state, abilities, and the sidereal rate."""

from collections.abc import Mapping
from datetime import datetime
from enum import StrEnum
from math import radians
from typing import Protocol

from kochab.core.frame import Site
from kochab.core.values import frozen
from kochab.text.translation import tr_noop


class Epoch(StrEnum):
    """The equator and equinox a mount's coordinates belong to."""

    J2000 = "J2000"
    DATE = tr_noop("of date")


class Direction(StrEnum):
    """Where the telescope is moved on the sky; east is towards greater right ascension."""

    NORTH = tr_noop("north")
    SOUTH = tr_noop("south")
    EAST = "east"
    WEST = "west"

    @property
    def in_dec(self) -> bool:
        """Whether the declination axis moves, not the one of right ascension."""
        return self in (Direction.NORTH, Direction.SOUTH)


class PierSide(StrEnum):
    """The side of the pier that the telescope is on."""

    EAST = tr_noop("east")
    WEST = tr_noop("west")

    @property
    def opposite(self) -> "PierSide":
        """The other side."""
        return PierSide.WEST if self is PierSide.EAST else PierSide.EAST


class Home(StrEnum):
    """The user's word for the home of a mount that only counts the steps of its motors.

    Home: the tube at the pole, the counterweight down.
    """

    NOW = "now"  # it is there at this moment
    POWER_ON = "power-on"  # it stood there when it was switched on; no program set its counters
    EQMOD = "eqmod"  # EQMod has set its counters there: the Dec axis to a quarter turn


CONFIRM_HOME = tr_noop(
    "The mount's home is not confirmed, and a slew could drive the tube into the pier: sync on a solved frame; or put "
    "the tube at the pole with the counterweight down, and connect again with home confirmed (--home now). A mount "
    "with home sensors finds its home when you nudge both axes over it."
)


class Ability(StrEnum):
    """What a mount may or may not be able to do; :attr:`Mount.lacks` has the reasons."""

    SYNC = "sync"
    GOTO = "goto"
    STOP = "stop"
    PULSE = "guide pulse"
    MOVE = "move at a rate"
    TRACKING = "tracking on and off"
    SIDEREAL = "sidereal rate"
    LUNAR = "lunar rate"
    SOLAR = "solar rate"
    KING = "King rate"
    PARK = "park"
    UNPARK = "unpark"
    HOME = "go home"
    SITE = "report its site"
    TIME = "report its time"
    SET_SITE = "set its site"
    SET_CLOCK = "set its clock"


class TrackingRate(StrEnum):
    """What the mount follows; King's rate is the stars' with the refraction near the pole."""

    OFF = "off"
    SIDEREAL = "sidereal"
    LUNAR = "lunar"
    SOLAR = "solar"
    KING = "king"

    @property
    def ability(self) -> Ability:
        """What a mount needs for it."""
        return Ability.TRACKING if self is TrackingRate.OFF else Ability[self.name]

    @property
    def deg_s(self) -> float:
        """Of the RA axis: the mean Sun's and Moon's; King's in Sidgwick, Amateur Astronomer's Handbook."""
        return {
            TrackingRate.OFF: 0.0,
            TrackingRate.SIDEREAL: SIDEREAL_DEG_S,
            # The Moon falls behind by one turn in a sidereal month, 27.3 days.
            TrackingRate.LUNAR: SIDEREAL_DEG_S - 360.0 / (27.321661 * 86400.0),
            TrackingRate.SOLAR: 360.0 / 86400.0,  # the mean Sun: one turn a day
            TrackingRate.KING: 15.0369 / 3600.0,
        }[self]


@frozen
class Pointing:
    """Equatorial degrees, RA in [0, 360), and the epoch they belong to."""

    ra_deg: float
    dec_deg: float
    epoch: Epoch


@frozen
class MountState:
    """State of the mount; None where it does not report it.

    ``home_confirmed`` is False where the mount only counts steps from a home that nobody has
    confirmed: its position is a guess, and it must not slew. ``rate`` is the one it tracks at. ``fault`` is why it
    stopped by itself, empty when it did not.
    """

    slewing: bool | None = None
    parked: bool | None = None
    aligned: bool | None = None
    tracking: bool | None = None
    pier_side: PierSide | None = None
    alt_azimuth: bool | None = None
    home_confirmed: bool | None = None
    at_home: bool | None = None
    rate: TrackingRate | None = None
    fault: str | None = None


@frozen
class SiteReport:
    """The site and time that a mount uses; None where it does not report them.

    ``utc_offset_h`` is east positive, summer time included. ``last_start`` is what it says of its last start, in words
    of its own, empty where it says that nothing happened: other words later tell that it has started again.
    """

    site: Site | None = None
    time_utc: datetime | None = None
    utc_offset_h: float | None = None
    last_start: str | None = None


class Mount(Protocol):
    """What every driver offers. Every call blocks at most for the protocol's own time limit.

    All calls of one mount come from the one thread that owns its port, but for :meth:`stop`,
    which any thread may call at any time. Every call raises :class:`~kochab.core.errors.DeviceError`
    with one sentence. Coordinates are in :attr:`epoch`.
    """

    @property
    def name(self) -> str:
        """Its name in the registry of drivers."""

    @property
    def epoch(self) -> Epoch:
        """The epoch of its coordinates, a setting of the profile."""

    @property
    def blind_stop(self) -> bytes:
        """The bytes that stop it before it has answered anything."""

    @property
    def rates_deg_s(self) -> tuple[float, ...]:
        """The rates of :meth:`move`, slowest first; empty when they are not known."""

    @property
    def ends_alone(self) -> bool:
        """Whether the mount itself ends :meth:`move`, as each ends pulses and gotos, if this program fails."""

    @property
    def lag_s(self) -> float:
        """How old a place may be that it tells, seconds: a server repeats what it last asked its mount for."""

    @property
    def lacks(self) -> Mapping[Ability, str]:
        """What it cannot do, each with the reason in one sentence."""

    @property
    def missed(self) -> int:
        """How many questions it has left unanswered so far: meanwhile it may have been without power."""

    def identify(self) -> str:
        """The mount's own name and version."""

    def position(self) -> Pointing:
        """Where it says it points."""

    def state(self) -> MountState:
        """Slewing, parked, aligned, tracking, and the side of the pier."""

    def altaz_deg(self) -> tuple[float, float] | None:
        """Altitude and azimuth, which some count from south; None when not reported."""

    def site_report(self) -> SiteReport:
        """The site and time it uses, as far as it reports them."""

    def set_site(self, site: Site) -> None:
        """Let it use this site."""

    def set_clock(self, now: datetime) -> None:
        """Set its clock and its zone to a local time, whose zone is of whole hours."""

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Set its coordinates to these; nothing moves."""

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Begin a slew; returns as soon as the mount has accepted it."""

    def stop(self) -> None:
        """Stop every motion but tracking, now."""

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """Guide for a bounded time at the guide rate; returns at once."""

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """Move at the nearest rate the mount has, and stop after ``seconds`` at the latest."""

    def track(self, rate: TrackingRate) -> None:
        """Track at this rate, or stop tracking."""

    def park(self) -> None:
        """Begin to go to the park position that is set in the mount; there it stays."""

    def park_altitude_deg(self) -> float | None:
        """How high it points when parked; None when not reported."""

    def unpark(self) -> None:
        """Be ready to move again."""

    def go_home(self) -> None:
        """Begin to go to the mount's own home."""

    def close(self) -> None:
        """Stop what moves and give the port back; never raises."""


SIDEREAL_DAY_S = 86164.0905  # a turn of the Earth against the equinox; against the stars it takes 8 ms longer
SIDEREAL_DEG_S = 360.0 / SIDEREAL_DAY_S
SIDEREAL_RAD_S = radians(SIDEREAL_DEG_S)
