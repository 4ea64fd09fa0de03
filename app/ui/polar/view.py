"""Polar alignment in the window: set up, measure, turn the bolts, measure again; and keep it."""

import time
from dataclasses import replace

from PySide6.QtCore import QTimer
from PySide6.QtGui import QKeySequence, QShortcut, QShowEvent

from app.core.errors import KochabError
from app.core.progress import Progress
from app.polar.history import History
from app.ui.job import Job
from app.ui.mount.errand import Errand
from app.ui.mount.wishes import kept_mount
from app.ui.palette import Colours
from app.ui.polar.chooser import Chooser
from app.ui.polar.hearing import Hearing
from app.ui.polar.keeping import keep_fields, restore_fields
from app.ui.polar.panel import PolarPanel
from app.ui.polar.practice_hands import PracticeHands
from app.ui.polar.run import Run
from app.ui.polar.state import State, absorb
from app.ui.polar.wish import AlignWish, Source
from app.ui.services import Services
from app.ui.wiring import Practice
from app.workflows.polar_update import PolarControls

LOOK_EVERY_MS = 250


class PolarView(PolarPanel):
    """What is pressed goes to the alignment under way; what it says is shown."""

    def __init__(self, services: Services) -> None:
        super().__init__(services)
        self._services = services
        self.state = State()
        self.controls = PolarControls()
        self.hands: PracticeHands | None = None
        self.job: Job | Errand | None = None
        self._run: Run | None = None
        self.hearing = Hearing(self.cues)
        self._connect()
        self._dress(services.looks.colours)
        restore_fields(self.setup, services.settings)
        if services.cameras.choice is not None:
            self.setup.show_camera(*services.cameras.choice)
        self._idle()

    def _connect(self) -> None:
        for made, do in (
            (self.start, self.begin), (self.done, self.go_on), (self.again, self.remeasure),
            (self.enough, self.leave), (self.at_bolts, self.show_bolts),
            (self.obey, self.play_hands), (self.sound, self.switch_sounds),
            (self.second, self.sweep_again), (self.cancel, self.stop),
        ):  # fmt: skip
            made.clicked.connect(lambda _=False, do=do: do())
        Chooser(self.setup, self._services).said.connect(self.say)
        self.bolts.done.connect(self.go_on)
        self.bolts.remeasure.connect(self.remeasure)
        self.bolts.sounds.connect(self.sound.click)
        self.phone.switched.connect(self.tell_phone)
        self._services.looks.changed.connect(self._dress)
        self._services.jobs.closing.connect(self._close)
        self._services.mount.changed.connect(self._show_mount)
        self._services.cameras.chosen.connect(self.setup.show_camera)
        QShortcut(QKeySequence("F7"), self, self.show_bolts)
        self._clock = QTimer(self)
        self._clock.setInterval(LOOK_EVERY_MS)
        self._clock.timeout.connect(self._show)

    # what a person does -----------------------------------------------------------------------
    def begin(self) -> None:
        """Start what was set up."""
        try:
            wish = self.setup.wish()
            self._keep(wish)
            run = self._new_run(wish)
            job = run.start()
        except KochabError as error:
            self.say(str(error), "wrong")
            return
        self.state = State("opening", "Opening…")
        self.controls, self.hands = run.controls, None
        self.page.name_pole(wish)
        self._follow(job)

    def go_on(self) -> None:
        """What was asked for has been turned."""
        if self.state.running:
            self.controls.turned()
            self.say("Good: waiting for frames that show it.", "muted")

    def remeasure(self) -> None:
        """Leave the bolts and measure again now."""
        if self.state.stage == "adjust":
            self.controls.remeasure()
            self.say("Measuring again as soon as this frame is solved.", "muted")

    def leave(self) -> None:
        """Go on with the frames there are."""
        if self.state.running:
            self.controls.enough()

    def sweep_again(self) -> None:
        """A second sweep, at another declination, as soon as the present one is over."""
        if self.state.running:
            self.controls.second_sweep()
            self.say("A second sweep follows, at another declination: it shows bending.", "muted")

    def play_hands(self) -> None:
        """The practice telescope's hands do what is asked."""
        if self.hands is None:
            return
        try:
            told = self.hands.obey(self.state)
        except KochabError as error:
            told = str(error)
        self.go_on()
        self.say(told, "muted")

    def switch_sounds(self) -> None:
        """Sounds on or off, and words where the system has a voice."""
        on = self.sound.isChecked()
        self.sound.setText("Soun&ds: on" if on else "Soun&ds")
        self.cues.on = self.cues.aloud = on
        self.bolts.sounding = f"sounds: {self.cues.told}" if on else ""
        self.bolts.update()
        self.say(f"Sounds {'on' if on else 'off'}: {self.cues.told}.", "muted")

    def show_bolts(self) -> None:
        """The full screen for three metres."""
        self.bolts.colours = self._services.looks.colours
        self.bolts.show_state(self.state, time.monotonic())
        self.bolts.showFullScreen()
        self.bolts.activateWindow()

    def stop(self) -> None:
        """Give up; a mount that turns is stopped at once."""
        if self.job is not None:
            self.job.cancel()
            self.say("Stopping…", "muted")

    # a run ------------------------------------------------------------------------------------
    def _keep(self, wish: AlignWish) -> None:
        keep_fields(self.setup, self._services.settings)
        if wish.site is not None and wish.source is not Source.PRACTICE:
            self._services.settings.keep_site(wish.site)
        if wish.source is Source.CAMERA and wish.camera is not None:
            self._services.cameras.choose(wish.camera.source, wish.camera.address)

    def _new_run(self, wish: AlignWish) -> Run:
        """One of its own for each: what an older one still says is not heard."""
        if self._run is not None:
            self._run.deleteLater()
        self._run = run = Run(self._services, wish, self)
        run.step.connect(self._heard)
        run.kept.connect(self.night.keep)
        run.practising.connect(self._practising)
        return run

    def _follow(self, job: Job | Errand) -> None:
        self.tabs.setCurrentIndex(1)
        self.job = job
        job.succeeded.connect(self._succeeded)
        job.failed.connect(lambda sentence: self._ended(sentence, "wrong"))
        job.cancelled.connect(lambda: self._ended("Cancelled; this is what there was.", "muted"))
        job.finished.connect(lambda: self._over(job))
        self._clock.start()
        self.enable(True, False)
        self.say("", "muted")
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
        self.say("Done; the report is under Tonight.", "good")

    def _ended(self, sentence: str, role: str) -> None:
        self.state = replace(
            self.state, stage="ended", words=sentence, detail="", asked=None, instruction=None
        )
        self.say(sentence, role)

    def _over(self, job: Job | Errand) -> None:
        if self.job is job:
            self.job = None
            self._idle()

    def _idle(self) -> None:
        self._clock.stop()
        self.hands = None
        self.enable(False, False)
        self._show()

    # showing ----------------------------------------------------------------------------------
    def _show(self) -> None:
        self.show_state(self.state, time.monotonic())

    def _show_mount(self) -> None:
        self.setup.show_mount(kept_mount(self._services.settings), self._services.mount.known)

    def _dress(self, colours: Colours) -> None:
        for part in (self.page, self.night, self.phone):
            part.wear(colours)
        self.bolts.colours = colours
        self.bolts.update()

    def showEvent(self, event: QShowEvent) -> None:
        self.setup.show_site(self._services.settings.site)
        self._show_mount()
        super().showEvent(event)

    def _close(self) -> None:
        self._clock.stop()
        self.cues.close()
        self.bolts.close()
