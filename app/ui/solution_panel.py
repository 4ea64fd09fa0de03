"""The pane that says where the frame points."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QVBoxLayout, QWidget

from app.core.solution import Solution
from app.ui.formats import AngleStyle, dec_text, ra_text, radec_plain, short_name, unbroken
from app.ui.solution_text import attitude_forms, attitude_plain, rows, summary
from app.ui.widgets import (
    button,
    copy_text,
    facts_grid,
    fixed_font_family,
    label,
    narrow_box,
    position_labels,
    rule,
    set_role,
    value_label,
)

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
        self._style = AngleStyle.SEXAGESIMAL
        self.old = label("", "old", wrap=True)
        self.ra, self.dec = position_labels()
        self.style_box = narrow_box("How angles are written", 7)
        for style, title in STYLES.items():
            self.style_box.addItem(title, style)
        self.style_box.currentIndexChanged.connect(self._style_picked)
        self.values: dict[str, QWidget] = {}
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(10)
        layout.addWidget(self.old)
        layout.addLayout(self._position())
        layout.addWidget(rule())
        layout.addLayout(self._facts())
        layout.addWidget(rule())
        layout.addLayout(self._attitude())
        self.setVisible(False)

    def show_solution(self, solution: Solution, source: str = "", old: bool = False) -> None:
        """Show a pointing; ``old`` marks it as an earlier frame's."""
        self._solution, self._source = solution, source
        source = short_name(source) or "an earlier frame"
        self.old.setText(f"OLD: the last good pointing, from {source}")
        self.old.setVisible(old)
        for value in (self.ra, self.dec):
            set_role(value, "value_old" if old else "value")
        self._write()
        self.setVisible(True)

    def set_style(self, style: AngleStyle) -> None:
        """Write angles in another way."""
        self._style = style
        self.style_box.setCurrentIndex(self.style_box.findData(style))
        self._write()

    def _position(self) -> QGridLayout:
        grid = facts_grid(4, ("RA", self.ra), ("Dec", self.dec))
        grid.addWidget(
            label("ICRS (J2000), the middle of the frame", "muted", wrap=True), 2, 0, 1, 2
        )
        line = QHBoxLayout()
        line.setSpacing(8)
        line.addWidget(self.style_box, 1)
        line.addWidget(
            button("&Copy RA/Dec", self.copy_position, tip="As text, for other programs")
        )
        grid.addLayout(line, 3, 0, 1, 2)
        return grid

    def _facts(self) -> QGridLayout:
        self._grid = facts_grid(5)
        return self._grid

    def _attitude(self) -> QVBoxLayout:
        column = QVBoxLayout()
        column.setSpacing(4)
        column.addWidget(label("Attitude", "heading"))
        self.forms = []
        for name in ("Quaternion", "Matrix", "Euler angles"):
            title, value = label("", "muted"), value_label(name)
            value.setStyleSheet(f"font-family: '{fixed_font_family()}', monospace;")
            column.addWidget(title)
            column.addWidget(value)
            self.forms.append((title, value))
        line = QHBoxLayout()
        line.setSpacing(8)
        line.addWidget(button("Copy attitu&de", self.copy_attitude))
        line.addWidget(button("Copy a&ll", self.copy_all, tip="Everything on this pane as text"))
        line.addStretch(1)
        column.addSpacing(4)
        column.addLayout(line)
        return column

    def _write(self) -> None:
        s = self._solution
        if s is None:
            return
        ra, dec = s.ra_dec_deg
        self.ra.setText(ra_text(ra, self._style))
        self.dec.setText(dec_text(dec, self._style))
        for title, text, why in rows(s):
            if title not in self.values:
                row = self._grid.rowCount()
                value = value_label(title)
                self._grid.addWidget(label(title, "muted"), row, 0, Qt.AlignmentFlag.AlignTop)
                self._grid.addWidget(value, row, 1)
                self.values[title] = value
            shown = self.values[title]
            shown.setText(unbroken(text))  # type: ignore[attr-defined]
            shown.setToolTip(why)
        for (title_label, value), (name, text) in zip(self.forms, attitude_forms(s), strict=True):
            title_label.setText(name)
            value.setText(text)

    def _style_picked(self) -> None:
        self._style = AngleStyle(self.style_box.currentData())
        self._write()
        self.style_changed.emit(self._style)

    def copy_position(self) -> None:
        """RA/Dec to the clipboard."""
        if self._solution is not None:
            copy_text(radec_plain(*self._solution.ra_dec_deg, self._style))

    def copy_attitude(self) -> None:
        """All forms of the attitude to the clipboard."""
        if self._solution is not None:
            copy_text(attitude_plain(self._solution))

    def copy_all(self) -> None:
        """Everything to the clipboard."""
        if self._solution is not None:
            copy_text(summary(self._solution, self._style, self._source))
