"""Draws the full-screen view at the bolts: large digits and few shapes, each with its words."""

from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, Qt, QTimer
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from kochab.polar.tutor import Knob
from kochab.window.themes import Colours, theme_colours

GAP_DEG = 70.0  # opening of the ring of a turning arrow


def draw_arrow(painter: QPainter, box: QRectF, knob: Knob, positive: bool, colour: QColor) -> None:
    """Draw the way to turn that removes a positive or negative error."""
    square = _square(box)
    painter.save()
    painter.translate(square.center())
    if knob is Knob.ALTITUDE:
        painter.rotate(180.0 if positive else 0.0)
        _raising(painter, square.width() / 2.0, colour)
    else:
        painter.scale(-1.0 if positive else 1.0, 1.0)
        _clockwise(painter, square.width(), colour)
    painter.restore()


def draw_done(painter: QPainter, box: QRectF, colour: QColor) -> None:
    """Draw a tick: nothing more to turn."""
    square = _square(box)
    side = square.width()
    painter.setPen(_pen(colour, side / 8.0))
    corner = square.topLeft()
    places = ((0.15, 0.55), (0.42, 0.80), (0.88, 0.22))
    painter.drawPolyline(QPolygonF([corner + QPointF(x * side, y * side) for x, y in places]))


def _square(box: QRectF, share: float = 0.86) -> QRectF:
    side = share * min(box.width(), box.height())
    square = QRectF(0, 0, side, side)
    square.moveCenter(box.center())
    return square


def _raising(painter: QPainter, half: float, colour: QColor) -> None:
    """Draw an arrow that points up, twice ``half`` high."""
    outline = ((0, -1), (0.8, -0.1), (0.3, -0.1), (0.3, 1), (-0.3, 1), (-0.3, -0.1), (-0.8, -0.1))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(colour)
    painter.drawPolygon(QPolygonF([QPointF(x * half, y * half) for x, y in outline]))


def _clockwise(painter: QPainter, side: float, colour: QColor) -> None:
    """Draw a ring, open at the top, around the post seen from above, with a head at its end."""
    radius, width = 0.36 * side, 0.13 * side
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(_pen(colour, width, Qt.PenCapStyle.FlatCap))
    begin, span = 90.0 - GAP_DEG / 2.0, 360.0 - GAP_DEG
    # Qt counts arcs anticlockwise, but turns a painter clockwise.
    painter.drawArc(QRectF(-radius, -radius, 2 * radius, 2 * radius), round(16 * begin), round(-16 * span))
    painter.rotate(span - begin)  # the ring now ends on the right, on its way down
    head = 1.35 * width
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(colour)
    painter.drawPolygon(QPolygonF([QPointF(radius + x * head, y * head) for x, y in ((1, 0), (0, 1.6), (-1, 0))]))
    painter.drawEllipse(QPointF(0, 0), 0.06 * side, 0.06 * side)


def _pen(colour: QColor, width: float, cap: Qt.PenCapStyle = Qt.PenCapStyle.RoundCap) -> QPen:
    return QPen(colour, width, Qt.PenStyle.SolidLine, cap, Qt.PenJoinStyle.RoundJoin)


STEP_MS, STEP_DEG, ARC_DEG = 80, 30, 270


class Wheel(QTimer):
    """The angle of a wheel on ``widget``, which turns while the number is old."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget, interval=STEP_MS)
        self.angle_deg = 0
        self._widget = widget
        self.timeout.connect(self._step)

    def turn(self, on: bool) -> None:
        """Start or stop."""
        if on != self.isActive():
            self.start() if on else self.stop()
            self._widget.update()

    def _step(self) -> None:
        self.angle_deg = (self.angle_deg + STEP_DEG) % 360
        self._widget.update()


class Spinner(QWidget):
    """A small wheel, invisible while it does not turn."""

    def __init__(self) -> None:
        super().__init__()
        self.wheel = Wheel(self)
        side = self.fontMetrics().height() + 2
        self.setFixedSize(side, side)
        self.setAccessibleName("Waiting for a newer frame")

    def paintEvent(self, event: QPaintEvent) -> None:
        if self.wheel.isActive():
            painter = QPainter(self)
            draw_wheel(painter, QRectF(self.rect()), self.wheel.angle_deg, QColor(theme_colours().accent))
            painter.end()


def draw_wheel(painter: QPainter, box: QRectF, angle_deg: int, colour: QColor) -> None:
    """Draw the wheel at an angle."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    width = max(2.0, box.width() / 9.0)
    painter.setPen(_pen(colour, width))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawArc(box.adjusted(width, width, -width, -width), -16 * angle_deg, 16 * ARC_DEG)


DIGITS_SHARE = 1.0 / 3.0
"""Of the screen's height: 8 cm on a laptop, 1.5 degrees at three metres."""
LEAST_PX = 8  # no letter is smaller


@dataclass(frozen=True, slots=True)
class Face:
    """What the view shows; ``shape`` is "arrow" (for ``knob``), "done", "wheel" or ""."""

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


def paint_face(painter: QPainter, box: QRectF, face: Face, font: QFont, colours: Colours, angle_deg: int) -> None:
    """Draw the whole view with the wheel at ``angle_deg``."""
    drawing = _Drawing(painter, face, font, colours, box.height())
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.fillRect(box, QColor(colours.window))
    edge = 0.03 * box.height()

    def band(top: float, high: float) -> QRectF:
        return QRectF(edge, top * box.height(), box.width() - 2 * edge, high * box.height())

    drawing.head(band(0.03, 0.10))
    drawing.number(band(0.15, 0.46), angle_deg)
    drawing.words(band(0.63, 0.28))
    drawing.foot(band(0.93, 0.05))


def digit_font(base: QFont, digits: str, screen_px: float, width_px: float) -> QFont:
    """A font with digits a third of the screen high, smaller when they would be too wide."""
    font = QFont(base)
    font.setBold(True)
    font.setPixelSize(100)
    metrics = QFontMetricsF(font)
    cap = metrics.capHeight() or 70.0
    size = 100.0 * DIGITS_SHARE * screen_px / cap
    wide = metrics.horizontalAdvance(digits) * size / 100.0
    font.setPixelSize(max(LEAST_PX, int(size * min(1.0, width_px / max(wide, 1.0)))))
    return font


class _Drawing:
    """One face on one painter."""

    def __init__(self, painter: QPainter, face: Face, font: QFont, colours: Colours, high_px: float) -> None:
        self._painter, self._face, self._font = painter, face, font
        self._colours, self._high_px = colours, high_px

    def head(self, box: QRectF) -> None:
        """The axis, and the total error."""
        self._line(box, self._face.title, Qt.AlignmentFlag.AlignLeft, 0.8, bold=True)
        if self._face.total:
            self._line(box, self._face.total, Qt.AlignmentFlag.AlignRight, 0.62)

    def number(self, box: QRectF, angle_deg: int) -> None:
        """The digits with the shape beside them."""
        face, painter = self._face, self._painter
        colour = QColor(self._colours.muted if face.old else self._colours.text)
        shape = QRectF(box.left(), box.top(), min(box.height(), 0.34 * box.width()), box.height())
        text = box.adjusted(shape.width() + 0.02 * box.width(), 0, 0, 0)
        font = digit_font(self._font, face.digits, self._high_px, text.width())
        if face.old:
            self._outlined(text, font, colour)
        else:
            self._write(text, Qt.AlignmentFlag.AlignCenter, face.digits, font, self._colours.text)
        if face.shape == "wheel":
            draw_wheel(painter, _square(shape, 0.45), angle_deg, QColor(self._colours.text))
        elif face.shape == "done":
            draw_done(painter, shape, colour)
        elif face.shape == "arrow":
            draw_arrow(painter, shape, face.knob, face.positive, colour)

    def words(self, box: QRectF) -> None:
        """The arrow in words, and the instruction."""
        way = box.adjusted(0, 0, 0, -0.66 * box.height())
        self._line(way, self._face.way, Qt.AlignmentFlag.AlignCenter, 0.72, bold=True)
        self._wrapped(box.adjusted(0, 0.36 * box.height(), 0, 0), self._face.words)

    def foot(self, box: QRectF) -> None:
        """What the keys do."""
        font = self._sized(0.52 * box.height())
        self._write(box, Qt.AlignmentFlag.AlignCenter, self._face.keys, font, self._colours.muted)

    def _outlined(self, box: QRectF, font: QFont, colour: QColor) -> None:
        """Hollow digits: an old number, whatever the colours."""
        path = QPainterPath()
        path.addText(0.0, 0.0, font, self._face.digits)
        path.translate(box.center() - path.boundingRect().center())
        self._painter.setPen(QPen(colour, max(2.0, 0.012 * self._high_px)))
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        self._painter.drawPath(path)

    def _line(self, box: QRectF, text: str, side: Qt.AlignmentFlag, share: float, bold: bool = False) -> None:
        """A line ``share`` of the box high, or as high as its width allows."""
        font = self._sized(share * box.height(), bold)
        wide = QFontMetricsF(font).horizontalAdvance(text)
        if wide > box.width():
            font = self._sized(font.pixelSize() * box.width() / wide, bold)
        self._write(box, side | Qt.AlignmentFlag.AlignVCenter, text, font, self._colours.text)

    def _wrapped(self, box: QRectF, text: str) -> None:
        """Text over several lines, as large as it fits."""
        wrap = int(Qt.TextFlag.TextWordWrap) | int(Qt.AlignmentFlag.AlignCenter)
        font = self._sized(0.36 * box.height())
        while font.pixelSize() > LEAST_PX:
            needed = QFontMetricsF(font).boundingRect(box, wrap, text)
            if needed.height() <= box.height() and needed.width() <= box.width() + 1:
                break
            font.setPixelSize(font.pixelSize() - max(1, font.pixelSize() // 12))
        self._write(box, wrap, text, font, self._colours.text)

    def _sized(self, size_px: float, bold: bool = False) -> QFont:
        font = QFont(self._font)
        font.setBold(bold)
        font.setPixelSize(max(LEAST_PX, int(size_px)))
        return font

    def _write(self, box: QRectF, flags: int, text: str, font: QFont, colour: str) -> None:
        self._painter.setFont(font)
        self._painter.setPen(QColor(colour))
        self._painter.drawText(box, flags, text)
