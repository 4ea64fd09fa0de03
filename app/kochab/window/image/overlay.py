"""The marks over a frame, all painted in one pass."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainter

from kochab.core.arrays import Floats
from kochab.core.solution import Solution
from kochab.frames.sky_grid import GridLine, grid_lines
from kochab.window.image import marks
from kochab.window.image.screen_image import LabelSpace, Viewport
from kochab.window.image.sky_grid import paint_compass
from kochab.window.themes import theme_colours

MARKS = ("detected", "identified", "names", "grid", "centre", "compass")


@dataclass(slots=True)
class Overlay:
    """Paints detections and a solution: those of :data:`MARKS` that are ``on``; ``selected`` indexes its stars."""

    on: dict[str, bool] = field(default_factory=lambda: dict.fromkeys(MARKS, True))
    selected: int | None = None
    solution: Solution | None = None
    detected: Floats = field(default_factory=lambda: np.empty((0, 2)))
    _stars: Floats = field(default_factory=lambda: np.empty((0, 2)))
    _others: Floats = field(default_factory=lambda: np.empty((0, 2)))
    _lines: list[GridLine] = field(default_factory=list)
    _lines_key: object = None

    def show(self, detected: Floats, solution: Solution | None) -> None:
        """Detections (N, 2) px, brightest first, and their solution."""
        self.detected, self.solution, self.selected = detected, solution, None
        self._stars = np.empty((0, 2)) if solution is None else solution.stars_px
        self._others = detected[~_among(detected, self._stars)]

    def clear(self) -> None:
        self.show(np.empty((0, 2)), None)

    def paint(self, painter: QPainter, view: Viewport) -> None:
        """Everything that is switched on, back to front."""
        brush = marks.Brush(painter, view, theme_colours(), LabelSpace(view.width, view.height))
        solution = self.solution
        edges = _edges(view, solution)
        lines = self._grid(view, solution) if self.on["grid"] else []
        marks.sky_lines(brush, lines, edges)
        if self.on["detected"]:
            # An identified star has its own circle, unless that kind is switched off.
            xy = self._others if self.on["identified"] else self.detected
            marks.circles(brush, xy, brush.colours.detected, marks.DETECTED_PX, 1.0)
        if solution is not None:
            self._solved(brush, solution, lines, edges)

    def _solved(self, brush: marks.Brush, solution: Solution, lines: list[GridLine], edges: QRectF) -> None:
        if self.on["identified"]:
            marks.circles(brush, self._stars, brush.colours.identified, marks.IDENTIFIED_PX, 1.5)
        if self.on["centre"]:
            camera = solution.camera
            x, y = brush.view.to_screen(np.array([(camera.width - 1) / 2, (camera.height - 1) / 2]))
            for colour, width, alpha in ((brush.colours.halo, 4.5, 140), (brush.colours.centre, 1.8, 255)):
                brush.pen(colour, width, alpha)
                marks.cross(brush, x, y, 6.0, 18.0)
        if self.on["compass"]:
            paint_compass(brush.painter, brush.view, solution, brush.colours, brush.space)
        if self.selected is not None and self.selected < len(solution.stars):
            star = solution.stars[self.selected]
            at = brush.view.to_screen(self._stars[self.selected])
            marks.selection(brush, at, star.name or star.id)
        marks.sky_labels(brush, lines, edges)
        if self.on["names"]:
            marks.names(brush, solution, self._stars)

    def _grid(self, view: Viewport, solution: Solution | None) -> list[GridLine]:
        if solution is None:
            return []
        if (key := (view, id(solution))) != self._lines_key:
            self._lines, self._lines_key = grid_lines(solution, *view.corners()), key
        return self._lines


def _among(xy: Floats, stars: Floats) -> NDArray[np.bool_]:
    """Which places (N, 2) are those of one of the stars (M, 2), to 0.01 px."""
    grid = np.array([1.0, 1e7])
    return np.isin(np.rint(xy * 100.0) @ grid, np.rint(stars * 100.0) @ grid)


def _edges(view: Viewport, solution: Solution | None) -> QRectF:
    """The part of the frame that the widget shows, screen px."""
    whole = QRectF(0, 0, view.width, view.height)
    if solution is None:
        return whole
    (x0, y0), (x1, y1) = view.to_screen(
        np.array([[-0.5, -0.5], [solution.camera.width - 0.5, solution.camera.height - 0.5]])
    )
    return whole.intersected(QRectF(QPointF(x0, y0), QPointF(x1, y1)))
