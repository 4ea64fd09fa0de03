"""Makes a window that is not ours, such as Qt's file dialog, shine red alone."""

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor, QPainter
from PySide6.QtWidgets import QGraphicsEffect


class RedLight(QGraphicsEffect):
    """Multiplies what a widget painted with pure red."""

    def draw(self, painter: QPainter) -> None:
        offset = QPoint()
        picture = self.sourcePixmap(Qt.CoordinateSystem.DeviceCoordinates, offset)
        filtered = QPainter(picture)
        filtered.setCompositionMode(QPainter.CompositionMode.CompositionMode_Multiply)
        filtered.fillRect(picture.rect(), QColor(255, 0, 0))
        filtered.end()
        painter.save()
        painter.resetTransform()
        painter.drawPixmap(offset, picture)
        painter.restore()
