"""The LX200 family: classic, Autostar and 10micron, told apart by ``:GVP#``."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from app.core.earth import SIDEREAL_DEG_S
from app.core.errors import NoAnswerError, RefusedError
from app.core.hint import Site
from app.core.mount import Ability, Direction, MountState, Pointing
from app.mounts.beliefs import Beliefs, utc_of
from app.mounts.conversation import Reader, exactly, until
from app.mounts.drivers.base import SerialMount
from app.mounts.link import Link
from app.mounts.protocols import lx200 as words
from app.mounts.protocols import lx200_place as where

T = TypeVar("T")
PRODUCT_S = 1.0  # a classic does not know the question and stays silent


@dataclass(frozen=True, slots=True)
class Dialect:
    """What differs between the members of the family."""

    title: str
    pulse: bool = True
    status: bytes = b""  # tells tracking and alignment
    precise: bytes = words.TOGGLE_PRECISION
    track: tuple[bytes, bytes] | None = None  # off, on


CLASSIC = Dialect("Meade LX200 classic", pulse=False)
AUTOSTAR = Dialect("Meade Autostar", status=b":GW#")
TEN_MICRON = Dialect("10micron", precise=b":U1#", track=(b":AL#", b":AP#"))
CLONE = Dialect("LX200 compatible mount")

DIALECTS = {
    "autostar": AUTOSTAR, "audiostar": AUTOSTAR, "lx2001": AUTOSTAR, "lx200gps": AUTOSTAR,
    "etx": AUTOSTAR, "rcx": AUTOSTAR, "10micron": TEN_MICRON,
}  # fmt: skip
"""Part of the product's name, lower case -> its dialect."""


class Lx200(SerialMount):
    """A mount that speaks Meade's LX200 language."""

    name = "lx200"
    title = "Meade LX200, Autostar, 10micron and compatible"
    blind_stop = b"#:Q#"
    rates_deg_s = (2 * SIDEREAL_DEG_S, 32 * SIDEREAL_DEG_S, 2.0, 6.0)
    rate_words = (b":RG#", b":RC#", b":RM#", b":RS#")

    def start(self) -> None:
        """Find the dialect, and ask for the longer form of coordinates."""
        self.product = self.ask_product()
        self.dialect = self.find_dialect()
        self.refine()
        if not self.dialect.pulse:
            self._lacks[Ability.PULSE] = "The classic LX200 has no guide pulse in its language."
        if self.dialect.track is None:
            self._lacks[Ability.TRACKING] = (
                f"The {self.dialect.title} cannot be told to stop tracking without losing its "
                "alignment."
            )

    def ask_product(self) -> str:
        """The product's name, or nothing."""
        try:
            return self.talk.ask(words.PRODUCT, until(b"#", 40, PRODUCT_S), words.parse_text)
        except NoAnswerError:
            return ""

    def find_dialect(self) -> Dialect:
        """By the product's name; no name is a classic."""
        plain = self.product.lower().replace(" ", "")
        found = next((d for key, d in DIALECTS.items() if key in plain), None)
        return found or (CLONE if self.product else CLASSIC)

    def refine(self) -> None:
        """``:U#`` toggles: read, toggle only when coarse, read again."""
        reply = self.read_ra()
        if words.is_coarse(reply):
            self.talk.tell(self.dialect.precise)
            reply = self.read_ra()
        self.coarse = words.is_coarse(reply)

    def read_ra(self) -> bytes:
        """The answer to ``:GR#`` as it came, if it is one."""

        def checked(reply: bytes) -> bytes:
            words.parse_ra(reply)
            return reply

        return self.talk.query(words.GET_RA, until(b"#", 16, self.timeout_s), checked)

    def identify(self) -> str:
        """The product's name where it has one."""
        return self.product or self.dialect.title

    def position(self) -> Pointing:
        """Where it says it points."""
        self.deadman.check()
        reader = until(b"#", 16, self.timeout_s)
        ra = self.talk.query(words.GET_RA, reader, words.parse_ra)
        dec = self.talk.query(words.GET_DEC, reader, words.parse_dec)
        return Pointing(ra, dec, self.epoch)

    def horizontal_deg(self) -> tuple[float, float]:
        """Altitude and azimuth, which some count from south."""
        reader = until(b"#", 16, self.timeout_s)
        altitude = self.talk.query(where.ALTITUDE, reader, where.parse_latitude)
        return altitude, self.talk.query(where.AZIMUTH, reader, where.parse_azimuth)

    def state(self) -> MountState:
        """Slewing from the distance bars, the rest where the dialect tells."""
        slewing = self.talk.query(words.BARS, until(b"#", 40, self.timeout_s), words.parse_slewing)
        aligned = tracking = None
        if self.dialect is CLASSIC:
            reader = exactly(1, self.timeout_s)
            aligned = self.talk.query(words.ALIGNMENT, reader, words.parse_alignment) != "L"
        elif self.dialect.status:
            tracking, aligned = self.talk.query(
                self.dialect.status, until(b"#", 8, self.timeout_s), words.parse_scope_status
            )
        return MountState(slewing=slewing, aligned=aligned, tracking=tracking)

    def beliefs(self) -> Beliefs:
        """Site, zone and clock."""

        def told(command: bytes, parse: Callable[[bytes], T]) -> T:
            return self.talk.query(command, until(b"#", 20, self.timeout_s), parse)

        site = Site(
            told(where.LATITUDE, where.parse_latitude), told(where.LONGITUDE, where.parse_longitude)
        )
        offset = told(where.ZONE, where.parse_zone)
        date, time = told(where.DATE, where.parse_date), told(where.TIME, where.parse_time)
        try:
            return Beliefs(site, utc_of(*date, *time, offset), offset)
        except ValueError:
            return Beliefs(site, None, offset)

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then match it."""
        self.set_target(ra_deg, dec_deg)
        reason = self.talk.ask(words.SYNC, until(b"#", 64, self.timeout_s), words.parse_sync)
        if reason:
            raise RefusedError(f"The mount refuses the sync: {reason}.")

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then slew."""
        since = self.talk.stops
        self.set_target(ra_deg, dec_deg)
        reason = self.talk.ask(words.SLEW, self.read_slew, words.parse_slew, since)
        if reason:
            raise RefusedError(f"The mount refuses to go there: {reason.rstrip('.')}.")

    def set_target(self, ra_deg: float, dec_deg: float) -> None:
        """``:Sr`` and ``:Sd``; mounts that want a space after them are given one."""
        for setter, value in ((words.set_ra, ra_deg), (words.set_dec, dec_deg)):
            if not any(
                self.talk.ask(
                    setter(value, space), exactly(1, self.timeout_s), words.parse_accepted
                )
                for space in (False, True)
            ):
                raise RefusedError("The mount does not accept these coordinates.")

    def read_slew(self, link: Link) -> bytes:
        """``0``, or a digit with a text that some leave out."""
        first = link.read_exact(1, self.timeout_s)
        if first == b"0" or not first.isdigit():
            return first
        try:
            return first + link.read_until(b"#", 64, 0.5)
        except NoAnswerError:
            return first

    def stop_words(self, moved: bool) -> list[tuple[bytes, tuple[Reader, ...]]]:
        """``:Q#`` ends slews and moves alike."""
        return [(words.STOP, ())]

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The mount itself ends it."""
        self.need(Ability.PULSE)
        self.talk.tell(words.pulse(direction, milliseconds))

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the nearest of four rates."""
        since = self.talk.stops
        self.talk.tell(self.rate_words[self.nearest_rate(rate_deg_s)])
        self.bounded(direction, seconds, (words.halt(direction), ()))
        self.talk.tell(words.move(direction), since)

    def track(self, on: bool) -> None:
        """Where the dialect can."""
        self.need(Ability.TRACKING)
        assert self.dialect.track is not None
        self.talk.tell(self.dialect.track[on])
