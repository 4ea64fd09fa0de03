"""The mount of a window: every view gives its orders here and is told of their end."""

from dataclasses import replace
from typing import Any

from PySide6.QtCore import QObject, Signal

from kochab.core.errors import RefusedError
from kochab.core.frame import Site
from kochab.core.solution import Solution
from kochab.gear.actions import MountSituation, reason_against_order
from kochab.gear.mount_events import (
    Connected,
    EpochDoubted,
    FrameTaken,
    LimitReached,
    LineLost,
    MountSnapshot,
    OrderDone,
    OrderFailed,
    OrderProgress,
    PracticeStarted,
    StandsStill,
    StopFailed,
    Stopped,
)
from kochab.gear.mount_line import MakeTask, SurvivesLineLoss, never
from kochab.gear.profiles import current_profile
from kochab.gear.session import (
    CameraSelection,
    MountSelection,
    Opening,
    Practice,
    PracticeOpening,
    PracticeScore,
    port_opening,
)
from kochab.pointing.disagreement import MountSighting
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.cameras import Cameras
from kochab.window.devices.mount_camera import TelescopeCamera
from kochab.window.devices.mount_connection import MountConnection
from kochab.window.devices.mount_limits import SiteAndLimits
from kochab.window.devices.mount_task import MountTask
from kochab.window.frame.session import Session
from kochab.window.job import Jobs
from kochab.window.settings import WindowSettings
from kochab.workflows.session.wiring import Wiring
from kochab.workflows.solve_frame import SolvedFrame

PRACTISE_LATER = tr_noop("A mount is connected. Disconnect it before you practise.")


class MountControl(QObject):
    """Connects the mount, gives it orders and keeps what is known of it, for all views.

    Its line is `connection`, its camera `telescope`, what is kept of site and limits `kept`.
    """

    changed = Signal()
    message = Signal(str, str)  # a sentence and its role
    progressed = Signal(object)  # Progress, or None when nothing is under way
    ended = Signal(object)  # OrderDone or OrderFailed, after every order
    stopping = Signal()
    scored = Signal(object)  # PracticeScore, when a practice is over
    window_released = Signal(str)  # it may close now; the alarm, empty where the mount stands

    def __init__(
        self, settings: WindowSettings, session: Session, jobs: Jobs, wiring: Wiring, cameras: Cameras
    ) -> None:
        super().__init__(jobs)
        self.known = MountSnapshot()
        self.sightings: tuple[MountSighting, ...] = ()  # the offsets seen since the last sync
        self.by_hand = False  # a person turns the RA axis for a polar alignment
        self.connection = MountConnection(jobs)
        self.telescope = TelescopeCamera(self.connection, session, cameras)
        self.kept = SiteAndLimits(settings, self.connection, lambda: self.known)
        self._settings, self._session, self._wiring, self._cameras = settings, session, wiring, cameras
        self._tasks: dict[str, MountTask] = {}
        self._holds_window = False
        self.connection.heard.connect(self._hear)
        self.connection.closed.connect(self._closed)
        # Sent before the jobs are abandoned: a mount must not move on when its window is gone.
        jobs.closing.connect(self.stop)

    def connect_mount(self, selection: MountSelection) -> None:
        """Open a mount."""
        self.begin(port_opening(selection, self.kept.site, self.kept.limits), selection.port)

    def practise(self) -> None:
        """Start a simulated telescope and connect to it."""
        if self.known.phase != "off":
            self.message.emit(tr(PRACTISE_LATER), "wrong")
            return
        start = self._wiring.practice
        if start is None:
            self.message.emit(tr("No simulated telescope in this program."), "wrong")
            return
        self.begin(PracticeOpening(start, self.connection.post, self.kept.limits), "")
        self.known.practice = True
        self.changed.emit()

    @property
    def practice(self) -> Practice | None:
        """The practice telescope that is connected, once it has started."""
        opening = self.connection.opening
        return opening.practice if opening is not None else None

    def begin(self, opening: Opening, port: str) -> None:
        """Open a line; the one before is closed."""
        self.disconnect_mount()
        self.known = MountSnapshot("connecting", port)
        self.connection.begin(opening, self.telescope.close)
        self.message.emit(tr("Connecting…"), "muted")
        self.changed.emit()

    def disconnect_mount(self) -> None:
        """Stop what moves and close the port; a practice telescope ends with it."""
        if not self.connection.open:
            return
        self.connection.end()
        self.stopping.emit()
        self.known.phase = "leaving"
        self.changed.emit()

    def hold_window(self, why: list[str]) -> None:
        """The window is to close: it stays until a mount that may move is seen to stand, unless it is closed again.

        The reason goes to ``why``.
        """
        moves = self.connection.may_move or self.known.phase == "leaving"
        if not self.connection.open or self._holds_window or not moves:
            return
        self._holds_window = True
        why.append(tr("Stopping the mount. The window closes when it stands; close it again not to wait."))
        if self.known.phase != "leaving":
            self.disconnect_mount()

    def _closed(self, sentence: str, farewell: str, score: PracticeScore | None) -> None:
        """The line is closed: by a person, or for a reason."""
        before, self.known = self.known, MountSnapshot(alarm=self.known.alarm)
        if before.practice:
            # The simulated camera ends with its telescope; the profile's own comes back.
            saved, camera = current_profile(self._settings).camera, self.telescope.camera
            self.use_camera(saved if saved.source else None)
            if camera is not None:
                self._cameras.forget(camera.selection.source, camera.selection.address)
        # Orders that the line never began end here, so that whoever waits for one hears of it.
        for name in list(self._tasks):
            self._tasks.pop(name).end(OrderFailed(name, sentence, stopped=not sentence))
        stopped = tr("Disconnected, mount stopped. {farewell}", farewell=farewell).strip()
        text = before.alarm or sentence or (stopped if before.connected else tr("Disconnected."))
        self.message.emit(text, "bad" if before.alarm else "wrong" if sentence else "muted")
        self.progressed.emit(None)
        self.changed.emit()
        if score is not None and not sentence:
            self.scored.emit(score)
        if self._holds_window:
            self._holds_window = False
            self.window_released.emit(before.alarm)

    def order(self, name: str, make: MakeTask, survives_line_loss: SurvivesLineLoss = never) -> MountTask:
        """Do this on the guard, in the line's thread; one order at a time.

        A line being opened does it once it is open. ``survives_line_loss`` tells from the order's progress
        whether it waits for a lost line or ends. RefusedError says that no mount is connected, or what is under way.
        """
        why = reason_against_order(name, self.situation)
        line = self.connection.line
        if line is None or why:
            raise RefusedError(why)
        # Now, not when the line begins it: a second press must be refused meanwhile.
        self.known.busy = name
        self._tasks[name] = task = MountTask(name, self.stop, self)
        line.order(name, make, survives_line_loss)
        self.changed.emit()
        return task

    def ask(self, name: str, make: MakeTask) -> None:
        """The same; when it cannot be done now, a message says why."""
        try:
            self.order(name, make)
        except RefusedError as error:
            self.message.emit(str(error), "wrong")

    def stop(self) -> None:
        """Stop the mount now and end every order; never waits."""
        self.connection.stop()
        self.stopping.emit()

    def set_by_hand(self, by_hand: bool) -> None:
        """Whether a person turns the RA axis: meanwhile nothing else of the mount may turn."""
        self.by_hand = by_hand
        self.changed.emit()

    def use_camera(self, selection: CameraSelection | None) -> None:
        """Use this camera from now on."""
        if self.telescope.use(selection):
            self.changed.emit()

    @property
    def solution(self) -> Solution | None:
        """The solution of the open frame."""
        return self._session.known.solution

    def use_site(self, site: Site | None) -> None:
        """Keep the site; the horizon limit goes by it from the next connection on."""
        self.kept.use_site(site)
        self.compare_site()

    def compare_site(self) -> None:
        """Tell what a new site needs while a mount is connected."""
        if note := self.kept.site_note():
            self.message.emit(note, "wrong")

    def use_limits(self, **changes: Any) -> None:
        """Keep these limits in the profile, by its names, and go by them from the next motion on."""
        self.kept.use_limits(**changes)
        self.changed.emit()

    @property
    def situation(self) -> MountSituation:
        """What decides which actions are possible now."""
        known = self.known
        lacks = known.connected.lacks if known.connected is not None else None
        has = self.telescope.camera is not None, self.solution is not None
        if (report := known.report) is None:
            return MountSituation(known.phase, lacks, None, known.user, *has, by_hand=self.by_hand)
        now = MountSituation(known.phase, lacks, report.state, known.user, *has, report.can_undo, self.by_hand)
        return replace(now, clock_conflict=report.clock_conflict, slew_block_reason=report.slew_block_reason)

    def _hear(self, event: object) -> None:
        # Of a line that is being closed only matters whether the mount stands.
        if self.known.phase == "leaving" and not isinstance(event, StopFailed | StandsStill):
            return
        self.known.hear(event)
        match event:
            case FrameTaken():
                self.telescope.show(event)
            case SolvedFrame():
                self._session.answer(event)
            case PracticeStarted():
                self.use_camera(CameraSelection("simulated", event.camera))
                self._cameras.choose("simulated", event.camera)
            case Connected():
                sentence = tr("Connected to {name}. Take a frame to see where it really points.", name=event.name)
                self.message.emit(sentence, "good")
            case EpochDoubted():
                self.message.emit(event.sentence, "wrong")
            case OrderProgress():
                self.progressed.emit(event.progress)
            case OrderDone() | OrderFailed():
                self._end(event)
            case LineLost():
                self.message.emit(event.again or event.sentence, "wrong")
            case Stopped():
                self.message.emit(tr("Stopping…"), "muted")
            case StandsStill():
                stands = tr("Mount stopped.")
                self.message.emit(f"{stands} {event.sentence}".rstrip(), "wrong" if event.sentence else "muted")
            case StopFailed() | LimitReached():
                self.message.emit(event.sentence, "bad")
        self.changed.emit()

    def _end(self, event: OrderDone | OrderFailed) -> None:
        self.progressed.emit(None)
        task = self._tasks.pop(event.name, None)
        if isinstance(event, OrderFailed):
            self.message.emit(event.sentence, "muted" if event.stopped else "wrong")
        if task is not None:
            task.end(event)
        self.ended.emit(event)
