"""Polar alignment in the window: set up, measure, turn the bolts, measure again; and keep it."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QApplication,
    QFileDialog,
    QHBoxLayout,
    QProgressBar,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from app.core.errors import KochabError, UsageError
from app.core.progress import Progress, Task
from app.polar.history import History
from app.ui.job import Job
from app.ui.mount.wishes import kept_mount
from app.ui.palette import Colours
from app.ui.polar.align_page import AlignPage
from app.ui.polar.bolts_view import BoltsView
from app.ui.polar.cues import Cues
from app.ui.polar.hearing import Hearing
from app.ui.polar.keeping import keep_fields, restore_fields
from app.ui.polar.night import NightPage
from app.ui.polar.phone import PhonePanel
from app.ui.polar.practice_hands import PracticeHands
from app.ui.polar.setup import SetupPanel
from app.ui.polar.state import State, absorb
from app.ui.polar.turning import Holding
from app.ui.polar.wish import Source
from app.ui.polar.work import Tools, working
from app.ui.red_light import RedLight
from app.ui.services import Services
from app.ui.widgets import button, label, scrolled, set_role
from app.ui.wiring import Practice
from app.workflows.polar_update import PolarControls

LOOK_EVERY_MS = 250
READY = "Choose where the frames come from, and begin."
FRAMES = "Frames (*.fit *.fits *.fts *.xisf *.cr2 *.cr3 *.nef *.arw *.dng *.tif *.tiff *.png *.jpg)"


class _Relay(QObject):
    """Carries every step from the alignment's thread to the window's."""

    step = Signal(object)
    kept = Signal(object)
    practising = Signal(object)


class PolarView(QWidget):
    """Tabs above; what can be pressed, and what is said, always in sight below."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.setObjectName("page")
        self._services = services
        self.state = State()
        self.controls = PolarControls()
        self.hands: PracticeHands | None = None
        self.job: Job | None = None
        self._holding = Holding()
        self._relay = _Relay(self)
        self.setup = SetupPanel(services.wiring.practice is not None)
        self.page = AlignPage()
        self.night = NightPage(services)
        self.phone = PhonePanel(services)
        self.bolts = BoltsView()
        self.cues = Cues(QApplication.beep)
        self.hearing = Hearing(self.cues)
        self._make_buttons()
        self._lay_out()
        self._connect()
        self._dress(services.looks.colours)
        restore_fields(self.setup, services.settings)
        self._idle()

    def _make_buttons(self) -> None:
        self.start = button("&Begin", self.begin, "main", "Measure, adjust, and measure again")
        self.done = button("Done, &go on", self.go_on, tip="I have turned what was asked (Space)")
        self.again = button("&Measure again", self.remeasure, tip="Leave the bolts; measure now")
        self.enough = button("Eno&ugh", self.leave, tip="Go on with the frames there are")
        self.at_bolts = button("At the bo&lts", self.show_bolts, tip="Huge digits (F7)")
        self.obey = button("&Practice hands: do it", self.play_hands, tip="Turn what is asked for")
        self.sound = button("So&unds", self.switch_sounds)
        self.sound.setCheckable(True)
        self.sound.setToolTip(f"Heard beside the mount: {self.cues.told}")
        self.cancel = button("Cancel", self.stop, tip="Give up; a mount that turns is stopped")
        self.bar = QProgressBar()
        self.bar.setTextVisible(False)
        self.bar.setRange(0, 1000)
        self.bar.setAccessibleName("Progress of the alignment")
        self.said = label(READY, "muted", wrap=True)
        self.served = label("", "good", wrap=True)
        self.served.setVisible(False)

    def _lay_out(self) -> None:
        self.tabs = QTabWidget()
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName("Polar alignment")
        for widget, name in (
            (scrolled(self.setup), "Set up"), (scrolled(self.page), "Align"),
            (scrolled(self.night), "Tonight"), (scrolled(self.phone), "Phone"),
        ):  # fmt: skip
            self.tabs.addTab(widget, name)
        first, second = QHBoxLayout(), QHBoxLayout()
        for made in (self.start, self.done, self.obey, self.cancel):
            first.addWidget(made)
        first.addWidget(self.bar, 1)
        first.addStretch(1)
        for made in (self.again, self.enough, self.at_bolts, self.sound):
            second.addWidget(made)
        second.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 8, 8, 8)
        column.addWidget(self.tabs, 1)
        column.addWidget(self.said)
        column.addWidget(self.served)
        column.addLayout(first)
        column.addLayout(second)
        self.setFocusProxy(self.start)

    def _connect(self) -> None:
        self.setup.files_wanted.connect(self._ask_files)
        self.setup.open_frame_wanted.connect(self._add_open_frame)
        self.setup.devices_wanted.connect(self._find_devices)
        self.bolts.done.connect(self.go_on)
        self.bolts.remeasure.connect(self.remeasure)
        self.bolts.sounds.connect(self.sound.click)
        self.phone.switched.connect(self._tell_phone)
        self._services.looks.changed.connect(self._dress)
        self._services.jobs.closing.connect(self._close)
        QShortcut(QKeySequence("F7"), self, self.show_bolts)
        self._clock = QTimer(self)
        self._clock.setInterval(LOOK_EVERY_MS)
        self._clock.timeout.connect(self._show)

    # what a person does -----------------------------------------------------------------------
    def begin(self) -> None:
        """Start what was set up."""
        try:
            wish = self.setup.wish()
        except UsageError as error:
            self._say(str(error), "wrong")
            return
        keep_fields(self.setup, self._services.settings)
        if wish.site is not None and wish.source is not Source.PRACTICE:
            self._services.settings.keep_site(wish.site)
        relay = self._new_relay()
        self.state = State("opening", "Opening…")
        self.controls, self._holding, self.hands = PolarControls(), Holding(), None
        self.page.name_pole(wish)
        tools = Tools(
            self.controls, relay.step.emit, relay.kept.emit, self._holding, relay.practising.emit,
            self._services.wiring.practice,
        )  # fmt: skip
        self._run(working(wish, tools))

    def go_on(self) -> None:
        """What was asked for has been turned."""
        if self.state.running:
            self.controls.turned()
            self._say("Good: waiting for frames that show it.", "muted")

    def remeasure(self) -> None:
        """Leave the bolts and measure again now."""
        if self.state.stage == "adjust":
            self.controls.remeasure()
            self._say("Measuring again as soon as this frame is solved.", "muted")

    def leave(self) -> None:
        """Go on with the frames there are."""
        if self.state.running:
            self.controls.enough()

    def play_hands(self) -> None:
        """The practice telescope's hands do what is asked."""
        if self.hands is None:
            return
        try:
            told = self.hands.obey(self.state)
        except KochabError as error:
            told = str(error)
        self.go_on()
        self._say(told, "muted")

    def switch_sounds(self) -> None:
        """Sounds on or off, and words where the system has a voice."""
        on = self.sound.isChecked()
        self.sound.setText("So&unds: on" if on else "So&unds")
        self.cues.on = self.cues.aloud = on
        self.bolts.sounding = f"sounds: {self.cues.told}" if on else ""
        self.bolts.update()
        self._say(f"Sounds {'on' if on else 'off'}: {self.cues.told}.", "muted")

    def show_bolts(self) -> None:
        """The full screen for three metres."""
        self.bolts.colours = self._services.looks.colours
        self.bolts.show_state(self.state, time.monotonic())
        self.bolts.showFullScreen()
        self.bolts.activateWindow()

    def stop(self) -> None:
        """Give up; whatever turns is stopped first."""
        self._holding.stop()
        if self.job is not None:
            self.job.cancel()
            self._say("Stopping…", "muted")

    # a run ------------------------------------------------------------------------------------
    def _new_relay(self) -> _Relay:
        """One of its own for each run: what an older one still says is not heard."""
        self._relay.deleteLater()
        self._relay = relay = _Relay(self)
        relay.step.connect(self._heard)
        relay.kept.connect(self.night.keep)
        relay.practising.connect(self._practising)
        return relay

    def _run(self, task: Task[History]) -> None:
        self.tabs.setCurrentIndex(1)
        self.job = job = self._services.jobs.run(task, "polar")
        job.succeeded.connect(self._succeeded)
        job.failed.connect(lambda sentence: self._ended(sentence, "wrong"))
        job.cancelled.connect(lambda: self._ended("Cancelled; this is what there was.", "muted"))
        job.finished.connect(lambda: self._idle() if self.job is job else None)
        self._clock.start()
        self._enable(True)
        self._say("", "muted")
        self._show()

    def _heard(self, step: Progress) -> None:
        before, self.state = self.state, absorb(self.state, step, time.monotonic())
        if self.state == before:
            return
        self.hearing.hear(before, self.state)
        if self.state.hand_needed and not before.hand_needed:
            self._ask_for_space()
        self._show()

    def _ask_for_space(self) -> None:
        """Space presses what has the focus: the button that says that it was done."""
        window = self.window()
        if self.isAncestorOf(window.focusWidget() or window):
            (self.obey if self.hands is not None else self.done).setFocus()

    def _practising(self, practice: Practice) -> None:
        self.hands = PracticeHands(practice)
        self.obey.setVisible(True)

    def _succeeded(self, history: History) -> None:
        self.night.keep(history)
        self._say("Done; the report is under Tonight.", "good")

    def _ended(self, sentence: str, role: str) -> None:
        self.state = replace(
            self.state, stage="ended", words=sentence, detail="", asked=None, instruction=None
        )
        self._say(sentence, role)

    def _idle(self) -> None:
        self._clock.stop()
        self.hands = None
        self._enable(False)
        self._show()

    def _enable(self, running: bool) -> None:
        within = self.isAncestorOf(self.window().focusWidget() or self.window())
        for made in (self.done, self.again, self.enough, self.cancel, self.bar):
            made.setVisible(running)
        self.start.setVisible(not running)
        self.setup.setEnabled(not running)
        self.obey.setVisible(running and self.hands is not None)
        self.done.setEnabled(running)
        self.cancel.setEnabled(running)
        self.setFocusProxy(self.done if running else self.start)
        if within:
            self.setFocus()

    # showing ----------------------------------------------------------------------------------
    def _show(self) -> None:
        now, state = time.monotonic(), self.state
        self.page.show_state(state, now)
        self.phone.show_state(state)
        if self.bolts.isVisible():
            self.bolts.show_state(state, now)
        self.bar.setRange(0, 0 if state.fraction is None else 1000)
        if state.fraction is not None:
            self.bar.setValue(round(1000 * state.fraction))
        if state.running:
            self.again.setEnabled(state.stage == "adjust")
            self.enough.setEnabled(state.stage != "opening")
            self.obey.setEnabled(state.hand_needed)

    def _say(self, text: str, role: str) -> None:
        self.said.setText(text)
        self.said.setVisible(bool(text))
        if self.said.property("role") != role:
            set_role(self.said, role)

    def _tell_phone(self, on: bool) -> None:
        self.served.setText(f"The phone's page is ON: {self.phone.page.url}" if on else "")
        self.served.setVisible(on)
        self.tabs.setTabText(3, "Phone: ON" if on else "Phone")

    def _dress(self, colours: Colours) -> None:
        for part in (self.page, self.night, self.phone):
            part.wear(colours)
        self.bolts.colours = colours
        self.bolts.update()

    # set-up -----------------------------------------------------------------------------------
    def showEvent(self, event: Any) -> None:
        self.setup.show_site(self._services.settings.site)
        self.setup.show_mount(kept_mount(self._services.settings))
        super().showEvent(event)

    def _ask_files(self, second: bool) -> None:
        start = self._services.settings.text("folder", str(Path.home()))
        dialog = QFileDialog(self.window(), "Frames to measure", start, f"{FRAMES};;All files (*)")
        dialog.setFileMode(QFileDialog.FileMode.ExistingFiles)
        if self._services.looks.is_night:
            dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
            dialog.setGraphicsEffect(RedLight(dialog))
        if dialog.exec():
            self.setup.add_files([Path(p) for p in dialog.selectedFiles()], int(second))
        dialog.deleteLater()

    def _add_open_frame(self) -> None:
        path = self._services.session.known.path
        if path is None:
            self._say("Open a frame first.", "muted")
        else:
            self.setup.add_files([path])

    def _find_devices(self, source: str, address: str) -> None:
        def looking() -> Task[Any]:
            from app.cameras import list_devices

            yield Progress("devices")
            return list_devices(source, address)

        job = self._services.jobs.run(looking(), "devices")
        job.succeeded.connect(self._found)
        job.failed.connect(lambda sentence: self._say(sentence, "wrong"))

    def _found(self, devices: list[Any]) -> None:
        self.setup.show_devices(devices)
        self._say("" if devices else "No camera of this kind was found.", "muted")

    def _close(self) -> None:
        self._clock.stop()
        self._holding.stop()
        self.cues.close()
        self.bolts.close()
