"""Where to go: a field that knows names, Goto and Centre."""

from PySide6.QtCore import QStringListModel, Qt, Signal
from PySide6.QtWidgets import (
    QCompleter,
    QDoubleSpinBox,
    QHBoxLayout,
    QLineEdit,
    QVBoxLayout,
    QWidget,
)

from app.ui.mount.reasoned import ReasonedButton
from app.ui.widgets import label

TOLERANCE_ARCSEC = (2.0, 3600.0)


class GoBox(QWidget):
    """The target and what to do about it; ``beside`` stands beside the buttons."""

    goto_wanted = Signal(str)
    centre_wanted = Signal(str, float)

    def __init__(self, beside: QWidget) -> None:
        super().__init__()
        self.target = QLineEdit()
        self.target.setAccessibleName("Where to go")
        self.target.setPlaceholderText("M 42, Vega, HIP 32349, or 5h35m17s -5d23m (J2000)")
        self._names = QStringListModel(self)
        self.completer = QCompleter(self._names, self)
        self.completer.setCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        self.completer.setFilterMode(Qt.MatchFlag.MatchStartsWith)
        self.target.setCompleter(self.completer)
        self.goto = ReasonedButton("Goto", self._goto, "Slew there; the mount’s own idea of there")
        self.centre = ReasonedButton(
            "Centre",
            self._centre,
            "Slew there, look, and correct until it is in the middle",
            "main",
        )
        self.tolerance = QDoubleSpinBox()
        self.tolerance.setAccessibleName("Centred to within, arcseconds")
        self.tolerance.setRange(*TOLERANCE_ARCSEC)
        self.tolerance.setDecimals(0)
        self.tolerance.setValue(60.0)
        self.tolerance.setPrefix("to ")
        self.tolerance.setSuffix("″")
        self.target.returnPressed.connect(self.goto.click)
        above, below = QHBoxLayout(), QHBoxLayout()
        above.addWidget(label("Go to", "heading"))
        above.addWidget(self.target, 1)
        for widget in (self.goto, self.centre, self.tolerance, beside):
            below.addWidget(widget)
        below.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addLayout(above)
        column.addLayout(below)

    def offer_names(self, names: list[str]) -> None:
        """What the field completes."""
        self._names.setStringList(names)

    def _goto(self) -> None:
        self.goto_wanted.emit(self.target.text())

    def _centre(self) -> None:
        self.centre_wanted.emit(self.target.text(), self.tolerance.value())
