"""The arrows that point north and east."""

import math

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF

from app.core.solution import Solution
from app.ui.labels import LabelSpace
from app.ui.palette import Colours
from app.ui.viewport import Viewport

LENGTH_PX = 32.0
MARGIN_PX = 52.0
EDGE_PX = 4.0  # what an arrow's dark edge is wider


def directions(solution: Solution) -> tuple[tuple[float, float], tuple[float, float]]:
    """Unit vectors on the screen (x right, y down) towards north and east at the frame's centre."""
    centre = solution.centre_vector
    east = np.array([-centre[1], centre[0], 0.0])
    east = east / max(float(np.linalg.norm(east)), 1e-12)
    north = np.cross(centre, east)
    step = 1.0 / solution.camera.focal_px
    here, there_n, there_e = solution.pixels_of(
        np.stack([centre, centre + step * north, centre + step * east])
    )
    return _unit(there_n - here), _unit(there_e - here)


def _unit(v: np.ndarray) -> tuple[float, float]:
    length = math.hypot(v[0], v[1]) or 1.0
    return float(v[0] / length), float(v[1] / length)


def paint_compass(
    painter: QPainter,
    view: Viewport,
    solution: Solution,
    colours: Colours,
    space: LabelSpace,
) -> None:
    """Arrows in the top right corner, with dark edges that keep them readable on a bright sky."""
    north, east = directions(solution)
    at = QPointF(view.width - MARGIN_PX - 10, MARGIN_PX + 10)
    space.place(QRectF(at.x() - MARGIN_PX, at.y() - MARGIN_PX, 2 * MARGIN_PX, 2 * MARGIN_PX))
    arrows = ((north, "N", 2.4), (east, "E", 1.6))
    edge = QColor(colours.halo)
    edge.setAlpha(190)
    for shade, more in ((edge, EDGE_PX), (QColor(colours.identified), 0.0)):
        for way, letter, width in arrows:
            _arrow(painter, at, way, QPen(shade, width + more))
            _letter(painter, at, way, letter, shade, ground=more > 0.0)
    painter.setBrush(Qt.BrushStyle.NoBrush)


def _arrow(painter: QPainter, at: QPointF, way: tuple[float, float], pen: QPen) -> None:
    dx, dy = way
    tip = at + QPointF(dx, dy) * LENGTH_PX
    side = QPointF(-dy, dx) * 4.5
    back = at + QPointF(dx, dy) * (LENGTH_PX - 10)
    painter.setPen(pen)
    painter.setBrush(pen.color())
    painter.drawLine(at, tip)
    painter.drawPolygon(QPolygonF([tip, back + side, back - side]))


def _letter(
    painter: QPainter,
    at: QPointF,
    way: tuple[float, float],
    letter: str,
    shade: QColor,
    ground: bool,
) -> None:
    """The letter beyond the tip, or the dark ground it stands on."""
    spot = at + QPointF(*way) * (LENGTH_PX + 12)
    box = QRectF(spot.x() - 9, spot.y() - 9, 18, 18)
    if ground:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(shade)
        painter.drawRoundedRect(box, 4, 4)
    else:
        painter.setPen(shade)
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, letter)
