"""At the bolts: the whole screen says which way to turn and how far, readable from three metres.

One axis at a time. Arrows mean the same from every side of the mount: up and down for the axis,
and for the azimuth the sense of rotation seen from above. Shapes and words carry everything that
colours do.
"""

from PySide6.QtCore import QRectF, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from app.polar.bolts import Knob
from app.polar.error import PolarError
from app.ui.palette import THEMES, Colours
from app.ui.polar.bolts_painting import Face, paint_face
from app.ui.polar.numbers import total_text
from app.ui.polar.spinner import STEP_DEG, STEP_MS
from app.ui.polar.state import State
from app.ui.polar.target import primes, typeset

KEYS = "Space: done    Tab: other axis    M: measure again    S: sounds    Esc: back"
TURNING = "Esc: STOP the mount, and back    Tab: other axis    S: sounds    F7: back"


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
    @property
    def face(self) -> Face:
        """All that is to be seen."""
        state, error = self.state, self.state.error
        over = state.stop or state.stage == "done"
        title = "Polar alignment" if error is None else self.knob.value.capitalize()
        told = self.way()
        if self.old:
            told = f"OLD: {state.detail}" if state.detail else "OLD: wait for a new frame"
        total = ""
        if error is not None:
            total = f"total {total_text(error)}"
        return Face(
            "Total" if over else title, total, self.digits(), told,
            primes(state.words) or "Begin an alignment first.", self._keys(), self._shape(over),
            self.knob, error is not None and _of(error, self.knob) > 0, self.old,
        )  # fmt: skip

    def _shape(self, over: bool) -> str:
        if self.old or (self.state.running and self.state.stage != "adjust"):
            return "wheel"
        if self.state.error is None:
            return ""
        return "done" if over else "arrow"

    def _keys(self) -> str:
        keys = TURNING if self.state.mount_turns else KEYS
        return f"{keys}    ({self.sounding})" if self.sounding else keys

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        box = QRectF(self.rect())
        paint_face(painter, box, self.face, self.font(), self.colours, self._angle_deg)
        painter.end()

    def _turn_wheel(self) -> None:
        self._angle_deg = (self._angle_deg + STEP_DEG) % 360
        self.update()


def _of(error: PolarError, knob: Knob) -> float:
    return error.altitude_arcsec if knob is Knob.ALTITUDE else error.azimuth_arcsec
