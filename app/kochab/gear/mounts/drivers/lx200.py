"""The LX200 family: classic, Autostar, 10micron, OnStep and OnStepX."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime

from kochab.core.attitude import apart_deg
from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Ability, Direction, MountState, Pointing, SiteReport
from kochab.gear.mounts.coordinates import utc_of
from kochab.gear.mounts.drivers.serial_mount import ALIGNED_BY_CLOCK, SerialMount
from kochab.gear.mounts.protocols import lx200 as protocol
from kochab.gear.mounts.protocols import parse_accepted
from kochab.gear.mounts.serial_line import Command, ProtocolError, SerialLink, until

PRODUCT_S = 1.0  # a classic does not know the question and stays silent
BOOT_TRIES = 10  # opening the port resets an OnStep on an ESP32, which then is silent for about 8 s
SAME_DEG = 0.1  # a target in low precision is rounded to 0.025 deg


@dataclass(frozen=True, slots=True)
class Dialect:
    """What differs between the members of the family."""

    title: str
    pulse: bool = True
    status: bytes = b""  # reports tracking and more, as ``parse`` reads it
    parse: Callable[[bytes], MountState] = protocol.parse_scope_status
    precise: bytes = protocol.TOGGLE_PRECISION
    commands: Mapping[Ability, bytes] = field(default_factory=dict)  # to track, park and go home


CLASSIC = Dialect("Meade LX200 classic", pulse=False)
AUTOSTAR = Dialect("Meade Autostar", status=b":GW#", commands=protocol.AUTOSTAR_COMMANDS)
TEN_MICRON = Dialect(
    "10micron", status=b":Gstat#", parse=protocol.parse_10micron, precise=b":U1#", commands=protocol.TEN_MICRON_COMMANDS
)
CLONE = Dialect("LX200 compatible mount")

AUTOSTARS = ("autostar", "audiostar", "lx2001", "lx200gps", "etx", "rcx")
DIALECTS = {"10micron": TEN_MICRON, **dict.fromkeys(AUTOSTARS, AUTOSTAR)}
"""Part of the product's name, lower case -> its dialect."""


class Lx200(SerialMount):
    """A mount that speaks Meade's LX200 language."""

    name = "lx200"
    title = "Meade LX200, Autostar, 10micron and compatible"
    blind_stop = b"#:Q#"
    rates_deg_s = (2 * SIDEREAL_DEG_S, 32 * SIDEREAL_DEG_S, 2.0, 6.0)
    rate_commands = (b":RG#", b":RC#", b":RM#", b":RS#")
    parking = False

    def start(self) -> None:
        """Find the dialect, and ask for the longer form of coordinates."""
        self.product = self.ask_product()
        self.dialect = self.find_dialect()
        self.reads_back = self.dialect in (CLASSIC, CLONE)  # its target; the others take it without a space
        self.tells_status = self.dialect is CLASSIC or bool(self.dialect.status)
        self.refine()
        if not self.dialect.pulse:
            self._lacks[Ability.PULSE] = "The classic LX200 has no guide pulse."
        title = self.dialect.title
        self.use_commands(self.dialect.commands, f"Kochab knows no such command of the {title}: use its hand control.")
        if Ability.TRACKING in self._lacks:
            self._lacks[Ability.TRACKING] = f"The {title} cannot stop tracking without losing its alignment."
        if self.dialect is AUTOSTAR:
            self._lacks[Ability.UNPARK] = f"A parked {title} does not answer: switch it off and on."

    def ask_product(self) -> str:
        """The product's name, or nothing."""
        try:
            return self.talk.ask(protocol.PRODUCT, until(b"#", 40, PRODUCT_S), protocol.parse_text)
        except NoAnswerError:
            return ""

    def find_dialect(self) -> Dialect:
        """By the product's name; no name is a classic."""
        plain = self.product.lower().replace(" ", "")
        found = next((d for key, d in DIALECTS.items() if key in plain), None)
        return found or (CLONE if self.product else CLASSIC)

    def refine(self) -> None:
        """``:U#`` toggles: read, toggle only when coarse, read again."""
        if self.query(protocol.GET_RA, protocol.parse_coarse):
            self.talk.send(self.dialect.precise)
            self.query(protocol.GET_RA, protocol.parse_ra)  # the toggle itself is not answered

    def identify(self) -> str:
        """The product's name where it has one."""
        return self.product or self.dialect.title

    def position(self) -> Pointing:
        """Where it says it points."""
        self.watchdog.check()
        ra = self.query(protocol.GET_RA, protocol.parse_ra)
        return Pointing(ra, self.query(protocol.GET_DEC, protocol.parse_dec), self.epoch)

    def altaz_deg(self) -> tuple[float, float]:
        """Altitude and azimuth, which some count from south."""
        return self.query(protocol.ALTITUDE, protocol.parse_dec), self.query(protocol.AZIMUTH, protocol.parse_azimuth)

    def state(self) -> MountState:
        """Slewing from the distance bars, the rest where the dialect reports it."""
        try:
            slewing = self.query(protocol.BARS, protocol.parse_slewing)
        except ProtocolError:
            raise
        except NoAnswerError:
            if not self.parking:
                raise
            return MountState(slewing=False, parked=True)  # an Autostar that has parked is silent
        status = self.read_status() if self.tells_status else MountState()
        return replace(status, slewing=slewing or bool(status.slewing))

    def read_status(self) -> MountState:
        """Without the slew; a mount that does not know the question is asked once (LX200GPS 4.0g, Gemini)."""
        ask = self.talk.query
        try:
            if self.dialect.status:
                return ask(self.dialect.status, self.reply(), self.dialect.parse, again=NoAnswerError)
            letter = ask(protocol.ALIGNMENT, self.reply(1), protocol.parse_alignment, again=NoAnswerError)
            return MountState(aligned=letter != "L")
        except ProtocolError:
            raise
        except NoAnswerError:
            self.tells_status = False
            return MountState()

    def site_report(self) -> SiteReport:
        """Site, zone and clock."""
        latitude = self.query(protocol.LATITUDE, protocol.parse_dec)
        site = Site(latitude, self.query(protocol.LONGITUDE, protocol.parse_longitude))
        offset = self.query(protocol.ZONE, protocol.parse_zone)
        date = self.query(protocol.DATE, protocol.parse_date)
        time = self.query(protocol.TIME, protocol.parse_time)
        try:
            return SiteReport(site, utc_of(*date, *time, offset), offset)
        except ValueError:
            return SiteReport(site, None, offset)

    def set_site(self, site: Site) -> None:
        """``:St`` and ``:Sg``."""
        for command in protocol.set_site(site):
            self.require_accepted(command, "The mount does not accept this site.")

    def set_clock(self, now: datetime) -> None:
        """Zone, time and date, after which a Meade tells in two texts that it reckons the planets anew."""
        if self.dialect is AUTOSTAR and self.read_status().aligned:
            raise RefusedError(ALIGNED_BY_CLOCK)
        for command in protocol.set_clock(now):
            self.require_accepted(command, "The mount does not accept this time.")
        self.talk.link.discard(PRODUCT_S)

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then match it."""
        self.set_target(ra_deg, dec_deg)
        reason = self.talk.ask(protocol.SYNC, self.reply(), protocol.parse_sync)
        if reason:
            raise RefusedError(f"The mount refuses the sync: {reason}.")

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then slew."""
        since = self.talk.stops
        self.set_target(ra_deg, dec_deg)
        reason = self.talk.ask(protocol.SLEW, self.read_slew, protocol.parse_slew, since)
        if reason:
            raise RefusedError(f"The mount refuses to go there: {reason.rstrip('.')}.")

    def set_target(self, ra_deg: float, dec_deg: float) -> None:
        """``:Sr`` and ``:Sd``; some mounts want a space after them, and the FS2 takes another target without."""
        self.send_target(ra_deg, dec_deg, (False, True))
        if not self.holds_target(ra_deg, dec_deg):
            self.send_target(ra_deg, dec_deg, (True,))
            if not self.holds_target(ra_deg, dec_deg):
                raise RefusedError("The mount takes another target than it is sent.")

    def send_target(self, ra_deg: float, dec_deg: float, spaces: tuple[bool, ...]) -> None:
        """Both coordinates, in the first form that it accepts."""
        for setter, value in ((protocol.set_ra, ra_deg), (protocol.set_dec, dec_deg)):
            if not any(self.talk.ask(setter(value, space), self.reply(1), parse_accepted) for space in spaces):
                raise RefusedError("The mount does not accept these coordinates.")

    def holds_target(self, ra_deg: float, dec_deg: float) -> bool:
        """Whether it reads back the target, as far as it answers that."""
        if not self.reads_back:
            return True
        try:
            ra = self.query(protocol.GET_TARGET_RA, protocol.parse_ra)
            return (
                apart_deg((ra, self.query(protocol.GET_TARGET_DEC, protocol.parse_dec)), (ra_deg, dec_deg)) < SAME_DEG
            )
        except NoAnswerError:
            self.reads_back = False
            return True

    def read_slew(self, link: SerialLink) -> bytes:
        """``0``, or a digit with a text that some leave out."""
        first = link.read_exact(1, self.timeout_s)
        if first not in b"123456789e":
            return first
        try:
            return first + link.read_until(b"#", 64, 0.5)
        except NoAnswerError:
            return first

    def stop_commands(self, moved: bool) -> list[Command]:
        """``:Q#`` ends slews and moves alike."""
        return [(protocol.STOP, ())]

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The mount itself ends it."""
        self.require(Ability.PULSE)
        self.talk.send(protocol.pulse(direction, milliseconds))

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the nearest of four rates."""
        since = self.talk.stops
        self.talk.send(self.rate_commands[self.nearest_rate(rate_deg_s)])
        self.bounded(direction, seconds, (protocol.halt(direction), ()))
        self.talk.send(protocol.move(direction), since)

    def switch(self, ability: Ability) -> None:
        """Not answered by these mounts."""
        self.require(ability)
        self.talk.send(self.commands[ability])
        self.parking = ability is Ability.PARK and self.dialect is AUTOSTAR


# OnStep and OnStepX: LX200 with a status word, refusals by number, and tracking on and off.

ON_STEP = Dialect("OnStep", commands=protocol.ON_STEP_COMMANDS)


class OnStep(Lx200):
    """A mount with Howard Dutton's OnStep."""

    name = "onstep"
    title = "OnStep and OnStepX"
    bauds = (9600, 115200)
    rates_deg_s = (SIDEREAL_DEG_S, 8 * SIDEREAL_DEG_S, 20 * SIDEREAL_DEG_S, 48 * SIDEREAL_DEG_S)
    rate_commands = (b":RG#", b":RC#", b":RM#", b":R7#")

    def ask_product(self) -> str:
        """The product's name, also of a board that has just been reset."""
        return next(filter(None, (super(OnStep, self).ask_product() for _ in range(BOOT_TRIES))), "")

    def find_dialect(self) -> Dialect:
        """It names itself ``On-Step`` or ``OnStepX``."""
        if "onstep" not in self.product.lower().replace("-", ""):
            name = f"calls itself {self.product}" if self.product else "does not give its name"
            raise NoAnswerError(f"The device on {self.talk.link.port} {name}: not an OnStep, or wrong baud rate.")
        return ON_STEP

    def state(self) -> MountState:
        """Everything from ``:GU#``."""
        return self.query(protocol.STATUS, protocol.parse_flags)

    def switch(self, ability: Ability) -> None:
        """Answered by 1 or 0, but for the way home."""
        if ability is Ability.HOME:
            super().switch(ability)
        else:
            super(Lx200, self).switch(ability)
