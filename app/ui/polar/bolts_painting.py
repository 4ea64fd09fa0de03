"""How the screen at the bolts is drawn: large, in few shapes, each with its words."""

from dataclasses import dataclass

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen

from app.polar.bolts import Knob
from app.ui.palette import Colours
from app.ui.polar.arrows import draw_arrow, draw_done
from app.ui.polar.spinner import draw_wheel

DIGITS_SHARE = 1.0 / 3.0
"""Of the screen's height: digits of 8 cm on a laptop, which is 1.5 degrees at three metres."""


@dataclass(frozen=True, slots=True)
class Face:
    """What is to be read, in words, and which shape stands beside the digits.

    ``shape`` is "arrow" (of ``knob``, one way or the other), "done", "wheel" or "".
    """

    title: str
    total: str
    digits: str
    way: str
    words: str
    keys: str
    shape: str
    knob: Knob
    positive: bool = False
    old: bool = False


def paint_face(
    painter: QPainter, box: QRectF, face: Face, font: QFont, colours: Colours, angle_deg: int
) -> None:
    """Draw all of it; ``angle_deg`` is where the wheel stands."""
    drawing = _Drawing(painter, face, font, colours, box.height())
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.fillRect(box, QColor(colours.window))
    wide, high = box.width(), box.height()
    edge = 0.03 * high
    drawing.head(QRectF(edge, edge, wide - 2 * edge, 0.10 * high))
    drawing.number(QRectF(edge, 0.15 * high, wide - 2 * edge, 0.46 * high), angle_deg)
    drawing.words(QRectF(edge, 0.63 * high, wide - 2 * edge, 0.28 * high))
    drawing.foot(QRectF(edge, 0.93 * high, wide - 2 * edge, 0.05 * high))


def digit_font(base: QFont, digits: str, screen_px: float, width_px: float) -> QFont:
    """Capitals and digits as high as a third of the screen, less when that is too wide."""
    font = QFont(base)
    font.setBold(True)
    font.setPixelSize(100)
    metrics = QFontMetricsF(font)
    cap = metrics.capHeight() or 70.0
    size = 100.0 * DIGITS_SHARE * screen_px / cap
    wide = metrics.horizontalAdvance(digits) * size / 100.0
    font.setPixelSize(max(8, int(size * min(1.0, width_px / max(wide, 1.0)))))
    return font


class _Drawing:
    """One face on one painter."""

    def __init__(
        self, painter: QPainter, face: Face, font: QFont, colours: Colours, high_px: float
    ) -> None:
        self._painter, self._face, self._font = painter, face, font
        self._colours, self._high_px = colours, high_px

    def head(self, box: QRectF) -> None:
        """Which axis, and how the whole stands."""
        self._line(box, self._face.title, Qt.AlignmentFlag.AlignLeft, 0.8, bold=True)
        if self._face.total:
            self._line(box, self._face.total, Qt.AlignmentFlag.AlignRight, 0.62)

    def number(self, box: QRectF, angle_deg: int) -> None:
        """The digits, a third of the screen high, and the shape beside them."""
        face, painter = self._face, self._painter
        colour = QColor(self._colours.muted if face.old else self._colours.text)
        shape = QRectF(box.left(), box.top(), min(box.height(), 0.34 * box.width()), box.height())
        text = box.adjusted(shape.width() + 0.02 * box.width(), 0, 0, 0)
        font = digit_font(self._font, face.digits, self._high_px, text.width())
        if face.old:
            self._outlined(text, font, colour)
        else:
            painter.setFont(font)
            painter.setPen(colour)
            painter.drawText(text, Qt.AlignmentFlag.AlignCenter, face.digits)
        if face.shape == "wheel":
            side = 0.45 * shape.width()
            wheel = QRectF(0, 0, side, side)
            wheel.moveCenter(shape.center())
            draw_wheel(painter, wheel, angle_deg, QColor(self._colours.text))
        elif face.shape == "done":
            draw_done(painter, shape, colour)
        elif face.shape == "arrow":
            draw_arrow(painter, shape, face.knob, face.positive, colour)

    def words(self, box: QRectF) -> None:
        """The arrow in words, and what the tutor says."""
        way = box.adjusted(0, 0, 0, -0.66 * box.height())
        self._line(way, self._face.way, Qt.AlignmentFlag.AlignCenter, 0.72, bold=True)
        self._wrapped(box.adjusted(0, 0.36 * box.height(), 0, 0), self._face.words)

    def foot(self, box: QRectF) -> None:
        """What the keys do."""
        font = QFont(self._font)
        font.setPixelSize(max(9, int(0.52 * box.height())))
        self._painter.setFont(font)
        self._painter.setPen(QColor(self._colours.muted))
        self._painter.drawText(box, Qt.AlignmentFlag.AlignCenter, self._face.keys)

    def _outlined(self, box: QRectF, font: QFont, colour: QColor) -> None:
        """Hollow digits: not of just now, in any colour."""
        path = QPainterPath()
        path.addText(0.0, 0.0, font, self._face.digits)
        path.translate(box.center() - path.boundingRect().center())
        self._painter.setPen(QPen(colour, max(2.0, 0.012 * self._high_px)))
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        self._painter.drawPath(path)

    def _line(
        self, box: QRectF, text: str, side: Qt.AlignmentFlag, share: float, bold: bool = False
    ) -> None:
        """A line ``share`` of the box high, or as high as its width allows."""
        font = QFont(self._font)
        font.setBold(bold)
        font.setPixelSize(max(8, int(share * box.height())))
        wide = QFontMetricsF(font).horizontalAdvance(text)
        if wide > box.width():
            font.setPixelSize(max(8, int(font.pixelSize() * box.width() / wide)))
        self._painter.setFont(font)
        self._painter.setPen(QColor(self._colours.text))
        self._painter.drawText(box, side | Qt.AlignmentFlag.AlignVCenter, text)

    def _wrapped(self, box: QRectF, text: str) -> None:
        """Words over several lines, as large as they fit."""
        wrap = int(Qt.TextFlag.TextWordWrap) | int(Qt.AlignmentFlag.AlignCenter)
        font = QFont(self._font)
        size = max(8, int(0.36 * box.height()))
        while size > 8:
            font.setPixelSize(size)
            needed = QFontMetricsF(font).boundingRect(box, wrap, text)
            if needed.height() <= box.height() and needed.width() <= box.width() + 1:
                break
            size -= max(1, size // 12)
        self._painter.setFont(font)
        self._painter.setPen(QColor(self._colours.text))
        self._painter.drawText(box, wrap, text)
