"""The Polar alignment view: the room with the live frame, and beside it the axis, the set-up, tonight and the phone."""

import time
from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QKeySequence, QShortcut, QShowEvent
from PySide6.QtWidgets import QApplication, QLabel, QSizePolicy

from kochab.core.errors import KochabError, UsageError
from kochab.gear.session import EXPOSURE_S
from kochab.text.translation import number, tr, tr_noop
from kochab.window.devices.mount_status import StopKey
from kochab.window.dialogs import dropped_files
from kochab.window.phone import PhonePanel
from kochab.window.polar.alignment import RunningAlignment
from kochab.window.polar.bolts_view import BoltsView
from kochab.window.polar.buttons import AlignmentButtons
from kochab.window.polar.error_display import AlignPage
from kochab.window.polar.history import HistoryPage
from kochab.window.polar.messages import Message, all_known, most_urgent
from kochab.window.polar.room import PolarRoom
from kochab.window.polar.setup import AlignmentSetupPanel
from kochab.window.polar.sound_cues import SoundCues
from kochab.window.services import Services
from kochab.window.tones import Cues
from kochab.window.view import View
from kochab.window.widgets import button, column, row, scrolled, tab_pages
from kochab.workflows.polar.update import PolarButton
from kochab.workflows.session.alignment import AlignmentRequest, FrameSource
from kochab.workflows.session.alignment_state import AlignmentState

REPLIES = {
    PolarButton.TURNED: tr_noop("Turned; taking a frame ({seconds} s)."),
    PolarButton.REMEASURE: tr_noop("Measuring again after this frame."),
    PolarButton.ENOUGH: "",
    PolarButton.BACK: tr_noop("Kochab returns RA to the start and takes one more frame to check for creep."),
    PolarButton.SECOND_SWEEP: tr_noop("A second sweep at another declination follows, to measure flexure."),
}
REFRESH_MS = 250
SET_UP, ALIGN, TONIGHT, PHONE = range(4)  # pages beside the room
FRAMES_WAITED, LEAST_WAIT_S = 4.0, 6.0
"""Exposures, and at least so long, that a turn may take to be seen; then its button may be pressed again."""


class PolarView(View):
    """Passes buttons to the alignment under way and shows its state in the room, at the bolts and to the ear."""

    room: PolarRoom
    room_first = True  # an alignment begins there
    pages_scroll = True

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.alignment = RunningAlignment(services, self)
        self.setAcceptDrops(True)
        self.setup = AlignmentSetupPanel(services)
        self.page = AlignPage(lambda: self.press(PolarButton.SECOND_SWEEP))
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
            "phone": self.show_phone,
            "stop": self.alignment.stop,
            "set_up": lambda: self.show_page(SET_UP),
            "tonight": lambda: self.show_page(TONIGHT),
        }
        self.buttons = AlignmentButtons(self.press, calls, self.cues.description)
        self.room = PolarRoom(services, self.buttons, calls["set_up"])
        self._said = Message()  # the answer to what a person did last
        self._answered: object = None  # the turn that was made, and when: its frame is awaited
        self._answered_s = 0.0
        self._lay_out()
        self._connect()
        self._show_idle()

    @property
    def message(self) -> QLabel:
        """The label of the room's one message."""
        return self.room.message

    def _lay_out(self) -> None:
        pages = {tr("Set up"): self.setup, tr("Align"): self.page, tr("Tonight"): self.history, tr("Phone"): self.phone}
        self.tabs = tab_pages(tr("Polar alignment"), *((name, scrolled(inside)) for name, inside in pages.items()))
        self.tabs.tabBar().hide()
        self.tabs.currentChanged.connect(self._ask_for_its_room)
        self.tabs.setCurrentIndex(ALIGN)
        self.back = button(tr("‹ Alignment"), lambda: self.tabs.setCurrentIndex(ALIGN), "link")
        self.back.hide()
        self.tabs.currentChanged.connect(lambda index: self.back.setVisible(index != ALIGN))
        column(row(self.back, None), (self.tabs, 1), on=self, margins=(8, 8, 8, 8))

    def _ask_for_its_room(self, current: int) -> None:
        """No page that is not seen makes the view wider than 1024 px leave room for."""
        for index in range(self.tabs.count()):
            page = self.tabs.widget(index)
            assert page is not None
            policy = page.sizePolicy()
            seen = QSizePolicy.Policy.Expanding if index == current else QSizePolicy.Policy.Ignored
            policy.setHorizontalPolicy(seen)
            page.setSizePolicy(policy)

    def _connect(self) -> None:
        services, alignment, buttons = self._services, self.alignment, self.buttons
        self.setup.frames.message.connect(self.say)
        for fields in (self.setup.frames, self.setup.axis, self.setup.aim):
            fields.changed.connect(self._show)
        self.setup.aim.goal.valueChanged.connect(self._show)
        alignment.began.connect(self._began)
        alignment.stepped.connect(self._stepped)
        alignment.seen.connect(self.room.frame.see)
        self.room.files_dropped.connect(self._take_files)
        alignment.practising.connect(self._show)
        alignment.kept.connect(self.history.keep)
        alignment.message.connect(self.say)
        alignment.finished.connect(self._show_idle)
        alignment.telescope_gone.connect(self._fall_silent)
        self.bolts.done.connect(self._confirm)
        self.bolts.remeasure.connect(lambda: self.press(PolarButton.REMEASURE))
        self.bolts.sounds.connect(buttons.sound.click)
        self.phone.switched.connect(self._show_served)
        self.page.zone.activated.connect(self._use_zone)
        services.jobs.closing.connect(self._close)
        services.mount.changed.connect(self.setup.refresh)
        QShortcut(QKeySequence("F7"), self, self.show_bolts)
        self._key = StopKey(alignment.stop, self)  # the mount's Esc does not stop motors at the bolts
        self._clock = QTimer(self, interval=REFRESH_MS)
        self._clock.timeout.connect(self._show)

    def begin(self) -> None:
        """Start what was set up."""
        try:
            request = self.setup.request()
            self.page.imaging = self.setup.aim.frames_to_take
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
        self.room.frame.begin()
        self.tabs.setCurrentIndex(ALIGN)
        self._clock.start()
        self._enable(True)
        self._answered = None
        self.say("", "muted")

    def _use_zone(self, index: int) -> None:
        """Measure the files again with the clock that a person says."""
        self.setup.frames.zone.setCurrentIndex(index)
        self.begin()

    def press(self, pressed: PolarButton) -> None:
        """Pass a button on to the alignment under way."""
        if self.alignment.press(pressed):
            if pressed is PolarButton.TURNED:
                self._answer()
            elif reply := tr(REPLIES[pressed]):
                self.say(reply, "muted")

    def turn_practice(self) -> None:
        """Let the practice telescope make the turn that is asked for."""
        if (text := self.alignment.turn_practice()) is None:
            self._answer()
        else:
            self.say(text, "muted")

    def _confirm(self) -> None:
        """The turn that is asked for was made; once a frame is awaited there is nothing to confirm."""
        if self.alignment.state.hand_needed and not self._waiting:
            self.press(PolarButton.TURNED)

    def _answer(self) -> None:
        """Say at once that the turn was heard, and what is awaited now."""
        self._answered, self._answered_s = self._asked, time.monotonic()
        if self._has_focus():
            self.room.frame.setFocus()  # a button that waits would pass Space on to its neighbour
        self.say(tr(REPLIES[PolarButton.TURNED], seconds=number(self._exposure_s, ".3g")), "muted")

    @property
    def _asked(self) -> object:
        """The turn that is asked for: of RA, or of a bolt."""
        return self.alignment.state.turn_instruction or self.alignment.state.instruction

    @property
    def _exposure_s(self) -> float:
        request = self.alignment.request
        return EXPOSURE_S if request is None or request.camera is None else request.camera.exposure_s

    @property
    def _waiting(self) -> bool:
        """Whether the frame after a turn is awaited."""
        if self._answered is None or self._answered is not self._asked:
            return False
        if self.alignment.adjuster is not None and self.alignment.state.turn_instruction is not None:
            return True  # practice hands have rotated RA for sure, and would rotate it once more
        return time.monotonic() - self._answered_s < max(FRAMES_WAITED * self._exposure_s, LEAST_WAIT_S)

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
        self.room.frame.begin()

    def show_phone(self) -> None:
        """Switch the phone's page on, if it is off, and show its address."""
        self.phone.switch.setChecked(self.phone.switch.isEnabled())
        self.show_page(PHONE)

    def show_page(self, index: int) -> None:
        """Show a page beside the room."""
        self.tabs.setCurrentIndex(index)
        self.side_wanted.emit()

    def show_bolts(self) -> None:
        """Open the full-screen view."""
        self.bolts.show_state(self.alignment.state, time.monotonic())
        self.bolts.showFullScreen()
        self.bolts.activateWindow()

    def _stepped(self, before: AlignmentState, after: AlignmentState) -> None:
        self.sound_cues.play_change(before, after)
        asked = after.turn_instruction is not before.turn_instruction or after.instruction is not before.instruction
        if self._said.role != "wrong" and (asked or after.stage != before.stage):
            self._said = Message()  # what was said is over
        if after.instruction is not before.instruction and self.alignment.goes_on:
            self.turn_practice()
        elif after.hand_needed and not before.hand_needed and self._has_focus():
            # Space presses the button that confirms the turn.
            self._show()  # a button that waits takes no focus
            (self.buttons.turn_for_me if self.alignment.adjuster is not None else self.buttons.done).setFocus()
        else:
            self._show()

    def _has_focus(self) -> bool:
        window = self.window()
        there = window.focusWidget() or window
        return self.isAncestorOf(there) or self.room.isAncestorOf(there)

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
        self.room.setAcceptDrops(not running)
        self.setFocusProxy(self.buttons.done if running else self.buttons.start)
        if had_focus:
            (self.room.frame if running else self).setFocus()  # Space is for no button until a turn is asked for

    def _show(self, _: object = None) -> None:
        state, now_s = self.alignment.state, time.monotonic()
        self.room.show_state(state, now_s, self.setup.aim.goal.value())
        self.page.show_state(state)
        self.page.flexure.setEnabled(state.running and not self.alignment.drifts)
        asked = self.alignment.of_files and not state.running and state.clock_doubted
        self.page.ask_zone(asked, self.setup.frames.zone.currentIndex())
        self.history.note(all_known(state))
        self.phone.show_state(state)
        if self.bolts.isVisible():
            self.bolts.show_state(state, now_s)
        self.buttons.show_state(self.alignment, self._waiting)
        self.room.first.say(self.setup.other_steps)
        with suppress(UsageError):  # while a site is typed
            self.room.sky.show_site(self.setup.aim.typed_site)
        message = most_urgent(state, self._said)
        self.room.strip.show_message(message if message.text else Message(self.setup.sentence))

    def say(self, text: str, role: str) -> None:
        """One sentence, which stays until the next step; an empty one removes it."""
        self._said = Message(text, role)
        self._show()

    def _show_served(self, on: bool) -> None:
        """Whether the phone page is on, in sight whatever is beside the room."""
        self.buttons.phone.setText(tr("Pho&ne: on") if on else tr("Pho&ne"))
        self.buttons.phone.setToolTip(self.phone.url.text() or tr("The same numbers on a phone at the mount"))

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if self.alignment.job is None and dropped_files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        if self.alignment.job is None and (paths := dropped_files(event)):
            event.acceptProposedAction()
            self._take_files(paths)

    def _take_files(self, paths: list[Path]) -> None:
        self.setup.frames.take_files(paths)
        self.show_page(SET_UP)

    def measure(self, paths: list[Path]) -> None:
        """Measure these frames alone, unless an alignment is under way."""
        if self.alignment.job is None:
            self.setup.frames.use_files(paths)
            self.begin()

    def showEvent(self, event: QShowEvent) -> None:
        self.setup.refresh()
        super().showEvent(event)

    def _close(self) -> None:
        self._key.listen(False)
        self._clock.stop()
        self.cues.close()
        self.bolts.close()
