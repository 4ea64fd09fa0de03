"""The histogram beside the exposure: how far the camera's pixels are filled."""

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen

from app.ui.histogram import AXIS_POWER, Histogram
from app.ui.live.brighten import Levels

MARKS = (0.01, 0.1, 0.5)  # shares of full that are marked


class LevelView(Histogram):
    """Counts over the whole of what the camera can hold, full at the right edge."""

    def __init__(self) -> None:
        super().__init__()
        self._levels = Levels()
        self.setAccessibleName("Histogram of the camera, empty to full")

    def show_levels(self, levels: Levels) -> None:
        """Another frame's."""
        if levels is not self._levels:
            self._levels = levels
            self.set_counts(levels.counts)

    def _curve(self, painter: QPainter, box: QRectF) -> None:
        """No stretch here: ticks of what is full, and a bar at the right where pixels clip."""
        painter.setPen(QPen(QColor(self.colours.muted), 1.0, Qt.PenStyle.DotLine))
        for share in MARKS:
            x = box.left() + share ** (1 / AXIS_POWER) * box.width()
            painter.drawLine(QPointF(x, box.top()), QPointF(x, box.bottom()))
        if self._levels.clipped > 0:
            painter.setPen(QPen(QColor(self.colours.bad), 3.0))
            painter.drawLine(box.topRight(), box.bottomRight())
