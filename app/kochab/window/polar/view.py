"""The Polar alignment view: set up, measure, adjust, measure again, and keep the result."""

import time

from PySide6.QtCore import QTimer
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QKeySequence, QShortcut, QShowEvent
from PySide6.QtWidgets import QApplication

from kochab.core.errors import KochabError
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_status import StopKey
from kochab.window.dialogs import dropped_files
from kochab.window.frame.picture_age import PictureAge
from kochab.window.polar.alignment import RunningAlignment
from kochab.window.polar.bolts_view import BoltsView
from kochab.window.polar.buttons import AlignmentButtons
from kochab.window.polar.error_display import AlignPage
from kochab.window.polar.history import HistoryPage
from kochab.window.polar.phone import PhonePanel
from kochab.window.polar.setup import AlignmentSetupPanel
from kochab.window.polar.sound_cues import Cues, SoundCues
from kochab.window.services import Services
from kochab.window.view import View
from kochab.window.widgets import column, label, scrolled, show_text, tab_pages
from kochab.workflows.polar.update import PolarButton
from kochab.workflows.session.alignment import AlignmentRequest, FrameSource
from kochab.workflows.session.alignment_state import AlignmentState

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
    """Passes buttons to the alignment under way and shows its state on every page, at the bolts and to the ear."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.alignment = RunningAlignment(services, self)
        self.setAcceptDrops(True)
        self.setup = AlignmentSetupPanel(services)
        self.page = AlignPage()
        self.history = HistoryPage(services)
        self.phone = PhonePanel(services)
        # A window of its own, without a parent: `_close` closes it.
        self.bolts = BoltsView()
        self.cues = Cues(QApplication.beep)
        self.sound_cues = SoundCues(self.cues)
        calls = {
            "begin": self.begin,
            "turn": self.turn_practice,
            "bolts": self.show_bolts,
            "sounds": self.switch_sounds,
            "stop": self.alignment.stop,
        }
        self.buttons = AlignmentButtons(self.press, calls, self.cues.description)
        self.message = label(tr(READY), "muted", wrap=True)
        self.picture = PictureAge(services.session)
        self.served = label("", "good", wrap=True)
        self.served.setVisible(False)
        self._lay_out()
        self._connect()
        self._show_idle()

    def _lay_out(self) -> None:
        pages = {tr("Set up"): self.setup, tr("Align"): self.page, tr("Tonight"): self.history, tr("Phone"): self.phone}
        self.tabs = tab_pages(tr("Polar alignment"), *((name, scrolled(inside)) for name, inside in pages.items()))
        parts = ((self.tabs, 1), self.picture, self.message, self.served, *self.buttons.rows())
        column(*parts, on=self, margins=(8, 8, 8, 8))

    def _connect(self) -> None:
        services, alignment, buttons = self._services, self.alignment, self.buttons
        self.setup.frames.message.connect(self.say)
        alignment.began.connect(self._began)
        alignment.stepped.connect(self._stepped)
        alignment.practising.connect(lambda: buttons.turn_for_me.setVisible(not alignment.drifts))
        alignment.kept.connect(self.history.keep)
        alignment.message.connect(self.say)
        alignment.finished.connect(self._show_idle)
        alignment.telescope_gone.connect(self._fall_silent)
        self.bolts.done.connect(buttons.done.click)
        self.bolts.remeasure.connect(buttons.again.click)
        self.bolts.sounds.connect(buttons.sound.click)
        self.phone.switched.connect(self._show_served)
        self.page.zone.activated.connect(self._use_zone)
        services.jobs.closing.connect(self._close)
        services.mount.changed.connect(self.setup.refresh)
        QShortcut(QKeySequence("F7"), self, self.show_bolts)
        self._key = StopKey(alignment.stop, self)  # the mount's Esc does not stop motors at the bolts
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
            self.alignment.begin(request)
        except KochabError as error:
            self.say(str(error), "wrong")

    def _save(self, request: AlignmentRequest) -> None:
        self.setup.save()
        if request.site is not None and request.source is not FrameSource.PRACTICE:
            self._services.settings.keep_site(request.site)
        if request.source is FrameSource.CAMERA and request.camera is not None:
            self._services.cameras.choose(request.camera.source, request.camera.address)

    def _began(self, request: AlignmentRequest) -> None:
        self.page.show_pole(request, self.setup.guess)
        self.tabs.setCurrentIndex(1)
        self._clock.start()
        self._enable(True)
        self.say("", "muted")
        self._show()

    def _use_zone(self, index: int) -> None:
        """Measure the files again with the clock that a person says."""
        self.setup.frames.zone.setCurrentIndex(index)
        self.begin()

    def press(self, pressed: PolarButton) -> None:
        """Pass a button on to the alignment under way."""
        if self.alignment.press(pressed):
            self.say(tr(REPLIES[pressed]) or self.message.text(), "muted")

    def turn_practice(self) -> None:
        """Let the practice telescope make the turn that is asked for."""
        if text := self.alignment.turn_practice():
            self.say(text, "muted")

    def switch_sounds(self) -> None:
        """Sounds on or off, and speech where the system has a voice."""
        on = self.buttons.sound.isChecked()
        self._sound(on)
        message = tr("Sounds on: {description}.") if on else tr("Sounds off: {description}.")
        self.say(message.format(description=self.cues.description), "muted")

    def _sound(self, on: bool) -> None:
        self.buttons.sound.setText(tr("So&unds: on") if on else tr("So&unds"))
        self.cues.on = on
        self.bolts.sounding = tr("sounds: {description}", description=self.cues.description) if on else ""
        self.bolts.update()

    def _fall_silent(self) -> None:
        """No sound and no phone page for a telescope that is gone."""
        self.buttons.sound.setChecked(False)
        self._sound(False)
        self.phone.switch.setChecked(False)

    def show_bolts(self) -> None:
        """Open the full-screen view."""
        self.bolts.show_state(self.alignment.state, time.monotonic())
        self.bolts.showFullScreen()
        self.bolts.activateWindow()

    def _stepped(self, before: AlignmentState, after: AlignmentState) -> None:
        self.sound_cues.play_change(before, after)
        if after.hand_needed and not before.hand_needed and self._has_focus():
            # Space presses the button that confirms the turn.
            (self.buttons.turn_for_me if self.alignment.adjuster is not None else self.buttons.done).setFocus()
        self._show()

    def _has_focus(self) -> bool:
        window = self.window()
        return self.isAncestorOf(window.focusWidget() or window)

    def _show_idle(self) -> None:
        self._clock.stop()
        self._enable(False)
        self._show()

    def _enable(self, running: bool) -> None:
        """What can be used while an alignment runs, and while none does."""
        # Hiding the button that has the focus would pass it on to any other.
        had_focus = self._has_focus()
        self.buttons.enable(running, self.alignment.drifts)
        self.bolts.motors = running and self.alignment.with_motors
        self._key.listen(self.bolts.motors)
        self.setup.setEnabled(not running)
        self.setFocusProxy(self.buttons.done if running else self.buttons.start)
        if had_focus:
            self.setFocus()

    def _show(self) -> None:
        state, now_s = self.alignment.state, time.monotonic()
        self.page.show_state(state, now_s)
        asked = self.alignment.of_files and not state.running and state.clock_doubted
        self.page.ask_zone(asked, self.setup.frames.zone.currentIndex())
        self.phone.show_state(state)
        if self.bolts.isVisible():
            self.bolts.show_state(state, now_s)
        self.buttons.show_state(self.alignment)

    def say(self, text: str, role: str) -> None:
        """One sentence that stays until the next; an empty one removes it."""
        show_text(self.message, text, role)

    def _show_served(self, on: bool) -> None:
        """Whether the phone page is on, in sight from every tab."""
        show_text(self.served, tr("Phone page is ON: {text}", text=self.phone.url.text()) if on else "")
        self.tabs.setTabText(PHONE, tr("Phone: ON") if on else tr("Phone"))

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if self.alignment.job is None and dropped_files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        if self.alignment.job is None and (paths := dropped_files(event)):
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
