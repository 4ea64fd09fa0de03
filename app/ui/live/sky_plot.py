"""The picture of the chart of the sky, by pyqtgraph, on the plane of Hammer's projection."""

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPainterPath, QTransform
from PySide6.QtWidgets import QGraphicsEllipseItem

from app.core.attitude import unit_vectors
from app.ui.live.sky_map import hammer, pieces
from app.ui.live.sky_points import SkyPoints
from app.ui.live.trail import Trail
from app.ui.palette import Colours
from app.ui.still_plot import StillPlot

Floats = NDArray[np.float64]
SIZES_PX = ((1.0, 4.6), (2.0, 3.6), (3.0, 2.6), (9.0, 1.7))  # up to a magnitude, the dot's width
GRID_ALPHA, FIGURES_ALPHA = 55, 140
HOURS = range(0, 24, 6)
LABEL_REACH = 1.84  # of the map's 2: further out an hour's name would lie outside
PADDING = 0.03
HERE_PX = 24


class SkyPlot(StillPlot):
    """All of the sky, always."""

    def __init__(self) -> None:
        super().__init__()
        box = self.getViewBox()
        box.setAspectLocked(True)
        box.setRange(xRange=(-2.0, 2.0), yRange=(-1.0, 1.0), padding=PADDING)
        self._edge = QGraphicsEllipseItem(-2.0, -1.0, 4.0, 2.0)
        self._grid = pg.PlotCurveItem(antialias=True, connect="finite")
        self._figures = pg.PlotCurveItem(antialias=True, connect="pairs")
        self._stars = pg.ScatterPlotItem(pen=None)
        self._hours = {hour: pg.TextItem(f"{hour}h", anchor=(0, 0)) for hour in HOURS}
        self._trail = pg.PlotCurveItem(antialias=True, connect="finite")
        self._here = pg.ScatterPlotItem(
            symbol=_cross_hair(), size=HERE_PX, brush=None, antialias=True
        )
        for part in (
            self._edge, self._grid, *self._hours.values(), self._figures, self._stars,
            self._trail, self._here,
        ):  # fmt: skip
            self.addItem(part, ignoreBounds=True)
        self._middle_ra_deg = 0.0
        self._colours: Colours | None = None
        self._old = False

    def show_sky(self, points: SkyPoints | None, middle_ra_deg: float) -> None:
        """Grid, figures and stars, with a right ascension in the middle."""
        self._middle_ra_deg = middle_ra_deg
        self._grid.setData(*self._lines(_grid_lines(middle_ra_deg)))
        for hour, text in self._hours.items():
            x, y = hammer(unit_vectors(hour * 15.0, 0.0), middle_ra_deg)
            text.setPos(x, y)
            text.setVisible(bool(abs(x) < LABEL_REACH))
        if points is None:
            return
        ends = hammer(points.strokes, middle_ra_deg)
        whole = np.abs(ends[:, 0, 0] - ends[:, 1, 0]) < 1.0  # the others cross the map's edge
        self._figures.setData(*ends[whole].reshape(-1, 2).T)
        places = hammer(points.stars, middle_ra_deg)
        limits, sizes = np.array(SIZES_PX).T
        widths = sizes[np.searchsorted(limits, points.mag, side="right").clip(max=len(sizes) - 1)]
        self._stars.setData(places[:, 0], places[:, 1], size=widths)

    def show_trail(self, trail: Trail) -> None:
        """Where the camera has pointed, and points."""
        if trail.here is None:
            self._trail.setData([], [])
            self._here.setData([], [])
            return
        self._trail.setData(*self._lines([np.vstack([trail.points, trail.here])]))
        self._here.setData(*hammer(trail.here[None], self._middle_ra_deg).T)
        if trail.old != self._old:
            self._old = trail.old
            self._dress_here()

    def dress(self, colours: Colours) -> None:
        """The colours of a theme."""
        self._colours = colours
        self.setBackground(colours.window)
        self._edge.setPen(pg.mkPen(colours.line))
        self._edge.setBrush(pg.mkBrush(colours.sky))
        self._grid.setPen(pg.mkPen(_faint(colours.grid, GRID_ALPHA)))
        self._figures.setPen(pg.mkPen(_faint(colours.grid, FIGURES_ALPHA)))
        self._stars.setBrush(colours.grid_text)
        self._trail.setPen(pg.mkPen(colours.detected, width=1.6))
        for text in self._hours.values():
            text.setColor(colours.grid_text)
        self._dress_here()

    def _dress_here(self) -> None:
        if self._colours is not None:
            style = Qt.PenStyle.DotLine if self._old else Qt.PenStyle.SolidLine
            self._here.setPen(pg.mkPen(self._colours.centre, width=2.0, style=style))

    def _lines(self, lines: list[Floats]) -> Floats:
        """Lines through directions, each (N, 3), as x and y (2, M) with gaps between."""
        gap = np.full((1, 2), np.nan)
        parts = [
            part for line in lines for cut in pieces(hammer(line, self._middle_ra_deg))
            for part in (cut, gap)
        ]  # fmt: skip
        return np.vstack([np.zeros((0, 2)), *parts]).T


def _grid_lines(middle_ra_deg: float) -> list[Floats]:
    around = middle_ra_deg + np.linspace(-179.9, 179.9, 73)
    up = np.linspace(-90.0, 90.0, 37)
    parallels = [unit_vectors(around, np.full(73, d)) for d in (-60.0, -30.0, 0.0, 30.0, 60.0)]
    return parallels + [unit_vectors(np.full(37, r), up) for r in np.arange(0.0, 360.0, 45.0)]


def _faint(colour: str, alpha: int) -> QColor:
    made = QColor(colour)
    made.setAlpha(alpha)
    return made


def _cross_hair() -> QPainterPath:
    """A ring with a stroke on each side, within -0.5 to 0.5."""
    path = QPainterPath()
    path.addEllipse(-0.21, -0.21, 0.42, 0.42)
    stroke = QPainterPath()
    stroke.moveTo(0.3, 0.0)
    stroke.lineTo(0.5, 0.0)
    for turn in range(4):
        path.addPath(QTransform().rotate(90.0 * turn).map(stroke))
    return path
