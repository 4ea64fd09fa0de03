"""The Solution tab: everything about a pointing but what the card over the image says."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from kochab.core.solution import Solution
from kochab.text import angle_text
from kochab.text.angle_text import AngleStyle, unbroken
from kochab.text.translation import tr, tr_noop
from kochab.window.widgets import (
    button,
    column,
    copy_text,
    facts_grid,
    fixed_font_family,
    label,
    narrow_box,
    row,
    styled_frame,
    value_label,
)
from kochab.workflows import solution_text

STYLES = {
    AngleStyle.SEXAGESIMAL: tr_noop("hours (hms)"),
    AngleStyle.DEGREES: tr_noop("degrees (dms)"),
    AngleStyle.DECIMAL: tr_noop("decimal degrees"),
}


class SolutionPanel(QWidget):
    """Camera, method, timings and attitude of one :class:`Solution`, and what can be copied of it."""

    style_changed = Signal(object)  # AngleStyle

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._solution: Solution | None = None
        self._source = ""
        self.style_box = narrow_box(tr("Angle format"), 7, {tr(title): style for style, title in STYLES.items()})
        self.style_box.currentIndexChanged.connect(self._style_picked)
        self.values: dict[str, QLabel] = {}
        self._grid = facts_grid(5)
        copy = button(tr("&Copy RA/Dec"), self.copy_position, tip=tr("As text, for other programs"))
        angles = row((self.style_box, 1), copy, spacing=8)
        parts = (angles, styled_frame("rule"), self._grid, styled_frame("rule"), self._attitude())
        column(*parts, on=self, spacing=10, margins=(0, 0, 0, 0))
        self.setVisible(False)

    def show_solution(self, solution: Solution, source: str = "") -> None:
        """Show a pointing, found in the file ``source``."""
        self._solution, self._source = solution, source
        self._write()
        self.setVisible(True)

    @property
    def _style(self) -> AngleStyle:
        return AngleStyle(self.style_box.currentData())

    def set_style(self, style: AngleStyle) -> None:
        self.style_box.setCurrentIndex(self.style_box.findData(style))
        self._write()

    def _attitude(self) -> QVBoxLayout:
        names = (tr("Quaternion"), tr("Matrix"), tr("Euler angles"), tr("Optical axis"))
        self.forms = [(label("", "muted"), value_label(name)) for name in names]
        for _, value in self.forms:
            value.setStyleSheet(f"font-family: '{fixed_font_family()}', monospace;")
        copy = button(tr("Copy attitu&de"), self.copy_attitude)
        copy_all = button(tr("Copy a&ll"), self.copy_all, tip=tr("All values as text"))
        parts = [part for form in self.forms for part in form]
        return column(label(tr("Attitude"), "heading"), *parts, 4, row(copy, copy_all, None, spacing=8), spacing=4)

    def _write(self) -> None:
        s = self._solution
        if s is None:
            return
        for title, text, why in solution_text.rows(s):
            # Every solution has the same titles, so the rows are made once.
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
