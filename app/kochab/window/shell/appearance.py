"""How the window looks: theme and text size, put on one part after the other; both remembered."""

from PySide6.QtCore import QObject, QSignalBlocker, Qt, QTimer
from PySide6.QtGui import QActionGroup
from PySide6.QtWidgets import QApplication, QDockWidget, QLineEdit, QWidget
from shiboken6 import isValid

from kochab.window.dialogs import redden_caret
from kochab.window.frame.looks import FrameLooks
from kochab.window.settings import WindowSettings
from kochab.window.shell.actions import colour_icons
from kochab.window.shell.main_window import MainWindow
from kochab.window.themes import THEMES, apply_theme, theme_colours


class StyleSheets(QObject):
    """Puts a style sheet on the window one part a turn of the event loop, visible parts first.

    Given to the application as a whole, a sheet holds up the event loop for a tenth of a second,
    longer with more views open. Nothing is painted until the visible parts have it.
    """

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self.sheet = ""
        self._window = window
        self.waiting: list[QWidget] = []
        self._timer = QTimer(self)
        self._timer.timeout.connect(self._next)
        window.has_part.connect(self.meet)
        window.closing.connect(self._timer.stop)

    def apply(self, sheet: str) -> None:
        self.sheet = sheet
        self.waiting = sorted(self.parts(), key=lambda part: not part.isVisible())
        if self._window.isVisible():
            self._window.setUpdatesEnabled(False)
            self._timer.start(0)
        else:
            self.finish()

    def finish(self) -> None:
        """Apply the sheet to every part that waits."""
        while self.waiting:
            self._next()

    def parts(self) -> list[QWidget]:
        """What is styled separately: the window's direct children and the pages in its middle.

        A dock that holds no view yet is met when it is to be seen: five of them take 30 ms of a start.
        """
        window, pages = self._window, self._window.pages
        direct = Qt.FindChildOption.FindDirectChildrenOnly
        inside = [page for i in range(pages.count()) if (page := pages.widget(i)) is not None]
        empty = [pages, *(dock for dock in window.findChildren(QDockWidget, options=direct) if dock.widget() is None)]
        return inside + [w for w in window.findChildren(QWidget, options=direct) if w not in empty]

    def _next(self) -> None:
        if self.waiting and isValid(part := self.waiting.pop(0)):
            part.ensurePolished()  # else a toolbar that was never seen keeps its old margins
            self.meet(part)  # which a part of the window itself has been through by now, the first time
        self.waiting = [p for p in self.waiting if isValid(p)]  # a dialog may have been closed
        if not self.waiting:
            self._timer.stop()
        if not (self.waiting and self.waiting[0].isVisible()):
            self._show()

    def _show(self) -> None:
        if self._window.updatesEnabled():
            return
        self._window.setUpdatesEnabled(True)
        if (screen := self._window.windowHandle()) is not None:
            screen.requestUpdate()  # else Qt drops the updates asked for meanwhile, and waits for ever

    def meet(self, part: QWidget) -> None:
        """Style what the sheet did not reach: a dialog, a dock that was empty, tabs of docks that share a place."""
        if part is not self._window.pages and part.styleSheet() != self.sheet:
            part.setStyleSheet(self.sheet)


class Appearance(QObject):
    """Theme and text size, from the settings and the menus; ``looks`` are the open frame's, which follow the theme."""

    def __init__(self, window: MainWindow, settings: WindowSettings, looks: FrameLooks) -> None:
        super().__init__(window)
        self._window, self._settings, self._looks = window, settings, looks
        self._style = StyleSheets(window)
        self.use_theme()
        window.menus.themes.triggered.connect(lambda a: self.use_theme(a.data()))
        window.menus.text_sizes.triggered.connect(lambda a: self.use_theme(text_size=a.data()))

    def use_theme(self, name: str | None = None, text_size: str | None = None) -> None:
        """Switch theme or text size, and remember it; None keeps the present one."""
        name = name or self._settings.text("theme", "dark")
        name = name if name in THEMES else "dark"
        size = text_size or self._settings.text("text_size", "normal")
        app = QApplication.instance()
        assert isinstance(app, QApplication)
        self._style.apply(apply_theme(app, name, size))
        self._settings.keep("theme", name)
        self._settings.keep("text_size", size)
        # What the Night switch goes back to.
        if name != "night":
            self._settings.keep("day_theme", name)
        actions, menus = self._window.actions_by_name, self._window.menus
        colour_icons(actions, theme_colours())
        _check(menus.themes, name)
        _check(menus.text_sizes, size)
        with QSignalBlocker(actions["night"]):
            actions["night"].setChecked(name == "night")
        self.redden_carets(self._window)
        self._window.welcome.draw_pictures(name == "night")
        self._looks.show_frame()
        self._looks.changed.emit()

    def use_night(self, on: bool) -> None:
        """Red light alone, or the theme of the day."""
        self.use_theme("night" if on else self._settings.text("day_theme", "dark"))

    @property
    def settled(self) -> bool:
        """Whether the whole window has the present theme; it takes a few turns of the loop."""
        return not self._style.waiting

    def meet(self, part: QWidget) -> None:
        """Style a part of the window that was empty when its theme came."""
        self._style.meet(part)

    def redden_carets(self, within: QWidget) -> None:
        """Make the carets of the fields in ``within`` red at night."""
        for field in within.findChildren(QLineEdit):
            redden_caret(field)


def _check(group: QActionGroup, name: str) -> None:
    for action in group.actions():
        action.setChecked(action.data() == name)
