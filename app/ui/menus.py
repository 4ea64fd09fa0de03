"""The menu bar and the toolbar, laid out from the actions."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMainWindow, QMenu, QToolBar

from app.ui.actions import MARKS
from app.ui.formats import short_name
from app.ui.palette import THEME_TITLES
from app.ui.theme import TEXT_SIZES

Actions = dict[str, QAction]


class Menus:
    """Owns the menus that change: recent files, export, theme, text size, tools."""

    def __init__(self, window: QMainWindow, actions: Actions) -> None:
        bar = window.menuBar()
        file = bar.addMenu("&File")
        file.addAction(actions["open"])
        self.recent: QMenu = file.addMenu("Open &recent")
        self._clear = actions["clear_recent"]
        self.samples: QMenu = file.addMenu("Open a &sample")
        file.addSeparator()
        self.export: QMenu = file.addMenu("&Export")
        file.addSeparator()
        file.addAction(actions["quit"])
        _fill(bar.addMenu("&Edit"), actions, "copy", "copy_all")
        view = bar.addMenu("&View")
        _fill(view, actions, "fit", "one", "in", "out", "", "stretch", "colour", "")
        marks = view.addMenu("&Marks")
        _fill(marks, actions, *MARKS)
        _fill(view, actions, "", "tab_solution", "tab_stars", "tab_hints", "log", "")
        self.themes = _choices(window, view.addMenu("&Theme"), THEME_TITLES)
        titles = {name: f"&{name.capitalize()}" for name in TEXT_SIZES}
        self.text_sizes = _choices(window, view.addMenu("Te&xt size"), titles)
        _fill(view, actions, "night", "full")
        _fill(bar.addMenu("&Solve"), actions, "solve", "cancel", "", "tab_hints")
        self.tools: QMenu = bar.addMenu("&Tools")
        self.practice = self.tools.addAction("Practice with a &simulated telescope")
        self.tools.addSeparator()
        _fill(self.tools, actions, "fill", "")
        _fill(bar.addMenu("&Help"), actions, "keys", "about")

    def show_files(
        self, menu: QMenu, paths: list[tuple[str, Path]], chosen: Callable[[Path], object]
    ) -> None:
        """Fill the recent or the sample menu."""
        menu.clear()
        menu.setEnabled(bool(paths))
        for i, (text, path) in enumerate(paths):
            shown = short_name(text).replace("&", "&&")
            action = menu.addAction(f"&{(i + 1) % 10}  {shown}")
            action.setToolTip(str(path))
            action.triggered.connect(lambda _=False, p=path: chosen(p))
        if menu is self.recent and paths:
            menu.addSeparator()
            menu.addAction(self._clear)


def make_toolbar(window: QMainWindow, actions: Actions) -> QToolBar:
    """The toolbar: the frame, the view, the marks, night."""
    bar = QToolBar("Tools", window)
    bar.setObjectName("tools")
    bar.setMovable(False)
    bar.setIconSize(QSize(22, 22))
    bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
    groups = (("open", "solve", "cancel"), ("fit", "one", "in", "out"),
              ("stretch", "colour", "night"), MARKS, ("copy",))  # fmt: skip
    for i, group in enumerate(groups):
        if i:
            bar.addSeparator()
        for name in group:
            bar.addAction(actions[name])
            button = bar.widgetForAction(actions[name])
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
            button.setAccessibleName(actions[name].text().replace("&", ""))
    window.addToolBar(bar)
    return bar


def _fill(menu: QMenu, actions: Actions, *names: str) -> None:
    for name in names:
        if name:
            menu.addAction(actions[name])
        else:
            menu.addSeparator()


def _choices(window: QMainWindow, menu: QMenu, titles: dict[str, str]) -> QActionGroup:
    group = QActionGroup(window)
    for name, title in titles.items():
        action = menu.addAction(title)
        action.setCheckable(True)
        action.setData(name)
        group.addAction(action)
    return group
