"""The mount as the window sees it: what is known of it, and what is asked of its line."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Signal

from app.core.errors import RefusedError
from app.core.hint import Site
from app.core.mount import Direction
from app.core.solution import Solution
from app.mounts.guard import Guard
from app.solve.disagreement import Finding, Sighting
from app.ui.job import Job
from app.ui.mount import orders
from app.ui.mount.eye import CameraWish, Eye, looking
from app.ui.mount.line_thread import Make, MountLine
from app.ui.mount.opening import Opening, PracticeOpening, on_port
from app.ui.mount.outcome import spoken
from app.ui.mount.reasons import Situation
from app.ui.mount.wishes import MountWish, kept_camera
from app.ui.mount.words import (
    CannotStop,
    Connected,
    Done,
    Failed,
    Lost,
    Practising,
    Report,
    Seen,
    Shown,
    Sight,
    Silent,
    Stopped,
    Under,
    Word,
)
from app.ui.services import Services
from app.workflows.centre_target import Centring, End
from app.workflows.fresh_frame import SolveNow
from app.workflows.sync_mount import SyncDone, SyncOffer

MOST_SIGHTINGS = 6
MOVING = ("goto", "centre", "nudge", "bring")
TITLES = {
    "goto": "going there", "centre": "centring", "nudge": "nudging", "bring": "bringing the star",
    "take": "taking a frame", "offer": "looking at the sky twice", "accept": "syncing",
    "undo": "taking the sync back", "track": "switching the tracking",
    "why": "looking for the cause",
}  # fmt: skip


@dataclass(slots=True)
class MountKnown:
    """All that is known; ``moved_since`` says that the sight is from before the last motion."""

    phase: str = "off"
    port: str = ""
    connected: Connected | None = None
    report: Report | None = None
    sight: Sight | None = None
    moved_since: bool = False
    busy: str = ""
    practice: bool = False
    trouble: str = ""


class Desk(QObject):
    """Gives orders and listens; widgets hold nothing and ask only here."""

    changed = Signal()
    said = Signal(str, str)  # a sentence and its role
    progressed = Signal(object)  # Progress, or None when nothing is under way
    offered = Signal(object)  # SyncOffer
    _heard = Signal(object)

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.known = MountKnown()
        self.auto_frame = True
        self.eye: Eye | None = None
        self._services = services
        self._line: MountLine | None = None
        self._opening: Opening | None = None
        self._job: Job | None = None
        self._frames = 0
        self._sightings: tuple[Sighting, ...] = ()
        self._heard.connect(self._hear)
        services.jobs.closing.connect(self.stop)

    # the connection ---------------------------------------------------------------------------
    def connect_mount(self, wish: MountWish) -> None:
        """Open a mount; what comes of it is heard."""
        self.begin(on_port(wish, self._services.settings.site), wish.port)

    def practise(self) -> None:
        """Start a simulated telescope and connect to it as to a real one."""
        if self.known.phase != "off":
            self.said.emit("A mount is connected: disconnect it before you practise.", "wrong")
            return
        start = self._services.wiring.practice
        if start is None:
            self.said.emit("No simulated telescope is part of this program.", "wrong")
            return
        self.begin(PracticeOpening(start, lambda word: self._tell(self._line, word)), "")
        self.known.practice = True
        self.changed.emit()

    def begin(self, opening: Opening, port: str) -> None:
        """Open a line in any way; the one before is closed."""
        self.disconnect_mount()
        self.known = MountKnown("connecting", port)
        line = MountLine(opening, lambda word: self._tell(line, word), self._close_camera(opening))
        self._line, self._opening = line, opening
        self._job = job = self._services.jobs.run(line.run(), "mount")
        job.failed.connect(lambda sentence: self._ended(job, sentence, "wrong"))
        job.cancelled.connect(lambda: self._ended(job, "", "muted"))
        self.said.emit("Connecting…", "muted")
        self.changed.emit()

    def _close_camera(self, opening: Opening) -> Callable[[], None]:
        def close() -> None:
            if self.eye is not None:
                self.eye.close()
            opening.over()

        return close

    def disconnect_mount(self) -> None:
        """Stop what moves and give the port back; a practice telescope ends with it."""
        if self._job is not None:
            self.stop()
            self._job.cancel()
            self._line = None
            self.known.phase = "leaving"
            self.changed.emit()

    def _ended(self, job: Job, sentence: str, role: str) -> None:
        if job is not self._job:
            return
        self._job, self._line = None, None
        practised, self.known = self.known.practice, MountKnown()
        if practised:
            kept = kept_camera(self._services.settings)
            self.use_camera(kept if kept.source else None)
        farewell = self._opening.farewell if self._opening is not None else ""
        self.said.emit(sentence or f"Disconnected; whatever moved was stopped. {farewell}", role)
        self.progressed.emit(None)
        self.changed.emit()

    def _tell(self, line: MountLine | None, word: Word) -> None:
        """From the line's threads."""
        try:
            self._heard.emit((line, word))
        except RuntimeError:  # the window is gone
            return

    # what a person asks for -------------------------------------------------------------------
    def stop(self) -> None:
        """Stop the mount now; never waits."""
        if self._line is not None:
            self._line.stop()

    def use_camera(self, wish: CameraWish | None) -> None:
        """Look through this camera from now on."""
        if self.eye is not None and wish == self.eye.wish:
            return
        old, self.eye = self.eye, None if wish is None else Eye(wish)
        if old is not None and self._line is not None:
            self._line.order("camera", orders.close_camera(old))
        self.changed.emit()

    def use_site(self, site: Site | None) -> None:
        """Where the mount stands; the guard judges altitudes by it."""
        self._services.settings.keep_site(site)
        if self._line is not None and not self.known.practice:
            self._line.order("site", orders.use_site(site))

    def take_frame(self) -> None:
        """A fresh frame, shown and solved."""
        self._order("take", orders.take(self._look))

    def offer_sync(self) -> None:
        """Say what a sync would do; without a camera the open frame has to do."""
        look = None if self.eye is None else self._look
        self._order("offer", orders.offer(look, self.solution))

    def ask_why(self) -> None:
        """Name the cause of the disagreement, as far as there is one."""
        self._order("why", orders.why(self._look, self._sightings))

    def accept_sync(self, offer: SyncOffer) -> None:
        """The person said yes."""
        self._order("accept", orders.accept(offer))

    def undo_sync(self) -> None:
        """Take back the last sync."""
        self._order("undo", orders.undo())

    def goto(self, text: str) -> None:
        """Slew to a name or coordinates."""
        self._order("goto", orders.goto(text))

    def centre(self, text: str, tolerance_arcsec: float) -> None:
        """Slew there, look and correct until it is in the middle."""
        self._order("centre", orders.centre(text, tolerance_arcsec, self._look))

    def nudge(self, direction: Direction, arcsec: float, rate_deg_s: float = 0.0) -> None:
        """A small motion, at a rate of the mount or, for 0, at whatever suits it."""
        self._order("nudge", orders.nudged(direction, arcsec, rate_deg_s))

    def bring(self, star: tuple[float, float], here: tuple[float, float]) -> None:
        """Move so that what is at pixel ``star`` of the open frame comes to pixel ``here``."""
        if self.solution is not None:
            self._order("bring", orders.bring(self.solution, star, here))

    def track(self, on: bool) -> None:
        """Sidereal tracking."""
        self._order("track", orders.track(on))

    # what is known ----------------------------------------------------------------------------
    @property
    def solution(self) -> Solution | None:
        """Of the open frame."""
        result = self._services.session.known.result
        return result if isinstance(result, Solution) else None

    @property
    def situation(self) -> Situation:
        """All that decides what may be done now."""
        known = self.known
        return Situation(
            known.phase,
            known.connected.lacks if known.connected is not None else None,
            known.report.state if known.report is not None else None,
            TITLES.get(known.busy, known.busy),
            self.eye is not None,
            self.solution is not None,
            known.report is not None and known.report.can_undo,
        )

    # inside -----------------------------------------------------------------------------------
    def _order(self, name: str, make: Make | None) -> None:
        if self._line is None or make is None:
            return
        self.known.busy = name
        self._line.order(name, make)
        self.changed.emit()

    def _look(self, guard: Guard) -> SolveNow:
        """A solver for the line's thread; what it sees is told in this one."""
        if self.eye is None:
            raise RefusedError("No camera is chosen.")
        line = self._line
        return looking(self.eye, guard, lambda word: self._tell(line, word))

    def _hear(self, told: tuple[MountLine | None, Word]) -> None:
        line, word = told
        if line is not self._line:
            return
        known, session = self.known, self._services.session
        match word:
            case Practising():
                known.port = word.port
                self.use_camera(CameraWish("simulated", word.camera))
            case Shown():
                self._frames += 1
                session.show(word.frame, f"Camera frame {self._frames}")
            case Seen():
                if word.sight is not None:
                    known.sight, known.moved_since = word.sight, False
                session.answer(word.solved)
            case Connected():
                known.phase, known.connected, known.trouble = "on", word, ""
                self.said.emit(f"Connected: {word.name}.", "good")
            case Report():
                known.report, known.trouble = word, ""
                if word.state.slewing:
                    known.moved_since = known.sight is not None
            case Under():
                known.busy = word.name
                self.progressed.emit(word.progress)
            case Done() | Failed():
                self._over(word)
            case Lost():
                known.phase = "lost"
                self.said.emit(word.again or word.sentence, "wrong")
            case Silent():
                known.trouble = word.sentence
            case Stopped():
                self.said.emit("Stopped.", "muted")
            case CannotStop():
                known.trouble = word.sentence
                self.said.emit(word.sentence, "bad")
        self.changed.emit()

    def _over(self, word: Done | Failed) -> None:
        known = self.known
        known.busy = ""
        if word.name in MOVING:
            known.moved_since = known.sight is not None
        self.progressed.emit(None)
        if isinstance(word, Failed):
            self.said.emit(word.sentence, "muted" if word.stopped else "wrong")
            return
        self._done(word.name, word.result)

    def _done(self, name: str, result: Any) -> None:
        known = self.known
        sentence, role = spoken(result, known.sight)
        if sentence:
            self.said.emit(sentence, role)
        match result:
            case SyncOffer():
                self.offered.emit(result)
            case SyncDone(synced=True):
                self._resync()
            case SyncDone(slewed=True):
                known.moved_since = known.sight is not None
            case Centring() if known.sight is not None:
                seen_last = known.sight.solution is result.solution
                known.moved_since = not seen_last or result.end is End.REFUSED
            case (Finding(), sightings):
                self._sightings = sightings[-MOST_SIGHTINGS:]
            case str() if name == "undo":
                self._resync()
        if name in ("goto", "nudge", "bring") and self.auto_frame and self.eye is not None:
            self.take_frame()

    def _resync(self) -> None:
        """After a sync the mount says something else of the place of the last frame."""
        known, self._sightings = self.known, ()
        if known.sight is not None and known.report is not None:
            known.sight = Sight(known.sight.solution, known.report.icrs_deg, known.sight.when)
            known.moved_since = False
