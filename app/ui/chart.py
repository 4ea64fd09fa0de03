"""A small chart: lines with markers over two axes, in the theme's colours.

It paints in a few milliseconds and needs nothing loaded. A plotting library was measured first:
nine tenths of a second to load, and more than a tenth to make six charts in the window's thread.
"""

import math
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from app.ui.axis import Axis
from app.ui.palette import THEMES, Colours
from app.ui.series import draw_marker, series_pen

REACH_PX = 12.0


@dataclass(frozen=True, slots=True)
class Series:
    """One line; ``style`` numbers its colour, dashes and marker. NaN breaks the line."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    style: int = 0


class Chart(QWidget):
    """Shows some :class:`Series`; the point under the cursor tells its numbers.

    ``title`` is its accessible name: what is seen is titled by the axes.
    """

    def __init__(self, title: str, across: Axis, up: Axis) -> None:
        super().__init__()
        self.across, self.up = across, up
        self.colours: Colours = THEMES["dark"]
        self.series: tuple[Series, ...] = ()
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(160, 100)
        self.setAccessibleName(title)

    def sizeHint(self) -> QSize:
        return QSize(300, 220)

    def show_series(self, series: tuple[Series, ...]) -> None:
        """Draw these, over axes that hold them."""
        self.series = series
        self.across = self.across.holding([v for s in series for v in s.x])
        self.up = self.up.holding([v for s in series for v in s.y])
        self.setAccessibleDescription("; ".join(map(_spoken, series)))
        self.update()

    # painting ---------------------------------------------------------------------------------
    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), QColor(self.colours.surface))
        box = self._box()
        self._frame(painter, box)
        painter.setClipRect(box.adjusted(-5, -5, 5, 5))
        for one in self.series:
            self._line(painter, box, one)
        painter.end()

    def _box(self) -> QRectF:
        metrics = QFontMetricsF(self.font())
        line = metrics.height()
        wide = max((metrics.horizontalAdvance(t) for _, t in self.up.ticks()), default=20.0)
        around = QRectF(self.rect())
        return around.adjusted(wide + line + 14, line / 2 + 6, -18, -2.0 * line - 10)

    def _frame(self, painter: QPainter, box: QRectF) -> None:
        line = QFontMetricsF(self.font()).height()
        thin, text = QPen(QColor(self.colours.line), 1), QColor(self.colours.muted)
        middle = Qt.AlignmentFlag.AlignCenter
        for value, told in self.across.ticks():
            at = self._at(box, value, self.up.low).x()
            painter.setPen(thin)
            painter.drawLine(QPointF(at, box.top()), QPointF(at, box.bottom()))
            painter.setPen(text)
            painter.drawText(QRectF(at - 60, box.bottom() + 3, 120, line), middle, told)
        for value, told in self.up.ticks(max(1, min(5, int(box.height() / line / 1.3)))):
            at = self._at(box, self.across.low, value).y()
            painter.setPen(thin)
            painter.drawLine(QPointF(box.left(), at), QPointF(box.right(), at))
            painter.setPen(text)
            right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            painter.drawText(QRectF(0, at - line / 2, box.left() - 6, line), right, told)
        below = QRectF(box.left() - 40, box.bottom() + line + 4, box.width() + 50, line + 2)
        painter.setPen(QColor(self.colours.text))
        painter.drawText(below, middle, self.across.title)
        painter.save()
        painter.translate(line / 2 + 4, box.center().y())
        painter.rotate(-90)
        painter.drawText(QRectF(-200, -line / 2, 400, line), middle, self.up.title)
        painter.restore()

    def _line(self, painter: QPainter, box: QRectF, one: Series) -> None:
        pen = series_pen(one.style, self.colours)
        painter.setPen(pen)
        points = [self._at(box, x, y) for x, y in zip(one.x, one.y, strict=True)]
        seen = [not math.isnan(y) for y in one.y]
        for k in range(1, len(points)):
            if seen[k - 1] and seen[k]:
                painter.drawLine(points[k - 1], points[k])
        for point in (p for p, there in zip(points, seen, strict=True) if there):
            draw_marker(painter, point, one.style, pen.color())

    def _at(self, box: QRectF, x: float, y: float) -> QPointF:
        return QPointF(
            box.left() + self.across.share(x) * box.width(),
            box.bottom() - self.up.share(y) * box.height(),
        )

    # the cursor -------------------------------------------------------------------------------
    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        text = self.told_at(event.position())
        if text:
            QToolTip.showText(event.globalPosition().toPoint(), text, self)
        else:
            QToolTip.hideText()

    def told_at(self, place: QPointF) -> str:
        """The points near a place of the widget, a line each; "" when there is none."""
        box = self._box()
        near = []
        for one in self.series:
            for x, y in zip(one.x, one.y, strict=True):
                gap = self._at(box, x, y) - place
                if not math.isnan(y) and math.hypot(gap.x(), gap.y()) < REACH_PX:
                    near.append(f"{one.name}: {self.across.text(x)}, {self.up.text(y)}")
        return "\n".join(near)


def _spoken(one: Series) -> str:
    return f"{one.name}: " + ", ".join(
        f"{x:g} gives {y:.3g}" for x, y in zip(one.x, one.y, strict=True)
    )
