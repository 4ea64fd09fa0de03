"""At the bolts: the whole screen says which way to turn and how far, readable from three metres.

One axis at a time. Arrows mean the same from every side of the mount: up and down for the axis,
and for the azimuth the sense of rotation seen from above. Shapes and words carry everything that
colours do.
"""

from PySide6.QtCore import QRectF, Qt, QTimer, Signal
from PySide6.QtGui import (
    QColor,
    QFont,
    QFontMetricsF,
    QKeyEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
)
from PySide6.QtWidgets import QWidget

from app.polar.bolts import Knob
from app.polar.error import PolarError
from app.ui.palette import THEMES, Colours
from app.ui.polar.arrows import draw_arrow, draw_done
from app.ui.polar.spinner import STEP_DEG, STEP_MS, draw_wheel
from app.ui.polar.state import State
from app.ui.polar.target import primes, typeset

DIGITS_SHARE = 1.0 / 3.0
"""Of the screen's height: digits of 8 cm on a laptop, which is 1.5 degrees at three metres."""

KEYS = "Space: done    Tab: other axis    M: measure again    S: sounds    Esc: back"


class BoltsView(QWidget):
    """A window of its own over the whole screen; it shows a :class:`State` and asks by signals."""

    done = Signal()
    remeasure = Signal()
    sounds = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle("At the bolts")
        self.setAccessibleName("At the bolts")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.colours: Colours = THEMES["night"]
        self.state = State()
        self.old = False
        self.sounding = ""
        self._chosen: Knob | None = None
        self._angle_deg = 0
        self._timer = QTimer(self)
        self._timer.setInterval(STEP_MS)
        self._timer.timeout.connect(self._turn_wheel)

    def show_state(self, state: State, now_s: float) -> None:
        """Show this; a new instruction chooses its own axis."""
        if state.instruction is not self.state.instruction:
            self._chosen = None
        self.state, self.old = state, state.old(now_s)
        waits = self.old or (state.running and state.stage != "adjust")
        if waits != self._timer.isActive():
            self._timer.start() if waits else self._timer.stop()
        self.setAccessibleDescription(f"{self.digits()} {self.way()}. {state.words}")
        self.update()

    @property
    def knob(self) -> Knob:
        """The axis that is shown."""
        return self._chosen or self.state.knob or Knob.ALTITUDE

    def digits(self) -> str:
        """What stands in huge digits: what is left on this axis."""
        error = self.state.error
        if error is None:
            return "–"
        if self.state.stop or self.state.stage == "done":
            return typeset(error.total_arcsec)
        return typeset(_of(error, self.knob))

    def way(self) -> str:
        """The arrow in words."""
        error = self.state.error
        if error is None or self.state.stop or self.state.stage == "done":
            return ""
        positive = _of(error, self.knob) > 0
        if self.knob is Knob.ALTITUDE:
            return "lower the axis" if positive else "raise the axis"
        return f"{'anticlockwise' if positive else 'clockwise'}, from above"

    # keys -------------------------------------------------------------------------------------
    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = Qt.Key
        match event.key():
            case key.Key_Escape | key.Key_F11 | key.Key_F7:
                self.close()
            case key.Key_Space | key.Key_Return | key.Key_Enter:
                self.done.emit()
            case key.Key_M:
                self.remeasure.emit()
            case key.Key_S:
                self.sounds.emit()
            case key.Key_Left | key.Key_Right | key.Key_Up | key.Key_Down:
                self.other_axis()
            case _:
                super().keyPressEvent(event)

    def focusNextPrevChild(self, next: bool) -> bool:
        """Tab shows the other axis; there is nothing else to go to."""
        self.other_axis()
        return True

    def other_axis(self) -> None:
        """Show the other one of altitude and azimuth until the next instruction."""
        self._chosen = Knob.AZIMUTH if self.knob is Knob.ALTITUDE else Knob.ALTITUDE
        self.update()

    # painting ---------------------------------------------------------------------------------
    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), QColor(self.colours.window))
        wide, high = float(self.width()), float(self.height())
        edge = 0.03 * high
        self._head(painter, QRectF(edge, edge, wide - 2 * edge, 0.10 * high))
        middle = QRectF(edge, 0.15 * high, wide - 2 * edge, 0.46 * high)
        self._number(painter, middle)
        below = QRectF(edge, 0.63 * high, wide - 2 * edge, 0.28 * high)
        self._words(painter, below)
        self._foot(painter, QRectF(edge, 0.93 * high, wide - 2 * edge, 0.05 * high))
        painter.end()

    def _head(self, painter: QPainter, box: QRectF) -> None:
        """Which axis, and how the whole stands."""
        error = self.state.error
        title = "Polar alignment" if error is None else self.knob.value.capitalize()
        if self.state.stop or self.state.stage == "done":
            title = "Total"
        self._text(painter, box, title, Qt.AlignmentFlag.AlignLeft, 0.8, bold=True)
        if error is not None:
            total = f"total {typeset(error.total_arcsec)} ± {typeset(error.sigma_total_arcsec)}"
            self._text(painter, box, total, Qt.AlignmentFlag.AlignRight, 0.62)

    def _number(self, painter: QPainter, box: QRectF) -> None:
        """The digits, a third of the screen high, and the arrow beside them."""
        colour = QColor(self.colours.muted if self.old else self.colours.text)
        arrow = QRectF(box.left(), box.top(), min(box.height(), 0.34 * box.width()), box.height())
        text = box.adjusted(arrow.width() + 0.02 * box.width(), 0, 0, 0)
        font = self.digit_font(text)
        if self.old:
            self._outlined(painter, text, font, colour)
        else:
            painter.setFont(font)
            painter.setPen(colour)
            painter.drawText(text, Qt.AlignmentFlag.AlignCenter, self.digits())
        error = self.state.error
        if self.old or (self.state.running and self.state.stage != "adjust"):
            side = 0.45 * arrow.width()
            wheel = QRectF(0, 0, side, side)
            wheel.moveCenter(arrow.center())
            draw_wheel(painter, wheel, self._angle_deg, QColor(self.colours.text))
        elif error is not None and (self.state.stop or self.state.stage == "done"):
            draw_done(painter, arrow, colour)
        elif error is not None:
            draw_arrow(painter, arrow, self.knob, _of(error, self.knob) > 0, colour)

    def _outlined(self, painter: QPainter, box: QRectF, font: QFont, colour: QColor) -> None:
        """Hollow digits: not of just now, in any colour."""
        path = QPainterPath()
        path.addText(0.0, 0.0, font, self.digits())
        path.translate(box.center() - path.boundingRect().center())
        painter.setPen(QPen(colour, max(2.0, 0.012 * self.height())))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawPath(path)

    def digit_font(self, box: QRectF) -> QFont:
        """Capitals and digits as high as a third of the screen, less when that is too wide."""
        font = QFont(self.font())
        font.setBold(True)
        font.setPixelSize(100)
        metrics = QFontMetricsF(font)
        cap = metrics.capHeight() or 70.0
        size = 100.0 * DIGITS_SHARE * self.height() / cap
        wide = metrics.horizontalAdvance(self.digits()) * size / 100.0
        font.setPixelSize(max(8, int(size * min(1.0, box.width() / max(wide, 1.0)))))
        return font

    def _words(self, painter: QPainter, box: QRectF) -> None:
        """The arrow in words, what the tutor says, and when the number is old."""
        way = box.adjusted(0, 0, 0, -0.66 * box.height())
        told = self.way()
        if self.old:
            told = f"OLD: {self.state.detail}" if self.state.detail else "OLD: wait for a new frame"
        self._text(painter, way, told, Qt.AlignmentFlag.AlignCenter, 0.72, bold=True)
        rest = box.adjusted(0, 0.36 * box.height(), 0, 0)
        self._wrapped(painter, rest, primes(self.state.words) or "Begin an alignment first.")

    def _foot(self, painter: QPainter, box: QRectF) -> None:
        keys = KEYS if not self.sounding else f"{KEYS}    ({self.sounding})"
        font = QFont(self.font())
        font.setPixelSize(max(9, int(0.52 * box.height())))
        painter.setFont(font)
        painter.setPen(QColor(self.colours.muted))
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, keys)

    def _text(
        self, painter: QPainter, box: QRectF, text: str, side: Qt.AlignmentFlag,
        share: float, bold: bool = False,
    ) -> None:  # fmt: skip
        """A line ``share`` of the box high, or as high as its width allows."""
        font = QFont(self.font())
        font.setBold(bold)
        font.setPixelSize(max(8, int(share * box.height())))
        wide = QFontMetricsF(font).horizontalAdvance(text)
        if wide > box.width():
            font.setPixelSize(max(8, int(font.pixelSize() * box.width() / wide)))
        painter.setFont(font)
        painter.setPen(QColor(self.colours.text))
        painter.drawText(box, side | Qt.AlignmentFlag.AlignVCenter, text)

    def _wrapped(self, painter: QPainter, box: QRectF, text: str) -> None:
        """Words over several lines, as large as they fit."""
        wrap = int(Qt.TextFlag.TextWordWrap) | int(Qt.AlignmentFlag.AlignCenter)
        font = QFont(self.font())
        size = max(8, int(0.36 * box.height()))
        while size > 8:
            font.setPixelSize(size)
            needed = QFontMetricsF(font).boundingRect(box, wrap, text)
            if needed.height() <= box.height() and needed.width() <= box.width() + 1:
                break
            size -= max(1, size // 12)
        painter.setFont(font)
        painter.setPen(QColor(self.colours.text))
        painter.drawText(box, wrap, text)

    def _turn_wheel(self) -> None:
        self._angle_deg = (self._angle_deg + STEP_DEG) % 360
        self.update()


def _of(error: PolarError, knob: Knob) -> float:
    return error.altitude_arcsec if knob is Knob.ALTITUDE else error.azimuth_arcsec
