"""Arrows for the bolts: up, down, and the two senses of rotation seen from above."""

import math

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF

from app.polar.bolts import Knob

GAP_DEG = 70.0  # that the ring of a turning arrow leaves open


def draw_arrow(painter: QPainter, box: QRectF, knob: Knob, positive: bool, colour: QColor) -> None:
    """What takes a positive or negative error away."""
    if knob is Knob.ALTITUDE:
        _straight(painter, _square(box), down=positive, colour=colour)
    else:
        _turning(painter, _square(box), clockwise=not positive, colour=colour)


def draw_done(painter: QPainter, box: QRectF, colour: QColor) -> None:
    """A tick: nothing more to turn."""
    square = _square(box)
    side = square.width()
    painter.setPen(_pen(colour, side / 8.0))
    corner = square.topLeft()
    places = ((0.15, 0.55), (0.42, 0.80), (0.88, 0.22))
    painter.drawPolyline(QPolygonF([corner + QPointF(x * side, y * side) for x, y in places]))


def _square(box: QRectF) -> QRectF:
    side = 0.86 * min(box.width(), box.height())
    square = QRectF(0, 0, side, side)
    square.moveCenter(box.center())
    return square


def _straight(painter: QPainter, box: QRectF, down: bool, colour: QColor) -> None:
    painter.save()
    painter.translate(box.center())
    if down:
        painter.rotate(180.0)
    half = box.width() / 2.0
    outline = (
        (0, -1), (0.8, -0.1), (0.3, -0.1), (0.3, 1), (-0.3, 1), (-0.3, -0.1), (-0.8, -0.1),
    )  # fmt: skip
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(colour)
    painter.drawPolygon(QPolygonF([QPointF(x * half, y * half) for x, y in outline]))
    painter.restore()


def _turning(painter: QPainter, box: QRectF, clockwise: bool, colour: QColor) -> None:
    """A ring, open at the top, with its head where it ends; the post inside is seen from above."""
    painter.save()
    painter.translate(box.center())
    if not clockwise:
        painter.scale(-1.0, 1.0)
    radius, width = 0.36 * box.width(), 0.13 * box.width()
    ring = QRectF(-radius, -radius, 2 * radius, 2 * radius)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(_pen(colour, width, Qt.PenCapStyle.FlatCap))
    begin, span = 90.0 - GAP_DEG / 2.0, 360.0 - GAP_DEG
    painter.drawArc(ring, round(16 * begin), round(-16 * span))  # Qt counts anticlockwise
    end = math.radians(begin - span)
    at = QPointF(radius * math.cos(end), -radius * math.sin(end))
    along = QPointF(math.sin(end), math.cos(end))  # clockwise on the screen
    out = QPointF(math.cos(end), -math.sin(end))
    head = 1.35 * width
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(colour)
    painter.drawPolygon(
        QPolygonF([at + out * head, at + along * (1.6 * head), at - out * head])
    )  # fmt: skip
    painter.drawEllipse(QPointF(0, 0), 0.06 * box.width(), 0.06 * box.width())
    painter.restore()


def _pen(
    colour: QColor, width: float, cap: Qt.PenCapStyle = Qt.PenCapStyle.RoundCap
) -> QPen:  # fmt: skip
    return QPen(colour, width, Qt.PenStyle.SolidLine, cap, Qt.PenJoinStyle.RoundJoin)
