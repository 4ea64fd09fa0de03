"""NexStar hand controls (Celestron), and SynScan (Sky-Watcher), which shares their framing."""

from datetime import datetime
from math import inf
from typing import ClassVar

from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Ability, Direction, Epoch, MountState, Pointing, SiteReport, TrackingRate
from kochab.core.values import frozen
from kochab.gear.mounts.drivers.serial_mount import ALIGNED_BY_CLOCK, STOP_S, SerialMount
from kochab.gear.mounts.protocols import code_table
from kochab.gear.mounts.protocols import nexstar as protocol
from kochab.gear.mounts.serial_line import Command, SerialLink, exactly
from kochab.text.translation import tr, tr_noop

PRECISE_SINCE, MAKER_SINCE = (1, 6), (5, 28)  # the versions that introduced e, r and z; and v
VARIANT_S = 1.0
EQUATORIAL = {"CGE", "CGE Pro", "CGEM DX", "AVX", "CGX", "CGXL", "Advanced GT"}
BOARDS = protocol.AZM, protocol.ALT
HALTS = b"".join(protocol.move_fixed(board, True, 0) for board in BOARDS)
GUIDE_PERCENT, GUIDE_LONGEST_MS = 50, 2550  # of sidereal; one byte of hundredths of a second


@frozen
class HandControl:
    """What the make of a hand control decides: the versions since which it has a sync and reports the pier's side.

    In the south it has named the other side up to a version; where that is not known, none is taken from it.
    """

    sync_since: tuple[float, ...]
    pier_since: tuple[float, ...]
    reversed_in_south: tuple[float, ...] | None = None


NEXSTAR = HandControl((4, 10), (4, 15), reversed_in_south=(5, 24))
STARSENSE = HandControl((1, 18), (1, 18))
SYNSCAN = HandControl((), (inf,))  # never asked for the pier side: only newer versions report it
VARIANTS = {0x13: STARSENSE}
"""Reply to ``v``; a StarSense has version numbers of its own. Source: INDI's celestrondriver.h and celestrongps.cpp."""


class NexStar(SerialMount):
    """A mount behind a NexStar hand control, or a StarSense one, which is found."""

    name = "nexstar"
    title = "Celestron NexStar hand control"
    blind_stop = protocol.CANCEL + HALTS
    models = protocol.MODELS
    rates_deg_s = (*(k * SIDEREAL_DEG_S for k in (0.5, 1, 4, 8, 16, 64)), 0.5, 2.0, 4.0)
    cancels = 1
    tcp_port = 4030  # of a SkyFi
    control: ClassVar[HandControl] = NEXSTAR

    def start(self) -> None:
        """Read its make and version, which decide what it can do."""
        self.version = self.talk.query(protocol.VERSION, protocol.read_version(self.timeout_s), protocol.parse_version)
        self.hand_control = self.find_control()
        self.model = self.byte(protocol.MODEL)
        self._mode = 0
        tracks = dict.fromkeys((Ability.TRACKING, Ability.SIDEREAL), protocol.TRACKING)
        self.use_commands(tracks, tr("A {mount} has no command for it: use its menu.", mount=tr(self.title)))
        if self.version < self.hand_control.sync_since:
            version, needed = (
                ".".join(f"{n:02}" if i else str(n) for i, n in enumerate(v))
                for v in (self.version, self.hand_control.sync_since)
            )
            old = tr("The hand control is version {version}, a sync needs {needed}.", version=version, needed=needed)
            self._lacks[Ability.SYNC] = old

    def find_control(self) -> HandControl:
        """The variant tells it; versions between never knew the question, those before 2.0 are silent."""
        if self.control is not NEXSTAR or (2, 2) <= self.version < MAKER_SINCE:
            return self.control
        try:
            variant = self.talk.ask(protocol.VARIANT, exactly(2, VARIANT_S), protocol.parse_byte)
        except NoAnswerError:
            return self.control
        return VARIANTS.get(variant, self.control)

    def identify(self) -> str:
        """Model and version."""
        version = ".".join(f"{part:02d}" if i else str(part) for i, part in enumerate(self.version))
        model = self.models.get(self.model) or tr("model {number}", number=self.model)
        return tr("{model}, hand control {version}", model=model, version=version)

    def position(self) -> Pointing:
        """``e``, or ``E`` of old versions."""
        self.watchdog.check()
        return Pointing(*self.angles(protocol.GET_PRECISE, protocol.GET_COARSE), self.epoch)

    def altaz_deg(self) -> tuple[float, float]:
        """Altitude and azimuth: ``z``, or ``Z`` of old versions."""
        azimuth, altitude = self.angles(protocol.ALTAZ_PRECISE, protocol.ALTAZ_COARSE)
        return altitude, azimuth

    def angles(self, precise: bytes, coarse: bytes) -> tuple[float, float]:
        """Two angles, degrees, as precisely as the version can."""
        # The angles are read by their length: 8 or 4 digits each, a comma and "#".
        command, length = (precise, 18) if self.version >= PRECISE_SINCE else (coarse, 10)
        return self.query(command, protocol.parse_position, length)

    def state(self) -> MountState:
        """Slewing, aligned, tracking; the side of the pier where the version reports it, once reversed in the south."""
        control = self.hand_control
        side = self.query(protocol.PIER, protocol.parse_pier, 2) if self.version >= control.pier_since else None
        if side and self.site is not None and self.site.latitude_deg < 0.0:
            until = control.reversed_in_south
            side = None if until is None else side.opposite if self.version <= until else side
        return MountState(
            pier_side=side,
            slewing=self.query(protocol.SLEWING, protocol.parse_digit, 2),
            aligned=self.query(protocol.ALIGNED, protocol.parse_flag, 2),
            tracking=(mode := self.byte(protocol.TRACKING)) != 0,
            alt_azimuth=mode == 1 if mode else None,  # mode 0 (off) doesn't show it
        )

    def site_report(self) -> SiteReport:
        """Site, zone and clock."""
        site = self.query(protocol.SITE, protocol.parse_site, 9)
        return SiteReport(site, *self.query(protocol.TIME, protocol.parse_time, 9))

    def set_site(self, site: Site) -> None:
        """``W``, before it is aligned."""
        self._set_unaligned(protocol.set_site(site))

    def set_clock(self, now: datetime) -> None:
        """``H``, before it is aligned."""
        self._set_unaligned(protocol.set_clock(now))

    def _set_unaligned(self, command: bytes) -> None:
        if self.query(protocol.ALIGNED, protocol.parse_flag, 2):
            raise RefusedError(ALIGNED_BY_CLOCK)
        self.done(command)

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """``s``, since version 4.10."""
        self.require(Ability.SYNC)
        self.require_aligned()
        self.done(protocol.sync(ra_deg, dec_deg))

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """``r``; without an alignment it would answer and stay."""
        # Before the question below: a Stop meanwhile wins.
        since = self.talk.stops
        self.require_aligned()
        self.done(protocol.goto(ra_deg, dec_deg, self.version >= PRECISE_SINCE), since)

    def require_aligned(self) -> None:
        """Refuse on a mount that does not know the sky."""
        if not self.query(protocol.ALIGNED, protocol.parse_flag, 2):
            raise RefusedError("The mount is not aligned: do its alignment on the hand control first.")

    def stop_commands(self) -> list[Command]:
        """Cancel a goto, and end moves at a fixed rate on both axes."""
        # M cancels a goto, not a move. A move may be from before the line broke: no timer knows of it.
        return [(protocol.CANCEL, (self.stop_reply(1),))] * self.cancels + [self.halt(board) for board in BOARDS]

    def halt(self, board: int) -> Command:
        """The bytes that end a move on one axis."""
        return protocol.move_fixed(board, True, 0), (lambda link: self.read_passed(link, STOP_S),)

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The motor board ends it; a pulse too long for it runs at twice the rate for half."""
        self.require(Ability.PULSE)
        times = 2 if milliseconds > GUIDE_LONGEST_MS else 1
        board, positive = axis_of(direction)
        percent = GUIDE_PERCENT * times
        hundredths = min(max(round(milliseconds / times / 10.0), 1), 255)
        self.passed(protocol.guide(board, percent if positive else -percent, hundredths))

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the nearest of nine rates."""
        since = self.talk.stops
        board, positive = axis_of(direction)
        with self.bounded(direction, seconds, self.halt(board)):
            self.passed(protocol.move_fixed(board, positive, self.nearest_rate(rate_deg_s) + 1), since)

    def track(self, rate: TrackingRate) -> None:
        """Off, or on in the mode it had."""
        self.require(rate.ability)
        self._mode = self.byte(protocol.TRACKING) or self._mode  # with tracking off the mount no longer tells its mode
        self.done(protocol.track(0 if rate is TrackingRate.OFF else self._mode or self.usual_mode()))

    def usual_mode(self) -> int:
        """1 for a fork in altitude and azimuth, 2 or 3 for an axis in the north or the south."""
        if self.is_altaz():
            return 1
        return 3 if self.query(protocol.SITE, protocol.parse_site, 9).latitude_deg < 0.0 else 2

    def is_altaz(self) -> bool:
        """Whether the model is taken for alt-azimuth."""
        return self.models.get(self.model) not in EQUATORIAL

    def byte(self, command: bytes) -> int:
        """One binary byte."""
        return self.query(command, protocol.parse_byte, 2)

    def done(self, command: bytes, since: int | None = None) -> None:
        """What is answered by ``#``."""
        self.talk.ask(command, self.reply(1), protocol.parse_done, since)

    def passed(self, command: bytes, since: int | None = None) -> None:
        """What the hand control passes on to a motor."""
        self.talk.ask(command, self.read_passed, protocol.parse_passed, since)

    def read_passed(self, link: SerialLink, timeout_s: float = 0.0) -> bytes:
        """``#``, or one byte more when it failed; within its usual time where none is given."""
        timeout_s = timeout_s or self.timeout_s
        reply = link.read_exact(1, timeout_s)
        return reply if reply == b"#" else reply + link.read_exact(1, timeout_s)


class StarSense(NexStar):
    """A mount behind a StarSense hand control."""

    name = "starsense"
    title = "Celestron StarSense hand control"
    control = STARSENSE


def axis_of(direction: Direction) -> tuple[int, bool]:
    """The motor board and the sign: north and west count up."""
    board = protocol.ALT if direction.in_dec else protocol.AZM
    return board, direction in (Direction.NORTH, Direction.WEST)


# Sky-Watcher's SynScan hand controls: NexStar's framing, J2000, and a sync that may be refused.

MODELS = {
    **code_table("0 EQ6, 1 HEQ5, 2 EQ5, 3 EQ3, 4 EQ8, 5 AZ-EQ6, 6 AZ-EQ5, 9 EQ6-R, 10 Star Adventurer, 160 AllView"),
    **dict.fromkeys(range(128, 144), "AZ GoTo"),
    **dict.fromkeys(range(144, 160), "Dobsonian"),
}


class SynScan(NexStar):
    """A mount behind a SynScan hand control; a sync beyond 6 to 7 deg is silently not taken."""

    name = "synscan"
    title = "Sky-Watcher SynScan hand control"
    blind_stop = 2 * protocol.CANCEL + HALTS
    default_epoch = Epoch.J2000
    timeout_s = 3.0
    models = MODELS
    cancels = 2  # the first may be lost during a slew
    control = SYNSCAN

    def start(self) -> None:
        """No guide pulse through the hand control."""
        super().start()
        self._lacks[Ability.PULSE] = tr_noop("A SynScan hand control has no guide pulse: use the guide port.")

    def identify(self) -> str:
        """Model and version."""
        return f"SynScan {super().identify()}"

    def is_altaz(self) -> bool:
        """Models from 128 on are alt-azimuth."""
        return self.model >= 128
