"""The Polar alignment view: set up, measure, adjust, measure again, and keep the result."""

import time
from dataclasses import replace
from functools import partial

from PySide6.QtCore import QTimer
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QKeySequence, QShortcut, QShowEvent
from PySide6.QtWidgets import QApplication

from kochab.core import tr, tr_noop
from kochab.core.errors import KochabError
from kochab.core.progress import Progress
from kochab.gear.session import Practice
from kochab.polar.report import History
from kochab.window.devices.mount_control import MountTask
from kochab.window.devices.mount_status import StopKey
from kochab.window.dialogs import dropped_files
from kochab.window.frame.picture_age import PictureAge
from kochab.window.job import Job
from kochab.window.polar.alignment_run import AlignmentRun, PracticeAdjuster
from kochab.window.polar.bolts_view import BoltsView
from kochab.window.polar.error_display import AlignPage
from kochab.window.polar.history import HistoryPage
from kochab.window.polar.phone import PhonePanel
from kochab.window.polar.setup import SECOND_TIP, AlignmentSetupPanel
from kochab.window.polar.sound_cues import Cues, SoundCues
from kochab.window.services import Services
from kochab.window.view import View
from kochab.window.widgets import ProgressBar, button, column, label, row, scrolled, show_text, tab_pages
from kochab.workflows.polar.sources import SolvedFile
from kochab.workflows.polar.update import PolarButton, PolarControls
from kochab.workflows.session.alignment import AlignmentRequest, AxisTurnedBy, FrameSource
from kochab.workflows.session.alignment_state import AlignmentState, absorb

READY = tr_noop("Choose the source of the frames, then begin.")
REPLIES = {
    PolarButton.TURNED: tr_noop("Waiting for a new frame."),
    PolarButton.REMEASURE: tr_noop("Measuring again after this frame."),
    PolarButton.ENOUGH: "",
    PolarButton.BACK: tr_noop("Kochab returns RA to the start and takes one more frame to check for creep."),
    PolarButton.SECOND_SWEEP: tr_noop("A second sweep at another declination follows, to measure flexure."),
}
REFRESH_MS = 250
PHONE = 3  # its tab


class PolarView(View):
    """Passes buttons to the alignment under way and shows its state on every page."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.state = AlignmentState()
        self.controls = PolarControls()
        self.adjuster: PracticeAdjuster | None = None
        self.job: Job | MountTask | None = None
        self._run: AlignmentRun | None = None
        self._request: AlignmentRequest | None = None
        self._connected = False  # the mount, when it was last heard of
        # What was solved is kept: another clock or pole needs no new solve of the same files.
        self._solved: dict[tuple[object, ...], list[SolvedFile]] = {}
        self.setAcceptDrops(True)
        self.setup = AlignmentSetupPanel(services)
        self.page = AlignPage()
        self.history = HistoryPage(services)
        self.phone = PhonePanel(services)
        # A window of its own, without a parent: `_close` closes it.
        self.bolts = BoltsView()
        self.cues = Cues(QApplication.beep)
        self.sound_cues = SoundCues(self.cues)
        self._make_buttons()
        self.bar = ProgressBar(tr("Progress of the alignment"))
        self.message = label(tr(READY), "muted", wrap=True)
        self.picture = PictureAge(services.session)
        self.served = label("", "good", wrap=True)
        self.served.setVisible(False)
        self._lay_out()
        self._connect()
        self._show_idle()

    def _make_buttons(self) -> None:
        # In the order of REPLIES.
        turned, measure, enough, back, sweep = (partial(self.press, pressed) for pressed in REPLIES)
        self.start = button(tr("&Begin"), self.begin, "main", tr("Measure, adjust, and measure again"))
        self.done = button(tr("&Done"), turned, tip=tr("I have made this turn (Space)"))
        self.turn_for_me = button(
            tr("Turn it &for me"), self.turn_practice, tip=tr("Let the practice telescope make this turn")
        )
        self.again = button(tr("&Measure again"), measure, tip=tr("Stop adjusting and measure the axis now"))
        self.use_frames = button(tr("Use &these frames"), enough, tip=tr("Continue with the frames taken so far"))
        self.back = button(tr("Bac&k to start"), back, tip=tr("One more frame where RA began: it shows what crept"))
        self.second = button(tr("Second s&weep"), sweep, tip=tr(SECOND_TIP))
        self.at_bolts = button(
            tr("At the bo&lts"), self.show_bolts, tip=tr("Full screen, readable from three metres (F7)")
        )
        self.sound = button(
            tr("So&unds"),
            self.switch_sounds,
            tip=tr("Sound cues at the mount: {description}", description=self.cues.description),
        )
        self.sound.setCheckable(True)
        self.cancel = button(tr("Cancel"), self.stop, tip=tr("End the alignment; a turning mount stops"))

    def _lay_out(self) -> None:
        pages = {tr("Set up"): self.setup, tr("Align"): self.page, tr("Tonight"): self.history, tr("Phone"): self.phone}
        self.tabs = tab_pages(tr("Polar alignment"), *((name, scrolled(inside)) for name, inside in pages.items()))
        first = row(self.start, self.done, self.turn_for_me, self.cancel, (self.bar, 1), None)
        second = row(self.again, self.use_frames, self.back, self.second, self.at_bolts, self.sound, None)
        parts = ((self.tabs, 1), self.picture, self.message, self.served, first, second)
        column(*parts, on=self, margins=(8, 8, 8, 8))

    def _connect(self) -> None:
        services = self._services
        self.setup.frames.message.connect(self.say)
        self.bolts.done.connect(self.done.click)
        self.bolts.remeasure.connect(self.again.click)
        self.bolts.sounds.connect(self.sound.click)
        self.phone.switched.connect(self._show_served)
        self.page.zone.activated.connect(self._use_zone)
        services.jobs.closing.connect(self._close)
        services.mount.changed.connect(self.setup.refresh)
        services.mount.changed.connect(self._hear_mount)
        QShortcut(QKeySequence("F7"), self, self.show_bolts)
        self._key = StopKey(self.stop, self)  # the mount's Esc does not stop motors at the bolts
        self._clock = QTimer(self, interval=REFRESH_MS)
        self._clock.timeout.connect(self._show)

    def heightForWidth(self, width: int) -> int:
        """As low as can be: the pages scroll, and the buttons stay in sight on a small screen."""
        layout = self.layout()
        return -1 if layout is None else layout.minimumHeightForWidth(width)

    def begin(self) -> None:
        """Start what was set up."""
        try:
            request = self.setup.request()
            self.page.numbers.imaging = self.setup.aim.frames_to_take
            self._save(request)
            run = self._new_run(request)
            job = run.start()
        except KochabError as error:
            self.say(str(error), "wrong")
            return
        # Not before `start`, which may say why it cannot.
        self.state = AlignmentState("opening", tr("Opening…"))
        self.controls, self.adjuster = run.controls, None
        self.page.show_pole(request, self.setup.guess)
        self._request = request
        self._follow(job)

    def _use_zone(self, index: int) -> None:
        """Measure the files again with the clock that a person says."""
        self.setup.frames.zone.setCurrentIndex(index)
        self.begin()

    def press(self, pressed: PolarButton) -> None:
        """Pass a button on to the alignment under way; the axis is measured again while adjusting alone."""
        if self.state.running and (pressed is not PolarButton.REMEASURE or self.state.stage == "adjust"):
            self.controls.press(pressed)
            self.say(tr(REPLIES[pressed]) or self.message.text(), "muted")

    def turn_practice(self) -> None:
        """Let the practice telescope make the turn that is asked for."""
        if self.adjuster is None:
            return
        try:
            text = self.adjuster.turn(self.state)
        except KochabError as error:
            text = str(error)
        self.press(PolarButton.TURNED)
        self.say(text, "muted")

    def switch_sounds(self) -> None:
        """Sounds on or off, and speech where the system has a voice."""
        on = self.sound.isChecked()
        self._sound(on)
        told = tr("Sounds on: {description}.") if on else tr("Sounds off: {description}.")
        self.say(told.format(description=self.cues.description), "muted")

    def _sound(self, on: bool) -> None:
        self.sound.setText(tr("So&unds: on") if on else tr("So&unds"))
        self.cues.on = on
        self.bolts.sounding = tr("sounds: {description}", description=self.cues.description) if on else ""
        self.bolts.update()

    def _hear_mount(self) -> None:
        """End with the mount that turns the axis, or with the practice: sounds and phone page as well."""
        before, self._connected = self._connected, self._services.mount.known.phase not in ("off", "leaving")
        request = self._request
        if before and not self._connected and request is not None and request.with_mount:
            if self.state.running:
                self.stop()
            self._fall_silent()

    def _fall_silent(self) -> None:
        """No sound and no phone page for a telescope that is gone."""
        self.sound.setChecked(False)
        self._sound(False)
        self.phone.switch.setChecked(False)

    def show_bolts(self) -> None:
        """Open the full-screen view."""
        self.bolts.show_state(self.state, time.monotonic())
        self.bolts.showFullScreen()
        self.bolts.activateWindow()

    def stop(self) -> None:
        """End the alignment; a turning mount stops at once."""
        if self.job is not None:
            self.job.cancel()
            self.say(tr("Stopping…"), "muted")

    def _save(self, request: AlignmentRequest) -> None:
        self.setup.save()
        if request.site is not None and request.source is not FrameSource.PRACTICE:
            self._services.settings.keep_site(request.site)
        if request.source is FrameSource.CAMERA and request.camera is not None:
            self._services.cameras.choose(request.camera.source, request.camera.address)

    def _new_run(self, request: AlignmentRequest) -> AlignmentRun:
        """A new run for each alignment, so that the steps of an older one are not shown."""
        if self._run is not None:
            self._run.deleteLater()
        self._run = run = AlignmentRun(self._services, request, self._solved, self)
        run.step.connect(self._step)
        run.kept.connect(self.history.keep)
        run.practising.connect(self._use_practice)
        return run

    def _follow(self, job: Job | MountTask) -> None:
        self.tabs.setCurrentIndex(1)
        self.job = job
        job.succeeded.connect(self._succeeded)
        job.failed.connect(lambda sentence: self._ended(sentence, "wrong"))
        job.cancelled.connect(lambda: self._ended(tr("Cancelled. These are the last results."), "muted"))
        job.finished.connect(lambda: self._finished(job))
        self._clock.start()
        self._enable(True)
        self.say("", "muted")
        self._show()

    def _step(self, step: Progress) -> None:
        before, self.state = self.state, absorb(self.state, step, time.monotonic())
        if self.state == before:
            return
        self.sound_cues.play_change(before, self.state)
        if self.state.hand_needed and not before.hand_needed and self._has_focus():
            # Space presses the button that confirms the turn.
            (self.turn_for_me if self.adjuster is not None else self.done).setFocus()
        self._show()

    def _has_focus(self) -> bool:
        window = self.window()
        return self.isAncestorOf(window.focusWidget() or window)

    def _use_practice(self, practice: Practice) -> None:
        self.adjuster = PracticeAdjuster(practice)
        self.turn_for_me.setVisible(not self._drifts)

    def _succeeded(self, history: History) -> None:
        # There are none where a drift tells one knob alone.
        if history.entries:
            self.history.keep(history)
            done = tr("Done. The report is in the Tonight tab."), "good"
            self.say(*((tr("Not to be trusted: see why above."), "wrong") if self.state.spoilt else done))

    def _ended(self, sentence: str, role: str) -> None:
        self.state = replace(
            self.state, stage="ended", words=sentence, detail="", turn_instruction=None, instruction=None
        )
        self.say(sentence, role)

    def _finished(self, job: Job | MountTask) -> None:
        if self.job is job:
            self.job = None
            self._show_idle()
            if self._request is not None and self._request.source is FrameSource.PRACTICE and not self._connected:
                self._fall_silent()  # the practice telescope was this alignment's own

    @property
    def _drifts(self) -> bool:
        """Whether nobody turns the axis of the alignment under way."""
        request = self._request
        return request is not None and (request.hand is AxisTurnedBy.NOBODY or request.source is FrameSource.FILES)

    def _show_idle(self) -> None:
        self._clock.stop()
        self.adjuster = None
        self._enable(False)
        self._show()

    def _enable(self, running: bool) -> None:
        """What can be pressed while an alignment runs, and while none does."""
        # Hiding the button that has the focus would pass it on to any other.
        had_focus = self._has_focus()
        for made in (self.use_frames, self.cancel, self.bar):
            made.setVisible(running)
        for made in (self.done, self.second):
            made.setVisible(running and not self._drifts)
        self.again.setVisible(False)
        self.back.setVisible(False)
        self.bolts.motors = running and self._request is not None and bool(self._request.adjusters)
        self._key.listen(self.bolts.motors)
        self.start.setVisible(not running)
        self.setup.setEnabled(not running)
        self.turn_for_me.setVisible(False)
        self.setFocusProxy(self.done if running else self.start)
        if had_focus:
            self.setFocus()

    def _show(self) -> None:
        state, now_s = self.state, time.monotonic()
        self.page.show_state(state, now_s)
        files = self._request is not None and self._request.source is FrameSource.FILES
        self.page.ask_zone(files and not state.running and state.clock_doubted, self.setup.frames.zone.currentIndex())
        self.phone.show_state(state)
        if self.bolts.isVisible():
            self.bolts.show_state(state, now_s)
        self.bar.show_share(state.fraction)
        if state.running:
            adjusting = state.stage == "adjust"
            self.again.setVisible(adjusting)  # one of the two: while adjusting they mean the same
            self.use_frames.setVisible(not adjusting)
            self.back.setVisible(state.creep_arcsec > 0.0 and not self.controls.pressed(PolarButton.BACK))
            self.use_frames.setEnabled(state.stage != "opening")
            self.turn_for_me.setEnabled(state.hand_needed)

    def say(self, text: str, role: str) -> None:
        """One sentence that stays until the next; an empty one removes it."""
        show_text(self.message, text, role)

    def _show_served(self, on: bool) -> None:
        """Whether the phone page is on, in sight from every tab."""
        show_text(self.served, tr("Phone page is ON: {text}", text=self.phone.url.text()) if on else "")
        self.tabs.setTabText(PHONE, tr("Phone: ON") if on else tr("Phone"))

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if self.job is None and dropped_files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        if self.job is None and (paths := dropped_files(event)):
            event.acceptProposedAction()
            self.setup.frames.take_files(paths)
            self.tabs.setCurrentIndex(0)

    def showEvent(self, event: QShowEvent) -> None:
        self.setup.refresh()
        super().showEvent(event)

    def _close(self) -> None:
        self._clock.stop()
        self.cues.close()
        self.bolts.close()
