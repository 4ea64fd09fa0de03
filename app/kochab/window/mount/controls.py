"""Goto, centre and nudge, and buttons that explain why they cannot be used now."""

from collections.abc import Callable, Mapping
from functools import partial

from PySide6.QtCore import QEvent, QObject, QSize, QStringListModel, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QStandardItemModel
from PySide6.QtWidgets import QComboBox, QCompleter, QGridLayout, QPushButton, QWidget

from kochab.core.mount import SIDEREAL_DEG_S, Direction, MountState, TrackingRate
from kochab.text.translation import number, tr, tr_noop
from kochab.window.flow import Flow
from kochab.window.widgets import (
    ChoiceBox,
    choice_box,
    column,
    label,
    named,
    number_field,
    row,
    set_property,
    text_field,
)


class Explanation(QObject):
    """Greys a control with a reason, which is shown when the control is pressed or gets the focus.

    The control is not disabled: it must keep the focus for the keyboard to reach its reason.
    """

    shown = Signal(str)

    def __init__(self, control: QWidget, tip: str) -> None:
        super().__init__(control)
        self.reason = ""
        self._control, self._tip = control, tip
        control.installEventFilter(self)
        self._dress()

    def set_reason(self, reason: str) -> None:
        """Grey the control; an empty reason frees it."""
        if reason != self.reason:
            self.reason = reason
            self._dress()
            if self._control.hasFocus():
                self.shown.emit(reason)

    def allows(self) -> bool:
        """Whether the control can be used now; if not, its reason is shown."""
        if self.reason:
            self.shown.emit(self.reason)
        return not self.reason

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.FocusIn:
            self.shown.emit(self.reason)
        elif event.type() == QEvent.Type.FocusOut:
            self.shown.emit("")
        return False

    def _dress(self) -> None:
        control, off = self._control, bool(self.reason)
        control.setToolTip(self.reason or self._tip)
        control.setAccessibleDescription(tr("Not available. {reason}", reason=self.reason) if off else self._tip)
        if bool(control.property("off")) != off:
            set_property(control, "off", off)


class ExplainedButton(QPushButton):
    """A button that explains why it cannot be used now."""

    def __init__(self, text: str, pressed: Callable[[], object], tip: str, role: str = "") -> None:
        super().__init__(text, autoDefault=False)
        self.explanation = Explanation(self, tip)
        self._pressed = pressed
        if role:
            self.setProperty("role", role)
        self.clicked.connect(self._click)

    def _click(self) -> None:
        if self.explanation.allows():
            self._pressed()


RATES = {
    TrackingRate.OFF: tr_noop("Tracking off"),
    TrackingRate.SIDEREAL: tr_noop("Track the stars"),
    TrackingRate.LUNAR: tr_noop("Track the Moon"),
    TrackingRate.SOLAR: tr_noop("Track the Sun"),
    TrackingRate.KING: tr_noop("King rate"),
}


class TrackingChoice(ChoiceBox):
    """Shows what the mount tracks; a choice only asks for another."""

    wanted = Signal(TrackingRate)

    def __init__(self) -> None:
        super().__init__()
        named(self, tr("Tracking rate"))
        for rate, text in RATES.items():
            self.addItem(tr(text), rate)
        self.explanation = Explanation(self, tr("What the mount follows; King’s rate is sidereal with refraction"))
        self._shown: TrackingRate | None = None
        self.activated.connect(self._choose)

    def minimumSizeHint(self) -> QSize:
        """No wider than a rate: Qt counts the placeholder too, which is long in other languages."""
        hint = super().minimumSizeHint()
        return QSize(min(hint.width(), 18 * self.fontMetrics().averageCharWidth()), hint.height())

    def show_state(self, state: MountState, reasons: Mapping[str, str]) -> None:
        """Show the tracking rate; ``reasons`` say, by action, why a rate cannot be chosen."""
        self._shown = state.rate if state.tracking else None if state.tracking is None else TrackingRate.OFF
        against = [reasons[f"track {rate}"] for rate in RATES]
        items = self.model()
        # The box's own model, whose items can be greyed one by one.
        assert isinstance(items, QStandardItemModel)
        for i, reason in enumerate(against):
            item = items.item(i)
            item.setEnabled(not reason)
            item.setToolTip(reason)
        # Where no rate can be chosen, the reason against the sidereal one stands for all.
        self.explanation.set_reason("" if "" in against else against[1])
        # Seen at index -1: it tracks at an unknown rate, or does not report whether it tracks; in few letters.
        self.setPlaceholderText(tr("Tracking") if state.tracking else tr("Tracking: ?"))
        self._show_rate()

    def _show_rate(self) -> None:
        self.setCurrentIndex(-1 if self._shown is None else self.findData(self._shown))

    def _choose(self, index: int) -> None:
        rate = TrackingRate(self.itemData(index))
        self._show_rate()
        if self.explanation.allows():
            self.wanted.emit(rate)


STEPS_ARCSEC = {"10″": 10.0, "30″": 30.0, "1′": 60.0, "5′": 300.0, "20′": 1200.0, "1°": 3600.0, "5°": 18000.0}
FIRST = "5′"
RATE_TIP = tr_noop(
    "How fast. Auto uses moves the mount stops on its own; at a fixed rate most mounts keep moving if this computer"
    " fails."
)
HINT = tr_noop("Arrow keys nudge after a click here: up is north, left is east.")
WAYS = {
    Direction.NORTH: (tr_noop("N ↑"), tr_noop("Nudge north"), 0, 1, Qt.Key.Key_Up),
    Direction.EAST: (tr_noop("← E"), tr_noop("Nudge east"), 1, 0, Qt.Key.Key_Left),
    Direction.WEST: (tr_noop("W →"), tr_noop("Nudge west"), 1, 2, Qt.Key.Key_Right),
    Direction.SOUTH: (tr_noop("S ↓"), tr_noop("Nudge south"), 2, 1, Qt.Key.Key_Down),
}


class NudgePad(QWidget):
    """Nudges by arcsec at deg/s or 0; presses while the mount moves are ignored."""

    def __init__(self, nudge: Callable[[Direction, float, float], None]) -> None:
        super().__init__()
        self._nudge = nudge
        self.step = choice_box(tr("Step of a nudge"), STEPS_ARCSEC, 0)
        self.step.setToolTip(tr("How far one press moves the mount"))
        self.step.setCurrentText(FIRST)
        self.rate = choice_box(tr("Rate of a nudge"), (), 0)
        self.rate.setToolTip(tr(RATE_TIP))
        self.rate.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.show_rates(())
        self.buttons: dict[Direction, ExplainedButton] = {}
        grid = QGridLayout()
        grid.setSpacing(4)
        for way, (text, tip, at_row, at_column, _) in WAYS.items():
            made = ExplainedButton(tr(text), partial(self._press, way), tr(tip))
            # A screen reader cannot read "N ↑".
            made.setAccessibleName(tr(tip))
            made.installEventFilter(self)
            grid.addWidget(made, at_row, at_column)
            self.buttons[way] = made
        grid.addWidget(self.step, 1, 1)
        self.hint = label(tr(HINT), "muted", wrap=True)
        title = row(label(tr("Nudge"), "heading"), None, self.rate)
        column(title, row(None, grid, None), self.hint, on=self, spacing=8, margins=(0, 0, 0, 0))

    def show_rates(self, rates_deg_s: tuple[float, ...]) -> None:
        """Offer the mount's rates."""
        if [self.rate.itemData(i) for i in range(1, self.rate.count())] == list(rates_deg_s):
            return
        # Only for other rates: this is called twice a second, and filling anew drops the person's choice.
        self.rate.clear()
        self.rate.addItem(tr("Auto rate"), 0.0)
        for rate in rates_deg_s:
            self.rate.addItem(rate_text(rate), rate)

    def allow(self, reason: str, dec_reason: str) -> None:
        """Grey the buttons of the RA axis and those of the declination axis with their reasons."""
        for way, made in self.buttons.items():
            made.explanation.set_reason(dec_reason if way.in_dec else reason)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            for way, (*_, key) in WAYS.items():
                if event.key() == key:
                    self.buttons[way].setFocus()
                    # A key that is held asks for one nudge.
                    if not event.isAutoRepeat():
                        self.buttons[way].click()
                    return True
        return super().eventFilter(watched, event)

    def _press(self, way: Direction) -> None:
        self._nudge(way, float(self.step.currentData()), float(self.rate.currentData() or 0.0))


def rate_text(rate_deg_s: float) -> str:
    """In degrees per second when fast, else in multiples of sidereal."""
    times = rate_deg_s / SIDEREAL_DEG_S
    return tr("{rate:.2g}°/s", rate=rate_deg_s) if times > 100.0 else tr("{times:.3g} × sidereal", times=times)


WAIT_MS = 350  # after the last letter of a target
FIELD_PX = 150  # of a target, at least
TOLERANCE_ARCSEC = (2.0, 3600.0)
GOTO_TIP = tr_noop("Slew there by the mount’s own pointing")
CENTRE_TIP = tr_noop("Slew there, plate solve, and correct until the target is centred")


class GoBox(QWidget):
    """The target, Centre and Go to; ``beside`` are more commands after them. Below, what is known of the target.

    ``tolerance`` is placed elsewhere.
    """

    typed = Signal(str)  # a target, a moment after the last letter

    def __init__(self, goto: Callable[[str], None], centre: Callable[[str, float], None]) -> None:
        super().__init__()
        self.target = text_field(
            tr("Target"), tr("{names}, or {place} (J2000)", names="M 42, Vega, HIP 32349", place="5h35m17s -5d23m")
        )
        self.target.setClearButtonEnabled(True)
        self._names = QStringListModel(self)
        self.completer = QCompleter(self._names, self, caseSensitivity=Qt.CaseSensitivity.CaseInsensitive)
        self.target.setCompleter(self.completer)
        self.goto = ExplainedButton(tr("Go to"), lambda: goto(self.target.text()), tr(GOTO_TIP))
        self.centre = ExplainedButton(
            "", lambda: centre(self.target.text(), self.tolerance.value()), tr(CENTRE_TIP), "main"
        )
        self.tolerance = number_field(tr("Centring tolerance, arcseconds"), *TOLERANCE_ARCSEC, 60.0, 0, "″")
        self.tolerance.valueChanged.connect(self._name_centre)
        self._name_centre()
        self.about = label("", "muted", wrap=True)
        self.target.returnPressed.connect(self._enter)
        self._wait = QTimer(self, singleShot=True, interval=WAIT_MS)
        self._wait.timeout.connect(lambda: self.typed.emit(self.target.text().strip()))
        self.target.textChanged.connect(lambda _: self._wait.start())

    def lay_out(self, *more: QWidget) -> None:
        """With more commands beside these."""
        self.target.setMinimumWidth(FIELD_PX)
        above = Flow(self.target, self.centre, self.goto, *more, fill=self.target, spacing=6)
        column(above, self.about, on=self, spacing=4, margins=(0, 0, 0, 0))

    def _name_centre(self) -> None:
        self.centre.setText(tr("Centre ({arcsec}″)", arcsec=number(self.tolerance.value(), "g")))

    def _enter(self) -> None:
        # Qt tells of Enter on a suggestion, too; that one only takes the name.
        popup = self.completer.popup()
        if popup is None or popup.isHidden() or not popup.currentIndex().isValid():
            self.goto.click()

    def offer_names(self, names: list[str]) -> None:
        """Names the field completes."""
        self._names.setStringList(names)
