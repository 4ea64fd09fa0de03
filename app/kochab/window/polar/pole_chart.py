"""The sky around the celestial pole: what the Polar room shows before its first frame."""

from datetime import UTC, datetime

import numpy as np
from PySide6.QtCore import QPoint, QPointF, QRect, QSize, Qt
from PySide6.QtGui import QPainter, QShowEvent

from kochab.core.frame import Site
from kochab.polar.pole import northern, pole_direction
from kochab.polar.rotations import alt_az, direction
from kochab.sky.horizon import Horizon
from kochab.text.translation import tr
from kochab.window.atlas.chart import StarChart
from kochab.window.atlas.mosaic import frame_at
from kochab.window.atlas.sky_reading import read_sky
from kochab.window.image.overlay import HALO_PX, cross
from kochab.window.services import Services
from kochab.window.themes import theme_colours

FIELD_DEG = 44.0  # of the shorter side: the pole's constellation, and Kochab in it
UNKNOWN = Site(45.0, 0.0)  # whoever has said no site sees the northern pole
ABOVE_RAD = 0.1  # what is so far above the pole tells which way the zenith is
CROSS_PX = 6.0, 20.0  # the inner and outer end of a tick
NAME_GAP_PX = 2  # between the cross and the edge of the name below it


class PoleChart(StarChart):
    """Drawn as one sees it who faces the pole, the zenith above; it is looked at only."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAccessibleName(tr("Sky around the celestial pole"))
        self.setAccessibleDescription("")
        self.overlay.layers.on["boundaries"] = False
        self.own, self.site, self.pole = self, UNKNOWN, np.array([0.0, 0.0, 1.0])
        self._services, self._is_read, self._marked = services, False, True

    def show_site(self, site: Site | None) -> None:
        """Turn to the pole of a site as it stands there now; None: its hemisphere is not known."""
        if (site or UNKNOWN) != self.site:
            self.site = site or UNKNOWN
            self.turn(datetime.now(UTC))

    def turn(self, at: datetime) -> None:
        """Turn to the pole as it is seen at a given time."""
        horizon = Horizon(self.site, at)
        pole = pole_direction(self.site)
        altitude, azimuth = alt_az(pole)
        self.pole, above = horizon.catalogue(np.stack([pole, direction(altitude + ABOVE_RAD, azimuth)]))
        # North is no way up here: the pole of the chart's coordinates is another by a sixth of a degree.
        right, down = np.diff(frame_at(self.sheet.camera, self.pole).pixels_of(np.stack([self.pole, above])), axis=0)[0]
        self.roll_deg = float(np.degrees(np.arctan2(-right, -down)))
        self.look(self.pole, FIELD_DEG)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.turn(datetime.now(UTC))
        if not self._is_read:
            self._is_read = True
            job = self._services.jobs.run(read_sky(), "pole-sky")
            job.succeeded.connect(lambda read: self.fill(*read))

    def place(self, room: QRect, cards: QRect, bar: QRect) -> None:
        """Fill a room with the pole where the cards leave most free, beside them or between them and the bar."""
        beside = room.adjusted(cards.right(), 0, 0, 0)
        reach, name = round(CROSS_PX[1]), self._name_box
        # Cross and name in the middle between them: the name stands below its cross.
        below = QRect(room.left(), cards.bottom(), room.width(), bar.top() - cards.bottom() - name.height())
        middle = max((beside, below), key=lambda free: min(free.width(), free.height())).center()
        wide = max(middle.x() - room.left(), room.right() - middle.x())
        high = max(middle.y() - room.top(), room.bottom() - middle.y())
        self.setGeometry(QRect(middle - QPoint(wide, high), QSize(2 * wide, 2 * high)))
        mark = QRect(middle, middle).adjusted(-reach, -reach, reach, reach) | name.translated(middle)
        self._marked = room.contains(mark) and not (mark.intersects(cards) or mark.intersects(bar))
        # Of the chart only the room is seen: a name that reached over its edges would be cut.
        all_of_it, right, low = self.geometry(), room.topRight() + QPoint(1, 0), room.bottomLeft() + QPoint(0, 1)
        edges = (
            QRect(all_of_it.topLeft(), room.bottomLeft() - QPoint(1, 0)),
            QRect(all_of_it.topLeft(), room.topRight() - QPoint(0, 1)),
            QRect(right, all_of_it.bottomRight()),
            QRect(low, all_of_it.bottomRight()),
        )
        covered = [cards, bar, mark, *(edge for edge in edges if edge.isValid())]
        self.overlay.covered[:] = [box.translated(-self.pos()) for box in covered]

    @property
    def _name(self) -> str:
        return tr("north celestial pole") if northern(self.site) else tr("south celestial pole")

    @property
    def _name_box(self) -> QRect:
        """Where the name below the cross is drawn, with its dark edge, as seen from the pole."""
        box, edge = self.fontMetrics().boundingRect(self._name), round(HALO_PX)
        wide, high = box.width() + 2 * edge, box.height() + 2 * edge
        return QRect(-wide // 2, round(CROSS_PX[1]) + NAME_GAP_PX, wide, high)

    @property
    def ground_key(self) -> object:
        return self.pole.tobytes()

    def paint_ground(self, painter: QPainter, chart: StarChart) -> None:
        """Nothing: no ground is in sight."""

    def paint_marks(self, painter: QPainter, chart: StarChart) -> None:
        """A cross where the axis is to point, unless the cards leave no room for it."""
        if not self._marked:
            return
        colours, brush = theme_colours(), self.brush(painter)
        x, y = (self.sheet.pixels_of(self.pole[None])[0] + 0.5).tolist()
        brush.pen(colours.centre, 2.0)
        cross(brush, x, y, *CROSS_PX)
        brush.draw(QPointF(x, y) + self._name_box.topLeft() + QPointF(HALO_PX, HALO_PX), self._name, colours.centre)
