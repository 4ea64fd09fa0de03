"""The actions of the window, its menu bar and its toolbar."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu, QToolBar

from kochab.core.angle_text import short_name
from kochab.window.image.overlay import MARKS
from kochab.window.themes import TEXT_SIZES, THEME_TITLES, Colours, glyphs, icon


@dataclass(frozen=True, slots=True)
class Spec:
    """One action: its name, its text with mnemonic, shortcuts, and whether it switches."""

    name: str
    text: str
    keys: str = ""  # separated by spaces
    tip: str = ""
    switch: bool = False
    short: str = ""  # text on the toolbar


SPECS = (
    Spec("open", "&Open…", "Ctrl+O", "Open an image", short="Open"),
    Spec("clear_recent", "&Clear this list"),
    Spec("quit", "&Quit", "Ctrl+Q"),
    Spec("solve", "&Solve again", "F5 Ctrl+R", "Plate solve the open image again", short="Solve"),
    Spec("cancel", "&Cancel", "Esc", "Stop the current task", short="Cancel"),
    Spec("fit", "&Fit to window", "0 Ctrl+0", "Show the whole image", short="Fit"),
    Spec("one", "&Actual pixels", "1 Ctrl+1", "Show the image at 100 %", short="1:1"),
    Spec("in", "Zoom &in", "+ = Ctrl++", short="In"),
    Spec("out", "Zoom &out", "- Ctrl+-", short="Out"),
    Spec("stretch", "Automatic &stretch", "T", "Stretch the image so that faint stars show", True, "Stretch"),
    Spec("colour", "&Colour", "C", "Show in colour or mono", True, "Colour"),
    Spec("detected", "&Detected stars", "D", "Circle every detected star", True, "Detected"),
    Spec("identified", "&Identified stars", "I", "Circle identified stars", True, "Identified"),
    Spec("names", "&Names", "N", "Label identified stars", True, "Names"),
    Spec("grid", "RA/Dec &grid", "G", "Right ascension and declination lines", True, "Grid"),
    Spec("centre", "&Centre cross", "X", "Mark the centre of the frame", True, "Centre"),
    Spec("compass", "North and &east arrows", "E", "Show north and east", True, "N/E"),
    Spec("night", "Ni&ght", "Ctrl+N", "Red light only, for dark-adapted eyes", True, "Night"),
    Spec("fill", "Tool fills the &window", "Shift+F11", "Hide the image beside an open tool", True),
    Spec("full", "F&ull screen", "F11", "", True),
    Spec("log", "&Log", "Ctrl+L", "Show the log", True),
    Spec("copy", "Copy &RA/Dec", "Ctrl+Shift+C", "Copy the coordinates of the frame's centre", short="Copy"),
    Spec("copy_all", "Copy &everything"),
    Spec("tab_solution", "Solutio&n", "Alt+1"),
    Spec("tab_stars", "Sta&rs", "Alt+2"),
    Spec("tab_hints", "&Hints and methods", "Alt+3"),
    Spec("about", "&About Kochab"),
    Spec("keys", "&Keyboard", "F1"),
    Spec("report", "Save a &report…", "", "Pack the journal and versions for a bug report"),
)
Actions = dict[str, QAction]


def make_actions(window: QMainWindow) -> Actions:
    """All actions by name, with shortcuts that work wherever the focus is in ``window``."""
    made: Actions = {}
    for spec in SPECS:
        # An icon in the menu would take the place of a switch's tick.
        action = QAction(spec.text, window, checkable=spec.switch, iconVisibleInMenu=False)
        action.setObjectName(spec.name)
        action.setShortcuts([QKeySequence(k) for k in spec.keys.split()])
        if spec.short:
            action.setIconText(spec.short)
        keys = f" ({spec.keys.split()[0]})" if spec.keys else ""
        action.setToolTip(f"{spec.tip or spec.text.replace('&', '').rstrip('…')}{keys}")
        made[spec.name] = action
        window.addAction(action)
    return made


def colour_icons(actions: Actions, colours: Colours) -> None:
    """Draw the icons in the theme's colours."""
    for name, action in actions.items():
        if glyphs(colours.text).elementExists(name):
            action.setIcon(icon(name, colours.text, colours.faint))


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
        _fill(bar.addMenu("&Help"), actions, "keys", "report", "about")

    def show_files(self, menu: QMenu, paths: list[tuple[str, Path]], chosen: Callable[[Path], object]) -> None:
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
    bar = QToolBar("Tools", window, movable=False, iconSize=QSize(22, 22))
    bar.setObjectName("tools")
    bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
    groups = (
        ("open", "solve", "cancel"),
        ("fit", "one", "in", "out"),
        ("stretch", "colour", "night"),
        MARKS,
        ("copy",),
    )
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
        action = QAction(title, group, checkable=True)
        action.setData(name)
        menu.addAction(action)
    return group
