"""The actions of the window, its menus, the rail at its left, and the buttons over the image."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu, QMenuBar, QSizePolicy, QToolBar, QToolButton, QWidget

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
    short: str = ""  # text on a button


NEWS = "What’s new"  # also a page of the help book
SPECS = (
    Spec("open", "&Open…", "Ctrl+O", "Open an image", short="Open…"),
    Spec("folder", "Open a &folder…", "Ctrl+Shift+O", "Open all images of a folder"),
    Spec("clear_recent", "&Clear this list"),
    Spec("quit", "&Quit", "Ctrl+Q"),
    Spec("solve", "&Solve again", "F5 Ctrl+R", "Plate solve the open image again"),
    Spec("cancel", "&Cancel", "Esc", "Stop the current task"),
    Spec("fit", "&Fit to window", "0 Ctrl+0", "Show the whole image", short="Fit"),
    Spec("one", "&Actual pixels", "1 Ctrl+1", "Show the image at 100 %"),
    Spec("in", "Zoom &in", "+ = Ctrl++"),
    Spec("out", "Zoom &out", "- Ctrl+-"),
    Spec("next", "N&ext image", "Ctrl+Right", "Open the next file of the film strip"),
    Spec("previous", "&Previous image", "Ctrl+Left", "Open the file before"),
    Spec("blink", "&Blink", "B", "Show this image and the one before in turn", True),
    Spec("stretch", "Automatic &stretch", "T", "Stretch the image so that faint stars show", True),
    Spec("histogram", "Histogra&m", "H", "Show the histogram, black point and brightness", True, "Stretch"),
    Spec("colour", "&Colour", "C", "Show in colour or mono", True),
    Spec("objects", "Deep-sky &objects", "O", "Outlines and names of galaxies, nebulae and clusters", True),
    Spec("names", "Star &names", "N", "Names of bright stars", True),
    Spec("bodies", "&Planets, asteroids, comets", "P", "Bodies of the Solar System in a dated frame", True),
    Spec("figures", "Constellation &lines", "L", "The figures of the constellations", True),
    Spec("boundaries", "Constellation &boundaries", "", "The IAU's boundaries", True),
    Spec("ecliptic", "E&cliptic", "", "The Sun's path", True),
    Spec("galactic", "&Galactic equator", "", "The middle of the Milky Way", True),
    Spec("identified", "&Identified stars", "I", "Circle identified stars", True),
    Spec("detected", "&Detected stars", "D", "Circle detected stars that are not identified", True),
    Spec("grid", "&RA/Dec grid", "G", "Right ascension and declination lines", True),
    Spec("centre", "Centre cros&s", "X", "Mark the centre of the frame", True),
    Spec("compass", "North and &east arrows", "E", "Show north and east", True),
    Spec("night", "Ni&ght", "Ctrl+N", "Red light only, for dark-adapted eyes", True, "Night"),
    Spec("preferences", "Pre&ferences…", "Ctrl+,", "Angles, theme, layers, equipment, folders", short="Settings"),
    Spec("details", "&Details", "Ctrl+D", "Attitude, camera, times, the stars, hints and methods", True, "Details"),
    Spec("fill", "Tool fills the &window", "Shift+F11", "Hide the image beside an open tool", True),
    Spec("full", "F&ull screen", "F11", "", True),
    Spec("log", "&Log", "Ctrl+L", "Show the log", True),
    Spec("search", "Fi&nd…", "Ctrl+K", "Find a star, an object, coordinates or a command"),
    Spec("copy", "Copy &RA/Dec", "Ctrl+Shift+C", "Copy the coordinates of the frame's centre"),
    Spec("copy_all", "Copy &everything"),
    Spec("tab_solution", "Solutio&n", "Alt+1"),
    Spec("tab_stars", "Sta&rs", "Alt+2"),
    Spec("tab_hints", "&Hints and methods", "Alt+3"),
    Spec("help", "&Help", "F1", "The help book, at the page of the present mode"),
    Spec("tour", "&Tour", "", "Four cards for the first evening"),
    Spec("news", f"&{NEWS}"),
    Spec("keys", "&Keyboard", "Shift+F1"),
    Spec("about", "&About Kochab"),
    Spec("report", "Save a &report…", "", "Pack the journal and versions for a bug report"),
)
Actions = dict[str, QAction]
LEAST_LETTERS = 105  # of the window's width, for a rail with names


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

    def __init__(self, window: QMainWindow, bar: QMenuBar, actions: Actions) -> None:
        file = bar.addMenu("&File")
        _fill(file, actions, "open", "folder")
        self.recent: QMenu = file.addMenu("Open &recent")
        self._clear = actions["clear_recent"]
        self.samples: QMenu = file.addMenu("Open a &sample")
        file.addSeparator()
        self.export: QMenu = file.addMenu("&Export")
        file.addSeparator()
        file.addAction(actions["quit"])
        _fill(bar.addMenu("&Edit"), actions, "search", "", "copy", "copy_all", "", "preferences")
        view = bar.addMenu("&View")
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
        self.layers = view.addMenu("La&yers")
        _fill(self.layers, actions, *MARKS)
        _fill(view, actions, "", "details", "tab_solution", "tab_stars", "tab_hints", "log", "")
        self.themes = _choices(window, view.addMenu("&Theme"), THEME_TITLES)
        titles = {name: f"&{name.capitalize()}" for name in TEXT_SIZES}
        self.text_sizes = _choices(window, view.addMenu("Te&xt size"), titles)
        _fill(view, actions, "night", "full")
        _fill(bar.addMenu("&Solve"), actions, "solve", "cancel", "", "tab_hints")
        self.tools: QMenu = bar.addMenu("&Tools")
        self.practice = self.tools.addAction("Practice with a &simulated telescope")
        self.tools.addSeparator()
        _fill(self.tools, actions, "fill", "")
        _fill(bar.addMenu("&Help"), actions, "help", "keys", "tour", "news", "", "report", "about")

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


class Rail(QToolBar):
    """The modes at the left of the window; large letters on a small screen leave them their icons."""

    def __init__(self, window: QMainWindow) -> None:
        super().__init__("Modes", window, movable=False, iconSize=QSize(22, 22))
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
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
            button.setAccessibleName(action.text().replace("&", ""))
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def suit(self, width_px: int) -> None:
        """Show the names of the modes, or icons alone in a window of ``width_px``."""
        small = width_px < self.fontMetrics().averageCharWidth() * LEAST_LETTERS
        style = Qt.ToolButtonStyle
        self.setToolButtonStyle(style.ToolButtonIconOnly if small else style.ToolButtonTextUnderIcon)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.StyleChange:
            self.suit(self.window().width())


def button_of(action: QAction, menu: QMenu | None = None) -> QToolButton:
    """A small button over the image that triggers ``action``, or opens ``menu``, which is then the action's."""
    made = QToolButton(popupMode=QToolButton.ToolButtonPopupMode.InstantPopup)
    made.setDefaultAction(action)
    made.setMenu(menu)  # type: ignore[arg-type]  # None is no menu
    made.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    made.setAccessibleName(action.text().replace("&", ""))
    made.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
    return made


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
