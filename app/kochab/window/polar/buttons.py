"""The four buttons and the menu of an alignment: which can be used while it runs, and which while none does."""

from collections.abc import Callable
from functools import partial

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QPushButton

from kochab.text.translation import tr
from kochab.window.flow import SPACING_PX, Flow
from kochab.window.polar.alignment import RunningAlignment
from kochab.window.polar.setup import SECOND_TIP
from kochab.window.widgets import ProgressBar, button, named
from kochab.workflows.polar.update import PolarButton

BAR_PX = 120


class AlignmentButtons:
    """``press`` takes those that the alignment waits for, ``do`` has what the others call, by their names.

    ``start``, ``turn_for_me`` and ``done`` share a place: one of them is seen, the next thing to do. What is wanted
    less often is in the menu.
    """

    def __init__(self, press: Callable[[PolarButton], None], do: dict[str, Callable[[], None]], sounds: str) -> None:
        turned, again, enough, back, sweep = (
            partial(press, pressed)
            for pressed in (
                PolarButton.TURNED,
                PolarButton.REMEASURE,
                PolarButton.ENOUGH,
                PolarButton.BACK,
                PolarButton.SECOND_SWEEP,
            )
        )
        self.start = button(tr("&Begin"), do["begin"], "main", tr("Measure, adjust, and measure again"))
        self.done = button(tr("&Done"), turned, "main", tr("I have made this turn (Space)"))
        tip = tr("Let practice hands make this turn, and go on while the same bolt is asked for")
        self.turn_for_me = button(tr("Turn it &for me"), do["turn"], "main", tip)
        self.at_bolts = button(tr("Big digits"), do["bolts"], tip=tr("Full screen, readable from three metres (F7)"))
        tip = tr("Sound cues at the mount: {description}", description=sounds)
        self.sound = button(tr("So&unds"), do["sounds"], tip=tip)
        self.sound.setCheckable(True)
        self.phone = button(tr("Pho&ne"), do["phone"], tip=tr("The same numbers on a phone at the mount"))
        self.menu = QMenu()
        self.again = self._row(tr("&Measure again"), again, tr("Stop adjusting and measure the axis now"))
        self.use_frames = self._row(tr("Use &these frames"), enough, tr("Continue with the frames taken so far"))
        self.back = self._row(tr("Bac&k to start"), back, tr("Back to where RA began: checks for slip"))
        self.second = self._row(tr("Second s&weep"), sweep, tr(SECOND_TIP))
        self.cancel = self._row(tr("&End the alignment"), do["stop"], tr("A turning mount stops"))
        self.menu.addSeparator()
        self._rows = {made: self._row(made.text(), made.click, made.toolTip()) for made in (self.phone, self.sound)}
        self.set_up = self._row(tr("&Set up…"), do["set_up"], tr("Frames, axis, site, pole and goal"))
        self.tonight = self._row(tr("Ton&ight…"), do["tonight"], tr("All that is known, and the report"))
        self.more = named(QPushButton("…"), tr("More"), tr("More"))
        self.more.setProperty("role", "more")
        self.more.setMenu(self.menu)
        self.bar = ProgressBar(tr("Progress of the alignment"))
        self.bar.setFixedWidth(BAR_PX)
        self._running = False
        self.menu.aboutToShow.connect(self._name_rows)
        for action in self._rows.values():
            action.setVisible(False)

    def _row(self, text: str, called: Callable[[], None], tip: str) -> QAction:
        action = self.menu.addAction(text)
        action.setToolTip(tip)
        action.triggered.connect(lambda _=False: called())
        return action

    def _name_rows(self) -> None:
        """Give the rows of the menu what their buttons say now: on, or off."""
        for made, action in self._rows.items():
            action.setText(made.text())

    def flow(self) -> Flow:
        """All of them side by side, in as many lines as there is room for."""
        first = (self.start, self.done, self.turn_for_me)
        return Flow(*first, self.at_bolts, self.sound, self.phone, self.more, self.bar)

    def fit(self, width: int) -> None:
        """Move the least used buttons into the menu until the others fit on one line of ``width`` px.

        The progress is seen where there is room left for it.
        """
        places = (self.start, self.done, self.turn_for_me, self.at_bolts)
        line = [*(made for made in places if not made.isHidden()), self.sound, self.phone, self.more]
        for made, action in self._rows.items():
            wide = sum(each.sizeHint().width() for each in line) + SPACING_PX * (len(line) - 1)
            if wide > width:
                line.remove(made)
            if made.isHidden() is not (made not in line):
                made.setVisible(made in line)
            action.setVisible(made not in line)
        left = width - sum(each.sizeHint().width() + SPACING_PX for each in line)
        if self.bar.isHidden() is (self._running and left >= BAR_PX):
            self.bar.setVisible(self.bar.isHidden())

    def enable(self, running: bool, drifts: bool) -> None:
        """What can be used while one runs, and while none does; nobody turns the axis where it ``drifts``."""
        for made in (self.use_frames, self.cancel):
            made.setVisible(running)
        self._running = running
        self.second.setVisible(running and not drifts)
        self.again.setVisible(False)
        self.back.setVisible(False)
        self.start.setVisible(not running)
        self.done.setVisible(running and not drifts)
        self.turn_for_me.setVisible(False)

    def show_state(self, alignment: RunningAlignment, waiting: bool) -> None:
        """What can be used at this step; ``waiting`` for the frame after a turn."""
        state = alignment.state
        self.bar.show_share(state.fraction)
        if not state.running:
            return
        adjusting, practising = state.stage == "adjust", alignment.adjuster is not None
        self.turn_for_me.setVisible(practising and not alignment.drifts)
        self.done.setVisible(not practising and not alignment.drifts)
        for made in (self.turn_for_me, self.done):
            made.setEnabled(state.hand_needed and not waiting)
        self.again.setVisible(adjusting)  # one of the two: while adjusting they mean the same
        self.use_frames.setVisible(not adjusting)
        self.use_frames.setEnabled(state.stage != "opening")
        self.back.setVisible(state.creep_arcsec > 0.0 and not alignment.controls.pressed(PolarButton.BACK))
