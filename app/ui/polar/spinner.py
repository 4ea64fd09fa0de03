"""A small wheel that turns while the newest number is not of just now."""

from PySide6.QtCore import QRectF, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from app.ui.palette import THEMES, Colours

STEP_MS, STEP_DEG, ARC_DEG = 80, 30, 270


class Spinner(QWidget):
    """Turns while ``turning``; else nothing is seen and nothing runs."""

    def __init__(self) -> None:
        super().__init__()
        self.colours: Colours = THEMES["dark"]
        self.angle_deg = 0
        self._timer = QTimer(self)
        self._timer.setInterval(STEP_MS)
        self._timer.timeout.connect(self._step)
        self.setFixedSize(self.sizeHint())
        self.setAccessibleName("Waiting for a newer frame")

    def sizeHint(self) -> QSize:
        side = self.fontMetrics().height() + 2
        return QSize(side, side)

    @property
    def turning(self) -> bool:
        """Whether it turns."""
        return self._timer.isActive()

    def turn(self, on: bool) -> None:
        """Start or stop."""
        if on != self.turning:
            self._timer.start() if on else self._timer.stop()
            self.update()

    def _step(self) -> None:
        self.angle_deg = (self.angle_deg + STEP_DEG) % 360
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if not self.turning:
            return
        painter = QPainter(self)
        draw_wheel(painter, QRectF(self.rect()), self.angle_deg, QColor(self.colours.accent))
        painter.end()


def draw_wheel(painter: QPainter, box: QRectF, angle_deg: int, colour: QColor) -> None:
    """The wheel at an angle."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    width = max(2.0, box.width() / 9.0)
    painter.setPen(QPen(colour, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawArc(box.adjusted(width, width, -width, -width), -16 * angle_deg, 16 * ARC_DEG)
