"""The Solution tab: the state of the frame, and its pointing."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QVBoxLayout, QWidget

from kochab.core import angle_text
from kochab.core.angle_text import AngleStyle, breakable, short_name, unbroken
from kochab.core.progress import Progress
from kochab.core.solution import NoSolution, Solution
from kochab.window.widgets import (
    button,
    clear_layout,
    column,
    copy_text,
    facts_grid,
    fixed_font_family,
    grid,
    label,
    narrow_box,
    position_labels,
    row,
    set_role,
    show_text,
    styled_frame,
    value_label,
)
from kochab.workflows import solution_text

STYLES = {
    AngleStyle.SEXAGESIMAL: "hours (hms)",
    AngleStyle.DEGREES: "degrees (dms)",
    AngleStyle.DECIMAL: "decimal degrees",
}


class SolutionPanel(QWidget):
    """Shows one :class:`Solution`, marked old when it belongs to an earlier frame."""

    style_changed = Signal(object)  # AngleStyle

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._solution: Solution | None = None
        self._source = ""
        self.old = label("", "old", wrap=True)
        self.ra, self.dec = position_labels()
        self.style_box = narrow_box("Angle format", 7, {title: style for style, title in STYLES.items()})
        self.style_box.currentIndexChanged.connect(self._style_picked)
        self.values: dict[str, QLabel] = {}
        self._grid = facts_grid(5)
        parts = (self.old, self._position(), styled_frame("rule"), self._grid, styled_frame("rule"), self._attitude())
        column(*parts, on=self, spacing=10, margins=(0, 0, 0, 0))
        self.setVisible(False)

    def show_solution(self, solution: Solution, source: str = "", old: bool = False) -> None:
        """Show a pointing; ``old`` marks it as an earlier frame's."""
        self._solution, self._source = solution, source
        source = short_name(source) or "an earlier frame"
        show_text(self.old, f"OLD: last solution, from {source}" if old else "")
        for value in (self.ra, self.dec):
            set_role(value, "value_old" if old else "value")
        self._write()
        self.setVisible(True)

    @property
    def _style(self) -> AngleStyle:
        return AngleStyle(self.style_box.currentData())

    def set_style(self, style: AngleStyle) -> None:
        self.style_box.setCurrentIndex(self.style_box.findData(style))
        self._write()

    def _position(self) -> QGridLayout:
        grid = facts_grid(4, ("RA", self.ra), ("Dec", self.dec))
        grid.addWidget(label("ICRS (J2000), centre of the frame", "muted", wrap=True), 2, 0, 1, 2)
        copy = button("&Copy RA/Dec", self.copy_position, tip="As text, for other programs")
        grid.addLayout(row((self.style_box, 1), copy, spacing=8), 3, 0, 1, 2)
        return grid

    def _attitude(self) -> QVBoxLayout:
        names = ("Quaternion", "Matrix", "Euler angles", "Optical axis")
        self.forms = [(label("", "muted"), value_label(name)) for name in names]
        for _, value in self.forms:
            value.setStyleSheet(f"font-family: '{fixed_font_family()}', monospace;")
        copy = button("Copy attitu&de", self.copy_attitude)
        copy_all = button("Copy a&ll", self.copy_all, tip="All values as text")
        parts = [part for form in self.forms for part in form]
        return column(label("Attitude", "heading"), *parts, 4, row(copy, copy_all, None, spacing=8), spacing=4)

    def _write(self) -> None:
        s = self._solution
        if s is None:
            return
        ra, dec = s.ra_dec_deg
        self.ra.setText(angle_text.ra_text(ra, self._style))
        self.dec.setText(angle_text.dec_text(dec, self._style))
        for title, text, why in solution_text.rows(s):
            if title not in self.values:
                at = self._grid.rowCount()
                self.values[title] = value_label(title)
                self._grid.addWidget(label(title, "muted"), at, 0, Qt.AlignmentFlag.AlignTop)
                self._grid.addWidget(self.values[title], at, 1)
            self.values[title].setText(unbroken(text))
            self.values[title].setToolTip(why)
        for (title_label, value), (name, text) in zip(self.forms, solution_text.attitude_forms(s), strict=True):
            title_label.setText(name)
            value.setText(text)

    def _style_picked(self) -> None:
        self._write()
        self.style_changed.emit(self._style)

    def copy_position(self) -> None:
        if self._solution is not None:
            copy_text(angle_text.radec_plain(*self._solution.ra_dec_deg, self._style))

    def copy_attitude(self) -> None:
        if self._solution is not None:
            copy_text(solution_text.attitude_plain(self._solution))

    def copy_all(self) -> None:
        if self._solution is not None:
            copy_text(solution_text.summary(self._solution, self._style, self._source))


LONGEST = 120  # letters of a stage's detail


class StateCard(QFrame):
    """The state of the frame; for a failed solve also the advice and the numbers."""

    hints_wanted = Signal()
    again_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("card")
        self.title = label("", "heading", wrap=True)
        self.text = label("", wrap=True)
        self.advice = label("", wrap=True)
        self.advice.setStyleSheet("font-weight: 600;")
        self._failure: NoSolution | None = None
        self._source = ""
        self._numbers = facts_grid(3)
        self.again = button("Solve agai&n", self.again_wanted.emit)
        self.hints = button("G&ive a hint…", self.hints_wanted.emit, tip="Pixel scale, field or position")
        self.copy = button("Copy re&port", self._copy)
        buttons = grid((self.again, self.hints), (self.copy,), across=8, down=8, stretch=(0, 0, 1))
        parts = (self.title, self.text, self.advice, self._numbers, buttons)
        column(*parts, on=self, spacing=6, margins=(12, 10, 12, 10))
        self._say("No image", "Open an image of the night sky.")

    def show_working(self, progress: Progress) -> None:
        doing = {"read": "Reading", "display": "Preparing the image"}.get(progress.stage, "Solving")
        self._say(f"{doing}…", short_name(progress.detail or progress.stage, LONGEST))

    def show_solution(self, solution: Solution) -> None:
        """How many stars matched, and how likely that is by chance."""
        odds = angle_text.false_alarm_text(solution.log10_false_alarm)
        self._say("Solved", f"{len(solution.stars)} stars matched (chance match: {odds})", role="good")
        show_text(self.advice, "\n".join(solution.warnings))

    def show_failure(self, failure: NoSolution, source: str = "") -> None:
        """Why there is no solution, and what to do about it."""
        tried = f"Tried: {failure.tried}" if failure.tried else ""
        self._say(f"No solution: {failure.reason}", tried, failure.advice, role="bad")
        self._failure, self._source = failure, source
        numbers = [*solution_text.measured_rows(failure), ("time", solution_text.times_text(failure.elapsed_ms))]
        for at, (name, value) in enumerate(numbers):
            self._numbers.addWidget(label(name, "muted"), at, 0, Qt.AlignmentFlag.AlignTop)
            self._numbers.addWidget(label(unbroken(value), wrap=True), at, 1)
        for b in (self.again, self.hints, self.copy):
            b.setVisible(True)

    def show_error(self, title: str, sentence: str) -> None:
        """A file that cannot be read, or a fault."""
        self._say(title, sentence, role="bad")

    def show_stopped(self) -> None:
        self._say("Cancelled", "")
        self.again.setVisible(True)
        self.hints.setVisible(True)

    def _say(self, title: str, text: str, advice: str = "", role: str = "heading") -> None:
        self._failure = None
        self.title.setText(title)
        set_role(self.title, role if role != "good" else "heading")
        show_text(self.text, breakable(text))
        show_text(self.advice, advice)
        clear_layout(self._numbers)
        for b in (self.again, self.hints, self.copy):
            b.setVisible(False)
        self.setAccessibleName(title)
        self.setAccessibleDescription(f"{text} {advice}".strip())

    def _copy(self) -> None:
        if self._failure is not None:
            copy_text(solution_text.failure_plain(self._failure, self._source))
