"""The alignment under way, or the last one: its state, its job, and what a person may ask of it."""

import time
from dataclasses import replace

from PySide6.QtCore import QObject, Signal

from kochab.core.errors import KochabError
from kochab.core.progress import Progress
from kochab.gear.session import Practice
from kochab.polar.error import angle_in_words
from kochab.polar.report import History
from kochab.text.translation import tr
from kochab.window.devices.mount_task import MountTask
from kochab.window.job import Job
from kochab.window.polar.alignment_run import AlignmentRun, PracticeAdjuster
from kochab.window.services import Services
from kochab.workflows.polar.sources import SolvedFile
from kochab.workflows.polar.update import PolarButton, PolarControls
from kochab.workflows.session.alignment import AlignmentRequest, AxisTurnedBy, FrameSource
from kochab.workflows.session.alignment_state import AlignmentState, absorb


class RunningAlignment(QObject):
    """Begins alignments one at a time and follows each to its end; knows no widget."""

    began = Signal(object)  # AlignmentRequest
    stepped = Signal(object, object)  # the AlignmentState before and after
    practising = Signal()  # the practice telescope can be turned
    seen = Signal(object, object)  # Frame, Solution or None
    kept = Signal(object)  # History, so far or at the end
    message = Signal(str, str)  # a sentence and its role
    finished = Signal()
    telescope_gone = Signal()  # nobody needs sounds or the phone page any more

    def __init__(self, services: Services, parent: QObject) -> None:
        super().__init__(parent)
        self._services = services
        self.state = AlignmentState()
        self.controls = PolarControls()
        self.adjuster: PracticeAdjuster | None = None
        self.job: Job | MountTask | None = None
        self.request: AlignmentRequest | None = None
        self._run: AlignmentRun | None = None
        self._connected = False  # the mount, when it was last heard of
        self._gone = False  # the telescope went while it ran: what it said is of no telescope any more
        # What was solved is kept: another clock or pole needs no new solve of the same files.
        self._solved: dict[tuple[object, ...], list[SolvedFile]] = {}
        services.mount.changed.connect(self._hear_mount)

    @property
    def drifts(self) -> bool:
        """Whether nobody turns the axis of the alignment under way."""
        request = self.request
        return request is not None and (request.hand is AxisTurnedBy.NOBODY or request.source is FrameSource.FILES)

    @property
    def of_files(self) -> bool:
        """Whether it measures files."""
        return self.request is not None and self.request.source is FrameSource.FILES

    @property
    def with_motors(self) -> bool:
        """Whether motors turn the adjusters."""
        return self.request is not None and bool(self.request.adjusters)

    @property
    def goes_on(self) -> bool:
        """Whether the practice telescope's bolt that was turned last is to be turned on, the same way."""
        return self.adjuster is not None and self.adjuster.goes_on(self.state)

    def begin(self, request: AlignmentRequest) -> None:
        """Start it; KochabError says why it cannot start now."""
        run = self._new_run(request)
        job = run.start()
        # Not before `start`, which may say why it cannot.
        self.state = AlignmentState("opening", tr("Opening…"))
        self.controls, self.adjuster, self.request = run.controls, None, request
        self.job, self._gone = job, False
        job.succeeded.connect(self._succeeded)
        job.failed.connect(lambda sentence: self._ended(sentence, "wrong"))
        job.cancelled.connect(self._cancelled)
        job.finished.connect(lambda: self._finished(job))
        self.began.emit(request)

    def _new_run(self, request: AlignmentRequest) -> AlignmentRun:
        """A new run for each alignment, so that the steps of an older one are not shown."""
        if self._run is not None:
            self._run.deleteLater()
        self._run = run = AlignmentRun(self._services, request, self._solved, self)
        run.step.connect(self._step)
        run.kept.connect(self.kept)
        run.seen.connect(self.seen)
        run.practising.connect(self._use_practice)
        return run

    def press(self, pressed: PolarButton) -> bool:
        """Pass a button on; the axis is measured again while adjusting alone. Whether it was passed on."""
        heard = self.state.running and (pressed is not PolarButton.REMEASURE or self.state.stage == "adjust")
        if heard:
            self.controls.press(pressed)
        return heard

    def turn_practice(self) -> str | None:
        """Let the practice telescope make the turn that is asked for; None, or why it did not."""
        if self.adjuster is None:
            return tr("Nothing to turn now.")
        try:
            turned = self.adjuster.turn(self.state)
        except KochabError as error:
            return str(error)
        self.press(PolarButton.TURNED)
        return None if turned else tr("Nothing to turn now.")

    def stop(self) -> None:
        """End it; a turning mount stops at once."""
        if self.job is not None:
            self.job.cancel()
            self.message.emit(tr("Stopping…"), "muted")

    def _hear_mount(self) -> None:
        """End with the mount that turns the axis, or with the practice."""
        before, self._connected = self._connected, self._services.mount.known.phase not in ("off", "leaving")
        request = self.request
        if before and not self._connected and request is not None and request.with_mount:
            self._gone = True
            if self.state.running:
                self.stop()
            else:
                self._forget()
            self.telescope_gone.emit()

    def _forget(self) -> None:
        """A telescope that is gone has no error: the numbers of its alignments are in the history."""
        before, self.state = self.state, AlignmentState("ended", tr("The telescope is disconnected."))
        self.stepped.emit(before, self.state)

    def _step(self, step: Progress) -> None:
        before, self.state = self.state, absorb(self.state, step, time.monotonic())
        if self.state != before:
            self.stepped.emit(before, self.state)

    def _use_practice(self, practice: Practice) -> None:
        self.adjuster = PracticeAdjuster(practice)
        self.practising.emit()

    def _succeeded(self, history: History) -> None:
        # There are none where a drift tells one knob alone.
        if history.entries:
            self.kept.emit(history)
            spoilt = tr("Not to be trusted: see why above."), "wrong"
            self.message.emit(*(spoilt if self.state.spoilt else (self._done_words(), "good")))

    def _done_words(self) -> str:
        """That it is done, and within the goal if it is."""
        error, request = self.state.known_error, self.request
        if error is None or request is None or error.total_arcsec > request.goal_arcsec:
            return tr("Done. The report is in Tonight (…).")
        sizes = {"total": angle_in_words(error.total_arcsec), "goal": angle_in_words(request.goal_arcsec)}
        return tr("Done: {total}, within your {goal}. The report is in Tonight (…).", **sizes)

    def _cancelled(self) -> None:
        some = self.state.error is not None
        self._ended(
            tr("Cancelled. These are the last results.") if some else tr("Cancelled. Nothing measured."), "muted"
        )

    def _ended(self, sentence: str, role: str) -> None:
        self.state = replace(
            self.state, stage="ended", words=sentence, detail="", turn_instruction=None, instruction=None
        )
        if self._gone:
            self._forget()
        self.message.emit(sentence, role)

    def _finished(self, job: Job | MountTask) -> None:
        if self.job is job:
            self.job = self.adjuster = None
            self.finished.emit()
            if self.request is not None and self.request.source is FrameSource.PRACTICE and not self._connected:
                self.telescope_gone.emit()  # the practice telescope was this alignment's own
