"""A Sky-Watcher SynScan hand controller: NexStar's framing, J2000, and ways of its own."""

from datetime import UTC, datetime

from app.core.attitude import apart_deg
from app.core.mount import PierSide
from app.simulate.responders.nexstar import NexStar
from app.simulate.responders.nexstar_words import read_pair, written_pair
from app.simulate.responders.precession import from_j2000, to_j2000
from app.simulate.telescope import Telescope

SYNC_LIMIT_DEG = 6.0


class SynScan(NexStar):
    """Firmware 4.39.05 on an EQ6. Too far a sync is answered like a good one, and not done.

    The first ``M`` while it slews only begins to brake; the second ends the goto.
    """

    firmware = b"042705"
    model = 0

    def __init__(self, telescope: Telescope) -> None:
        super().__init__(telescope)
        self._braking = False
        self.commands[b"V"] = lambda _: self.firmware + b"#"
        self.commands[b"p"] = self.pointing_state
        self.commands[b"v"] = lambda _: b""  # Celestron's alone

    def position(self, digits: int) -> bytes:
        """RA and Dec of J2000."""
        return written_pair(*to_j2000(*self.telescope.believed_deg(), self._year()), digits)

    def goto(self, text: bytes, digits: int) -> bytes:
        """J2000; always ``#``."""
        return super().goto(self._of_date(text, digits), 8)

    def sync(self, text: bytes, digits: int) -> bytes:
        """J2000; always ``#``, and nothing done beyond some six degrees."""
        there = read_pair(text, digits)
        if there is None:
            return b""
        there = from_j2000(*there, self._year())
        if apart_deg(there, self.telescope.believed_deg()) <= SYNC_LIMIT_DEG:
            self._sync(*there)
        return b"#"

    def cancel(self, _: bytes = b"") -> bytes:
        """The first of two only brakes."""
        if self.telescope.slewing and not self._braking:
            self._braking = True
            return b"#"
        self._braking = False
        return super().cancel()

    def pointing_state(self, _: bytes) -> bytes:
        """Where the counterweights look: the other side than the tube's."""
        return b"E#" if self.telescope.pier_side is PierSide.WEST else b"W#"

    def _of_date(self, text: bytes, digits: int) -> bytes:
        pair = read_pair(text, digits)
        if pair is None:
            return b""
        return written_pair(*from_j2000(*pair, self._year()), 8)[:-1]

    def _year(self) -> float:
        at = datetime.fromtimestamp(self.telescope.now_unix(), UTC)
        return at.year + (at.timetuple().tm_yday - 1 + at.hour / 24.0) / 365.25
