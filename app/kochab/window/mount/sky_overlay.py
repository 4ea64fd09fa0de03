"""What a mount adds to the star chart: where it says it points, where the sky says, its way, the horizon, the meridian.

The mount's place is a ring, the solved one a dot, the way of a slew a dashed line to the target. Below the limits of
the mount lies a hill.
"""

from dataclasses import field
from datetime import datetime

import numpy as np
from PySide6.QtCore import QPointF, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPen, QPolygonF

from kochab.core.arrays import Floats
from kochab.core.attitude import angle_between, unit
from kochab.core.frame import Site
from kochab.core.values import frozen, mutable
from kochab.gear.mounts.motion_plan import Limits
from kochab.sky.horizon import Horizon
from kochab.text.translation import tr, tr_noop
from kochab.window.atlas.chart import StarChart
from kochab.window.image.overlay import Brush, cross
from kochab.window.themes import Colours, theme_colours, translucent

STEP_DEG = 1.0  # of azimuth along the hill, and of altitude along the meridian
FRESH_S = 20.0  # the sky turns by 5 arcmin meanwhile
RING_PX, DOT_PX = 13.0, 4.5
ASIDE_PX, UPPER, LOWER = 21.0, -10.0, 16.0  # of a mark's name from its middle: to its side, and its base line below
FARTHEST = 300.0  # from the middle of the chart, in focal lengths: the place opposite has none
WAY_POINTS = 65
LABEL_LETTERS = 20  # of the longest name of a mark
WAYS = ((0.0, tr_noop("N")), (90.0, tr_noop("E")), (180.0, tr_noop("S")), (270.0, tr_noop("W")))


@frozen(eq=False)
class LocalSky:
    """The horizon and the meridian of a site at one time, as ICRS unit vectors.

    ``floor`` (361, 3) goes from north over east, ``meridian`` (N, 3) from the southern floor to the northern one;
    ``nadir`` (3,).
    """

    floor: Floats
    meridian: Floats
    nadir: Floats

    @classmethod
    def at(cls, site: Site, when: datetime, limits: Limits) -> "LocalSky":
        """Where the ``limits`` of a mount lie among the stars."""
        horizon, azimuths = Horizon(site, when), np.arange(0.0, 361.0, STEP_DEG)
        floors = limits.floors_deg(azimuths)
        south, north = floors[180], floors[0]
        heights = np.arange(south, 180.0 - north, STEP_DEG)
        zenith = np.array([[0.0, 0.0, 1.0]])
        return cls(
            horizon.catalogue(_directions(azimuths, floors)),
            horizon.catalogue(_directions(np.full(len(heights), 180.0), heights)),
            -horizon.catalogue(zenith)[0],
        )


def _directions(azimuths_deg: Floats, altitudes_deg: Floats) -> Floats:
    """Unit vectors (N, 3) to east, north and up; past the zenith the altitude goes on beyond 90."""
    azimuth, altitude = np.radians(azimuths_deg), np.radians(altitudes_deg)
    level = np.cos(altitude)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(altitude)], axis=-1)


@mutable
class MountMarks:
    """What is painted; every place is an ICRS unit vector (3,), None where there is none.

    ``offset_text`` is how far the solved place is from the mount's; ``is_old``: it has moved since. ``slewing``: it is
    on its ``way`` to the target.
    """

    mount: Floats | None = None
    solved: Floats | None = None
    offset_text: str = ""
    is_old: bool = False
    target: Floats | None = None
    target_text: str = ""
    slewing: bool = False
    local: LocalSky | None = None
    meridian_text: str = ""
    _of: tuple[object, ...] = field(default_factory=tuple)
    _when: datetime | None = None

    def show_site(self, site: Site | None, when: datetime, limits: Limits) -> None:
        """Draw the horizon of a site; nothing where it is not known."""
        key = site, limits
        if site is None:
            self.local, self._of, self._when = None, key, None
        elif key != self._of or self._when is None or abs((when - self._when).total_seconds()) > FRESH_S:
            self.local, self._of, self._when = LocalSky.at(site, when, limits), key, when

    @property
    def ground_key(self) -> object:
        return id(self.local), self.meridian_text

    @staticmethod
    def south(site: Site, when: datetime) -> Floats:
        """Where one looks first, an ICRS unit vector (3,): halfway up the meridian, towards the equator."""
        azimuth = 180.0 if site.latitude_deg >= 0.0 else 0.0
        return np.asarray(Horizon(site, when).catalogue(_directions(np.array([azimuth]), np.array([40.0])))[0])

    def room_px(self, chart: StarChart) -> QRect:
        """Where the ring, the dot and their names need room in the middle of a chart that follows the mount."""
        high, wide = chart.fontMetrics().height(), chart.fontMetrics().averageCharWidth()
        middle = chart.rect().center()
        return QRect(middle.x() - 20, middle.y() - 2 * high, 20 + LABEL_LETTERS * wide, 4 * high)

    # -- painting --------------------------------------------------------------------------------

    def paint_ground(self, painter: QPainter, chart: StarChart) -> None:
        """The hill over what is too low, and the meridian."""
        if self.local is None:
            return
        colours = theme_colours()
        brush, sheet = chart.brush(painter), chart.sheet
        painter.save()
        floor = QPolygonF([QPointF(x, y) for x, y in flat(chart, self.local.floor).tolist()])
        hill = QPainterPath()
        hill.addPolygon(floor)
        hill.closeSubpath()
        # Of zenith and nadir the one before the chart tells which side is up: the other may have no place on it.
        up = -1.0 if self.local.nadir @ sheet.centre_vector > 0.0 else 1.0
        sure = QPointF(*flat(chart, -up * self.local.nadir[None])[0].tolist())
        if floor.containsPoint(sure, Qt.FillRule.OddEvenFill) is (up > 0.0):
            hill.addRect(QRectF(chart.rect()).adjusted(-2.0, -2.0, 2.0, 2.0))
        painter.fillPath(hill, translucent(colours.ground, 205))
        painter.setPen(QPen(translucent(colours.horizon, 220), 1.6))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawPolyline(floor)
        seen = self.local.meridian[self.local.meridian @ sheet.centre_vector > 0.0]
        painter.setPen(QPen(translucent(colours.horizon, 150), 1.2, Qt.PenStyle.DashLine))
        line = flat(chart, seen)
        painter.drawPolyline(QPolygonF([QPointF(x, y) for x, y in line.tolist()]))
        painter.restore()
        for azimuth, letter in WAYS:
            vector = self.local.floor[round(azimuth / STEP_DEG)]
            if vector @ sheet.centre_vector > 0.0:
                x, y = flat(chart, vector[None])[0].tolist()
                _write(brush, QPointF(x - 4.0, y + 18.0), tr(letter), colours.horizon_text)
        self._name_meridian(brush, chart, line, colours)

    def _name_meridian(self, brush: Brush, chart: StarChart, line: Floats, colours: Colours) -> None:
        """Beside the line where no other name is, as near as can be to a third of the chart's height."""
        if not self.meridian_text:
            return
        box = brush.box(self.meridian_text)
        taken = [QRectF(*label.box) for label in chart.overlay.labels] + [QRectF(at) for at in chart.overlay.covered]
        inside = QRectF(chart.rect()).adjusted(8.0, 8.0, -8.0, -8.0)
        for x, y in line[np.argsort(np.abs(line[:, 1] - 0.3 * chart.height()))].tolist():
            for left in (x + 10.0, x - box.width() - 14.0):
                at = box.translated(left, y)
                if inside.contains(at) and not any(at.intersects(other) for other in taken):
                    _write(brush, QPointF(left, y), self.meridian_text, colours.horizon_text)
                    return

    def paint_marks(self, painter: QPainter, chart: StarChart) -> None:
        """The way, the target, the ring and the dot."""
        colours, brush = theme_colours(), chart.brush(painter)
        ring, dot, goal = (_place(chart, at) for at in (self.mount, self.solved, self.target))
        taken = [QRectF(*label.box) for label in chart.overlay.labels]
        if self.slewing and self.mount is not None and self.target is not None:
            painter.setPen(QPen(QColor(colours.way), 2.0, Qt.PenStyle.DashLine))
            way = flat(chart, _between(self.mount, self.target))
            painter.drawPolyline(QPolygonF([QPointF(x, y) for x, y in way.tolist()]))
        apart = QPointF() if goal is None or ring is None else goal - ring
        if goal is not None and (ring is None or apart.manhattanLength() > 2.0 * RING_PX):  # else the ring says it
            brush.pen(colours.way, 2.0)
            cross(brush, goal.x(), goal.y(), 5.0, 14.0)
            name_mark(brush, goal, self.target_text, colours.way, taken)
        if dot is not None:
            painter.setPen(QPen(QColor(colours.halo), 1.0))
            painter.setBrush(translucent(colours.solved, 110 if self.is_old else 255))
            painter.drawEllipse(dot, DOT_PX, DOT_PX)
            text = tr("sky: {offset}", offset=self.offset_text)
            text = tr("old {place}", place=text) if self.is_old else text
            name_mark(brush, dot, text, colours.solved, taken)
        if ring is not None:
            for colour, width in ((colours.halo, 5.0), (colours.mount, 2.6)):
                brush.pen(colour, width)
                painter.drawEllipse(ring, RING_PX, RING_PX)
            name_mark(brush, ring, tr("mount"), colours.mount, taken, (LOWER, UPPER))


def flat(chart: StarChart, vectors: Floats) -> Floats:
    """Places of the widget (N, 2), px, of ICRS unit vectors (N, 3), behind the chart's hemisphere too."""
    sheet = chart.sheet
    seen = vectors @ sheet.attitude.matrix.T
    uv = 2.0 * seen[:, :2] / np.maximum(1.0 + seen[:, 2:], 1e-9)
    far = np.hypot(uv[:, 0], uv[:, 1])
    uv *= np.minimum(1.0, FARTHEST / np.maximum(far, 1e-9))[:, None]
    camera = sheet.camera
    return np.asarray(uv * camera.focal_px + (camera.cx + 0.5, camera.cy + 0.5))


def _place(chart: StarChart, vector: Floats | None) -> QPointF | None:
    """Where a direction is seen; None behind the chart."""
    if vector is None or vector @ chart.sheet.centre_vector <= 0.0:
        return None
    at = QPointF(*flat(chart, vector[None])[0].tolist())
    return at if QRectF(chart.rect()).contains(at) else None


def _between(start: Floats, end: Floats) -> Floats:
    """Unit vectors (N, 3) along the great circle."""
    angle = angle_between(start, end)
    share = np.linspace(0.0, 1.0, WAY_POINTS)[:, None]
    if angle < 1e-6:
        return np.stack([start, end])
    return unit(np.sin((1.0 - share) * angle) * start + np.sin(share * angle) * end)


def name_mark(
    brush: Brush, mark: QPointF, text: str, colour: str, taken: list[QRectF], sides: tuple[float, ...] = (UPPER, LOWER)
) -> None:
    """Write beside a mark, to its right or left, where no other name is.

    Parameters
    ----------
    brush : Brush
        Of the chart.
    mark : QPointF
        The mark's middle.
    text : str
        The name.
    colour : str
        Of the name.
    taken : list[QRectF]
        The boxes of other names, to which this one is added.
    sides : tuple[float, ...]
        How far its base line is below the middle, px, the best first.
    """
    box = brush.box(text)
    spots = [QPointF(across, down) for across in (ASIDE_PX, -ASIDE_PX - box.width()) for down in sides]
    free = (at for at in spots if not any(box.translated(mark + at).intersects(other) for other in taken))
    at = mark + next(free, spots[0])
    taken.append(box.translated(at))
    _write(brush, at, text, colour)


def _write(brush: Brush, at: QPointF, text: str, colour: str) -> None:
    """A text with a dark edge whose base line begins there, moved into the chart."""
    if text:
        box = brush.box(text).translated(at)
        left = min(max(box.left(), 4.0), max(4.0, brush.view.width - 4.0 - box.width()))
        brush.draw(QPointF(left, box.top()), text, colour)
