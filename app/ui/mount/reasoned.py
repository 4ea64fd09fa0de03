"""Controls that are greyed with a reason: they keep the focus, so that the reason can be asked."""

from collections.abc import Callable

from PySide6.QtCore import Signal
from PySide6.QtGui import QFocusEvent
from PySide6.QtWidgets import QCheckBox, QPushButton, QWidget


def _dress(widget: QWidget, reason: str, tip: str) -> None:
    off = bool(reason)
    widget.setToolTip(reason or tip)
    widget.setAccessibleDescription(f"Not now. {reason}" if off else tip)
    if bool(widget.property("off")) != off:
        widget.setProperty("off", off)
        widget.style().unpolish(widget)
        widget.style().polish(widget)


class ReasonedButton(QPushButton):
    """Pressed while greyed it says why; so it does when it gets the focus."""

    explained = Signal(str)

    def __init__(self, text: str, pressed: Callable[[], object], tip: str, role: str = "") -> None:
        super().__init__(text)
        self.reason = ""
        self._tip = tip
        self._pressed = pressed
        self.setAutoDefault(False)
        if role:
            self.setProperty("role", role)
        self.clicked.connect(self._click)
        _dress(self, "", tip)

    def allow(self, reason: str) -> None:
        """Greyed with ``reason``; free when that is empty."""
        if reason != self.reason:
            self.reason = reason
            _dress(self, reason, self._tip)
            if self.hasFocus():
                self.explained.emit(reason)

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.explained.emit(self.reason)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.explained.emit("")

    def _click(self) -> None:
        if self.reason:
            if self.isCheckable():
                self.setChecked(False)
            self.explained.emit(self.reason)
        else:
            self._pressed()


class ReasonedSwitch(QCheckBox):
    """Shows what the mount says; a click only asks for the other."""

    explained = Signal(str)
    wanted = Signal(bool)

    def __init__(self, text: str, tip: str) -> None:
        super().__init__(text)
        self.reason = ""
        self._tip = tip
        _dress(self, "", tip)

    def allow(self, reason: str) -> None:
        """Greyed with ``reason``; free when that is empty."""
        if reason != self.reason:
            self.reason = reason
            _dress(self, reason, self._tip)
            if self.hasFocus():
                self.explained.emit(reason)

    def nextCheckState(self) -> None:
        if self.reason:
            self.explained.emit(self.reason)
        else:
            self.wanted.emit(not self.isChecked())

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.explained.emit(self.reason)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.explained.emit("")
