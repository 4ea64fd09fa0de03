"""How the lines of a chart differ: by colour, by dashes and by marker, so that any one suffices."""

import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from app.ui.palette import THEMES, Colours

ON_DARK = (
    "#56b4f9", "#f0b440", "#5fd39a", "#ff8a7a", "#c79bf2", "#9aa7b8", "#e7e36a", "#ff7ab0",
)  # fmt: skip
ON_LIGHT = (
    "#0a63b0", "#a86200", "#17703f", "#b3261e", "#6a3fb5", "#515b69", "#7a7400", "#b0266f",
)  # fmt: skip
ON_RED = ("#ff0000", "#d00000", "#ff0000", "#d00000")
DASHES: tuple[tuple[float, ...], ...] = ((), (6, 3), (2, 2), (8, 3, 2, 3))
CORNERS = (0, 4, 3, 5, -4, -3)  # of the marker; 0 is round, negative stands on its tip
SIZE_PX = 3.6


def series_colour(style: int, colours: Colours) -> QColor:
    """The colour of line number ``style`` in a theme."""
    ground = QColor(colours.surface)
    if colours is THEMES["night"]:
        return QColor(ON_RED[style % len(ON_RED)])
    chosen = ON_LIGHT if ground.lightnessF() > 0.5 else ON_DARK
    return QColor(chosen[style % len(chosen)])


def series_pen(style: int, colours: Colours) -> QPen:
    """The pen of line number ``style``."""
    pen = QPen(series_colour(style, colours), 1.8)
    dashes = DASHES[style % len(DASHES)]
    if dashes:
        pen.setDashPattern(list(dashes))
    return pen


def draw_marker(painter: QPainter, at: QPointF, style: int, colour: QColor) -> None:
    """The marker of line number ``style``."""
    painter.save()
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(colour)
    corners = CORNERS[style % len(CORNERS)]
    if corners == 0:
        painter.drawEllipse(at, SIZE_PX, SIZE_PX)
    else:
        turn = math.pi / 2 + (math.pi / abs(corners) if corners > 0 else 0.0)
        around = [turn + 2 * math.pi * k / abs(corners) for k in range(abs(corners))]
        size = SIZE_PX * 1.35
        painter.drawPolygon(
            QPolygonF([at + QPointF(size * math.cos(a), size * math.sin(a)) for a in around])
        )
    painter.restore()


class Legend(QWidget):
    """Names with their lines, wrapped to the width."""

    def __init__(self) -> None:
        super().__init__()
        self.colours: Colours = THEMES["dark"]
        self._names: tuple[tuple[str, int], ...] = ()
        self.setAccessibleName("Legend")

    def show_names(self, names: tuple[tuple[str, int], ...]) -> None:
        """Names and the numbers of their styles."""
        self._names = names
        self.setAccessibleDescription(", ".join(name for name, _ in names))
        self.updateGeometry()
        self.update()

    def hasHeightForWidth(self) -> bool:
        return True

    def heightForWidth(self, width: int) -> int:
        boxes = self._boxes(width)
        return round(boxes[-1].bottom()) + 4 if boxes else 0

    def sizeHint(self) -> QSize:
        return QSize(300, self.heightForWidth(max(self.width(), 300)))

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for (name, style), box in zip(self._names, self._boxes(self.width()), strict=True):
            y = box.center().y()
            painter.setPen(series_pen(style, self.colours))
            painter.drawLine(QPointF(box.left(), y), QPointF(box.left() + 30, y))
            middle = QPointF(box.left() + 15, y)
            draw_marker(painter, middle, style, series_colour(style, self.colours))
            painter.setPen(QColor(self.colours.text))
            painter.drawText(box.adjusted(36, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, name)
        painter.end()

    def _boxes(self, width: int) -> list[QRectF]:
        metrics = self.fontMetrics()
        x, y, line = 6.0, 2.0, metrics.height() + 4.0
        boxes: list[QRectF] = []
        for name, _ in self._names:
            wide = metrics.horizontalAdvance(name) + 52.0
            if x + wide > width and boxes:
                x, y = 6.0, y + line
            boxes.append(QRectF(x, y, wide, line))
            x += wide
        return boxes
