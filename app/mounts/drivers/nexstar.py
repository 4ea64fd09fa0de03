"""Celestron's NexStar hand controls."""

from app.core.earth import SIDEREAL_DEG_S
from app.core.errors import RefusedError
from app.core.mount import Ability, Direction, MountState, Pointing
from app.mounts.beliefs import Beliefs
from app.mounts.conversation import Reader, exactly
from app.mounts.drivers.base import SerialMount
from app.mounts.link import Link
from app.mounts.protocols import nexstar as words

PRECISE_SINCE, SYNC_SINCE, PIER_SINCE = (1, 6), (4, 10), (4, 15)
EQUATORIAL = {"CGE", "CGE Pro", "CGEM DX", "AVX", "CGX", "CGXL", "Advanced GT"}
GUIDE_PERCENT, GUIDE_LONGEST_MS = 50, 2550


def read_version(link: Link) -> bytes:
    """Three bytes, or seven when they are digits."""
    reply = link.read_exact(3, NexStar.timeout_s)
    return reply if reply[2:] == b"#" else reply + link.read_exact(4, NexStar.timeout_s)


class NexStar(SerialMount):
    """A mount behind a NexStar hand control."""

    name = "nexstar"
    title = "Celestron NexStar hand control"
    blind_stop = b"M"
    timeout_s = 5.0
    models = words.MODELS
    rates_deg_s = (*(k * SIDEREAL_DEG_S for k in (0.5, 1, 4, 8, 16, 64)), 0.5, 2.0, 4.0)
    cancels = 1

    def start(self) -> None:
        """Its version decides what it can."""
        self.version = self.talk.query(words.VERSION, read_version, words.parse_version)
        self.model = self.byte(words.MODEL)
        self._mode = 0
        if self.version < SYNC_SINCE and self.default_epoch is NexStar.default_epoch:
            told = ".".join(str(part) for part in self.version)
            self._lacks[Ability.SYNC] = f"The hand control is version {told}, a sync needs 4.10."

    def identify(self) -> str:
        """Model and version."""
        version = ".".join(f"{part:02d}" if i else str(part) for i, part in enumerate(self.version))
        return f"{self.models.get(self.model, f'model {self.model}')}, hand control {version}"

    def position(self) -> Pointing:
        """``e``, or ``E`` of old versions."""
        self.deadman.check()
        precise = self.version >= PRECISE_SINCE
        command, length = (words.GET_PRECISE, 18) if precise else (words.GET_COARSE, 10)
        reader = exactly(length, self.timeout_s)
        return Pointing(*self.talk.query(command, reader, words.parse_position), self.epoch)

    def horizontal_deg(self) -> tuple[float, float]:
        """Altitude and azimuth: ``z``, or ``Z`` of old versions."""
        precise = self.version >= PRECISE_SINCE
        command, length = (words.LEVEL_PRECISE, 18) if precise else (words.LEVEL_COARSE, 10)
        reader = exactly(length, self.timeout_s)
        azimuth, altitude = self.talk.query(command, reader, words.parse_position)
        return altitude, azimuth

    def state(self) -> MountState:
        """Slewing, aligned, tracking; the side of the pier where the version tells it."""
        reader = exactly(2, self.timeout_s)
        pier = None
        if self.version >= PIER_SINCE:
            pier = self.talk.query(words.PIER, reader, words.parse_pier)
        return MountState(
            slewing=self.talk.query(words.SLEWING, reader, words.parse_digit),
            aligned=self.talk.query(words.ALIGNED, reader, words.parse_flag),
            tracking=self.byte(words.TRACKING) != 0,
            pier_side=pier,
        )

    def beliefs(self) -> Beliefs:
        """Site, zone and clock."""
        reader = exactly(9, self.timeout_s)
        site = self.talk.query(words.SITE, reader, words.parse_site)
        return Beliefs(site, *self.talk.query(words.TIME, reader, words.parse_time))

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """``s``, since version 4.10."""
        self.need(Ability.SYNC)
        self.be_aligned()
        self.done(words.sync(ra_deg, dec_deg))

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """``r``; without an alignment it would answer and stay."""
        since = self.talk.stops
        self.be_aligned()
        precise = self.version >= PRECISE_SINCE
        self.done((words.goto if precise else words.goto_coarse)(ra_deg, dec_deg), since)

    def be_aligned(self) -> None:
        """Refuse on a mount that does not know the sky."""
        if not self.talk.query(words.ALIGNED, exactly(2, self.timeout_s), words.parse_flag):
            raise RefusedError(
                "The mount is not aligned: do its alignment on the hand control first."
            )

    def stop_words(self, moved: bool) -> list[tuple[bytes, tuple[Reader, ...]]]:
        """Cancel a goto, and end moves at a fixed rate on both axes."""
        one: tuple[Reader, ...] = (exactly(1, self.timeout_s),)
        halts = [self.halt(board) for board in (words.AZM, words.ALT)] if moved else []
        return [(words.CANCEL, one)] * self.cancels + halts

    def halt(self, board: int) -> tuple[bytes, tuple[Reader, ...]]:
        """The bytes that end a move on one axis."""
        return words.move_fixed(board, True, 0), (self.read_passed,)

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The motor board ends it; a pulse too long for it runs at twice the rate for half."""
        self.need(Ability.PULSE)
        times = 2 if milliseconds > GUIDE_LONGEST_MS else 1
        board, positive = axis_of(direction)
        percent = GUIDE_PERCENT * times
        hundredths = min(max(round(milliseconds / times / 10.0), 1), 255)
        self.passed(words.guide(board, percent if positive else -percent, hundredths))

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the nearest of nine rates."""
        since = self.talk.stops
        board, positive = axis_of(direction)
        self.bounded(direction, seconds, self.halt(board))
        self.passed(words.move_fixed(board, positive, self.nearest_rate(rate_deg_s) + 1), since)

    def track(self, on: bool) -> None:
        """Off, or on in the mode it had."""
        now = self.byte(words.TRACKING)
        self._mode = now or self._mode
        mode = (self._mode or self.usual_mode()) if on else 0
        self.done(words.track(mode))

    def usual_mode(self) -> int:
        """1 for a fork in altitude and azimuth, 2 or 3 for an axis in the north or the south."""
        if self.models.get(self.model) not in EQUATORIAL:
            return 1
        reader = exactly(9, self.timeout_s)
        return 3 if self.talk.query(words.SITE, reader, words.parse_south) else 2

    def byte(self, command: bytes) -> int:
        """One binary byte."""
        return self.talk.query(command, exactly(2, self.timeout_s), words.parse_byte)

    def done(self, command: bytes, since: int | None = None) -> None:
        """What is answered by ``#``."""
        self.talk.ask(command, exactly(1, self.timeout_s), words.parse_done, since)

    def passed(self, command: bytes, since: int | None = None) -> None:
        """What the hand control passes on to a motor."""
        self.talk.ask(command, self.read_passed, words.parse_passed, since)

    def read_passed(self, link: Link) -> bytes:
        """``#``, or one byte more when it failed."""
        reply = link.read_exact(1, self.timeout_s)
        return reply if reply == b"#" else reply + link.read_exact(1, self.timeout_s)


def axis_of(direction: Direction) -> tuple[int, bool]:
    """The motor board and its way: north and west count up."""
    board = words.ALT if direction in (Direction.NORTH, Direction.SOUTH) else words.AZM
    return board, direction in (Direction.NORTH, Direction.WEST)
