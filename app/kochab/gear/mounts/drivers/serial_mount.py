"""The base of all drivers over a line: questions, bounded motions, Stop and close."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from datetime import datetime
from types import MappingProxyType
from typing import ClassVar, TypeVar, Unpack

from kochab.core.errors import DeviceError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, Epoch, SiteReport, TrackingRate
from kochab.gear.journal import utc_now
from kochab.gear.mounts import MountSettings
from kochab.gear.mounts.emergency_stop import Watchdog
from kochab.gear.mounts.protocols import parse_accepted
from kochab.gear.mounts.serial_line import Command, Conversation, Reader, SerialLink, exactly, until
from kochab.text.translation import tr, tr_noop

T = TypeVar("T")
RESTING = (Ability.PARK, Ability.UNPARK, Ability.HOME)
ALIGNED_BY_CLOCK = tr_noop(
    "The mount was aligned on stars with its present clock and site. If it points right, say that the mount is right;"
    " if not, switch it off and on, set them, and align it again."
)
STOP_S = 1.0  # without its answer in so long a Stop is sent again; mounts answer in some hundredths
LONGEST_REPLY = 64  # the longest are texts, such as why an LX200 refuses a slew


class SerialMount:
    """The common half of a driver; a driver adds the commands of its protocol."""

    name: ClassVar[str]
    title: ClassVar[str]
    bauds: ClassVar[tuple[int, ...]] = (9600,)
    tcp_port: ClassVar[int | None] = None  # of its Wi-Fi or its usual adapter
    default_epoch: ClassVar[Epoch] = Epoch.DATE
    timeout_s: ClassVar[float] = 4.5  # so that silence in a slew is told within 5 s
    blind_stop: ClassVar[bytes]
    ends_alone: ClassVar[bool] = False
    rates_deg_s: tuple[float, ...] = ()
    lag_s: ClassVar[float] = 0.0  # each question goes to the mount itself

    def __init__(self, link: SerialLink, **settings: Unpack[MountSettings]) -> None:
        self.epoch = settings.get("epoch") or self.default_epoch
        self.site = settings.get("site")
        self.clock = settings.get("clock") or utc_now
        self.home = settings.get("home")
        self.equatorial = settings.get("equatorial", False)
        self.kept = settings.get("kept")
        self.talk = Conversation(link)
        self.watchdog = Watchdog()
        self._lacks: dict[Ability, str] = {}
        self.start()

    def start(self) -> None:
        """Find out what is there; nothing may move."""

    def use_commands(self, commands: Mapping[Ability, bytes], otherwise: str) -> None:
        """Track, park and go home by these commands; ``otherwise`` is why it can't where there is none."""
        self.commands = commands
        switched = (*(rate.ability for rate in TrackingRate), *RESTING)
        self._lacks |= {ability: otherwise for ability in switched if ability not in commands}

    def switch(self, ability: Ability) -> None:
        """Send the command for this ability; the mount answers 1 when it accepts it."""
        self.require(ability)
        self.require_accepted(self.commands[ability], tr("The mount refuses this command: {what}.", what=tr(ability)))

    def track(self, rate: TrackingRate) -> None:
        """Track at this rate, or stop tracking."""
        self.switch(rate.ability)

    def park(self) -> None:
        """Begin to go to its park position."""
        self.switch(Ability.PARK)

    def park_altitude_deg(self) -> float | None:
        """These do not report it."""
        return None

    def unpark(self) -> None:
        """Unpark it, so that it can move again."""
        self.switch(Ability.UNPARK)

    def go_home(self) -> None:
        """Begin to go home."""
        self.switch(Ability.HOME)

    @property
    def lacks(self) -> Mapping[Ability, str]:
        """What it cannot do, each with the reason."""
        return MappingProxyType(self._lacks)

    @property
    def missed(self) -> int:
        """How many questions it has left unanswered."""
        return self.talk.missed

    def altaz_deg(self) -> tuple[float, float] | None:
        """Altitude and azimuth where it reports them."""
        return None

    def site_report(self) -> SiteReport:
        """The site and time it uses, where it reports them."""
        return SiteReport()

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """Guide for a bounded time."""
        raise RefusedError(self._lacks[Ability.PULSE])

    def set_site(self, site: Site) -> None:
        """Let it use this site."""
        raise RefusedError(self._lacks[Ability.SET_SITE])

    def set_clock(self, now: datetime) -> None:
        """Set its clock and zone."""
        raise RefusedError(self._lacks[Ability.SET_CLOCK])

    def stop(self) -> None:
        """Stop every motion, from any thread; the answers are read later."""
        self.talk.stopping()  # holds back every other exchange until Stop is on the line
        try:
            self.watchdog.disarm()
            self.talk.send_now(*self.stop_commands())
        finally:
            self.talk.stopped()

    def stop_commands(self) -> list[Command]:
        """The bytes of Stop, which end slews and moves, and how their answers are read."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop a bounded motion that still runs, and give the port back."""
        # The motion's timer dies with the program, and its end would never be sent.
        if self.watchdog.moving:
            with suppress(DeviceError):
                self.stop()
                self.talk.read_pending()
        self.watchdog.disarm()
        self.talk.link.close()

    def reply(self, size: int = 0) -> Reader:
        """Reader of ``size`` bytes; without a size up to ``#``."""
        return exactly(size, self.timeout_s) if size else until(b"#", LONGEST_REPLY, self.timeout_s)

    def stop_reply(self, size: int = 0) -> Reader:
        """The same of a Stop, which a mount that has heard it answers at once."""
        return exactly(size, STOP_S) if size else until(b"#", LONGEST_REPLY, STOP_S)

    def query(self, command: bytes, parse: Callable[[bytes], T], size: int = 0) -> T:
        """Answer to a question, which is repeated when the answer makes no sense."""
        return self.talk.query(command, self.reply(size), parse)

    def require_accepted(self, command: bytes, refusal: str, since: int | None = None) -> None:
        """Send a command that is answered by 1, or by 0 when the mount refuses it."""
        if not self.talk.ask(command, self.reply(1), parse_accepted, since):
            raise RefusedError(refusal)

    def require(self, ability: Ability) -> None:
        """Raise the reason when the mount cannot do this."""
        if ability in self._lacks:
            raise RefusedError(self._lacks[ability])

    def nearest_rate(self, rate_deg_s: float) -> int:
        """Index of the rate nearest to the one asked for."""
        return min(range(len(self.rates_deg_s)), key=lambda i: abs(self.rates_deg_s[i] - rate_deg_s))

    def bounded(self, direction: Direction, seconds: float, *halt: Command) -> AbstractContextManager[None]:
        """Within, a motion begins that is ended after ``seconds`` by these commands."""
        self.watchdog.check()
        # One timer an axis: a new move replaces that of the same axis and leaves the other alone.
        axis = "dec" if direction.in_dec else "ra"

        def end() -> None:
            self.talk.send_now(*halt)
            # Over UDP the halt itself may be lost: it is sent until it is answered.
            if self.talk.link.lossy:
                self.talk.read_pending()

        return self.watchdog.bounding(axis, seconds, end)
