"""A small chart of the whole sky with the trail of the pointing."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QLineF, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPaintEvent, QPen, QPixmap, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.core.attitude import radec_deg, unit_vectors
from app.ui.live.sky_map import hammer, pieces
from app.ui.live.sky_points import SkyPoints
from app.ui.live.trail import Trail
from app.ui.palette import THEMES, Colours

Floats = NDArray[np.float64]
MARGIN_PX = 6
CLASSES = ((-2.0, 1.0, 4.6), (1.0, 2.0, 3.6), (2.0, 3.0, 2.6), (3.0, 6.0, 1.7))
"""Stars from one magnitude to another, and the width of their dots, px."""
FAR_RAD = np.radians(75.0)  # from the middle meridian; beyond, the map is turned


class SkyChart(QWidget):
    """Stars and figures are drawn once for a size and a theme; the trail is drawn over them."""

    def __init__(self) -> None:
        super().__init__()
        self.colours: Colours = THEMES["dark"]
        self.trail = Trail()
        self.points: SkyPoints | None = None
        self._middle_ra_deg = 0.0
        self._ground: QPixmap | None = None
        self._key: object = None
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.setMinimumSize(220, 120)
        self.setAccessibleName("Chart of the whole sky with the trail of the pointing")

    def sizeHint(self) -> QSize:
        return QSize(360, 186)

    def heightForWidth(self, width: int) -> int:
        return min(width // 2 + MARGIN_PX, 300)

    def show_points(self, points: SkyPoints) -> None:
        """The stars to draw."""
        self.points, self._key = points, None
        self.update()

    def show_here(self, centre: Floats, old: bool) -> None:
        """The camera points there, ICRS unit vector (3,), or did when that is ``old``."""
        first = self.trail.here is None
        self.trail.add(centre, old)
        ra, dec = radec_deg(centre)
        away = np.radians((ra - self._middle_ra_deg + 180.0) % 360.0 - 180.0)
        if first or abs(away) > FAR_RAD:
            self._middle_ra_deg = round(ra / 15.0) * 15.0 % 360.0
        word = "was last known" if old else "is"
        self.setAccessibleDescription(f"The camera {word} at RA {ra:.1f}°, Dec {dec:+.1f}°.")
        self.update()

    def forget(self) -> None:
        """No trail."""
        self.trail.clear()
        self.update()

    # painting ---------------------------------------------------------------------------------
    def paintEvent(self, event: QPaintEvent) -> None:
        key = (self.size(), self.devicePixelRatioF(), self.colours, self._middle_ra_deg)
        if key != self._key or self._ground is None:
            self._ground, self._key = self._draw_ground(), key
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._ground)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._draw_trail(painter)
        painter.end()

    def _box(self) -> QRectF:
        """The map's ellipse on the widget."""
        around = QRectF(self.rect()).adjusted(MARGIN_PX, MARGIN_PX, -MARGIN_PX, -MARGIN_PX)
        width = min(around.width(), 2.0 * around.height())
        box = QRectF(0.0, 0.0, width, width / 2.0)
        box.moveCenter(around.center())
        return box

    def _screen(self, vectors: Floats) -> Floats:
        box, xy = self._box(), hammer(vectors, self._middle_ra_deg)
        x = box.center().x() + xy[..., 0] * box.width() / 4.0
        y = box.center().y() - xy[..., 1] * box.height() / 2.0
        return np.stack([x, y], axis=-1)

    def _draw_ground(self) -> QPixmap:
        ratio = self.devicePixelRatioF()
        made = QPixmap(self.size() * ratio)
        made.setDevicePixelRatio(ratio)
        made.fill(QColor(self.colours.window))
        painter = QPainter(made)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(self.colours.line), 1.0))
        painter.setBrush(QColor(self.colours.sky))
        painter.drawEllipse(self._box())
        painter.setBrush(Qt.BrushStyle.NoBrush)
        self._draw_grid(painter)
        if self.points is not None:
            self._draw_sky(painter, self.points)
        painter.end()
        return made

    def _draw_grid(self, painter: QPainter) -> None:
        faint = QColor(self.colours.grid)
        faint.setAlpha(55)
        painter.setPen(QPen(faint, 1.0))
        around = self._middle_ra_deg + np.linspace(-179.9, 179.9, 73)
        up = np.linspace(-90.0, 90.0, 37)
        parallels = [unit_vectors(around, np.full(73, d)) for d in (-60.0, -30.0, 0.0, 30.0, 60.0)]
        meridians = [unit_vectors(np.full(37, r), up) for r in np.arange(0.0, 360.0, 45.0)]
        for line in (*parallels, *meridians):
            self._line(painter, line)
        painter.setPen(QColor(self.colours.grid_text))
        metrics = painter.fontMetrics()
        for hours in range(0, 24, 6):
            x, y = self._screen(unit_vectors(hours * 15.0, 0.0))
            if abs(x - self._box().center().x()) < self._box().width() * 0.46:
                painter.drawText(QPointF(x + 3, y + metrics.ascent() + 1), f"{hours}h")

    def _draw_sky(self, painter: QPainter, points: SkyPoints) -> None:
        """A few calls for all of it: the window's thread has not the time for a thousand."""
        faint = QColor(self.colours.grid)
        faint.setAlpha(140)
        painter.setPen(QPen(faint, 1.0))
        ends = self._screen(points.strokes)
        whole = np.abs(ends[:, 0, 0] - ends[:, 1, 0]) < self._box().width() / 4.0
        painter.drawLines([QLineF(*a, *b) for a, b in ends[whole].tolist()])
        places = self._screen(points.stars)
        for brightest, faintest, width in CLASSES:
            mine = places[(points.mag >= brightest) & (points.mag < faintest)]
            pen = QPen(QColor(self.colours.grid_text), width)
            pen.setCapStyle(Qt.PenCapStyle.RoundCap)
            painter.setPen(pen)
            painter.drawPoints([QPointF(x, y) for x, y in mine.tolist()])

    def _line(self, painter: QPainter, vectors: Floats) -> None:
        """A line through directions (N, 3)."""
        box = self._box()
        middle, across, up = box.center(), box.width() / 4.0, box.height() / 2.0
        for part in pieces(hammer(vectors, self._middle_ra_deg)):
            xy = np.stack([middle.x() + part[:, 0] * across, middle.y() - part[:, 1] * up], axis=1)
            painter.drawPolyline(QPolygonF([QPointF(x, y) for x, y in xy.tolist()]))

    def _draw_trail(self, painter: QPainter) -> None:
        here = self.trail.here
        if here is None:
            return
        painter.setPen(QPen(QColor(self.colours.detected), 1.6))
        self._line(painter, np.vstack([self.trail.points, here]))
        x, y = self._screen(here)
        style = Qt.PenStyle.DotLine if self.trail.old else Qt.PenStyle.SolidLine
        painter.setPen(QPen(QColor(self.colours.centre), 2.0, style))
        painter.drawEllipse(QPointF(x, y), 5.0, 5.0)
        cross = QPainterPath()
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            cross.moveTo(x + 7 * dx, y + 7 * dy)
            cross.lineTo(x + 12 * dx, y + 12 * dy)
        painter.drawPath(cross)
