"""The marks over a frame, all painted in one pass."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen

from app.core.solution import NamedStar, Solution
from app.ui.compass import paint_compass
from app.ui.labels import LabelSpace
from app.ui.palette import THEMES, Colours
from app.ui.sky_grid import GridLine, grid_lines, label
from app.ui.viewport import Viewport

Floats = NDArray[np.float64]
DETECTED_PX, IDENTIFIED_PX = 6.0, 10.0  # radii on the screen
MOST_CIRCLES, MOST_NAMES = 3000, 80


@dataclass(slots=True)
class Switches:
    """Which marks are painted."""

    detected: bool = True
    identified: bool = True
    names: bool = True
    centre: bool = True
    grid: bool = True
    compass: bool = True


@dataclass(slots=True)
class Overlay:
    """Paints what it is given; knows nothing of where it came from.

    ``detected`` (N, 2) px, brightest first; ``selected`` indexes ``solution.stars``.
    """

    detected: Floats = field(default_factory=lambda: np.empty((0, 2)))
    solution: Solution | None = None
    selected: int | None = None
    switches: Switches = field(default_factory=Switches)
    colours: Colours = field(default_factory=lambda: THEMES["dark"])
    font: QFont | None = None
    _lines: list[GridLine] = field(default_factory=list)
    _lines_key: object = None

    def paint(self, painter: QPainter, view: Viewport) -> None:
        """Everything that is switched on, back to front."""
        if self.font is not None:
            painter.setFont(self.font)
        space = LabelSpace(view.width, view.height)
        if self.solution is not None and self.switches.grid:
            self._grid(painter, view, self.solution, space)
        if self.switches.detected:
            self._detected(painter, view)
        if self.solution is None:
            return
        if self.switches.identified:
            self._identified(painter, view, self.solution)
        if self.switches.centre:
            self._centre(painter, view, self.solution)
        self._selected(painter, view, self.solution, space)
        if self.switches.names:
            self._names(painter, view, self.solution, space)
        if self.switches.compass:
            paint_compass(painter, view, self.solution, self.colours)

    def _grid(
        self, painter: QPainter, view: Viewport, solution: Solution, space: LabelSpace
    ) -> None:
        key = (view, id(solution))
        if key != self._lines_key:
            self._lines, self._lines_key = grid_lines(solution, *view.corners()), key
        painter.setPen(_pen(self.colours.grid, 1.0, alpha=150))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        edges = _frame_on_screen(view, solution)
        painter.save()
        painter.setClipRect(edges)
        screens = [view.to_screen(line.xy) for line in self._lines]
        for xy in screens:
            painter.drawPath(_path(xy))
        painter.restore()
        for line, xy in zip(self._lines, screens, strict=True):
            spot = _label_spot(xy, edges.adjusted(2, 2, -2, -2), line.kind)
            if spot is not None:
                self._text(painter, space, spot, label(line), self.colours.grid_text)

    def _detected(self, painter: QPainter, view: Viewport) -> None:
        xy = view.to_screen(self.detected[:MOST_CIRCLES])
        painter.setPen(_pen(self.colours.detected, 1.0, alpha=210))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for x, y in xy[_in_sight(xy, view)]:
            painter.drawEllipse(QPointF(x, y), DETECTED_PX, DETECTED_PX)

    def _identified(self, painter: QPainter, view: Viewport, solution: Solution) -> None:
        xy = _stars_on_screen(view, solution.stars)
        painter.setPen(_pen(self.colours.identified, 1.6))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for x, y in xy[_in_sight(xy, view)]:
            painter.drawEllipse(QPointF(x, y), IDENTIFIED_PX, IDENTIFIED_PX)

    def _names(
        self, painter: QPainter, view: Viewport, solution: Solution, space: LabelSpace
    ) -> None:
        xy = _stars_on_screen(view, solution.stars)
        seen = np.flatnonzero(_in_sight(xy, view))
        order = sorted(seen, key=lambda i: (not solution.stars[i].name, solution.stars[i].mag))
        for i in order[:MOST_NAMES]:
            self._name(painter, space, solution.stars[i], xy[i], self.colours.identified)

    def _name(
        self, painter: QPainter, space: LabelSpace, star: NamedStar, at: Floats, colour: str
    ) -> None:
        spot = QPointF(at[0] + IDENTIFIED_PX + 3, at[1] + 4)
        self._text(painter, space, spot, star.name or star.id, colour)

    def _selected(
        self, painter: QPainter, view: Viewport, solution: Solution, space: LabelSpace
    ) -> None:
        if self.selected is None or self.selected >= len(solution.stars):
            return
        star = solution.stars[self.selected]
        at = view.to_screen(np.array([[star.x, star.y]]))[0]
        painter.setPen(_pen(self.colours.selected, 2.0))
        r, inner = IDENTIFIED_PX + 9, IDENTIFIED_PX + 3
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            near = QPointF(at[0] + dx * inner, at[1] + dy * inner)
            painter.drawLine(near, QPointF(at[0] + dx * r, at[1] + dy * r))
        self._name(painter, space, star, at + np.array([6.0, -10.0]), self.colours.selected)

    def _centre(self, painter: QPainter, view: Viewport, solution: Solution) -> None:
        camera = solution.camera
        middle = np.array([[(camera.width - 1) / 2, (camera.height - 1) / 2]])
        x, y = view.to_screen(middle)[0]
        painter.setPen(_pen(self.colours.centre, 1.6))
        for a, b in ((-18, -6), (6, 18)):
            painter.drawLine(QPointF(x + a, y), QPointF(x + b, y))
            painter.drawLine(QPointF(x, y + a), QPointF(x, y + b))

    def _text(
        self, painter: QPainter, space: LabelSpace, at: QPointF, text: str, colour: str
    ) -> None:
        box = QFontMetricsF(painter.font()).boundingRect(text).translated(at)
        placed = space.place(box)
        if placed is None:
            return
        at = at + (placed.topLeft() - box.topLeft())
        halo = QColor(self.colours.halo)
        halo.setAlpha(165)
        painter.fillRect(placed.adjusted(-3, -1, 3, 1), halo)
        painter.setPen(QColor(colour))
        painter.drawText(at, text)


def _pen(colour: str, width: float, alpha: int = 255) -> QPen:
    shade = QColor(colour)
    shade.setAlpha(alpha)
    return QPen(shade, width)


def _stars_on_screen(view: Viewport, stars: tuple[NamedStar, ...]) -> Floats:
    return view.to_screen(np.array([(s.x, s.y) for s in stars]).reshape(-1, 2))


def _in_sight(xy: Floats, view: Viewport) -> NDArray[np.bool_]:
    x, y = xy[:, 0], xy[:, 1]
    return np.asarray((x > -20) & (y > -20) & (x < view.width + 20) & (y < view.height + 20))


def _frame_on_screen(view: Viewport, solution: Solution) -> QRectF:
    """The part of the frame that the widget shows, screen px."""
    (x0, y0), (x1, y1) = view.to_screen(
        np.array([[-0.5, -0.5], [solution.camera.width - 0.5, solution.camera.height - 0.5]])
    )
    whole = QRectF(QPointF(x0, y0), QPointF(x1, y1))
    return whole.intersected(QRectF(0, 0, view.width, view.height))


def _path(xy: Floats) -> QPainterPath:
    path = QPainterPath()
    pen_down = False
    for x, y in xy:
        if x != x or y != y or abs(x) > 1e5 or abs(y) > 1e5:
            pen_down = False
        elif pen_down:
            path.lineTo(x, y)
        else:
            path.moveTo(x, y)
            pen_down = True
    return path


def _label_spot(xy: Floats, edges: QRectF, kind: str) -> QPointF | None:
    """Where the text of a line starts: low for right ascension, far left for declination."""
    inside = [
        i for i, (x, y) in enumerate(xy) if np.isfinite(x) and edges.contains(QPointF(x, y))
    ]  # fmt: skip
    if not inside:
        return None
    best = (
        max(inside, key=lambda i: xy[i][1]) if kind == "ra" else min(inside, key=lambda i: xy[i][0])
    )
    x, y = xy[best]
    return QPointF(x + 4, min(y - 4, edges.bottom() - 6))
