"""The one owner of the mount's line in a window: every view that wants the mount asks here."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from app.core.errors import RefusedError
from app.core.hint import Site
from app.mounts.guard import Guard
from app.ui.job import Job
from app.ui.mount import orders
from app.ui.mount.errand import Errand
from app.ui.mount.eye import CameraWish
from app.ui.mount.known import MountKnown
from app.ui.mount.line_order import Make, Outlives, never
from app.ui.mount.line_thread import MountLine
from app.ui.mount.lookout import Lookout
from app.ui.mount.opening import Opening, PracticeOpening, on_port
from app.ui.mount.reasons import Situation, unable
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

PRACTISE_LATER = "A mount is connected: disconnect it before you practise."


class Desk(QObject):
    """Opens the line, gives orders and listens; widgets hold nothing and ask only here."""

    changed = Signal()
    said = Signal(str, str)  # a sentence and its role
    progressed = Signal(object)  # Progress, or None when nothing is under way
    ended = Signal(object)  # Done or Failed, after every order
    stopping = Signal()  # somebody wants everything to stand still
    _heard = Signal(object)

    def __init__(self, services: Services) -> None:
        super().__init__(services.jobs)
        self.known = MountKnown()
        self.lookout = Lookout(services.session, services.cameras)
        self._services = services
        self._line: MountLine | None = None
        self._opening: Opening | None = None
        self._job: Job | None = None
        self._errands: dict[str, Errand] = {}
        self._heard.connect(self._hear)
        services.jobs.closing.connect(self.stop)

    # the connection ---------------------------------------------------------------------------
    def connect_mount(self, wish: MountWish) -> None:
        """Open a mount; what comes of it is heard."""
        self.begin(on_port(wish, self._services.settings.site), wish.port)

    def practise(self) -> None:
        """Start a simulated telescope and connect to it as to a real one."""
        if self.known.phase != "off":
            self.said.emit(PRACTISE_LATER, "wrong")
            return
        start = self._services.wiring.practice
        if start is None:
            self.said.emit("No simulated telescope is part of this program.", "wrong")
            return
        self.begin(PracticeOpening(start, lambda word: self._tell(self._line, word)), "")
        self.known.practice = True
        self.changed.emit()

    @property
    def practice(self) -> Practice | None:
        """The practice night that the line leads to, once it has begun."""
        opening = self._opening
        return opening.practice if isinstance(opening, PracticeOpening) else None

    def begin(self, opening: Opening, port: str) -> None:
        """Open a line in any way; the one before is closed."""
        self.disconnect_mount()
        self.known = MountKnown("connecting", port)
        line = MountLine(opening, lambda word: self._tell(line, word), self._close_camera(opening))
        self._line, self._opening = line, opening
        self._job = job = self._services.jobs.run(line.run(), "mount")
        job.failed.connect(lambda sentence: self._over(job, sentence, "wrong"))
        job.cancelled.connect(lambda: self._over(job, "", "muted"))
        self.said.emit("Connecting…", "muted")
        self.changed.emit()

    def _close_camera(self, opening: Opening) -> Callable[[], None]:
        def close() -> None:
            if self.lookout.eye is not None:
                self.lookout.eye.close()
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

    def _over(self, job: Job, sentence: str, role: str) -> None:
        if job is not self._job:
            return
        self._job, self._line = None, None
        practised, self.known = self.known.practice, MountKnown()
        if practised:
            kept, eye = kept_camera(self._services.settings), self.lookout.eye
            self.use_camera(kept if kept.source else None)
            if eye is not None:
                self._services.cameras.forget(eye.wish.source, eye.wish.address)
        farewell = self._opening.farewell if self._opening is not None else ""
        self._opening = None
        for name in list(self._errands):
            self._errands.pop(name).end(Failed(name, sentence, stopped=not sentence))
        self.said.emit(sentence or f"Disconnected; whatever moved was stopped. {farewell}", role)
        self.progressed.emit(None)
        self.changed.emit()

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
        why = unable(self.situation)
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
        )

    # what is heard ----------------------------------------------------------------------------
    def _tell(self, line: MountLine | None, word: Word) -> None:
        """From the line's threads."""
        try:
            self._heard.emit((line, word))
        except RuntimeError:  # the window is gone
            return

    def _hear(self, told: tuple[MountLine | None, Word]) -> None:
        line, word = told
        if line is not self._line:
            return
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
