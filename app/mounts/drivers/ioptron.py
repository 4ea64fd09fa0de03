"""iOptron mounts with the version 3 language."""

from dataclasses import replace

from app.core.earth import SIDEREAL_DEG_S
from app.core.errors import RefusedError
from app.core.mount import Direction, MountState, Pointing
from app.mounts.beliefs import Beliefs
from app.mounts.conversation import Reader, exactly, until
from app.mounts.drivers.base import SerialMount
from app.mounts.protocols import ioptron as words


class Ioptron(SerialMount):
    """CEM, GEM and HAE mounts, over USB or their TCP port 8899."""

    name = "ioptron"
    title = "iOptron (version 3 language)"
    blind_stop = b"#:Q#"
    bauds = (115200, 230400)
    timeout_s = 5.0
    rates_deg_s = (*(k * SIDEREAL_DEG_S for k in (1, 2, 8, 16, 64, 128, 256, 512)), 4.0)

    def start(self) -> None:
        """Its model."""
        reader = exactly(4, self.timeout_s)
        self.model = self.talk.query(words.MOUNT_INFO, reader, words.parse_model)

    def identify(self) -> str:
        """The model."""
        return f"iOptron {self.model}"

    def place(self) -> words.Place:
        """All that ``:GEP#`` tells."""
        return self.talk.query(
            words.POSITION, until(b"#", 24, self.timeout_s), words.parse_position
        )

    def position(self) -> Pointing:
        """Where it says it points."""
        self.deadman.check()
        place = self.place()
        return Pointing(place.ra_deg, place.dec_deg, self.epoch)

    def horizontal_deg(self) -> tuple[float, float]:
        """Altitude and azimuth."""
        return self.talk.query(words.LEVEL, until(b"#", 24, self.timeout_s), words.parse_level)

    def state(self) -> MountState:
        """``:GLS#``, and the pier side from ``:GEP#``."""
        reader = until(b"#", 26, self.timeout_s)
        state = self.talk.query(words.STATUS, reader, words.parse_status)
        return replace(state, pier_side=self.place().pier_side)

    def beliefs(self) -> Beliefs:
        """Site, zone and clock."""
        reader = until(b"#", 26, self.timeout_s)
        site = self.talk.query(words.STATUS, reader, words.parse_site)
        return Beliefs(site, *self.talk.query(words.TIME, reader, words.parse_time))

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then match it."""
        self.set_target(ra_deg, dec_deg)
        self.one(words.SYNC, "The mount refuses the sync.")

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then slew."""
        since = self.talk.stops
        self.set_target(ra_deg, dec_deg)
        self.one(words.SLEW, "The mount refuses to go there: outside its limits.", since)

    def set_target(self, ra_deg: float, dec_deg: float) -> None:
        """Both coordinates."""
        for command in (words.set_ra(ra_deg), words.set_dec(dec_deg)):
            self.one(command, "The mount does not accept these coordinates.")

    def stop_words(self, moved: bool) -> list[tuple[bytes, tuple[Reader, ...]]]:
        """End a slew, and moves on both axes."""
        commands = [words.STOP, *([words.HALT_RA, words.HALT_DEC] if moved else [])]
        return [(command, (exactly(1, self.timeout_s),)) for command in commands]

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The mount itself ends it."""
        self.talk.tell(words.pulse(direction, milliseconds))

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the nearest of nine rates."""
        since = self.talk.stops
        rate = words.move_rate(self.nearest_rate(rate_deg_s) + 1)
        self.one(rate, "The mount does not accept this rate.")
        vertical = direction in (Direction.NORTH, Direction.SOUTH)
        halt = words.HALT_DEC if vertical else words.HALT_RA
        self.bounded(direction, seconds, (halt, (exactly(1, self.timeout_s),)))
        self.talk.tell(words.move(direction), since)

    def track(self, on: bool) -> None:
        """Sidereal."""
        command = words.TRACK_ON if on else words.TRACK_OFF
        self.one(command, "The mount refuses to change its tracking.")

    def one(self, command: bytes, refusal: str, since: int | None = None) -> None:
        """What is answered by 1, or 0 for no."""
        if not self.talk.ask(command, exactly(1, self.timeout_s), words.parse_one, since):
            raise RefusedError(refusal)
