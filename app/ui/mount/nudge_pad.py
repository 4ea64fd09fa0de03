"""Four arrows: a press is one small step of the telescope."""

from functools import partial

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QComboBox, QGridLayout, QHBoxLayout, QVBoxLayout, QWidget

from app.core.earth import SIDEREAL_DEG_S
from app.core.mount import Direction
from app.ui.mount.reasoned import ReasonedButton
from app.ui.widgets import label

STEPS_ARCSEC = {
    "10″": 10.0, "30″": 30.0, "1′": 60.0, "5′": 300.0, "20′": 1200.0, "1°": 3600.0, "5°": 18000.0,
}  # fmt: skip
FIRST = "5′"
HINT = "Arrow keys do the same while the focus is here: up is north, left is east."
WAYS = {
    Direction.NORTH: ("N ↑", 0, 1, Qt.Key.Key_Up),
    Direction.EAST: ("← E", 1, 0, Qt.Key.Key_Left),
    Direction.WEST: ("W →", 1, 2, Qt.Key.Key_Right),
    Direction.SOUTH: ("S ↓", 2, 1, Qt.Key.Key_Down),
}


class NudgePad(QWidget):
    """One nudge at a time: what comes while the mount moves is not kept for later.

    ``beside`` is shown at its side.
    """

    nudge_wanted = Signal(object, float, float)  # Direction, arcsec, deg/s or 0
    explained = Signal(str)

    def __init__(self, beside: QWidget) -> None:
        super().__init__()
        self.step = QComboBox()
        self.step.setAccessibleName("Step of a nudge")
        self.step.setToolTip("How far a press goes; the mount’s slowest rate that will do is used.")
        for text, arcsec in STEPS_ARCSEC.items():
            self.step.addItem(text, arcsec)
        self.step.setCurrentText(FIRST)
        self.rate = QComboBox()
        self.rate.setAccessibleName("Rate of a nudge")
        self.rate.setToolTip("How fast; as a rule the slowest of the mount’s rates that will do.")
        self.rate.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.show_rates(())
        self.buttons: dict[Direction, ReasonedButton] = {}
        grid = QGridLayout()
        grid.setSpacing(4)
        for way, (text, row, column, _) in WAYS.items():
            made = ReasonedButton(text, partial(self._nudge, way), f"Nudge {way}")
            made.setAccessibleName(f"Nudge {way}")
            made.explained.connect(self.explained)
            made.installEventFilter(self)
            grid.addWidget(made, row, column)
            self.buttons[way] = made
        grid.addWidget(self.step, 1, 1)
        title = QVBoxLayout()
        title.addWidget(label("Nudge", "heading"))
        title.addWidget(label(HINT, "muted", wrap=True))
        title.addStretch(1)
        below = QHBoxLayout()
        below.addWidget(self.rate)
        below.addWidget(beside)
        below.addStretch(1)
        title.addLayout(below)
        line = QHBoxLayout(self)
        line.setContentsMargins(0, 0, 0, 0)
        line.setSpacing(14)
        line.addLayout(grid)
        line.addLayout(title, 1)

    def show_rates(self, rates_deg_s: tuple[float, ...]) -> None:
        """What the mount offers; the choice stays when it is still there."""
        if [self.rate.itemData(i) for i in range(1, self.rate.count())] == list(rates_deg_s):
            return
        self.rate.clear()
        self.rate.addItem("rate that suits", 0.0)
        for rate in rates_deg_s:
            self.rate.addItem(rate_text(rate), rate)

    def allow(self, reason: str, dec_reason: str) -> None:
        """Grey them with a reason: those of the RA axis, and those of the declination axis."""
        for way, made in self.buttons.items():
            made.allow(reason if way in (Direction.EAST, Direction.WEST) else dec_reason)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            for way, (_, _, _, key) in WAYS.items():
                if event.key() == key:
                    self.buttons[way].setFocus()
                    if not event.isAutoRepeat():
                        self.buttons[way].click()
                    return True
        return super().eventFilter(watched, event)

    def _nudge(self, way: Direction) -> None:
        rate = float(self.rate.currentData() or 0.0)
        self.nudge_wanted.emit(way, float(self.step.currentData()), rate)


def rate_text(rate_deg_s: float) -> str:
    """In degrees a second when fast, else in times the sky's own."""
    times = rate_deg_s / SIDEREAL_DEG_S
    return f"{rate_deg_s:.2g}°/s" if times > 100.0 else f"{times:.3g} × sidereal"
