"""Puts a style sheet on the window part by part.

Given to the application as a whole, a sheet holds up the event loop for a tenth of a second, and
for longer the more views are open. The parts are what lies directly in the window, and the pages
in its middle; dialogs are dressed when they come.
"""

from PySide6.QtCore import QObject, Qt, QTimer
from PySide6.QtWidgets import QWidget
from shiboken6 import isValid

from app.ui.main_window import MainWindow


class Wardrobe(QObject):
    """A part a turn of the event loop, those in sight first; nothing is painted until those are."""

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self.sheet = ""
        self._window = window
        self._waiting: list[QWidget] = []
        self._timer = QTimer(self)
        self._timer.timeout.connect(self._next)
        window.has_part.connect(self._meet)
        window.closing.connect(self._timer.stop)

    def wear(self, sheet: str) -> None:
        """Dress the whole window in ``sheet``."""
        self.sheet = sheet
        self._waiting = sorted(self.parts(), key=lambda part: not part.isVisible())
        if self._window.isVisible():
            self._window.setUpdatesEnabled(False)
            self._timer.start(0)
        else:
            self.finish()

    @property
    def done(self) -> bool:
        """Whether every part wears the sheet."""
        return not self._waiting

    def finish(self) -> None:
        """Dress what still waits."""
        while self._waiting:
            self._next()

    def parts(self) -> list[QWidget]:
        """What is dressed separately."""
        window, pages = self._window, self._window.pages
        direct = Qt.FindChildOption.FindDirectChildrenOnly
        inside = [page for i in range(pages.count()) if (page := pages.widget(i)) is not None]
        return inside + [w for w in window.findChildren(QWidget, options=direct) if w is not pages]

    def _next(self) -> None:
        part = self._waiting.pop(0) if self._waiting else None
        if part is not None and isValid(part):
            part.ensurePolished()  # else a toolbar that was never seen keeps its old margins
            part.setStyleSheet(self.sheet)
        self._waiting = [p for p in self._waiting if isValid(p)]  # a dialog may have been closed
        if not self._waiting:
            self._timer.stop()
        if not (self._waiting and self._waiting[0].isVisible()):
            self._show()

    def _show(self) -> None:
        """Let the window be painted again."""
        if self._window.updatesEnabled():
            return
        self._window.setUpdatesEnabled(True)
        screen = self._window.windowHandle()
        if screen is not None:  # Qt forgot what was asked of it meanwhile, and waits for ever
            screen.requestUpdate()

    def _meet(self, part: QWidget) -> None:
        """A dialog, or the tabs of docks that share a place: made after the sheet was put on."""
        if part is not self._window.pages and part.styleSheet() != self.sheet:
            part.setStyleSheet(self.sheet)
