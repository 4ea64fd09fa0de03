"""The error in numbers: altitude, azimuth and the whole, each with its uncertainty and its cure."""

from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QVBoxLayout, QWidget

from app.polar.error import PolarError
from app.polar.words import split_in_words, total_in_words
from app.ui.polar.spinner import Spinner
from app.ui.polar.state import LOCKED, State
from app.ui.polar.target import primes, typeset
from app.ui.widgets import card, label, set_role, value_label

NONE = "–"


class Numbers(QWidget):
    """Shows a :class:`State`; holds none itself."""

    def __init__(self) -> None:
        super().__init__()
        self.total = value_label("Total error")
        self.total.setProperty("role", "title")
        self.split = label("", "muted", wrap=True)
        self.split.setAccessibleName("What the uncertainty is made of")
        self.altitude, self.altitude_cure = value_label("Altitude error"), label("", "", wrap=True)
        self.azimuth, self.azimuth_cure = value_label("Azimuth error"), label("", "", wrap=True)
        for value in (self.altitude, self.azimuth):
            value.setProperty("role", "value")
        self.age = label("", "muted", wrap=True)
        self.more = label("", "", wrap=True)
        self.findings = label("", "", wrap=True)
        self.findings.setAccessibleName("Warnings")
        self.reminder = label(LOCKED, "muted", wrap=True)
        self.spinner = Spinner()
        self._lay_out()
        self.show_state(State(), 0.0)

    def _lay_out(self) -> None:
        box = card()
        grid = QGridLayout(box)
        grid.addWidget(self.total, 0, 0, 1, 2)
        grid.addWidget(self.split, 1, 0, 1, 2)
        for row, (name, value, cure) in enumerate(
            (
                ("Altitude", self.altitude, self.altitude_cure),
                ("Azimuth", self.azimuth, self.azimuth_cure),
            )
        ):
            grid.addWidget(label(name, "muted"), 2 + 2 * row, 0)
            grid.addWidget(value, 2 + 2 * row, 1)
            grid.addWidget(cure, 3 + 2 * row, 0, 1, 2)
        grid.setColumnStretch(1, 1)
        line = QHBoxLayout()
        line.addWidget(self.spinner)
        line.addWidget(self.age, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(box)
        column.addLayout(line)
        for widget in (self.reminder, self.more, self.findings):
            column.addWidget(widget)
        column.addStretch(1)

    def show_state(self, state: State, now_s: float) -> None:
        """Bring every label up to date."""
        error = state.error
        self.total.setText(NONE if error is None else total_text(error))
        self.split.setText("" if error is None else split_text(error))
        self.split.setVisible(error is not None)
        self.altitude.setText(NONE if error is None else altitude_text(error))
        self.azimuth.setText(NONE if error is None else azimuth_text(error))
        self.altitude_cure.setText("" if error is None else altitude_cure(error))
        self.azimuth_cure.setText("" if error is None else azimuth_cure(error))
        old = state.old(now_s)
        role = "muted" if old else "title"
        if self.total.property("kept") != role:  # a style sheet is asked again only on a change
            self.total.setProperty("kept", role)
            self.total.setEnabled(not old)
        self.spinner.turn(old or (state.running and state.stage != "adjust"))
        self.age.setText(age_text(state, now_s))
        self.reminder.setVisible(state.stage == "adjust")
        self.more.setText(more_text(state))
        self.more.setVisible(bool(self.more.text()))
        self.findings.setText("\n".join(f"⚠ {primes(finding.text)}" for finding in state.findings))
        self.findings.setVisible(bool(state.findings))

    def wear(self, colours: object) -> None:
        """The theme's colours, for what is painted."""
        self.spinner.colours = colours  # type: ignore[assignment]
        set_role(self.total, "title")


def total_text(error: PolarError) -> str:
    """The angle between axis and pole, with one sigma of all that may be wrong."""
    return primes(total_in_words(error))


def split_text(error: PolarError) -> str:
    """What the ± is made of."""
    told = primes(split_in_words(error))
    return f"{told[0].upper()}{told[1:]}."


def altitude_text(error: PolarError) -> str:
    """Signed: positive is too high."""
    sign = "+" if error.altitude_arcsec >= 0 else "−"
    return f"{sign}{typeset(error.altitude_arcsec)} ± {typeset(error.whole.sigma_arcsec[0])}"


def azimuth_text(error: PolarError) -> str:
    """Signed, as the knob turns: positive stands too far clockwise."""
    sign = "+" if error.azimuth_arcsec >= 0 else "−"
    return f"{sign}{typeset(error.azimuth_arcsec)} ± {typeset(error.whole.sigma_azimuth_arcsec)}"


def altitude_cure(error: PolarError) -> str:
    """Which way to go."""
    return "▼ lower the axis" if error.altitude_arcsec > 0 else "▲ raise the axis"


def azimuth_cure(error: PolarError) -> str:
    """Which way to go, true from every side."""
    way = "↺ anticlockwise" if error.azimuth_arcsec > 0 else "↻ clockwise"
    return f"{way}, seen from above"


def more_text(state: State) -> str:
    """How much further to turn, while it is measured or when that is all there is."""
    more = state.more_turn_deg
    if state.stage not in ("measure", "turn", "done") or not more:
        return ""
    return f"Turn {more:.0f}° more for a surer axis."


def age_text(state: State, now_s: float) -> str:
    """How old the number is, in words."""
    if state.error is None or not state.running:
        return ""
    seconds = max(0.0, now_s - state.heard_s)
    told = "live" if state.live else "measured"
    if not state.solved:
        told = "OLD: the newest frame has no answer; this was"
    elif state.old(now_s):
        told = "OLD:"
    return f"{told} {seconds:.0f} s ago"
