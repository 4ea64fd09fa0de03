"""The small histogram with the stretch drawn over it."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.palette import THEMES, Colours
from app.ui.stretch import Stretch

AXIS_POWER = 3.0  # the axis is the cube root of the value: the sky is near black, stars are far up


class Histogram(QWidget):
    """Counts on a logarithmic height; drawn, not asked anything."""

    def __init__(self) -> None:
        super().__init__()
        self.colours: Colours = THEMES["dark"]
        self._heights: NDArray[np.float64] = np.zeros(0)
        self._stretch = Stretch()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setMinimumWidth(120)
        self.setAccessibleName("Histogram of pixel values")

    def sizeHint(self) -> QSize:
        return QSize(240, 56)

    def set_counts(self, counts: NDArray[np.float64]) -> None:
        """Counts (N,) over the cube-root axis."""
        top = np.log1p(counts)
        self._heights = top / max(float(top.max()), 1e-9) if len(top) else top
        self.update()

    def set_stretch(self, stretch: Stretch) -> None:
        """The curve to draw."""
        self._stretch = stretch
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        box = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        painter.setPen(QPen(QColor(self.colours.line), 1))
        painter.setBrush(QColor(self.colours.surface))
        painter.drawRoundedRect(box, 4, 4)
        inner = box.adjusted(4, 4, -4, -4)
        if len(self._heights):
            self._bars(painter, inner)
            self._curve(painter, inner)
        painter.end()

    def _bars(self, painter: QPainter, box: QRectF) -> None:
        x = np.linspace(box.left(), box.right(), len(self._heights))
        points = [QPointF(box.left(), box.bottom())]
        points += [QPointF(a, box.bottom() - h * box.height())
                   for a, h in zip(x, self._heights, strict=True)]  # fmt: skip
        points.append(QPointF(box.right(), box.bottom()))
        shade = QColor(self.colours.muted)
        shade.setAlpha(120)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(shade)
        painter.drawPolygon(QPolygonF(points))

    def _curve(self, painter: QPainter, box: QRectF) -> None:
        t = np.linspace(0.0, 1.0, 160)
        y = self._stretch.apply(t**AXIS_POWER)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(self.colours.accent), 1.6))
        painter.drawPolyline(QPolygonF([
            QPointF(box.left() + a * box.width(), box.bottom() - b * box.height())
            for a, b in zip(t, y, strict=True)
        ]))  # fmt: skip
        black = box.left() + self._stretch.black ** (1 / AXIS_POWER) * box.width()
        painter.setPen(QPen(QColor(self.colours.text), 1.0, Qt.PenStyle.DashLine))
        painter.drawLine(QPointF(black, box.top()), QPointF(black, box.bottom()))
