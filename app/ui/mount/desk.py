"""The one owner of the mount's line in a window: every view that wants the mount asks here."""

from PySide6.QtCore import QObject, Signal

from app.core.errors import RefusedError
from app.core.hint import Site
from app.mounts.guard import Guard
from app.mounts.limits import Limits
from app.ui.mount import orders
from app.ui.mount.connection import Connection
from app.ui.mount.errand import Errand
from app.ui.mount.eye import CameraWish
from app.ui.mount.known import POLAR, MountKnown
from app.ui.mount.line_order import Make, Outlives, never
from app.ui.mount.line_thread import MountLine
from app.ui.mount.lookout import Lookout
from app.ui.mount.meridian import Meridian, keep_meridian, kept_meridian, limits_at
from app.ui.mount.opening import Opening, PracticeOpening, on_port
from app.ui.mount.reasons import BY_HAND, Situation, unable
from app.ui.mount.wishes import MountWish, kept_camera
from app.ui.mount.words import (
    CannotStop,
    Connected,
    Done,
    Doubted,
    Failed,
    Lost,
    Practising,
    Stopped,
    Under,
    Word,
)
from app.ui.services import Services
from app.ui.wiring import Practice
from app.workflows.fresh_frame import SolveNow

AXES = ("goto", "centre", "bring", "offer", "accept", POLAR)
PRACTISE_LATER = "A mount is connected: disconnect it before you practise."


class Desk(QObject):
    """Connects, gives orders and listens; widgets hold nothing and ask only here."""

    changed = Signal()
    said = Signal(str, str)  # a sentence and its role
    progressed = Signal(object)  # Progress, or None when nothing is under way
    ended = Signal(object)  # Done or Failed, after every order
    stopping = Signal()  # somebody wants everything to stand still

    def __init__(self, services: Services) -> None:
        super().__init__(services.jobs)
        self.known = MountKnown()
        self.lookout = Lookout(services.session, services.cameras)
        self.by_hand = False  # a person turns the RA axis for an alignment
        self._services = services
        self._connection = Connection(services.jobs, self)
        self._errands: dict[str, Errand] = {}
        self._connection.heard.connect(self._hear)
        self._connection.closed.connect(self._closed)
        services.jobs.closing.connect(self.stop)

    # the connection ---------------------------------------------------------------------------
    def connect_mount(self, wish: MountWish) -> None:
        """Open a mount; what comes of it is heard."""
        self.begin(on_port(wish, self._services.settings.site, self.limits), wish.port)

    def practise(self) -> None:
        """Start a simulated telescope and connect to it as to a real one."""
        if self.known.phase != "off":
            self.said.emit(PRACTISE_LATER, "wrong")
            return
        start = self._services.wiring.practice
        if start is None:
            self.said.emit("No simulated telescope is part of this program.", "wrong")
            return
        self.begin(PracticeOpening(start, lambda w: self._tell(self._line, w), self.limits), "")
        self.known.practice = True
        self.changed.emit()

    @property
    def practice(self) -> Practice | None:
        """The practice night that the line leads to, once it has begun."""
        return self._connection.practice

    def begin(self, opening: Opening, port: str) -> None:
        """Open a line in any way; the one before is closed."""
        self.disconnect_mount()
        self.known = MountKnown("connecting", port)
        self._connection.open(opening, self.lookout.close)
        self.said.emit("Connecting…", "muted")
        self.changed.emit()

    def disconnect_mount(self) -> None:
        """Stop what moves and give the port back; a practice telescope ends with it."""
        if self._connection.leave():
            self.stopping.emit()
            self.known.phase = "leaving"
            self.changed.emit()

    def _closed(self, sentence: str, farewell: str) -> None:
        practised, self.known = self.known.practice, MountKnown()
        if practised:
            kept, eye = kept_camera(self._services.settings), self.lookout.eye
            self.use_camera(kept if kept.source else None)
            if eye is not None:
                self._services.cameras.forget(eye.wish.source, eye.wish.address)
        for name in list(self._errands):
            self._errands.pop(name).end(Failed(name, sentence, stopped=not sentence))
        told = sentence or f"Disconnected; whatever moved was stopped. {farewell}"
        self.said.emit(told, "wrong" if sentence else "muted")
        self.progressed.emit(None)
        self.changed.emit()

    @property
    def _line(self) -> MountLine | None:
        return self._connection.line

    def _tell(self, line: MountLine | None, word: Word) -> None:
        self._connection.tell(line, word)

    # what is asked of it ----------------------------------------------------------------------
    def order(self, name: str, make: Make, outlives: Outlives = never) -> Errand:
        """Do this on the line's guard, in the line's thread; one order at a time.

        A line that is being opened does it when it is open. ``outlives`` tells by its progress
        whether it waits for a line that is lost, or ends.

        Raises
        ------
        RefusedError
            No mount is connected, or another order is under way; one sentence.

        """
        why = unable(self.situation) or (BY_HAND if self.by_hand and name in AXES else "")
        if self._line is None or why:
            raise RefusedError(why)
        self.known.busy = name
        self._errands[name] = errand = Errand(name, self.stop, self)
        self._line.order(name, make, outlives)
        self.changed.emit()
        return errand

    def ask(self, name: str, make: Make) -> None:
        """The same; that it cannot be done now is said aloud."""
        try:
            self.order(name, make)
        except RefusedError as error:
            self.said.emit(str(error), "wrong")

    def stop(self) -> None:
        """Stop the mount now and give up every order; never waits."""
        if self._line is not None:
            self._line.stop()
        self.stopping.emit()

    def leave_to_hand(self, by_hand: bool) -> None:
        """Whether a person turns the RA axis now: nothing else of the mount is to be turned."""
        self.by_hand = by_hand
        self.changed.emit()

    def use_camera(self, wish: CameraWish | None) -> None:
        """Look through this camera from now on."""
        eye = self.lookout.eye
        if eye is not None and wish == eye.wish:
            return
        before = self.lookout.use(wish)
        if before is not None and self._line is not None:
            self._line.order("camera", orders.close_camera(before))
        self.changed.emit()

    def use_site(self, site: Site | None) -> None:
        """Where the mount stands; the guard judges altitudes by it."""
        self._services.settings.keep_site(site)
        if self._line is not None and not self.known.practice:
            self._line.order("site", orders.use_site(site))

    def use_meridian(self, meridian: Meridian) -> None:
        """What the mount does at the meridian; the guard judges by it from the next motion on."""
        keep_meridian(self._services.settings, meridian)
        if self._line is not None:
            self._line.order("meridian", orders.use_limits(limits_at(meridian)))

    @property
    def limits(self) -> Limits:
        """What the guard of a mount begins with."""
        return limits_at(kept_meridian(self._services.settings))

    def look(self, guard: Guard) -> SolveNow:
        """A solver for the line's thread; what it sees is told in this one."""
        line = self._line
        return self.lookout.look(guard, lambda word: self._tell(line, word))

    @property
    def situation(self) -> Situation:
        """All that decides what may be done now."""
        known = self.known
        return Situation(
            known.phase,
            known.connected.lacks if known.connected is not None else None,
            known.report.state if known.report is not None else None,
            known.user,
            self.lookout.eye is not None,
            self.lookout.solution is not None,
            known.report is not None and known.report.can_undo,
            self.by_hand,
        )

    # what is heard ----------------------------------------------------------------------------
    def _hear(self, word: Word) -> None:
        self.known.hear(word)
        self.lookout.hear(word)
        match word:
            case Practising():
                self.use_camera(CameraWish("simulated", word.camera))
                self._services.cameras.choose("simulated", word.camera)
            case Connected():
                self.said.emit(f"Connected: {word.name}.", "good")
            case Doubted():
                self.said.emit(word.sentence, "wrong")
            case Under():
                self.progressed.emit(word.progress)
            case Done() | Failed():
                self._end(word)
            case Lost():
                self.said.emit(word.again or word.sentence, "wrong")
            case Stopped():
                self.said.emit("Stopped.", "muted")
            case CannotStop():
                self.said.emit(word.sentence, "bad")
        self.changed.emit()

    def _end(self, word: Done | Failed) -> None:
        self.progressed.emit(None)
        errand = self._errands.pop(word.name, None)
        if isinstance(word, Failed):
            self.said.emit(word.sentence, "muted" if word.stopped else "wrong")
        if errand is not None:
            errand.end(word)
        self.ended.emit(word)
