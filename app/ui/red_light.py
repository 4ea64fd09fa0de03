"""Makes a window that is not ours, such as Qt's file dialog, shine red alone."""

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPainter, QPalette
from PySide6.QtWidgets import QGraphicsEffect, QWidget


def is_red() -> bool:
    """Whether the application's palette is of red light alone."""
    text = QGuiApplication.palette().color(QPalette.ColorRole.WindowText)
    return text.red() > 0 and text.green() == text.blue() == 0


def dress_field(field: QWidget) -> None:
    """Make a field's caret red at night: Qt inverts the ground's colour, which gives white."""
    # None takes the effect away, which PySide's declaration does not know.
    field.setGraphicsEffect(RedLight(field) if is_red() else None)  # type: ignore[arg-type]


class RedLight(QGraphicsEffect):
    """Multiplies what a widget painted with pure red."""

    def draw(self, painter: QPainter) -> None:
        offset = QPoint()
        picture = self.sourcePixmap(Qt.CoordinateSystem.DeviceCoordinates, offset)
        shape = picture.copy()
        filtered = QPainter(picture)
        filtered.setCompositionMode(QPainter.CompositionMode.CompositionMode_Multiply)
        filtered.fillRect(picture.rect(), QColor(255, 0, 0))
        # What was transparent, as outside rounded corners, has become red and is so no more.
        filtered.setCompositionMode(QPainter.CompositionMode.CompositionMode_DestinationIn)
        filtered.drawPixmap(0, 0, shape)
        filtered.end()
        painter.save()
        painter.resetTransform()
        painter.drawPixmap(offset, picture)
        painter.restore()
