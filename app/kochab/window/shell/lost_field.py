"""Letters that are typed on after their field was taken away switch nothing.

A field that is hidden or greyed while somebody types passes the focus on, and the next letters would be the keys of
switches: colour, stretch, layers.
"""

from collections.abc import Callable

import shiboken6
from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QComboBox, QLineEdit, QPlainTextEdit, QTextEdit, QWidget

from kochab.text.translation import tr

FIELDS = (QLineEdit, QAbstractSpinBox, QPlainTextEdit, QTextEdit)
LOST_MS = 3000  # after the last letter; then a letter is meant as a key again


def typed_in(widget: QWidget | None) -> bool:
    """Whether letters go into it."""
    return isinstance(widget, FIELDS) or (isinstance(widget, QComboBox) and widget.isEditable())


class LostField(QObject):
    """Watches who gets the focus that a field had; ``say`` tells that its letters went nowhere."""

    def __init__(self, window: QWidget, say: Callable[[str], object]) -> None:
        super().__init__(window)
        self._say = say
        self._field: QWidget | None = None  # the one that may have been taken away
        self._next: QWidget | None = None  # where the focus went
        self._over = QTimer(self, interval=LOST_MS, singleShot=True)
        self._over.timeout.connect(self._release)
        app = QApplication.instance()
        assert isinstance(app, QApplication)
        app.focusChanged.connect(self._moved)

    def _moved(self, before: QWidget | None, after: QWidget | None) -> None:
        self._release()
        if before is not None and typed_in(before) and not typed_in(after):
            self._field, self._next = before, after or before.window()  # which has the keys when nothing has the focus
            self._next.installEventFilter(self)
            self._over.start()

    def _release(self) -> None:
        if self._next is not None and shiboken6.isValid(self._next):
            self._next.removeEventFilter(self)
        self._field = self._next = None

    @property
    def _lost(self) -> bool:
        """Whether the field cannot be typed in any more, so that nobody left it."""
        field = self._field
        gone = field is not None and not shiboken6.isValid(field)
        return gone or (field is not None and not (field.isVisible() and field.isEnabled()))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if isinstance(event, QKeyEvent) and event.type() in (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress):
            if event.text().isprintable() and event.text() and self._lost:
                self._over.start()
                self._say(tr("The field you were typing in is gone. Letters switch nothing for a moment."))
                event.accept()
                return True
            self._release()  # Tab, Enter, an arrow: somebody goes on by the keyboard
        elif event.type() == QEvent.Type.MouseButtonPress:
            self._release()
        return False
