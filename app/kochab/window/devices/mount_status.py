"""The state of the mount and Stop in the bar above every view; Escape stops from anywhere."""

from collections.abc import Callable
from functools import partial
from time import monotonic

from PySide6.QtCore import QEvent, QObject, Qt, SignalInstance
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QMainWindow, QWidget

from kochab.core.mount import MountState
from kochab.gear.actions import action
from kochab.gear.mount_events import MountSnapshot
from kochab.text.angle_text import angle_text
from kochab.text.translation import number, tr, tr_noop
from kochab.window.devices.mount_control import MountControl
from kochab.window.widgets import ElidedLabel, button, row, set_role

KEY = "Esc"
SAME_S = 0.1  # the events of one press come closer together
_LISTENING: set[int] = set()  # the mount's and the adjusters' keys


def _count(key: int, on: bool) -> None:
    """No key that is pressed in the system's own file dialog would come to a key that listens: then Qt's is shown."""
    (_LISTENING.add if on else _LISTENING.discard)(key)
    QApplication.setAttribute(Qt.ApplicationAttribute.AA_DontUseNativeDialogs, len(_LISTENING) > 0)


class StopKey(QObject):
    """Sees Escape wherever the focus is, before anything else, and lets it pass on."""

    def __init__(self, stop: Callable[[], None], parent: QObject) -> None:
        super().__init__(parent)
        self._stop = stop
        self._last = -1, 0.0  # stamp, and when it came
        self.destroyed.connect(partial(_count, id(self), False))

    def listen(self, on: bool) -> None:
        """Watch every event of the program, also of file dialogs, only while a mount is connected."""
        if (app := QApplication.instance()) is not None:
            # Every event of the program passes through Python while the filter is installed.
            (app.installEventFilter if on else app.removeEventFilter)(self)
            _count(id(self), on)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress):
            assert isinstance(event, QKeyEvent)
            if event.key() == Qt.Key.Key_Escape and self._is_new(event.timestamp()):
                self._stop()
        return False

    def _is_new(self, stamp: int) -> bool:
        """One press reaches several objects; some systems stamp every press alike."""
        last, when = self._last
        self._last = stamp, monotonic()
        return stamp != last or self._last[1] - when > SAME_S


ROUND_DEG = 10.0  # from here on a way is told in whole degrees
LINES = {
    "off": tr_noop("No mount"),
    "connecting": tr_noop("Mount: connecting…"),
    "leaving": tr_noop("Mount: disconnecting…"),
    "lost": tr_noop("Mount: CONNECTION LOST"),
}
ALARM = tr_noop("THE MOUNT MAY STILL MOVE: CUT ITS POWER")


class MountStatus(QWidget):
    """The state of the mount in the bar above every view, Stop at its end, and the Stop key."""

    def __init__(self, control: MountControl, closing: SignalInstance) -> None:
        super().__init__()
        self._control = control
        self.text = ElidedLabel()
        self.text.setAccessibleDescription(tr("Mount"))
        tip = tr("Stop the mount now ({key} from anywhere)", key=KEY)
        self.stop = button(tr("STOP  {key}", key=KEY), control.stop, "alarm", tip)
        row(self.text, self.stop, on=self, spacing=8, margins=(4, 0, 0, 0))
        self._key = StopKey(self._pressed, self)
        closing.connect(lambda: self._key.listen(False))
        control.changed.connect(self._show)
        self._show()

    def _show(self) -> None:
        known = self._control.known
        # The line may close after the window: that must not listen anew.
        self._key.listen(known.phase != "off" and not self.window().isHidden())
        self.text.setText(mount_status_text(known))
        name = "" if known.connected is None else known.connected.name
        self.text.setToolTip(", ".join(w for w in (name, known.port, known.user) if name and w))
        role = "bad" if known.alarm else {"lost": "wrong", "off": "muted"}.get(known.phase, "")
        set_role(self.text, role)
        self.text.setMinimumWidth(self.text.sizeHint().width() if known.alarm else 1)  # an alarm is never cut
        self.stop.setVisible(known.phase != "off")

    def _pressed(self) -> None:
        if not (self._control.known.at_rest and _closes_something()):
            self._control.stop()


def mount_status_text(known: MountSnapshot) -> str:
    """The mount in a few words: what it does, else its state."""
    if known.alarm:
        return tr(ALARM)
    if known.phase in LINES:
        return tr(LINES[known.phase])
    name = tr("Practice mount") if known.practice else tr("Mount")
    if known.stopping:
        return tr("{mount}: stopping…", mount=name)
    if known.left_deg is not None:
        return way_text(known)
    if known.busy:
        # The bar has no room for what stands in brackets, as "(F4)".
        doing = tr(action(known.busy).doing).partition(" (")[0]
        return f"{name}: {doing or known.busy}"
    state = tr("connected") if known.report is None else words_of(known.report.state)[0]
    return f"{name}: {state}"


def way_text(known: MountSnapshot) -> str:
    """Where a slew goes, how far it still is, and how long that takes at the speed of now."""
    if known.left_deg is None:
        return ""
    left = f"{number(known.left_deg, '.0f')}°" if known.left_deg >= ROUND_DEG else angle_text(known.left_deg)
    if known.left_s is not None:
        seconds = max(1, round(known.left_s))
        left = tr("{angle} to go, {seconds} s", angle=left, seconds=seconds)
    else:
        left = tr("{angle} to go", angle=left)
    going = tr("Slewing to {target}", target=known.target) if known.target else tr("Slewing")
    return f"{going} · {left}"


def _closes_something() -> bool:
    """Whether Escape closes a menu, a list, a dialog or a full-screen view now.

    While the mount is at rest it does only that: closing a menu must not end an alignment.
    """
    window = QApplication.activeWindow()
    return (
        QApplication.activePopupWidget() is not None
        or QApplication.activeModalWidget() is not None
        or (window is not None and not isinstance(window, QMainWindow) and window.isFullScreen())
    )


def words_of(state: MountState) -> list[str]:
    """What the mount reports; what it does not report is left out."""
    words = []
    if state.parked:
        words.append(tr("parked"))
    elif state.slewing:
        words.append(tr("slewing"))
    elif state.tracking is None:
        # None is not reported, which is not the same as False.
        words.append(tr("idle") if state.slewing is False else tr("idle or slewing (not reported)"))
    else:
        words.append(tr("tracking") if state.tracking else tr("idle, not tracking"))
    if state.aligned is not None:
        words.append(tr("aligned") if state.aligned else tr("not aligned"))
    if state.home_confirmed is False:
        words.append(tr("home NOT CONFIRMED (the position is a guess)"))
    if state.pier_side is not None:
        east = state.pier_side == "east"
        words.append(tr("east of the pier") if east else tr("west of the pier"))
    if state.fault:
        words.append(tr("STOPPED: {fault}", fault=tr(state.fault)))
    return words
