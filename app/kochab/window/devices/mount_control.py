"""The mount of a window: every view gives its orders here and is told of their end."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from PySide6.QtCore import QObject, Signal

from kochab.core.errors import RefusedError
from kochab.core.frame import Site
from kochab.core.progress import Progress, Task
from kochab.core.solution import Solution, SolveNow
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
from kochab.gear.mount_line import MakeTask, MountLine, SurvivesLineLoss, never
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.profiles import current_profile, keep_profile
from kochab.gear.session import CameraSelection, MountSelection, Opening, Practice, PracticeOpening, port_opening
from kochab.pointing.disagreement import MountSighting
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.cameras import Cameras
from kochab.window.frame.session import Session
from kochab.window.job import Job, Jobs
from kochab.window.settings import WindowSettings
from kochab.workflows.session.mount_camera import MountCamera, close_camera, frame_solver
from kochab.workflows.session.wiring import Wiring
from kochab.workflows.solve_frame import SolvedFrame


class MountTask(QObject):
    """One order, with a job's signals: ``succeeded``, ``failed`` or ``cancelled``, then ``finished``."""

    succeeded = Signal(object)
    failed = Signal(str)
    cancelled = Signal()
    finished = Signal()

    def __init__(self, name: str, stop: Callable[[], None], parent: QObject) -> None:
        super().__init__(parent)
        self.name = name
        self._stop = stop

    def cancel(self) -> None:
        """Stop the mount and end what is under way."""
        self._stop()

    def end(self, event: OrderDone | OrderFailed) -> None:
        """Emit how it ended."""
        if isinstance(event, OrderDone):
            self.succeeded.emit(event.result)
        elif event.stopped:
            self.cancelled.emit()
        else:
            self.failed.emit(event.sentence)
        self.finished.emit()
        self.deleteLater()


PRACTISE_LATER = tr_noop("A mount is connected. Disconnect it before you practise.")


class MountControl(QObject):
    """Connects the mount, one open line at a time, gives it orders and keeps what is known of it, for all views."""

    changed = Signal()
    message = Signal(str, str)  # a sentence and its role
    progressed = Signal(object)  # Progress, or None when nothing is under way
    ended = Signal(object)  # OrderDone or OrderFailed, after every order
    stopping = Signal()
    window_released = Signal(str)  # it may close now; the alarm, empty where the mount stands
    _posted = Signal(object, object)  # a line, and its MountEvent or SolvedFrame

    def __init__(
        self, settings: WindowSettings, session: Session, jobs: Jobs, wiring: Wiring, cameras: Cameras
    ) -> None:
        super().__init__(jobs)
        self.known = MountSnapshot()
        self.camera: MountCamera | None = None
        self.sightings: tuple[MountSighting, ...] = ()  # the offsets seen since the last sync
        self._session, self._shown = session, 0  # and how many of the camera's frames it was given
        self.by_hand = False  # a person turns the RA axis for a polar alignment
        self._settings, self._jobs, self._wiring, self._cameras = settings, jobs, wiring, cameras
        self._line: MountLine | None = None
        self._opening: Opening | None = None
        self._job: Job | None = None  # it runs the line, also while that is being closed
        self._tasks: dict[str, MountTask] = {}
        self._holds_window = False
        self._posted.connect(self._receive)
        # Sent before the jobs are abandoned: a mount must not move on when its window is gone.
        jobs.closing.connect(self.stop)

    def connect_mount(self, selection: MountSelection) -> None:
        """Open a mount."""
        self.begin(port_opening(selection, self._settings.site, self.limits), selection.port)

    def practise(self) -> None:
        """Start a simulated telescope and connect to it."""
        if self.known.phase != "off":
            self.message.emit(tr(PRACTISE_LATER), "wrong")
            return
        start = self._wiring.practice
        if start is None:
            self.message.emit(tr("No simulated telescope in this program."), "wrong")
            return
        # The line is made by `begin`, so it is asked for only when an event comes.
        self.begin(PracticeOpening(start, lambda event: self._post(self._line, event), self.limits), "")
        self.known.practice = True
        self.changed.emit()

    @property
    def practice(self) -> Practice | None:
        """The practice telescope that is connected, once it has started."""
        return self._opening.practice if self._opening is not None else None

    def begin(self, opening: Opening, port: str) -> None:
        """Open a line; the one before is closed."""
        self.disconnect_mount()
        self.known = MountSnapshot("connecting", port)

        def over() -> None:  # in the line's thread
            self.close_camera()
            opening.over()

        line = MountLine(opening, lambda event: self._post(line, event), over)
        self._line, self._opening = line, opening
        self._job = job = self._jobs.run(line.run(), "mount")
        # A line never succeeds: it serves orders until it is cancelled or fails.
        job.failed.connect(lambda sentence: self._closed(job, sentence))
        job.cancelled.connect(lambda: self._closed(job, ""))
        self.message.emit(tr("Connecting…"), "muted")
        self.changed.emit()

    def disconnect_mount(self) -> None:
        """Stop what moves and close the port; a practice telescope ends with it."""
        if self._job is None:
            return
        if self._line is not None:
            self._line.stop()
        # The Stop goes out in a thread of its own; the line ends when it comes to its next yield.
        self._job.cancel()
        self.stopping.emit()
        self.known.phase = "leaving"
        self.changed.emit()

    def hold_window(self, why: list[str]) -> None:
        """The window is to close: it stays until a mount that may move is seen to stand, unless it is closed again.

        The reason goes to ``why``.
        """
        moves = self._line is not None and self._line.may_move
        if self._job is None or self._holds_window or not (moves or self.known.phase == "leaving"):
            return
        self._holds_window = True
        why.append(tr("Stopping the mount. The window closes when it stands; close it again not to wait."))
        if self.known.phase != "leaving":
            self.disconnect_mount()

    def _closed(self, job: Job, sentence: str) -> None:
        """The line is closed: by a person, or for a reason."""
        # A later line has taken its place.
        if job is not self._job:
            return
        farewell = self._opening.farewell if self._opening is not None else ""
        self._job = self._line = self._opening = None
        before, self.known = self.known, MountSnapshot(alarm=self.known.alarm)
        if before.practice:
            # The simulated camera ends with its telescope; the profile's own comes back.
            saved, camera = current_profile(self._settings).camera, self.camera
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
        if self._holds_window:
            self._holds_window = False
            self.window_released.emit(before.alarm)

    def order(self, name: str, make: MakeTask, survives_line_loss: SurvivesLineLoss = never) -> MountTask:
        """Do this on the guard, in the line's thread; one order at a time.

        A line being opened does it once it is open. ``survives_line_loss`` tells from the order's progress
        whether it waits for a lost line or ends. RefusedError says that no mount is connected, or what is under way.
        """
        why = reason_against_order(name, self.situation)
        if self._line is None or why:
            raise RefusedError(why)
        # Now, not when the line begins it: a second press must be refused meanwhile.
        self.known.busy = name
        self._tasks[name] = task = MountTask(name, self.stop, self)
        self._line.order(name, make, survives_line_loss)
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
        if self._line is not None:
            self._line.stop()
        self.stopping.emit()

    def set_by_hand(self, by_hand: bool) -> None:
        """Whether a person turns the RA axis: meanwhile nothing else of the mount may turn."""
        self.by_hand = by_hand
        self.changed.emit()

    def use_camera(self, selection: CameraSelection | None) -> None:
        """Use this camera from now on; another exposure of the same holds for the other views that use it, too."""
        before, new = self.camera, None
        if before is not None and selection == before.selection:
            return
        if selection is not None:
            same = before is not None and before.selection.camera == selection.camera
            new = MountCamera(selection, self._cameras.open, insists=same)
        self.camera = new
        if before is not None and self._line is not None:
            # In the line's thread, which opened it and may be taking a frame just now.
            self._line.order("camera", lambda _: close_camera(before))
        self.changed.emit()

    def close_camera(self) -> None:
        """Close the camera until the next frame; in the thread of the line."""
        if self.camera is not None:
            self.camera.close()

    @property
    def solution(self) -> Solution | None:
        """The solution of the open frame."""
        return self._session.known.solution

    def use_site(self, site: Site | None) -> None:
        """Keep the site; the horizon limit goes by it from the next connection on."""
        self._settings.keep_site(site)
        self.compare_site()

    def compare_site(self) -> None:
        """Tell of a new site: the guard keeps the old one, by which its driver finds time, pole and pier side."""
        connected = self.known.connected
        if connected is not None and not self.known.practice and connected.site != self._settings.site:
            self.message.emit(tr("Disconnect the mount and connect it again to use the new site."), "wrong")

    def use_limits(self, **changes: Any) -> None:
        """Keep these limits in the profile, by its names, and go by them from the next motion on."""
        keep_profile(self._settings, **changes)
        limits = self.limits

        def use(guard: Guard) -> Task[None]:
            yield Progress(tr_noop("limits"))
            guard.limits = limits

        if self._line is not None:
            self._line.order("limits", use)
        self.changed.emit()

    @property
    def limits(self) -> Limits:
        """The limits of the next guard."""
        return current_profile(self._settings).limits

    def solver(self, guard: Guard) -> SolveNow:
        """Takes and solves a frame in the line's thread, and shows it in this one."""
        # Those of the moment of the order, whatever is connected or chosen when it is carried out.
        line, camera = self._line, self.camera
        if camera is None:
            raise RefusedError("No camera is chosen.")
        return frame_solver(camera, guard, lambda event: self._post(line, event))

    @property
    def situation(self) -> MountSituation:
        """What decides which actions are possible now."""
        known = self.known
        lacks = known.connected.lacks if known.connected is not None else None
        has = self.camera is not None, self.solution is not None
        if (report := known.report) is None:
            return MountSituation(known.phase, lacks, None, known.user, *has, by_hand=self.by_hand)
        now = MountSituation(known.phase, lacks, report.state, known.user, *has, report.can_undo, self.by_hand)
        return replace(now, clock_conflict=report.clock_conflict, slew_block_reason=report.slew_block_reason)

    def _post(self, line: MountLine | None, event: object) -> None:
        """Pass an event on from the line's threads."""
        with suppress(RuntimeError):  # the window is gone
            self._posted.emit(line, event)

    def _receive(self, line: MountLine | None, event: object) -> None:
        # Of a line that is being closed only its end matters, and whether the mount stands.
        if line is not self._line and not isinstance(event, StopFailed):
            return
        if self.known.phase == "leaving" and not isinstance(event, StopFailed | StandsStill):
            return
        self.known.hear(event)
        match event:
            case FrameTaken() if not self._session.streams:  # else the Live view shows this frame, too
                self._shown += 1
                self._session.show(event.frame, tr("Camera frame {number}", number=self._shown))
            case SolvedFrame():
                self._session.answer(event)
            case PracticeStarted():
                self.use_camera(CameraSelection("simulated", event.camera))
                self._cameras.choose("simulated", event.camera)
            case Connected():
                self.message.emit(tr("Connected to {name}.", name=event.name), "good")
            case EpochDoubted():
                self.message.emit(event.sentence, "wrong")
            case OrderProgress():
                self.progressed.emit(event.progress)
            case OrderDone() | OrderFailed():
                self._end(event)
            case LineLost():
                self.message.emit(event.again or event.sentence, "wrong")
            case Stopped():
                self.message.emit(tr("Stop sent."), "muted")
            case StandsStill():
                self.message.emit(tr("Mount stopped."), "muted")
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
