"""Where the axis stands around its pole: rings, the error's ellipse, and the way it came."""

import math
import re

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.polar.error import PolarError
from app.polar.words import altitude_in_words, angle_in_words, azimuth_in_words
from app.ui.palette import THEMES, Colours
from app.ui.polar.state import State

RINGS_ARCSEC = (30.0, 60.0, 300.0, 1800.0, 7200.0, 36000.0)
REACHES_ARCSEC = (45.0, 90.0, 200.0, 450.0, 1200.0, 2700.0, 6000.0, 14400.0, 43200.0, 324000.0)
SECONDS, MINUTES = re.compile(r'(?<=\d)"'), re.compile(r"(?<=\d)'")
LEAST_RING_PX = 12.0
LEAST_ELLIPSE_PX = 2.5


class Target(QWidget):
    """Altitude up, azimuth on the sky to the right when it stands clockwise; the pole inside.

    An instrument and not a chart: rings at round errors around the pole, the error's ellipse, and
    arrows the way the screws must go, all in the size of the letters.
    """

    def __init__(self) -> None:
        super().__init__()
        self.colours: Colours = THEMES["dark"]
        self.state = State()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(180, 180)
        self.setAccessibleName("The axis around the pole")

    def sizeHint(self) -> QSize:
        return QSize(340, 340)

    def show_state(self, state: State) -> None:
        """Draw this."""
        self.state = state
        error = state.error
        told = "Nothing is measured yet."
        if error is not None:
            told = f"{altitude_in_words(error)}; {azimuth_in_words(error)}"
        self.setAccessibleDescription(told)
        self.update()

    @property
    def reach_arcsec(self) -> float:
        """What lies at the edge: the error with its ellipse is well inside, and what was before."""
        errors = [e for e in (self.state.error, *self.state.measured[-1:]) if e is not None]
        most = max((e.total_arcsec + 1.5 * e.ellipse_arcsec()[0] for e in errors), default=280.0)
        return next((r for r in REACHES_ARCSEC if r > 1.1 * most), REACHES_ARCSEC[-1])

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), QColor(self.colours.surface))
        line = QFontMetricsF(self.font()).height()
        box = QRectF(self.rect()).adjusted(4, line + 4, -4, -line - 4)
        radius = min(box.width(), box.height()) / 2.0
        centre, scale = box.center(), radius / self.reach_arcsec
        self._rings(painter, centre, scale, radius)
        self._names(painter, centre, radius, line)
        painter.save()
        painter.setClipRect(box)
        for before in self.state.measured[:-1] if not self.state.live else self.state.measured:
            self._ellipse(painter, centre, scale, before, QColor(self.colours.muted), 1.0)
        self._trail(painter, centre, scale)
        if self.state.error is not None:
            self._ellipse(painter, centre, scale, self.state.error, QColor(self.colours.accent))
            self._cross(painter, centre, scale, self.state.error)
        painter.restore()
        painter.end()

    def _rings(self, painter: QPainter, centre: QPointF, scale: float, radius: float) -> None:
        painter.setBrush(Qt.BrushStyle.NoBrush)
        metrics = QFontMetricsF(self.font())
        for ring in RINGS_ARCSEC:
            size = ring * scale
            if not LEAST_RING_PX <= size <= 1.02 * radius:
                continue
            painter.setPen(QPen(QColor(self.colours.grid), 1.2))
            painter.drawEllipse(centre, size, size)
            name = ring_name(ring)
            at = centre + QPointF(size * math.sin(0.6), -size * math.cos(0.6))
            wide, high = metrics.horizontalAdvance(name) + 6, metrics.height()
            behind = QRectF(at.x() - wide / 2, at.y() - high / 2, wide, high)
            painter.fillRect(behind, QColor(self.colours.surface))
            painter.setPen(QColor(self.colours.text))
            painter.drawText(behind, Qt.AlignmentFlag.AlignCenter, name)
        painter.setPen(QPen(QColor(self.colours.good), 2))
        painter.drawLine(centre + QPointF(-8, 0), centre + QPointF(8, 0))
        painter.drawLine(centre + QPointF(0, -8), centre + QPointF(0, 8))

    def _names(self, painter: QPainter, centre: QPointF, radius: float, line: float) -> None:
        painter.setPen(QColor(self.colours.muted))
        wide = QRectF(centre.x() - 100, 0, 200, line)
        middle = Qt.AlignmentFlag.AlignCenter
        painter.drawText(wide.translated(0, centre.y() - radius - line - 2), middle, "too high")
        painter.drawText(wide.translated(0, centre.y() + radius + 2), middle, "too low")
        side = QRectF(6, centre.y() - 2.2 * line, self.width() - 12, line)
        right, left = Qt.AlignmentFlag.AlignRight, Qt.AlignmentFlag.AlignLeft
        painter.drawText(side, right, "clockwise")
        painter.drawText(side, left, "anticlockwise")

    def _place(self, centre: QPointF, scale: float, error: PolarError) -> QPointF:
        x, y = error.azimuth_on_sky_arcsec, error.altitude_arcsec
        return centre + QPointF(x * scale, -y * scale)

    def _ellipse(
        self, painter: QPainter, centre: QPointF, scale: float, error: PolarError,
        colour: QColor, width: float = 2.0,
    ) -> None:  # fmt: skip
        long, short, angle = error.whole.ellipse_arcsec()
        painter.save()
        painter.translate(self._place(centre, scale, error))
        painter.rotate(-math.degrees(angle))
        painter.setPen(QPen(colour, width))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawEllipse(
            QPointF(0, 0), max(long * scale, LEAST_ELLIPSE_PX), max(short * scale, LEAST_ELLIPSE_PX)
        )
        painter.restore()

    def _cross(
        self, painter: QPainter, centre: QPointF, scale: float, error: PolarError
    ) -> None:  # fmt: skip
        at = self._place(centre, scale, error)
        painter.setPen(QPen(QColor(self.colours.accent), 2.5))
        for dx, dy in ((9, 0), (0, 9), (-9, 0), (0, -9)):
            painter.drawLine(at + QPointF(dx / 2.2, dy / 2.2), at + QPointF(dx, dy))

    def _trail(self, painter: QPainter, centre: QPointF, scale: float) -> None:
        points = [centre + QPointF(x * scale, -y * scale) for x, y in self.state.trail]
        painter.setPen(QPen(QColor(self.colours.muted), 1.2, Qt.PenStyle.DotLine))
        painter.drawPolyline(QPolygonF(points))


def ring_name(arcsec: float) -> str:
    """``30″``, ``5′`` or ``2°``."""
    if arcsec < 60.0:
        return f"{arcsec:.0f}″"
    return f"{arcsec / 60.0:.0f}′" if arcsec < 3600.0 else f"{arcsec / 3600.0:.0f}°"


def primes(text: str) -> str:
    """Words with arcseconds and arcminutes as they are printed."""
    return SECONDS.sub("″", MINUTES.sub("′", text))


def typeset(arcsec: float) -> str:
    """``45″``, ``12.5′`` or ``1.25°``: as the words have it, with proper primes."""
    return primes(angle_in_words(arcsec))
