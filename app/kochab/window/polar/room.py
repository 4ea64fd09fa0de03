"""The Polar room: the live frame or the pole's sky; over it one number, a card for each knob, a message, buttons."""

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, QRect, QSize, Qt, Signal
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QFrame, QLabel, QSizePolicy, QWidget

from kochab.polar.error import Knob, PolarError, angle_in_words, cure
from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import dropped_files
from kochab.window.polar.bolts_painting import Spinner
from kochab.window.polar.buttons import AlignmentButtons
from kochab.window.polar.first_steps import LOW_PX, FirstSteps
from kochab.window.polar.live_frame import LiveFrame
from kochab.window.polar.messages import Message
from kochab.window.polar.pole_chart import PoleChart
from kochab.window.services import Services
from kochab.window.widgets import (
    Page,
    column,
    label,
    row,
    see_through,
    set_property,
    set_role,
    show_text,
    styled_frame,
    value_label,
)
from kochab.workflows.session.alignment_state import AlignmentState

NONE = "–"
KNOBS = {Knob.ALTITUDE: tr_noop("Altitude"), Knob.AZIMUTH: tr_noop("Azimuth")}
TITLES = {
    (Knob.ALTITUDE, "now"): tr_noop("Altitude, now"),
    (Knob.ALTITUDE, "next"): tr_noop("Altitude, next"),
    (Knob.ALTITUDE, "done"): tr_noop("Altitude, done"),
    (Knob.AZIMUTH, "now"): tr_noop("Azimuth, now"),
    (Knob.AZIMUTH, "next"): tr_noop("Azimuth, next"),
    (Knob.AZIMUTH, "done"): tr_noop("Azimuth, done"),
}
MARGIN_PX, OVER_PX, GAP_PX = 16, 600, 10  # around what lies over the frame, its width at most, and between its parts
BAR_MARGINS_PX = 8, 6, 8, 6  # around the buttons, within an edge of one pixel
LEAST_PX = 320, 240  # the width of the cards, and the height of the room, in a small window
LOW_ROOM_PX, LOW_MARGIN_PX, LOW_GAP_PX = 390, 8, 6  # a room lower than this has a smaller number, and less around it
NUMBER_MARGINS_PX, LOW_NUMBER_MARGINS_PX = (18, 6, 18, 10), (14, 4, 14, 5)
KNOB_MARGINS_PX, LOW_KNOB_MARGINS_PX = (14, 8, 14, 10), (12, 4, 12, 5)
DONE_SHARE = 0.5  # of the goal, within which a knob that nobody is asked to turn is done


class NumberCard(QFrame):
    """How far the axis is from its pole, 96 px high, its ± and its age: always here, grey when it is old."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("card")
        self.total, self.sigma = value_label(tr("Total error")), label("", "aside")
        self.total.setWordWrap(False)
        self.total.setProperty("role", "number")
        self.age = label("", "muted")
        self.spinner = Spinner()
        number = row(self.total, (self.sigma, 1), spacing=14)
        number.setAlignment(self.sigma, Qt.AlignmentFlag.AlignBottom)
        age = row(self.age, self.spinner, None, spacing=6)
        self._parts = column(number, age, spacing=0)
        self._column = column(self._parts, on=self, spacing=0, margins=NUMBER_MARGINS_PX)

    def shrink(self, on: bool) -> None:
        """Take less of a low room."""
        self._column.setContentsMargins(*(LOW_NUMBER_MARGINS_PX if on else NUMBER_MARGINS_PX))
        way = QBoxLayout.Direction
        self._parts.setDirection(way.LeftToRight if on else way.TopToBottom)  # the age beside the number
        self._parts.setSpacing(14 if on else 0)
        for each in (self, self.total, self.sigma):
            set_property(each, "low", on)

    def show_state(self, state: AlignmentState, now_s: float) -> None:
        """Show a state."""
        error = state.known_error
        self.total.setText(NONE if error is None else angle_in_words(error.total_arcsec))
        for number in (self.total, self.sigma):
            number.setVisible(state.error is not None)
        sigma = "" if error is None else angle_in_words(error.with_systematics.sigma_total_arcsec)
        self.sigma.setText(f"± {sigma}" if sigma else "")
        past = error is not None and not state.running
        set_role(self.total, "number_old" if error is None or past or state.old(now_s) else "number")
        self.spinner.wheel.turn(state.waits(now_s))
        self.age.setText(age_text(state, now_s))


def age_text(state: AlignmentState, now_s: float) -> str:
    """The number's age, or why there is no number."""
    if state.error is not None and state.known_error is None:
        return tr("Total error: {words}", words=state.total_words)
    return state.age_words(now_s) or tr("Not measured yet.")


class KnobCard(QFrame):
    """One knob: turned now, next or done; how far it is off and what to do."""

    def __init__(self, knob: Knob) -> None:
        super().__init__()
        self.setObjectName("knob")
        self._knob = knob
        self.title = label(tr(KNOBS[knob]), "muted")
        self.value = value_label(tr(KNOBS[knob]))
        self.value.setProperty("role", "title")
        self.value.setWordWrap(False)
        self.way = label("", "", wrap=True)
        self.way.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.standing = ""
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._column = column(self.title, self.value, (self.way, 1), on=self, spacing=2, margins=KNOB_MARGINS_PX)

    def shrink(self, on: bool) -> None:
        """Take less of a low room."""
        self._column.setContentsMargins(*(LOW_KNOB_MARGINS_PX if on else KNOB_MARGINS_PX))

    def show_state(self, state: AlignmentState, goal_arcsec: float) -> None:
        """Show a state."""
        error, knob = state.error, self._knob
        standing = standing_of(state, knob, goal_arcsec)
        self.title.setText(tr(TITLES[knob, standing]) if standing else tr(KNOBS[knob]))
        if standing != self.standing:
            self.standing = standing
            set_property(self, "standing", standing or None)
            for text, role in ((self.value, "title"), (self.way, "")):
                set_role(text, role if standing == "now" or not standing else "muted_title" if role else "muted")
        self.value.setText(self._value(state, error, standing))
        self.way.setText(self._words(state, error, standing))
        self.setAccessibleDescription(f"{self.title.text()}: {self.value.text()} {self.way.text()}")

    def _value(self, state: AlignmentState, error: PolarError | None, standing: str) -> str:
        if error is None:
            return NONE
        if state.drift is not None and not state.tells(self._knob):
            return state.drift.unknown(self._knob)
        size = angle_in_words(error.knob_arcsec(self._knob))
        if standing == "done":
            return f"✓ {size}"
        # As the plot has it: a bolt may have to go anticlockwise for the axis to go clockwise.
        return f"{cure(error, self._knob).sign} {size}" if state.bolt_error is not None else size

    def _words(self, state: AlignmentState, error: PolarError | None, standing: str) -> str:
        if error is None or standing == "done" or not state.tells(self._knob):
            return ""
        if standing == "now" and state.instruction is not None:
            return state.instruction.with_amounts(error).removeprefix(state.instruction.note).strip()
        # A measurement that is not to be trusted gives no way to turn.
        return cure(error, self._knob).way if state.checked and not state.spoilt else ""


def standing_of(state: AlignmentState, knob: Knob, goal_arcsec: float) -> str:
    """Whether a knob is turned "now", "next", is "done", or "" while none is."""
    error = state.bolt_error
    if error is None:
        return ""
    if not state.running and error.total_arcsec <= goal_arcsec:
        return "done"
    off = error.altitude_arcsec if knob is Knob.ALTITUDE else error.azimuth_on_sky_arcsec
    good = abs(off) <= DONE_SHARE * goal_arcsec
    if state.stage != "adjust" or state.instruction is None:
        return "done" if state.running and state.trail and good else ""  # it is measured again
    if state.instruction.knob is knob:
        return "now"
    return "done" if state.stop or good else "next"


class MessageStrip(QFrame):
    """One sentence."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("strip")
        self.text = label("", "muted", wrap=True)
        self.text.setAccessibleDescription(tr("Message"))
        column(self.text, on=self, margins=(14, 9, 14, 10))

    def show_message(self, message: Message) -> None:
        """Show it, or nothing."""
        self.setVisible(bool(message.text))
        show_text(self.text, message.text, message.role)
        loud = message.role if message.role in ("wrong", "old") else None
        if self.property("loud") != loud:
            set_property(self, "loud", loud)


class PolarRoom(Page):
    """Fills the middle of the window; ``buttons`` lie at its lower edge, ``set_up`` shows what can be chosen."""

    files_dropped = Signal(object)  # list[Path]

    def __init__(self, services: Services, buttons: AlignmentButtons, set_up: Callable[[], None]) -> None:
        super().__init__()
        self.frame = LiveFrame(services)
        self.number = NumberCard()
        self.knobs = {knob: KnobCard(knob) for knob in Knob}
        self.strip = MessageStrip()
        self.over = QWidget()
        self.cards = see_through(self.over)  # they scroll where a room is too low for them
        self.cards.setParent(self)
        self._low = False
        self._knob_row = row(*((card, 1) for card in self.knobs.values()), spacing=GAP_PX)
        parts = (self.number, self._knob_row, self.strip, None)
        self._column = column(*parts, on=self.over, spacing=GAP_PX, margins=(0, 0, 0, 0))
        self.bar = styled_frame("card")
        self.bar.setParent(self)
        flow, self._buttons = buttons.flow(), buttons
        flow.setContentsMargins(*BAR_MARGINS_PX)
        self.bar.setLayout(flow)
        self.first, self._is_first = FirstSteps(set_up), True
        self.first.setParent(self)
        column((self.frame, 1), on=self, spacing=0, margins=(0, 0, 0, 0))
        self.sky = PoleChart(services)
        self.sky.setParent(self)
        self.frame.pictured.connect(self._place)
        for over in (self.first, self.cards, self.bar):
            over.raise_()
        for watched in (self.first, self.over, self.bar):
            watched.installEventFilter(self)
        self.sky.stackUnder(self.first)

    @property
    def message(self) -> QLabel:
        """The label of the one message."""
        return self.strip.text

    def show_state(self, state: AlignmentState, now_s: float, goal_arcsec: float) -> None:
        """Show a state; its message is chosen by whoever knows what the person did last."""
        self.number.show_state(state, now_s)
        for card in self.knobs.values():
            card.setVisible(state.error is not None)
            card.show_state(state, goal_arcsec)
        self.frame.show_state(state)
        self.first.set_up.setEnabled(not state.running)
        self._is_first = state.error is None
        self._place()

    def minimumSizeHint(self) -> QSize:
        """Wide enough for the cards, and high enough for the number and the buttons."""
        return QSize(LEAST_PX[0] + 2 * MARGIN_PX, LEAST_PX[1])

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if dropped_files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        if paths := dropped_files(event):
            event.acceptProposedAction()
            self.files_dropped.emit(paths)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._place()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.LayoutRequest, QEvent.Type.ShowToParent):
            self._place()
        return super().eventFilter(watched, event)

    def _place(self) -> None:
        """The cards at the upper left, the buttons at the lower left."""
        if (low := self.height() < LOW_ROOM_PX) is not self._low:
            self._low = low
            cards: tuple[NumberCard | KnobCard, ...] = (self.number, *self.knobs.values())
            for card in cards:
                card.shrink(low)
            for layout in (self._column, self._knob_row):
                layout.setSpacing(LOW_GAP_PX if low else GAP_PX)
        margin = LOW_MARGIN_PX if low else MARGIN_PX
        inside = self.rect().adjusted(margin, margin, -margin, -margin)
        self._buttons.fit(inside.width() - BAR_MARGINS_PX[0] - BAR_MARGINS_PX[2] - 2)
        long = min(self.bar.sizeHint().width(), inside.width())
        bar = QRect(inside.topLeft(), QSize(long, self.bar.heightForWidth(long)))
        bar.moveBottomLeft(inside.bottomLeft())
        self.bar.setGeometry(bar)
        wide = min(OVER_PX, inside.width())
        high = min(self._column.heightForWidth(wide), bar.top() - GAP_PX - inside.top())
        self.cards.setGeometry(QRect(inside.topLeft(), QSize(wide, high)))
        self._place_first(inside)

    def _place_first(self, inside: QRect) -> None:
        """Before the first frame the sky around the pole, and an alignment's way below the cards or beside them."""
        over = self.cards.geometry()
        below = QRect(inside.left(), over.top() + self._column.minimumHeightForWidth(over.width()), over.width(), 0)
        below.translate(0, GAP_PX)
        below.setBottom(self.bar.y() - GAP_PX)
        self.first.drawing.setVisible(below.height() >= LOW_PX)
        fits = self.first.place(below) or self.first.place(inside.adjusted(over.width() + GAP_PX, 0, 0, 0))
        bare = self.frame.picture is None
        self.first.setVisible(fits and self._is_first and bare)
        self.sky.setVisible(bare)
        cards = QRect(over.topLeft(), QSize(over.width(), below.top() - GAP_PX - over.top()))
        if not self.first.isHidden():
            cards |= self.first.geometry()
        self.sky.place(self.rect(), cards, self.bar.geometry())
