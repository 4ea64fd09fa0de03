"""Directions on a solved frame: what the lines of its grid are called, and the north and east arrows."""

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF

from kochab.core.arrays import Floats
from kochab.core.solution import Solution
from kochab.frames.export import compass
from kochab.frames.sky_grid import GridLine
from kochab.window.image.screen_image import LabelSpace, Viewport
from kochab.window.themes import Colours, translucent


def label(line: GridLine) -> str:
    """The line's value, as fine as its step needs."""
    if line.kind == "ra":
        sign, units, whole_deg, turn = "", "hms", 15.0, 24
    else:
        sign, units, whole_deg, turn = "−" if line.value_deg < 0 else "+", "°′″", 1.0, 360
    minutes, s = divmod(round(abs(line.value_deg) / whole_deg * 3600.0), 60)
    whole, m = divmod(minutes, 60)
    places = 3 if s or line.step_deg < whole_deg / 60.0 else 2 if m or line.step_deg < whole_deg else 1
    return " ".join((f"{sign}{whole % turn}{units[0]}", f"{m:02d}{units[1]}", f"{s:02d}{units[2]}")[:places])


LENGTH_PX = 32.0
MARGIN_PX = 52.0
EDGE_PX = 4.0  # how much wider an arrow's dark edge is


def paint_compass(painter: QPainter, view: Viewport, solution: Solution, colours: Colours, space: LabelSpace) -> None:
    """Arrows in the top right corner, with dark edges that keep them readable on a bright sky."""
    north, east = compass(solution)
    at = QPointF(view.width - MARGIN_PX - 10, MARGIN_PX + 10)
    space.place(QRectF(at.x() - MARGIN_PX, at.y() - MARGIN_PX, 2 * MARGIN_PX, 2 * MARGIN_PX))
    arrows = ((north, "N", 2.4), (east, "E", 1.6))
    for shade, more in ((translucent(colours.halo, 190), EDGE_PX), (QColor(colours.identified), 0.0)):
        for way, letter, width in arrows:
            _arrow(painter, at, way, QPen(shade, width + more))
            _letter(painter, at, way, letter, shade, ground=more > 0.0)
    painter.setBrush(Qt.BrushStyle.NoBrush)


def _arrow(painter: QPainter, at: QPointF, way: Floats, pen: QPen) -> None:
    dx, dy = way.tolist()
    tip = at + QPointF(dx, dy) * LENGTH_PX
    side = QPointF(-dy, dx) * 4.5
    back = at + QPointF(dx, dy) * (LENGTH_PX - 10)
    painter.setPen(pen)
    painter.setBrush(pen.color())
    painter.drawLine(at, tip)
    painter.drawPolygon(QPolygonF([tip, back + side, back - side]))


def _letter(painter: QPainter, at: QPointF, way: Floats, letter: str, shade: QColor, ground: bool) -> None:
    """The letter beyond the tip, or its dark background."""
    spot = at + QPointF(*way.tolist()) * (LENGTH_PX + 12)
    box = QRectF(spot.x() - 9, spot.y() - 9, 18, 18)
    if ground:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(shade)
        painter.drawRoundedRect(box, 4, 4)
    else:
        painter.setPen(shade)
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, letter)
