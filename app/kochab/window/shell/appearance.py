"""How the window and the frame look: theme, text size, stretch, colour and marks; all remembered."""

import json

from PySide6.QtCore import QObject, QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtGui import QActionGroup
from PySide6.QtWidgets import QApplication, QLineEdit, QWidget
from shiboken6 import isValid

from kochab.core import tr
from kochab.sky.layer import AMOUNTS, MARKS, SHOWN
from kochab.window.dialogs import redden_caret
from kochab.window.frame.presenter import Presenter
from kochab.window.shell.main_window import MainWindow
from kochab.window.shell.menus import colour_icons
from kochab.window.themes import HUES, THEMES, apply_theme, theme_colours


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
        window.has_part.connect(self._meet)
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
        """What is styled separately: the window's direct children and the pages in its middle."""
        window, pages = self._window, self._window.pages
        direct = Qt.FindChildOption.FindDirectChildrenOnly
        inside = [page for i in range(pages.count()) if (page := pages.widget(i)) is not None]
        return inside + [w for w in window.findChildren(QWidget, options=direct) if w is not pages]

    def _next(self) -> None:
        if self.waiting and isValid(part := self.waiting.pop(0)):
            part.ensurePolished()  # else a toolbar that was never seen keeps its old margins
            part.setStyleSheet(self.sheet)
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

    def _meet(self, part: QWidget) -> None:
        """Style a dialog, or tabs of docks that share a place: made after the sheet was applied."""
        if part is not self._window.pages and part.styleSheet() != self.sheet:
            part.setStyleSheet(self.sheet)


class Appearance(QObject):
    """Theme, text size, stretch and marks, from the settings and the menus."""

    changed = Signal()

    def __init__(self, presenter: Presenter) -> None:
        super().__init__(presenter.window)
        self._window, self._settings = presenter.window, presenter.settings
        self.layers, self._horizon = presenter.overlay.layers, presenter.horizon
        self._actions = self._window.actions_by_name
        self._style = StyleSheets(self._window)
        self._panes = self._window.workspace
        self._restore()
        self._panes.strip.changed.connect(self._stretched)
        # Sliders are for the open frame; only the switch is remembered.
        self._panes.strip.auto.toggled.connect(lambda on: self._settings.keep("stretch", on))
        self._window.menus.themes.triggered.connect(lambda a: self.use_theme(a.data()))
        self._window.menus.text_sizes.triggered.connect(lambda a: self.use_theme(text_size=a.data()))

    def _restore(self) -> None:
        for name in MARKS:
            self.layers.on[name] = self._settings.flag(f"sky/{name}", name in SHOWN)
            self._actions[name].setChecked(self.layers.on[name])
        kept = self._settings.table("sky/amounts").items()
        # Settings may be damaged, or edited by hand.
        self.layers.amount |= {k: float(v) for k, v in kept if k in AMOUNTS and type(v) is float and 0.0 <= v <= 1.0}
        kept = self._settings.table("sky/colours").items()
        self.layers.colour |= {name: hue for name, hue in kept if name in MARKS and hue in HUES.values()}
        automatic = self._settings.flag("stretch", True)
        self._actions["stretch"].setChecked(automatic)
        self._panes.strip.auto.setChecked(automatic)
        self._actions["colour"].setChecked(self._settings.flag("colour", True))
        self.use_theme()

    @property
    def is_night(self) -> bool:
        """Whether only red light is allowed."""
        return self._settings.text("theme", "dark") == "night"

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
        colour_icons(self._actions, theme_colours())
        _check(self._window.menus.themes, name)
        _check(self._window.menus.text_sizes, size)
        with QSignalBlocker(self._actions["night"]):
            self._actions["night"].setChecked(name == "night")
        self.redden_carets(self._window)
        self._window.welcome.draw_pictures(name == "night")
        self.show_frame()
        self.changed.emit()

    @property
    def settled(self) -> bool:
        """Whether the whole window has the present theme; it takes a few turns of the loop."""
        return not self._style.waiting

    def redden_carets(self, within: QWidget) -> None:
        """Make the carets of the fields in ``within`` red at night."""
        for field in within.findChildren(QLineEdit):
            redden_caret(field)

    def use_night(self, on: bool) -> None:
        self.use_theme("night" if on else self._settings.text("day_theme", "dark"))

    def show_frame(self, _: object = None) -> None:
        colour = self._actions["colour"].isChecked()
        self._settings.keep("colour", colour)
        self._panes.view.set_look(self._panes.strip.stretch, colour, self.is_night)

    def show_mark(self, name: str, on: bool) -> None:
        self._settings.keep(f"sky/{name}", on)
        self.layers.on[name] = on
        self._panes.view.update()
        if name == "altaz" and on and self._panes.view.picture is not None and self._horizon() is None:
            self._window.status.showMessage(tr("No Alt/Az grid: the frame’s time or your site is not known."), 8000)

    def set_amount(self, layer: str, amount: float) -> None:
        """Draw more or less of a layer, 0..1."""
        self.layers.amount[layer] = amount
        self._settings.keep("sky/amounts", json.dumps(self.layers.amount))
        self._panes.view.update()

    def use_layers(self, looks: tuple[dict[str, float], dict[str, str]]) -> None:
        """Draw so much of the layers that are named first, and all in the colours that are named, or in their own."""
        amounts, colours = looks
        self.layers.amount |= amounts
        self.layers.colour = dict(colours)
        self._settings.keep("sky/amounts", json.dumps(self.layers.amount))
        self._settings.keep("sky/colours", json.dumps(colours))
        self._panes.view.update()
        self.changed.emit()

    def _stretched(self, _: object) -> None:
        self._actions["stretch"].setChecked(self._panes.strip.auto.isChecked())
        self.show_frame()


def _check(group: QActionGroup, name: str) -> None:
    for action in group.actions():
        action.setChecked(action.data() == name)
