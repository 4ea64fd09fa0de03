"""The buttons of an alignment, in two rows: which can be pressed while it runs, and which while none does."""

from collections.abc import Callable
from functools import partial

from PySide6.QtWidgets import QHBoxLayout

from kochab.text.translation import tr
from kochab.window.polar.alignment import RunningAlignment
from kochab.window.polar.setup import SECOND_TIP
from kochab.window.widgets import ProgressBar, button, row
from kochab.workflows.polar.update import PolarButton


class AlignmentButtons:
    """``press`` takes those that the alignment waits for, ``do`` has what the others call, by their names."""

    def __init__(self, press: Callable[[PolarButton], None], do: dict[str, Callable[[], None]], sounds: str) -> None:
        self.start = button(tr("&Begin"), do["begin"], "main", tr("Measure, adjust, and measure again"))
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
        self.done = button(tr("&Done"), turned, tip=tr("I have made this turn (Space)"))
        self.turn_for_me = button(
            tr("Turn it &for me"), do["turn"], tip=tr("Let the practice telescope make this turn")
        )
        self.again = button(tr("&Measure again"), again, tip=tr("Stop adjusting and measure the axis now"))
        self.use_frames = button(tr("Use &these frames"), enough, tip=tr("Continue with the frames taken so far"))
        self.back = button(tr("Bac&k to start"), back, tip=tr("Back to where RA began: checks for slip"))
        self.second = button(tr("Second s&weep"), sweep, tip=tr(SECOND_TIP))
        self.at_bolts = button(tr("At the bo&lts"), do["bolts"], tip=tr("Full screen, readable from three metres (F7)"))
        tip = tr("Sound cues at the mount: {description}", description=sounds)
        self.sound = button(tr("So&unds"), do["sounds"], tip=tip)
        self.sound.setCheckable(True)
        self.cancel = button(tr("Cancel"), do["stop"], tip=tr("End the alignment; a turning mount stops"))
        self.bar = ProgressBar(tr("Progress of the alignment"))

    def rows(self) -> tuple[QHBoxLayout, QHBoxLayout]:
        """The two rows, to be laid out below each other."""
        first = row(self.start, self.done, self.turn_for_me, self.cancel, (self.bar, 1), None)
        return first, row(self.again, self.use_frames, self.back, self.second, self.at_bolts, self.sound, None)

    def enable(self, running: bool, drifts: bool) -> None:
        """What can be pressed while one runs, and while none does; nobody turns the axis where it ``drifts``."""
        for made in (self.use_frames, self.cancel, self.bar):
            made.setVisible(running)
        for made in (self.done, self.second):
            made.setVisible(running and not drifts)
        self.again.setVisible(False)
        self.back.setVisible(False)
        self.start.setVisible(not running)
        self.turn_for_me.setVisible(False)

    def show_state(self, alignment: RunningAlignment) -> None:
        """What can be pressed at this step."""
        state = alignment.state
        self.bar.show_share(state.fraction)
        if state.running:
            adjusting = state.stage == "adjust"
            self.again.setVisible(adjusting)  # one of the two: while adjusting they mean the same
            self.use_frames.setVisible(not adjusting)
            self.back.setVisible(state.creep_arcsec > 0.0 and not alignment.controls.pressed(PolarButton.BACK))
            self.use_frames.setEnabled(state.stage != "opening")
            self.turn_for_me.setEnabled(state.hand_needed)
