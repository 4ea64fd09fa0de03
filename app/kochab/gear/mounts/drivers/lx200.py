"""The LX200 family: one driver, which speaks the dialects of the table."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from datetime import datetime
from typing import ClassVar, TypeVar

from kochab.core.attitude import apart_deg
from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, MountState, Pointing, SiteReport
from kochab.gear.mounts.coordinates import utc_of
from kochab.gear.mounts.drivers.lx200_dialects import AUTOSTAR, CLASSIC, CLONE, DIALECTS, Dialect, Question, named
from kochab.gear.mounts.drivers.serial_mount import ALIGNED_BY_CLOCK, SerialMount
from kochab.gear.mounts.protocols import lx200 as protocol
from kochab.gear.mounts.serial_line import Command, ProtocolError, SerialLink, until
from kochab.text.translation import tr, tr_noop

T = TypeVar("T")
PRODUCT_S = 1.0  # a classic doesn't know the question and stays silent
SAME_DEG = 0.1  # a target in low precision is rounded to 0.025 deg


NO_PULSE = tr_noop("The {mount} has no guide pulse that Kochab could send.")
NO_COMMAND = tr_noop("The {mount} has no command to {what}: use its hand control.")
NOT_KNOWN = tr_noop("Kochab knows no such command of the {mount}: use its hand control.")
PARKED = tr_noop("A parked {mount} does not answer: switch it off and on.")
OTHER_NAME = tr_noop(
    "The device on {port} calls itself {name}, and the driver {driver} is for {title}: choose another driver or baud"
    " rate."
)
NO_NAME = tr_noop(
    "The device on {port} does not give its name, and the driver {driver} is for {title}: choose another driver or baud"
    " rate."
)


class Lx200(SerialMount):
    """A mount that speaks Meade's LX200 language; the dialect is found by the name that it gives."""

    name = "lx200"
    title = "Meade LX200, Autostar and compatible"
    blind_stop = b"#:Q#"
    rates_deg_s = tuple(CLONE.rates.values())
    tcp_port: ClassVar[int | None] = 4030  # of a SkyFi
    only: ClassVar[Dialect | None] = None
    parking = False
    _missed_before_park = 0
    _mute = False  # an Autostar that has parked

    def start(self) -> None:
        """Find the dialect, and ask for the longer form of coordinates."""
        self.dialect = self.find_dialect()
        row = self.dialect
        self.rates_deg_s = tuple(row.rates.values()) if row.rates_known else ()
        self.reads_back, self.unanswered = row.reads_back, set[bytes]()
        # Asked only where the precision or the pulses depend on it.
        version = self.ask_version() if row.fine_since or row.pulse_since else ()
        fine = version >= row.fine_since  # an empty fine_since admits every version
        self.places = row.places if fine else (protocol.GET_RA, protocol.GET_DEC)
        self.decimals = row.decimals if fine else 0
        self.refine()
        if not row.longest_pulse_ms or version < row.pulse_since:
            self._lacks[Ability.PULSE] = tr(NO_PULSE, mount=row.title)
        site = dict.fromkeys((Ability.SITE, Ability.TIME), row.tells_site)
        site |= dict.fromkeys((Ability.SET_SITE, Ability.SET_CLOCK), row.takes_site)
        self._lacks |= {one: tr(NO_COMMAND, what=tr(one), mount=row.title) for one, can in site.items() if not can}
        self.use_commands(row.commands, tr(NOT_KNOWN, mount=row.title))
        if Ability.TRACKING in self._lacks:
            why = tr("The {mount} cannot stop tracking without losing its alignment.", mount=row.title)
            self._lacks[Ability.TRACKING] = why
        if row is AUTOSTAR:
            self._lacks[Ability.UNPARK] = tr(PARKED, mount=row.title)

    def find_dialect(self) -> Dialect:
        """The one that was chosen, or by the product's name; no name is a classic."""
        if self.only is None:
            self.product = self.ask_product(protocol.PRODUCT)
            plain = self.product.lower().replace(" ", "")
            meade = AUTOSTAR if any(part in plain for part in AUTOSTAR.names) else CLONE
            return DIALECTS.get(named(self.product), meade) if self.product else CLASSIC
        row = self.only
        tries = (self.ask_product(row.who) for _ in range(row.boot_s))  # each waits PRODUCT_S, 1 s
        self.product = next(filter(None, tries), "").lstrip("0")  # a booting board may answer "0" first
        if not self.product or (row.who == protocol.PRODUCT and DIALECTS.get(named(self.product)) is not row):
            raise NoAnswerError(
                OTHER_NAME if self.product else NO_NAME,
                port=self.talk.link.port,
                name=self.product,
                driver=self.name,
                title=row.title,
            )
        return row

    def ask_product(self, question: bytes) -> str:
        """The product's name, or nothing."""
        try:
            return self.talk.ask(question, until(b"#", 40, PRODUCT_S), protocol.parse_text)
        except NoAnswerError:
            return ""

    def ask_version(self) -> tuple[int, ...]:
        """Of the firmware: (10, 24) of ``10.24i``."""
        return protocol.version_of(self.ask_product(protocol.VERSION))

    def refine(self) -> None:
        """``:U#`` toggles: read, toggle only when coarse, read again."""
        if self.query(self.places[0], protocol.parse_coarse):
            self.talk.send(self.dialect.precise)
            self.query(self.places[0], protocol.parse_ra)  # the toggle itself is not answered

    def query(self, command: bytes, parse: Callable[[bytes], T], size: int = 0) -> T:
        """Answer to a question, which some begin with the question itself."""
        return super().query(command, self.plain(command, parse), size)

    def plain(self, command: bytes, parse: Callable[[bytes], T]) -> Callable[[bytes], T]:
        """``parse`` of an answer that may begin with its question."""
        echo = command.rstrip(b"#") if self.dialect.echoes else b""

        def read(reply: bytes) -> T:
            if not reply.startswith(echo):
                raise ProtocolError("{reply!r} is no answer to {command!r}.", reply=reply, command=command)
            return parse(reply.removeprefix(echo))

        return read

    def identify(self) -> str:
        """The product's name where it has one."""
        if self.dialect.who != protocol.PRODUCT:
            return f"{self.dialect.title} {self.product.removeprefix(':AV')}"
        return self.product or self.dialect.title

    def position(self) -> Pointing:
        """Where it says it points."""
        self.watchdog.check()
        if self._mute:
            raise NoAnswerError(PARKED, mount=self.dialect.title)
        ra = self.query(self.places[0], protocol.parse_ra)
        return Pointing(ra, self.query(self.places[1], protocol.parse_dec), self.epoch)

    def altaz_deg(self) -> tuple[float, float]:
        """Altitude and azimuth, which some count from south."""
        return self.query(protocol.ALTITUDE, protocol.parse_dec), self.query(protocol.AZIMUTH, protocol.parse_azimuth)

    def state(self) -> MountState:
        """What the dialect's questions tell."""
        (command, size, parse), *others = self.dialect.questions
        try:
            found = self.query(command, parse, size)
        except ProtocolError:  # a garbled answer is not the silence of a parked mount
            raise
        except NoAnswerError:
            if not self.parking:
                raise
            self.talk.missed, self._mute = self._missed_before_park, True
            return MountState(slewing=False, parked=True)  # an Autostar that has parked is silent
        self._mute = False
        for question in others:
            found = with_more(found, self.ask_more(question))
        return found

    def ask_more(self, question: Question) -> MountState:
        """A mount that does not know this question is asked once (LX200GPS 4.0g)."""
        command, size, parse = question
        if command in self.unanswered:
            return MountState()
        try:
            return self.talk.query(command, self.reply(size), self.plain(command, parse), again=NoAnswerError)
        except ProtocolError:
            raise
        except NoAnswerError:
            self.unanswered.add(command)
            return MountState()

    def site_report(self) -> SiteReport:
        """Site, zone and clock."""
        if not self.dialect.tells_site:
            return SiteReport()
        latitude = self.query(protocol.LATITUDE, protocol.parse_dec)
        site = Site(latitude, self.query(protocol.LONGITUDE, protocol.parse_longitude))
        offset = self.query(protocol.ZONE, protocol.parse_zone)
        date = self.query(protocol.DATE, protocol.parse_date)
        time = self.query(protocol.TIME, protocol.parse_time)
        start = self.ask_last_start()
        try:
            return SiteReport(site, utc_of(*date, *time, offset), offset, start)
        # Every number is in range, but there is no such day.
        except ValueError:
            return SiteReport(site, None, offset, start)

    def ask_last_start(self) -> str | None:
        """What it says of its last start; an old firmware does not know the question, and is asked once."""
        if self.dialect.last_start is None or self.dialect.last_start[0] in self.unanswered:
            return None
        command, parse = self.dialect.last_start
        missed = self.talk.missed
        try:
            return self.talk.ask(command, self.read_short, parse)
        except NoAnswerError:
            self.unanswered.add(command)
            self.talk.missed = missed
            return None

    def set_site(self, site: Site) -> None:
        """``:St`` and ``:Sg``."""
        self.require(Ability.SET_SITE)
        for command in protocol.set_site(site):
            self.require_accepted(command, tr_noop("The mount does not accept this site."))

    def set_clock(self, now: datetime) -> None:
        """Set zone, time and date; a Meade then sends two texts about updating its planetary data."""
        self.require(Ability.SET_CLOCK)
        if self.dialect is AUTOSTAR and self.ask_more(AUTOSTAR.questions[-1]).aligned:
            raise RefusedError(ALIGNED_BY_CLOCK)
        for command in protocol.set_clock(now):
            self.require_accepted(command, tr_noop("The mount does not accept this time."))
        # "Updating Planetary Data#" and a second, blank text would be taken for the next replies.
        self.talk.link.discard(PRODUCT_S)

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then match it; or both at once, which is not answered."""
        # Only the Rainbow. Rounded before the modulo, so that 359.9999 is sent as 0 and not as 360.
        if b"%" in self.dialect.sync:
            self.talk.send(self.dialect.sync % (round(ra_deg, 3) % 360.0, dec_deg))
            return
        self.set_target(ra_deg, dec_deg)
        refusals = self.dialect.refusals
        reason = self.talk.ask(self.dialect.sync, self.reply(), lambda reply: protocol.parse_sync(reply, refusals))
        if reason:
            raise RefusedError("The mount refuses the sync: {reason}.", reason=tr(reason))

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then slew."""
        since = self.talk.stops  # a Stop while the target is set wins
        self.set_target(ra_deg, dec_deg)
        if not self.dialect.slew_answered:
            self.talk.send(protocol.SLEW, since)
            return
        refusals = self.dialect.refusals
        reason = self.talk.ask(protocol.SLEW, self.read_slew, lambda reply: protocol.parse_slew(reply, refusals), since)
        if reason:
            raise RefusedError("The mount refuses to go there: {reason}.", reason=tr(reason).rstrip("."))

    def set_target(self, ra_deg: float, dec_deg: float) -> None:
        """``:Sr`` and ``:Sd``; some mounts want a space after them, and the FS2 takes another target without."""
        self.send_target(ra_deg, dec_deg, self.dialect.spaces)
        if not self.holds_target(ra_deg, dec_deg):
            self.send_target(ra_deg, dec_deg, (True,))
            if not self.holds_target(ra_deg, dec_deg):
                raise RefusedError("Mount stored a different target than Kochab sent.")

    def send_target(self, ra_deg: float, dec_deg: float, spaces: tuple[bool, ...]) -> None:
        """Both coordinates, in the first form that it accepts."""
        fine = self.decimals, max(0, self.decimals - 1)  # an arcsecond is a fifteenth of a second of time
        for setter, value, decimals in ((protocol.set_ra, ra_deg, fine[0]), (protocol.set_dec, dec_deg, fine[1])):
            if not any(self.takes(setter(value, space, decimals)) for space in spaces):
                raise RefusedError("The mount does not accept these coordinates.")

    def takes(self, command: bytes) -> bool:
        """Whether a part of the target is accepted; ZWO's ``e2#`` is longer than a digit."""
        return self.talk.ask(command, self.read_set, protocol.parse_set)

    def read_set(self, link: SerialLink) -> bytes:
        """A digit, or ``e`` with a number."""
        # ZWO refuses with "e2#": read to its end, or the rest would be taken for the next reply.
        first = link.read_exact(1, self.timeout_s)
        return first if first != b"e" else first + link.read_until(b"#", 3, self.timeout_s)

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
            # It does not know the question: don't ask it again.
            self.reads_back = False
            return True

    def read_short(self, link: SerialLink) -> bytes:
        """A digit, after which some send ``#``."""
        first = link.read_exact(1, PRODUCT_S)
        with suppress(NoAnswerError):
            return first + link.read_until(b"#", 8, 0.2)
        return first

    def read_slew(self, link: SerialLink) -> bytes:
        """``0``, or a digit with a text that some leave out."""
        first = link.read_exact(1, self.timeout_s)
        if first not in b"123456789e":
            return first
        try:
            # A Meade adds a text and "#", OnStep sends the digit alone: wait only briefly for the rest.
            return first + link.read_until(b"#", 64, 0.5)
        except NoAnswerError:
            return first

    def stop_commands(self) -> list[Command]:
        """``:Q#`` ends slews and moves alike."""
        return [(protocol.STOP, ())]

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The mount itself ends it; the longest that it can."""
        self.require(Ability.PULSE)
        bounded = min(max(milliseconds, 1), self.dialect.longest_pulse_ms)
        self.talk.send(self.dialect.pulse % (direction.value[0].encode(), bounded))

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the nearest of its rates."""
        since, rates = self.talk.stops, self.dialect.rates
        self.talk.send(min(rates, key=lambda command: abs(rates[command] - rate_deg_s)))
        # End this axis alone where the make can: the other may be moving too.
        halt = protocol.halt(direction) if self.dialect.halts_axes else protocol.STOP
        with self.bounded(direction, seconds, (halt, ())):
            self.talk.send(protocol.move(direction), since)

    def switch(self, ability: Ability) -> None:
        """Answered by 1 or 0, or not at all."""
        if ability in self.dialect.answered:
            super().switch(ability)
            return
        self.require(ability)
        self.talk.send(self.commands[ability])
        self.parking = ability is Ability.PARK and self.dialect is AUTOSTAR
        self._missed_before_park = self.talk.missed


def with_more(found: MountState, more: MountState) -> MountState:
    """What the first answer leaves open is told by the second; either may say that it slews."""
    known = {name: value for name, value in asdict(found).items() if value is not None}
    return MountState(**asdict(more) | known | ({"slewing": True} if more.slewing else {}))


def speaking(driver: str) -> type[Lx200]:
    """The driver of one row of the table, which finds this make only."""
    row = DIALECTS[driver]

    class Speaking(Lx200):
        name, title, bauds, tcp_port, only = driver, row.title, row.bauds, row.tcp_port, row
        rates_deg_s = tuple(row.rates.values()) if row.rates_known else ()

    return Speaking


OnStep, TenMicron, Am5, Nyx, TeenAstro, AstroPhysics, Gemini, Rainbow = map(speaking, DIALECTS)
