"""Draws the full-screen view at the bolts: large digits and few shapes, each with its words."""

from time import monotonic_ns

from PySide6.QtCore import QRectF, Qt, QTimer
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from kochab.core.values import frozen
from kochab.text.translation import tr
from kochab.window.themes import Colours, draw_glyph, theme_colours

STEP_MS, STEP_DEG = 80, 30


class Wheel(QTimer):
    """A wheel on ``widget``, which turns while the number is old."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget, interval=STEP_MS)
        self._widget = widget
        self.timeout.connect(widget.update)

    def turn(self, on: bool) -> None:
        """Start or stop."""
        if on != self.isActive():
            self.start() if on else self.stop()
            self._widget.update()


def draw_wheel(painter: QPainter, box: QRectF, colour: str) -> None:
    """Draw the wheel as it stands now."""
    painter.save()
    painter.translate(box.center())
    # By the clock, so that the wheels of both screens agree.
    painter.rotate(STEP_DEG * (monotonic_ns() // (STEP_MS * 1_000_000) % (360 // STEP_DEG)))
    draw_glyph(painter, "wheel", colour, box.translated(-box.center()))
    painter.restore()


class Spinner(QWidget):
    """A small wheel, invisible while it does not turn."""

    def __init__(self) -> None:
        super().__init__()
        self.wheel = Wheel(self)
        side = self.fontMetrics().height() + 2
        self.setFixedSize(side, side)
        self.setAccessibleName(tr("Waiting for a newer frame"))

    def paintEvent(self, event: QPaintEvent) -> None:
        if self.wheel.isActive():
            painter = QPainter(self)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            draw_wheel(painter, QRectF(self.rect()), theme_colours().accent)
            painter.end()


DIGITS_SHARE = 1.0 / 3.0
"""Of the screen's height: 8 cm on a laptop, 1.5 degrees at three metres."""
LEAST_PX = 8  # no letter is smaller


@frozen
class Face:
    """What the view shows; ``shape`` is the name of a glyph, or empty."""

    title: str
    total: str
    digits: str
    way: str
    words: str
    keys: str
    shape: str
    old: bool = False


def digit_font(base: QFont, digits: str, screen_px: float, width_px: float) -> QFont:
    """A font with digits a third of the screen high, smaller when they would be too wide.

    Parameters
    ----------
    base : QFont
        Its family.
    digits : str
        The text.
    screen_px : float
        Height of the screen.
    width_px : float
        The room there is.
    """
    # Digits are as high as capitals: 70 of 100 px where the font does not tell.
    cap = QFontMetricsF(_sized(base, 100.0, bold=True)).capHeight() or 70.0
    return _fitted(base, digits, 100.0 * DIGITS_SHARE * screen_px / cap, width_px, bold=True)


def _fitted(base: QFont, text: str, size_px: float, width_px: float, bold: bool = False) -> QFont:
    """A font of this size, smaller when the text would be wider."""
    font = _sized(base, size_px, bold)
    wide = QFontMetricsF(font).horizontalAdvance(text)
    return _sized(base, font.pixelSize() * width_px / wide, bold) if wide > width_px else font


def _sized(base: QFont, size_px: float, bold: bool = False) -> QFont:
    font = QFont(base)
    font.setBold(bold)
    font.setPixelSize(max(LEAST_PX, int(size_px)))
    return font


def paint_face(painter: QPainter, box: QRectF, face: Face, font: QFont, colours: Colours) -> None:
    """Draw the whole view.

    Parameters
    ----------
    painter : QPainter
        Draws it.
    box : QRectF
        The whole view, px.
    face : Face
        What it shows.
    font : QFont
        Family of its texts.
    colours : Colours
        Of the theme.
    """
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.fillRect(box, QColor(colours.window))
    high, edge, to = box.height(), 0.03 * box.height(), Qt.AlignmentFlag

    def band(top: float, share: float) -> QRectF:
        return QRectF(edge, top * high, box.width() - 2 * edge, share * high)

    head, way, keys = band(0.03, 0.10), band(0.63, 0.095), band(0.93, 0.05)
    for at, side, text, share, colour, bold in (
        (head, to.AlignLeft, face.title, 0.8, colours.text, True),
        (head, to.AlignRight, face.total, 0.62, colours.text, False),
        (way, to.AlignHCenter, face.way, 0.72, colours.text, True),
        (keys, to.AlignHCenter, face.keys, 0.52, colours.muted, False),
    ):
        fitted = _fitted(font, text, share * at.height(), at.width(), bold)
        _write(painter, at, side | to.AlignVCenter, text, fitted, colour)
    _paint_words(painter, band(0.73, 0.18), face.words, font, colours.text)
    _paint_number(painter, band(0.15, 0.46), face, font, colours, high)


def _paint_number(painter: QPainter, box: QRectF, face: Face, font: QFont, colours: Colours, screen_px: float) -> None:
    """Draw the digits with the shape beside them; an old number is hollow, whatever the colours."""
    colour = colours.muted if face.old else colours.text
    shape = QRectF(box.left(), box.top(), min(box.height(), 0.34 * box.width()), box.height())
    text = box.adjusted(shape.width() + 0.02 * box.width(), 0, 0, 0)
    large = digit_font(font, face.digits, screen_px, text.width())
    if face.old:
        path = QPainterPath()
        path.addText(0.0, 0.0, large, face.digits)
        path.translate(text.center() - path.boundingRect().center())
        painter.strokePath(path, QPen(QColor(colour), max(2.0, 0.012 * screen_px)))
    else:
        _write(painter, text, Qt.AlignmentFlag.AlignCenter, face.digits, large, colour)
    if face.shape == "wheel":
        draw_wheel(painter, _square(shape, 0.45), colours.text)
    elif face.shape:
        draw_glyph(painter, face.shape, colour, _square(shape, 0.86))


def _square(box: QRectF, share: float) -> QRectF:
    side = share * min(box.width(), box.height())
    square = QRectF(0, 0, side, side)
    square.moveCenter(box.center())
    return square


def _paint_words(painter: QPainter, box: QRectF, text: str, base: QFont, colour: str) -> None:
    """Write over several lines, as large as it fits."""
    wrap = int(Qt.TextFlag.TextWordWrap) | int(Qt.AlignmentFlag.AlignCenter)
    font = _sized(base, 0.36 * box.height())
    # Where lines break depends on the size, so it is tried in steps of a twelfth.
    while font.pixelSize() > LEAST_PX:
        needed = QFontMetricsF(font).boundingRect(box, wrap, text)
        if needed.height() <= box.height() and needed.width() <= box.width() + 1:
            break
        font.setPixelSize(font.pixelSize() - max(1, font.pixelSize() // 12))
    _write(painter, box, wrap, text, font, colour)


def _write(painter: QPainter, box: QRectF, flags: int, text: str, font: QFont, colour: str) -> None:
    painter.setFont(font)
    painter.setPen(QColor(colour))
    painter.drawText(box, flags, text)
