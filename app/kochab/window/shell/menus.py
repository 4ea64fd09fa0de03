"""The menus of the window, the rail at its left, and the buttons over the image."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QAction, QActionGroup, QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QMainWindow, QMenu, QMenuBar, QSizePolicy, QToolBar, QToolButton, QWidget

from kochab.sky.layer import MARKS
from kochab.text.angle_text import short_name
from kochab.text.translation import tr
from kochab.window.shell.actions import Actions
from kochab.window.themes import TEXT_SIZE_TITLES, THEME_TITLES
from kochab.window.widgets import set_property

LEAST_LETTERS, LEAST_LINES = 116, 31  # of the window's width and height, for a rail with names
LOW_LINES = 26  # of its height, for icons of the usual size
ICON_PX, SMALL_ICON_PX = 22, 16


class Menus:
    """Owns the menus that change: recent files, export, theme, text size, tools."""

    def __init__(self, window: QMainWindow, bar: QMenuBar, actions: Actions) -> None:
        file = bar.addMenu(tr("&File"))
        _fill(file, actions, "open", "folder")
        self.recent: QMenu = file.addMenu(tr("Open &recent"))
        self._clear = actions["clear_recent"]
        self.samples: QMenu = file.addMenu(tr("Open a &sample"))
        file.addSeparator()
        self.export: QMenu = file.addMenu(tr("&Export"))
        file.addSeparator()
        file.addAction(actions["quit"])
        edit = bar.addMenu(tr("&Edit"))
        _fill(edit, actions, "undo", "redo", "", "search", "", "copy", "copy_all", "", "preferences")
        view = bar.addMenu(tr("&View"))
        _fill(
            view,
            actions,
            "next",
            "previous",
            "blink",
            "",
            "fit",
            "one",
            "in",
            "out",
            "",
            "stretch",
            "histogram",
            "colour",
            "",
        )
        self.layers = StayingMenu(tr("La&yers"), view)
        view.addMenu(self.layers)
        _fill(self.layers, actions, *MARKS, "", "layers")
        _fill(view, actions, "", "details", "tab_solution", "tab_stars", "tab_hints", "log", "atlas", "")
        self.themes = _choices(window, view.addMenu(tr("&Theme")), THEME_TITLES)
        self.text_sizes = _choices(window, view.addMenu(tr("Te&xt size")), TEXT_SIZE_TITLES)
        _fill(view, actions, "night", "full")
        _fill(bar.addMenu(tr("&Solve")), actions, "solve", "cancel", "", "tab_hints")
        self.tools: QMenu = bar.addMenu(tr("&Tools"))
        self.practice = self.tools.addAction(tr("Practice with a &simulated telescope"))
        self.tools.addSeparator()
        _fill(self.tools, actions, "fill", "")
        _fill(bar.addMenu(tr("&Help")), actions, "help", "keys", "tour", "news", "", "report", "about")

    def show_files(self, menu: QMenu, paths: list[tuple[str, Path]], chosen: Callable[[Path], object]) -> None:
        """Fill the recent or the sample menu."""
        menu.clear()
        menu.setEnabled(bool(paths))
        for i, (text, path) in enumerate(paths):
            shown = short_name(text).replace("&", "&&")
            # The tenth has the key 0.
            action = menu.addAction(f"&{(i + 1) % 10}  {shown}")
            action.setToolTip(str(path))
            action.triggered.connect(lambda _=False, p=path: chosen(p))
        if menu is self.recent and paths:
            menu.addSeparator()
            menu.addAction(self._clear)


class StayingMenu(QMenu):
    """Stays open while its switches are switched: one looks at several, and at what they do."""

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if not self._switch(self.actionAt(event.position().toPoint())):
            super().mouseReleaseEvent(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        pressed = event.key() in (Qt.Key.Key_Space, Qt.Key.Key_Return, Qt.Key.Key_Enter)
        if not (pressed and self._switch(self.activeAction())):
            super().keyPressEvent(event)

    def _switch(self, action: QAction | None) -> bool:
        """Switch it, if it is a switch that can be used."""
        switches = action is not None and action.isCheckable() and action.isEnabled()
        if action is not None and switches:
            action.trigger()
        return switches


class Rail(QToolBar):
    """The modes at the left of the window; a small window leaves them their icons, and a low one makes these small."""

    def __init__(self, window: QMainWindow) -> None:
        super().__init__(tr("Modes"), window, movable=False, iconSize=QSize(ICON_PX, ICON_PX))
        self.setObjectName("rail")
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)  # which would offer to hide it
        window.addToolBar(Qt.ToolBarArea.LeftToolBarArea, self)

    def fill(self, modes: list[QAction], below: list[QAction]) -> None:
        """Buttons for ``modes``, and at the lower end those ``below``, all of one width."""
        space = QWidget()
        space.setSizePolicy(QSizePolicy.Policy.Minimum, QSizePolicy.Policy.Expanding)
        self.addActions(modes)
        self.addWidget(space)
        self.addActions(below)
        for action in [*modes, *below]:
            button = self.widgetForAction(action)
            assert isinstance(button, QToolButton)
            _tell(button, action)
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def suit(self, window: QSize) -> None:
        """Show the names of the modes, or icons alone in a small ``window``: none may fall off its lower end."""
        metrics, style = self.fontMetrics(), Qt.ToolButtonStyle
        lines = window.height() / metrics.lineSpacing()
        small = window.width() < metrics.averageCharWidth() * LEAST_LETTERS or lines < LEAST_LINES
        self.setToolButtonStyle(style.ToolButtonIconOnly if small else style.ToolButtonTextUnderIcon)
        low = lines < LOW_LINES
        side = SMALL_ICON_PX if low else ICON_PX
        self.setIconSize(QSize(side, side))
        if bool(self.property("low")) is not low:
            for each in (self, *self.findChildren(QToolButton)):
                set_property(each, "low", low)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.StyleChange:
            self.suit(self.window().size())


def button_of(action: QAction, menu: QMenu | None = None) -> QToolButton:
    """A small button over the image that triggers ``action``, or opens ``menu``, which is then the action's."""
    made = QToolButton()
    if menu is None:
        made.setDefaultAction(action)
    else:  # by its text: with the menu's own action Qt opens another menu, in which this one is the only row
        made.setText(action.text().replace("&", ""))
        made.setMenu(menu)
    # Afterwards: in Qt 6.7 a menu gives its button an arrow of its own, which is drawn black.
    made.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
    _tell(made, action)
    made.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
    return made


def _tell(button: QToolButton, action: QAction) -> None:
    """Make a button known to keyboards and screen readers, whose Toggle does what a click does.

    It checks the button, which then checks its action and triggers nothing; else the action is checked first.
    """
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    button.setAccessibleName(action.text().replace("&", ""))
    ahead = 0  # how often the action has told of it, and the button not yet

    def checked(_: bool) -> None:
        nonlocal ahead
        ahead += 1

    def pressed(on: bool) -> None:
        nonlocal ahead
        ahead -= 1
        if ahead == 0:
            action.setChecked(not on)
            action.trigger()

    action.toggled.connect(checked)
    button.toggled.connect(pressed)


def _fill(menu: QMenu, actions: Actions, *names: str) -> None:
    for name in names:
        if name:
            menu.addAction(actions[name])
        else:
            menu.addSeparator()


def _choices(window: QMainWindow, menu: QMenu, titles: dict[str, str]) -> QActionGroup:
    group = QActionGroup(window)
    for name, title in titles.items():
        action = QAction(tr(title), group, checkable=True)
        action.setData(name)
        menu.addAction(action)
    return group
