"""The actions of the window, its menus, the rail at its left, and the buttons over the image."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu, QMenuBar, QSizePolicy, QToolBar, QToolButton, QWidget

from kochab.core import tr, tr_noop
from kochab.core.angle_text import short_name
from kochab.sky.layer import MARKS
from kochab.window.themes import TEXT_SIZE_TITLES, THEME_TITLES, Colours, glyphs, icon


@dataclass(frozen=True, slots=True)
class Spec:
    """One action: its name, its text with mnemonic, shortcuts, and whether it switches."""

    name: str
    text: str
    keys: str = ""  # separated by spaces
    tip: str = ""
    switch: bool = False
    short: str = ""  # text on a button


NEWS = tr_noop("What’s new")  # also a page of the help book
SPECS = (
    Spec("open", tr_noop("&Open…"), "Ctrl+O", tr_noop("Open an image"), short=tr_noop("Open…")),
    Spec("folder", tr_noop("Open a &folder…"), "Ctrl+Shift+O", tr_noop("Open all images of a folder")),
    Spec("clear_recent", tr_noop("&Clear this list")),
    Spec("quit", tr_noop("&Quit"), "Ctrl+Q"),
    Spec("solve", tr_noop("&Solve again"), "F5 Ctrl+R", tr_noop("Plate solve the open image again")),
    Spec("cancel", tr_noop("&Cancel"), "Esc", tr_noop("Stop the current task")),
    Spec("fit", tr_noop("&Fit to window"), "0 Ctrl+0", tr_noop("Show the whole image"), short=tr_noop("Fit")),
    Spec("one", tr_noop("&Actual pixels"), "1 Ctrl+1", tr_noop("Show the image at 100 %")),
    Spec("in", tr_noop("Zoom &in"), "+ = Ctrl++"),
    Spec("out", tr_noop("Zoom &out"), "- Ctrl+-"),
    Spec("next", tr_noop("N&ext image"), "Ctrl+Right", tr_noop("Open the next file of the film strip")),
    Spec("previous", tr_noop("&Previous image"), "Ctrl+Left", tr_noop("Open the file before")),
    Spec("blink", tr_noop("&Blink"), "B", tr_noop("Show this image and the one before in turn"), True),
    Spec("stretch", tr_noop("Automatic &stretch"), "T", tr_noop("Stretch the image so that faint stars show"), True),
    Spec(
        "histogram",
        tr_noop("Histogra&m"),
        "H",
        tr_noop("Show the histogram, black point and brightness"),
        True,
        tr_noop("Stretch"),
    ),
    Spec("colour", tr_noop("&Colour"), "C", tr_noop("Show in colour or mono"), True),
    Spec(
        "objects",
        tr_noop("Deep-sky &objects"),
        "O",
        tr_noop("Outlines and names of galaxies, nebulae and clusters"),
        True,
    ),
    Spec("names", tr_noop("Star &names"), "N", tr_noop("Names of bright stars"), True),
    Spec(
        "bodies",
        tr_noop("&Planets, asteroids, comets"),
        "P",
        tr_noop("Bodies of the Solar System in a dated frame"),
        True,
    ),
    Spec("figures", tr_noop("Constellation &lines"), "L", tr_noop("The figures of the constellations"), True),
    Spec("boundaries", tr_noop("Constellation &boundaries"), "", tr_noop("The IAU's boundaries"), True),
    Spec("ecliptic", tr_noop("E&cliptic"), "", tr_noop("The Sun's path"), True),
    Spec("galactic", tr_noop("&Galactic equator"), "", tr_noop("Galactic plane"), True),
    Spec(
        "altaz",
        tr_noop("&Alt/Az grid"),
        "A",
        tr_noop("Altitude and azimuth, where the frame’s time and site are known"),
        True,
    ),
    Spec("layers", tr_noop("A&mounts and colours…"), "", tr_noop("How much of each layer, and in which colour")),
    Spec("identified", tr_noop("&Identified stars"), "I", tr_noop("Circle identified stars"), True),
    Spec("detected", tr_noop("&Detected stars"), "D", tr_noop("Circle detected stars that are not identified"), True),
    Spec("grid", tr_noop("&RA/Dec grid"), "G", tr_noop("Right ascension and declination lines"), True),
    Spec("centre", tr_noop("Centre cros&s"), "X", tr_noop("Mark the centre of the frame"), True),
    Spec("compass", tr_noop("North and &east arrows"), "E", tr_noop("Show north and east"), True),
    Spec(
        "night", tr_noop("Ni&ght"), "Ctrl+N", tr_noop("Red light only, for dark-adapted eyes"), True, tr_noop("Night")
    ),
    Spec(
        "preferences",
        tr_noop("Pre&ferences…"),
        "Ctrl+,",
        tr_noop("Angles, theme, layers, equipment, folders"),
        short=tr_noop("Settings"),
    ),
    Spec(
        "details",
        tr_noop("&Details"),
        "Ctrl+D",
        tr_noop("Attitude, camera, times, the stars, hints and methods"),
        True,
        tr_noop("Details"),
    ),
    Spec("fill", tr_noop("Tool fills the &window"), "Shift+F11", tr_noop("Hide the image beside an open tool"), True),
    Spec("full", tr_noop("F&ull screen"), "F11", "", True),
    Spec("log", tr_noop("&Log"), "Ctrl+L", tr_noop("Show the log"), True),
    Spec("undo", tr_noop("&Undo"), "Ctrl+Z", tr_noop("Take the last change back")),
    Spec("redo", tr_noop("Re&do"), "Ctrl+Shift+Z Ctrl+Y", tr_noop("Make the change again")),
    Spec("search", tr_noop("Fi&nd…"), "Ctrl+K", tr_noop("Find a star, an object, coordinates or a command")),
    Spec("atlas", tr_noop("S&ky atlas"), "Ctrl+M", tr_noop("Star chart with the frame’s outline, framing and mosaics")),
    Spec("copy", tr_noop("Copy &RA/Dec"), "Ctrl+Shift+C", tr_noop("Copy the coordinates of the frame's centre")),
    Spec("copy_all", tr_noop("Copy &everything")),
    Spec("tab_solution", tr_noop("Solutio&n"), "Alt+1"),
    Spec("tab_stars", tr_noop("Sta&rs"), "Alt+2"),
    Spec("tab_hints", tr_noop("&Hints and methods"), "Alt+3"),
    Spec("help", tr_noop("&Help"), "F1", tr_noop("The help book, at the page of the present mode")),
    Spec("tour", tr_noop("&Tour"), "", tr_noop("Four cards for the first evening")),
    Spec("news", tr_noop("&What’s new")),
    Spec("keys", tr_noop("&Keyboard"), "Shift+F1"),
    Spec("about", tr_noop("&About Kochab")),
    Spec("report", tr_noop("Save a &report…"), "", tr_noop("Pack the journal and versions for a bug report")),
)
Actions = dict[str, QAction]
LEAST_LETTERS = 105  # of the window's width, for a rail with names


def make_actions(window: QMainWindow) -> Actions:
    """All actions by name, with shortcuts that work wherever the focus is in ``window``."""
    made: Actions = {}
    for spec in SPECS:
        # An icon in the menu would take the place of a switch's tick.
        action = QAction(tr(spec.text), window, checkable=spec.switch, iconVisibleInMenu=False)
        action.setObjectName(spec.name)
        action.setShortcuts([QKeySequence(k) for k in spec.keys.split()])
        if spec.short:
            action.setIconText(tr(spec.short))
        keys = f" ({spec.keys.split()[0]})" if spec.keys else ""
        action.setToolTip(f"{tr(spec.tip) or tr(spec.text).replace('&', '').rstrip('…')}{keys}")
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
        self.layers = view.addMenu(tr("La&yers"))
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


class Rail(QToolBar):
    """The modes at the left of the window; large letters on a small screen leave them their icons."""

    def __init__(self, window: QMainWindow) -> None:
        super().__init__(tr("Modes"), window, movable=False, iconSize=QSize(22, 22))
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
