"""Escape stops the mount, wherever the focus is: in a field, a dialog, a menu, another dock."""

from collections.abc import Callable
from time import monotonic

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication

KEY = "Esc"
SAME_S = 0.1


class StopKey(QObject):
    """Hears the key before anybody else and lets it pass: what it does besides is still done."""

    def __init__(self, stop: Callable[[], None], parent: QObject) -> None:
        super().__init__(parent)
        self._stop = stop
        self._on = False
        self._last = -1, 0.0  # stamp, and when it came

    def listen(self, on: bool) -> None:
        """Only while a mount is connected is every event looked at."""
        app = QApplication.instance()
        if on == self._on or app is None:
            return
        self._on = on
        if on:
            app.installEventFilter(self)
        else:
            app.removeEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress):
            assert isinstance(event, QKeyEvent)
            if event.key() == Qt.Key.Key_Escape and self._is_new(event.timestamp()):
                self._stop()
        return False

    def _is_new(self, stamp: int) -> bool:
        """One press comes to several objects; some systems stamp every press alike."""
        last, when = self._last
        self._last = stamp, monotonic()
        return stamp != last or self._last[1] - when > SAME_S
