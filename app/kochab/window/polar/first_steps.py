"""What the Polar room shows before its first frame: how an alignment goes, drawn and in three sentences."""

import math
from collections.abc import Callable, Sequence

from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QFrame, QLabel, QSizePolicy, QWidget

from kochab.text.translation import tr, tr_noop
from kochab.window.themes import theme_colours
from kochab.window.widgets import button, column, label, row

STEPS = (
    tr_noop("RA is rotated, and Kochab solves a frame before and after: that shows where the axis points."),
    tr_noop("You turn one bolt at a time, until the star in the frame is where it belongs."),
    tr_noop("Kochab measures again and says how far off the axis still is."),
)
DRAWING_PX, WIDE_PX, NARROWEST_PX = 132, 600, 330
TRAILS = ((0.30, 20.0, 110.0), (0.52, 200.0, 100.0), (0.62, 330.0, 40.0), (0.80, 80.0, 70.0), (0.92, 215.0, 60.0))
"""Arcs of stars around the pole: radius as a share of the drawing's, where it begins and how long, degrees."""
LOW_PX = 260  # lower than this there is room for the sentences alone
AXIS_AT, AXIS_PX, CROSS_PX, HEAD_PX = (0.72, -0.52), 9.0, 8.0, 7.0


class AxisDrawing(QWidget):
    """Stars that trail around the pole, the mount's axis beside it, and the way from the one to the other."""

    def __init__(self) -> None:
        super().__init__()
        self.setFixedSize(DRAWING_PX, DRAWING_PX)
        self.setAccessibleName(tr("The axis around the pole"))

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, colours = QPainter(self), theme_colours()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        radius = DRAWING_PX / 2.0 - 4.0
        painter.translate(DRAWING_PX / 2.0, DRAWING_PX / 2.0)
        painter.setPen(QPen(QColor(colours.faint), 2.0, c=Qt.PenCapStyle.RoundCap))
        for share, begins, long in TRAILS:
            size = share * radius
            painter.drawArc(QRectF(-size, -size, 2 * size, 2 * size), round(16 * begins), round(16 * long))
        axis = QPointF(*AXIS_AT) * radius
        apart = math.hypot(axis.x(), axis.y())
        way = -axis / apart
        ends = axis + way * (apart - CROSS_PX - 4.0)
        painter.setPen(QPen(QColor(colours.accent), 2.0, Qt.PenStyle.DashLine))
        painter.drawLine(axis + way * AXIS_PX, ends)
        painter.setPen(QPen(QColor(colours.accent), 2.0))
        painter.drawEllipse(axis, AXIS_PX, AXIS_PX)
        for side in (-1.0, 1.0):
            across = QPointF(-way.y(), way.x()) * side
            painter.drawLine(ends, ends - (way - across * 0.6) * HEAD_PX)
        painter.setPen(QPen(QColor(colours.good), 2.5))
        painter.drawLine(QPointF(-CROSS_PX, 0), QPointF(CROSS_PX, 0))
        painter.drawLine(QPointF(0, -CROSS_PX), QPointF(0, CROSS_PX))
        painter.end()


class FirstSteps(QFrame):
    """The drawing, the steps of an alignment, and the way to its set-up."""

    def __init__(self, set_up: Callable[[], None]) -> None:
        super().__init__()
        self.setObjectName("card")
        self.steps = [label("", "", wrap=True) for _ in STEPS]
        self.numbers: list[QLabel] = [label(f"{n + 1}", "strong") for n in range(len(STEPS))]
        self.set_up = button(tr("Set up…"), set_up, tip=tr("Frames, axis, site, pole and goal"))
        self.drawing = AxisDrawing()
        lines = []
        for number, text in zip(self.numbers, self.steps, strict=True):
            lines.append(row(number, (text, 1), spacing=10))
            lines[-1].setAlignment(number, Qt.AlignmentFlag.AlignTop)
        beside = row(self.drawing, (column(*lines, row(self.set_up, None), spacing=10), 1), spacing=18)
        beside.setAlignment(self.drawing, Qt.AlignmentFlag.AlignTop)
        column(beside, on=self, margins=(16, 14, 18, 14))
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)
        self.say(())

    def say(self, texts: Sequence[str]) -> None:
        """Show other sentences than those of an alignment by its bolts; none: those."""
        texts = texts or [tr(step) for step in STEPS]
        for n, (number, text) in enumerate(zip(self.numbers, self.steps, strict=True)):
            text.setText(texts[n] if n < len(texts) else "")
            text.setVisible(n < len(texts))
            number.setVisible(len(texts) > 1 and n < len(texts))

    def place(self, free: QRect) -> bool:
        """Stand at the top left of a rectangle; whether there is room."""
        wide = min(WIDE_PX, free.width())
        layout = self.layout()
        assert layout is not None
        high = layout.totalHeightForWidth(wide)  # with the edge that the style sheet draws
        self.setGeometry(QRect(free.topLeft(), QSize(wide, high)))
        return wide >= NARROWEST_PX and high <= free.height()
