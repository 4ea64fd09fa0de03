"""The chart of the whole sky, drawn by pyqtgraph in Hammer's projection."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QPainterPath, QTransform
from PySide6.QtWidgets import QGraphicsEllipseItem

from kochab.core.arrays import Floats
from kochab.core.attitude import unit_vectors
from kochab.window.charts.histogram_plot import StillPlot
from kochab.window.live.sky_points import SkyPoints, Trail
from kochab.window.themes import Colours, theme_colours, translucent


def hammer(vectors: Floats, centre_ra_deg: float) -> Floats:
    """Map places (..., 2) of ICRS unit vectors (..., 3): x in -2..2 to the right, y in -1..1 up, east left.

    ``centre_ra_deg`` is the right ascension of the central meridian. E. Hammer, Petermanns
    Mitteilungen 38, 85 (1892), scaled to the axes 2 and 1.
    """
    v = np.asarray(vectors, dtype=np.float64)
    ra = np.arctan2(v[..., 1], v[..., 0])
    west = -(np.mod(ra - np.radians(centre_ra_deg) + np.pi, 2.0 * np.pi) - np.pi)
    sine = np.clip(v[..., 2] / np.linalg.norm(v, axis=-1), -1.0, 1.0)
    cosine = np.sqrt(1.0 - sine**2)
    shrink = np.sqrt(1.0 + cosine * np.cos(west / 2.0))
    return np.stack([2.0 * cosine * np.sin(west / 2.0) / shrink, sine / shrink], axis=-1)


def pieces(xy: Floats) -> list[Floats]:
    """A line (N, 2) on the map, cut where it leaves on one side and returns on the other."""
    # Steps are short: one over a quarter of the map's width has crossed its edge.
    jumps = np.flatnonzero(np.abs(np.diff(xy[:, 0])) > 1.0) + 1
    return [part for part in np.split(xy, jumps) if len(part) > 1]


SIZES_PX = ((1.0, 4.6), (2.0, 3.6), (3.0, 2.6), (9.0, 1.7))  # up to a magnitude, the dot's width
GRID_ALPHA, FIGURES_ALPHA = 55, 140
HOURS = range(0, 24, 6)
LABEL_REACH = 1.84  # of the map's 2: farther out an hour's label would lie outside
PADDING = 0.03
HERE_PX = 24


class SkyPlot(StillPlot):
    """Stars, constellation figures and the trail of the pointing on the whole sky."""

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
        self._here = pg.ScatterPlotItem(symbol=_cross_hair(), size=HERE_PX, brush=None, antialias=True)
        below, above = (self._edge, self._grid), (self._figures, self._stars, self._trail, self._here)
        for part in (*below, *self._hours.values(), *above):
            self.addItem(part, ignoreBounds=True)
        self._centre_ra_deg = 0.0
        self._old = False

    def show_sky(self, points: SkyPoints | None, centre_ra_deg: float) -> None:
        """Draw grid, figures and stars about a central meridian."""
        self._centre_ra_deg = centre_ra_deg
        self._grid.setData(*self._lines(_grid_lines(centre_ra_deg)))
        for hour, text in self._hours.items():
            x, y = hammer(unit_vectors(hour * 15.0, 0.0), centre_ra_deg)
            text.setPos(x, y)
            text.setVisible(bool(abs(x) < LABEL_REACH))
        if points is None:
            return
        ends = hammer(points.strokes, centre_ra_deg)
        whole = np.abs(ends[:, 0, 0] - ends[:, 1, 0]) < 1.0  # the others cross the map's edge
        self._figures.setData(*ends[whole].reshape(-1, 2).T)
        places = hammer(points.stars, centre_ra_deg)
        limits, sizes = np.array(SIZES_PX).T
        widths = sizes[np.searchsorted(limits, points.mag, side="right").clip(max=len(sizes) - 1)]
        self._stars.setData(places[:, 0], places[:, 1], size=widths)

    def show_trail(self, trail: Trail) -> None:
        """Draw where the camera has pointed and where it points now."""
        if trail.here is None:
            self._trail.setData([], [])
            self._here.setData([], [])
            return
        self._trail.setData(*self._lines([np.vstack([trail.points, trail.here])]))
        self._here.setData(*hammer(trail.here[None], self._centre_ra_deg).T)
        if trail.old != self._old:
            self._old = trail.old
            self._dress_here()

    def set_colours(self, colours: Colours) -> None:
        """The colours of a theme."""
        self.setBackground(colours.window)
        self._edge.setPen(pg.mkPen(colours.line))
        self._edge.setBrush(pg.mkBrush(colours.sky))
        self._grid.setPen(pg.mkPen(translucent(colours.grid, GRID_ALPHA)))
        self._figures.setPen(pg.mkPen(translucent(colours.grid, FIGURES_ALPHA)))
        self._stars.setBrush(colours.grid_text)
        self._trail.setPen(pg.mkPen(colours.detected, width=1.6))
        for text in self._hours.values():
            text.setColor(colours.grid_text)
        self._dress_here()

    def _dress_here(self) -> None:
        style = Qt.PenStyle.DotLine if self._old else Qt.PenStyle.SolidLine
        self._here.setPen(pg.mkPen(theme_colours().centre, width=2.0, style=style))

    def _lines(self, lines: list[Floats]) -> Floats:
        """Lines through directions, each (N, 3), as x and y (2, M) with gaps between."""
        gap = np.full((1, 2), np.nan)
        parts = [part for line in lines for cut in pieces(hammer(line, self._centre_ra_deg)) for part in (cut, gap)]
        return np.vstack([np.zeros((0, 2)), *parts]).T


def _grid_lines(centre_ra_deg: float) -> list[Floats]:
    # At 180 both ends would lie on the same edge of the map.
    around = centre_ra_deg + np.linspace(-179.9, 179.9, 73)
    up = np.linspace(-90.0, 90.0, 37)
    parallels = [unit_vectors(around, np.full(73, d)) for d in (-60.0, -30.0, 0.0, 30.0, 60.0)]
    return parallels + [unit_vectors(np.full(37, r), up) for r in np.arange(0.0, 360.0, 45.0)]


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
