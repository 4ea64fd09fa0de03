"""How far the sky is from where the mount says it points: numbers, and an arrow."""

import math
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.core.attitude import apart_deg
from app.mounts.sky_frame import wrapped
from app.ui.palette import THEMES, Colours

RINGS = {
    "10″": 10 / 3600, "30″": 30 / 3600, "1′": 1 / 60, "3′": 3 / 60, "10′": 10 / 60, "30′": 0.5,
    "1°": 1.0, "3°": 3.0, "10°": 10.0, "30°": 30.0, "90°": 90.0, "180°": 180.0,
}  # fmt: skip
SHARE = 0.82  # of the half width, for the ring


@dataclass(frozen=True, slots=True)
class Offset:
    """From what the mount says to what the sky says, degrees on the sky."""

    total_deg: float
    east_deg: float
    north_deg: float

    @classmethod
    def between(cls, mount_deg: tuple[float, float], sky_deg: tuple[float, float]) -> "Offset":
        """Both ICRS degrees; east is narrowed by the sky's declination."""
        east = wrapped(sky_deg[0] - mount_deg[0]) * math.cos(math.radians(sky_deg[1]))
        return cls(apart_deg(mount_deg, sky_deg), east, sky_deg[1] - mount_deg[1])

    @property
    def parts_text(self) -> str:
        """Both parts with their directions."""
        east = "east" if self.east_deg >= 0 else "west"
        north = "north" if self.north_deg >= 0 else "south"
        return f"{size_text(self.east_deg)} {east}, {size_text(self.north_deg)} {north}"


def size_text(angle_deg: float) -> str:
    """A size in the unit that suits it."""
    size = abs(angle_deg)
    if size >= 1.0:
        return f"{size:.2f}°"
    return f"{size * 60:.1f}′" if size >= 1 / 60 else f"{size * 3600:.0f}″"


def ring(total_deg: float) -> tuple[str, float]:
    """Name and radius of the ring that holds the arrow."""
    return next(((n, r) for n, r in RINGS.items() if total_deg <= r * 1.001), ("180°", 180.0))


class OffsetArrow(QWidget):
    """North up, east left, as the sky is seen: from the mount's word to the sky's."""

    def __init__(self) -> None:
        super().__init__()
        self.colours: Colours = THEMES["dark"]
        self._offset: Offset | None = None
        self._old = False
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.show_offset(None)

    def sizeHint(self) -> QSize:
        side = max(132, 8 * self.fontMetrics().height())
        return QSize(side, side)

    def show_offset(self, offset: Offset | None, old: bool = False) -> None:
        """Draw it; ``old`` when the mount has moved since."""
        if (offset, old) == (self._offset, self._old) and self.accessibleName():
            return
        self._offset, self._old = offset, old
        words = "not known" if offset is None else f"{size_text(offset.total_deg)}: "
        words += "" if offset is None else offset.parts_text
        self.setAccessibleName(f"Offset of the sky from the mount: {words}")
        self.setToolTip("The middle is where the mount says it points, the tip what the sky says.")
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        middle = QPointF(self.width() / 2, self.height() / 2)
        radius = SHARE * min(self.width(), self.height()) / 2
        self._scale(painter, middle, radius)
        if self._offset is not None:
            self._arrow(painter, middle, radius, self._offset)
        painter.end()

    def _scale(self, painter: QPainter, middle: QPointF, radius: float) -> None:
        painter.setPen(QPen(QColor(self.colours.line), 1.2))
        painter.drawEllipse(middle, radius, radius)
        painter.drawEllipse(middle, 2.5, 2.5)
        painter.setPen(QColor(self.colours.muted))
        height = painter.fontMetrics().height()
        top = QRectF(middle.x() - 20, middle.y() - radius - height * 0.55, 40, height)
        left = QRectF(middle.x() - radius - 12, middle.y() - height / 2, 24, height)
        for box, letter in ((top, "N"), (left, "E")):
            painter.fillRect(
                QRectF(box.center().x() - height / 2.2, box.top(), height / 1.1, height),
                QColor(self.colours.surface),
            )
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, letter)
        if self._offset is not None:
            name, _ = ring(self._offset.total_deg)
            box = QRectF(middle.x() - 30, middle.y() + radius - height * 0.6, 60, height)
            wide = painter.fontMetrics().horizontalAdvance(name) + 6
            painter.fillRect(
                QRectF(box.center().x() - wide / 2, box.top(), wide, height),
                QColor(self.colours.surface),
            )
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, name)

    def _arrow(self, painter: QPainter, middle: QPointF, radius: float, offset: Offset) -> None:
        colour = QColor(self.colours.faint if self._old else self.colours.accent)
        long = radius * min(1.0, offset.total_deg / ring(offset.total_deg)[1])
        angle = math.atan2(offset.north_deg, -offset.east_deg)
        along = QPointF(math.cos(angle), -math.sin(angle))
        tip = middle + along * long
        painter.setPen(
            QPen(colour, 2.4, Qt.PenStyle.DashLine if self._old else Qt.PenStyle.SolidLine)
        )
        painter.drawLine(middle, tip)
        if long > 8.0:
            side = QPointF(-along.y(), along.x()) * 5.0
            back = tip - along * 11.0
            painter.setBrush(colour)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.drawPolygon(QPolygonF([tip, back + side, back - side]))
            painter.setBrush(Qt.BrushStyle.NoBrush)
