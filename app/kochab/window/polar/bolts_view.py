"""The full-screen view at the mount: which bolt, which way and how far, readable from three metres.

Arrows mean the same from every side of the mount: up and down in altitude, the sense of rotation
seen from above in azimuth. Shapes and words carry everything that colours do.
"""

from PySide6.QtCore import QRectF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from kochab.polar.error import Knob, angle_in_words, cure, total_in_words
from kochab.text.translation import tr, tr_noop
from kochab.window.polar.bolts_painting import Face, Wheel, paint_face
from kochab.window.themes import theme_colours
from kochab.workflows.session.alignment_state import AlignmentState

KEYS = tr_noop("Space: done    Tab: other axis    M: measure again    S: sounds    Esc: close")
TURNING = tr_noop("Esc: STOP the mount and close    Tab: other axis    S: sounds    F7: close")
MOTORS = tr_noop(
    "Esc: STOP the motors and end the alignment    Space: done    Tab: other axis    M: measure again    S: sounds"
    "    F7: close"
)


class BoltsView(QWidget):
    """A full-screen window that shows an :class:`AlignmentState`; keys become signals."""

    done = Signal()
    remeasure = Signal()
    sounds = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle(tr("At the bolts"))
        self.setAccessibleName(tr("At the bolts"))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        # paint_face fills the whole window.
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.state = AlignmentState()
        self.old = self.motors = False  # motors: they turn the bolts, and Esc stops them
        self.sounding = ""
        self._chosen: Knob | None = None
        self._wheel = Wheel(self)

    def show_state(self, state: AlignmentState, now_s: float) -> None:
        """Show a state; a new instruction chooses its own axis."""
        if state.instruction is not self.state.instruction:
            self._chosen = None
        self.state, self.old = state, state.old(now_s)
        self._wheel.turn(state.waits(now_s))
        self.setAccessibleDescription(f"{self.digits()} {self.way()}. {state.words}")
        self.update()

    @property
    def _over(self) -> bool:
        return self.state.stop or self.state.stage == "done"

    @property
    def knob(self) -> Knob:
        """The axis that is shown."""
        # A person's choice, else the instruction's; before there is one, altitude.
        return self._chosen or self.state.knob or Knob.ALTITUDE

    def digits(self) -> str:
        """The huge digits: the error of this axis, in the end the total."""
        error = self.state.known_error
        if error is None:
            return "–"
        return angle_in_words(error.total_arcsec if self._over else error.knob_arcsec(self.knob))

    def way(self) -> str:
        """The arrow in words."""
        error = self.state.bolt_error
        if error is None or self._over:
            return ""
        return cure(error, self.knob).way

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
        """Show the other axis until the next instruction."""
        self._chosen = Knob.AZIMUTH if self.knob is Knob.ALTITUDE else Knob.ALTITUDE
        self.update()

    @property
    def face(self) -> Face:
        """All that the view shows."""
        state, error = self.state, self.state.known_error
        title = tr("Polar alignment") if error is None else tr(self.knob.value.capitalize())
        old = tr("OLD: {what}", what=state.detail or tr("wait for a new frame"))
        keys = tr(TURNING if state.mount_turns else MOTORS if self.motors else KEYS)
        turning = state.bolt_error
        shape = "" if turning is None else "done" if self._over else cure(turning, self.knob).word
        return Face(
            tr("Total") if self._over else title,
            "" if error is None else tr("total {angle}", angle=total_in_words(error)),
            self.digits(),
            old if self.old else self.way(),
            state.words or tr("Start an alignment first."),
            f"{keys}    ({self.sounding})" if self.sounding else keys,
            "wheel" if self._wheel.isActive() else shape,
            self.old,
        )

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        paint_face(painter, QRectF(self.rect()), self.face, self.font(), theme_colours())
        painter.end()
