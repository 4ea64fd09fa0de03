"""What a person asks of the mount in its view, and what follows from the answers."""

from typing import Any

from PySide6.QtCore import QObject, Signal

from app.core.mount import Direction
from app.solve.disagreement import Finding
from app.ui.mount import orders
from app.ui.mount.desk import Desk
from app.ui.mount.line_order import Make
from app.ui.mount.outcome import spoken
from app.ui.mount.reasons import BY_HAND
from app.ui.mount.words import Done, Failed
from app.workflows.centre_target import Centring, End
from app.workflows.sync_mount import SyncDone, SyncOffer

LOOKS_AFTER = ("goto", "nudge", "bring")


class Asks(QObject):
    """Wishes become orders of the :class:`Desk`; with ``auto_frame`` a frame follows a move."""

    offered = Signal(object)  # SyncOffer

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.auto_frame = True
        self._desk, self._lookout = desk, desk.lookout
        desk.ended.connect(self._ended)

    def take_frame(self) -> None:
        """A fresh frame, shown and solved."""
        self._desk.ask("take", orders.take(self._desk.look))

    def offer_sync(self) -> None:
        """Say what a sync would do; without a camera the open frame has to do."""
        look = None if self._lookout.eye is None else self._desk.look
        make: Make | None = orders.offer(look, self._lookout.solution)
        if make is not None:
            self._desk.ask("offer", make)

    def why(self) -> None:
        """Name the cause of the disagreement, as far as there is one."""
        self._desk.ask("why", orders.why(self._desk.look, self._lookout.sightings))

    def accept_sync(self, offer: SyncOffer) -> None:
        """The person said yes."""
        self._desk.ask("accept", orders.accept(offer))

    def undo_sync(self) -> None:
        """Take back the last sync."""
        self._desk.ask("undo", orders.undo())

    def goto(self, text: str) -> None:
        """Slew to a name or coordinates."""
        self._desk.ask("goto", orders.goto(text))

    def centre(self, text: str, tolerance_arcsec: float) -> None:
        """Slew there, look and correct until it is in the middle."""
        self._desk.ask("centre", orders.centre(text, tolerance_arcsec, self._desk.look))

    def nudge(self, direction: Direction, arcsec: float, rate_deg_s: float = 0.0) -> None:
        """A small motion, at a rate of the mount or, for 0, at whatever suits it."""
        dec = direction in (Direction.NORTH, Direction.SOUTH)
        if self._desk.by_hand and dec:
            self._desk.said.emit(BY_HAND, "wrong")
            return
        self._desk.ask("nudge", orders.nudged(direction, arcsec, rate_deg_s))

    def bring(self, star: tuple[float, float], here: tuple[float, float]) -> None:
        """Move so that what is at pixel ``star`` of the open frame comes to pixel ``here``."""
        solution = self._lookout.solution
        if solution is not None:
            self._desk.ask("bring", orders.bring(solution, star, here))

    def track(self, on: bool) -> None:
        """Sidereal tracking."""
        self._desk.ask("track", orders.track(on))

    def _ended(self, word: Done | Failed) -> None:
        if isinstance(word, Failed):
            return
        self._answered(word.name, word.result)
        if word.name in LOOKS_AFTER and self.auto_frame and self._lookout.eye is not None:
            self.take_frame()

    def _answered(self, name: str, result: Any) -> None:
        known = self._desk.known
        sentence, role = spoken(result, known.sight)
        if sentence:
            self._desk.said.emit(sentence, role)
        match result:
            case SyncOffer():
                self.offered.emit(result)
            case SyncDone(synced=True):
                self._resynced()
            case SyncDone(slewed=True):
                known.has_moved()
            case Centring() if known.sight is not None:
                seen_last = known.sight.solution is result.solution
                known.moved_since = not seen_last or result.end is End.REFUSED
            case (Finding(), sightings):
                self._lookout.learn(sightings)
            case str() if name == "undo":
                self._resynced()

    def _resynced(self) -> None:
        self._desk.known.has_synced()
        self._lookout.forget()
