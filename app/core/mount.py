"""The words everybody uses of a telescope mount: where it says it is, what it can do, how it is."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class Epoch(StrEnum):
    """The equator and equinox a mount's coordinates belong to."""

    J2000 = "J2000"
    DATE = "of date"


class Direction(StrEnum):
    """Where the telescope is moved on the sky; east is towards greater right ascension."""

    NORTH = "north"
    SOUTH = "south"
    EAST = "east"
    WEST = "west"


class PierSide(StrEnum):
    """On which side of the pier the telescope stands."""

    EAST = "east"
    WEST = "west"


class Ability(StrEnum):
    """What a mount may or may not be able to do; what it cannot is said with a reason."""

    SYNC = "sync"
    GOTO = "goto"
    STOP = "stop"
    PULSE = "guide pulse"
    MOVE = "move at a rate"
    TRACKING = "tracking on and off"
    SITE = "tell its site"
    TIME = "tell its time"


@dataclass(frozen=True, slots=True)
class Pointing:
    """Equatorial degrees, RA in [0, 360), and the epoch they belong to."""

    ra_deg: float
    dec_deg: float
    epoch: Epoch


@dataclass(frozen=True, slots=True)
class MountState:
    """How the mount is; None where its protocol does not tell."""

    slewing: bool | None = None
    parked: bool | None = None
    aligned: bool | None = None
    tracking: bool | None = None
    pier_side: PierSide | None = None


class Mount(Protocol):
    """What every driver offers. Every call blocks at most for the protocol's own time limit.

    All calls of one mount come from the one thread that owns its port, but for :meth:`stop`,
    which any thread may call at any time. Every call raises :class:`~app.core.errors.DeviceError`
    with one sentence. Coordinates are in :attr:`epoch`, which is a setting of the profile.
    """

    name: str
    epoch: Epoch

    @property
    def lacks(self) -> Mapping[Ability, str]:
        """What it cannot do, each with the reason in one sentence."""

    def identify(self) -> str:
        """The mount's own name and version."""

    def position(self) -> Pointing:
        """Where it says it points."""

    def state(self) -> MountState:
        """How it is."""

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Make it believe that it points here; nothing moves."""

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Begin a slew; returns as soon as the mount has accepted it."""

    def stop(self) -> None:
        """Stop every motion but tracking, now."""

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """Guide for a bounded time at the guide rate; returns at once."""

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """Move at the nearest rate the mount has, and stop after ``seconds`` at the latest."""

    def track(self, on: bool) -> None:
        """Sidereal tracking on or off."""

    def close(self) -> None:
        """Stop what moves and give the port back; never raises."""
