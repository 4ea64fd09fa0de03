"""Every command of the window, a row each: its name, its words and keys, and whose method it calls."""

from collections.abc import Callable
from functools import partial
from operator import attrgetter

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow

from kochab.core.values import frozen
from kochab.sky.layer import MARKS
from kochab.text.translation import tr, tr_noop
from kochab.window.themes import Colours, glyphs, icon


@frozen
class Command:
    """One command; ``slot`` names a part of the window (:class:`kochab.window.shell.commands.Parts`) and its method.

    A switch hands its state over to the method, and that of a layer its name before it. Without a slot the part that
    shows it connects it.
    """

    name: str
    text: str  # with its mnemonic
    slot: str
    keys: str = ""  # separated by spaces
    tip: str = ""
    switch: bool = False
    short: str = ""  # text on a button
    everywhere: bool = False  # its keys work in every window of the program, as at the bolts

    @property
    def letter(self) -> str:
        """The single letter that switches it; empty where none does."""
        keys = self.keys.split()
        return keys[0] if self.switch and keys and len(keys[0]) == 1 else ""


NEWS = tr_noop("What’s new")  # also a page of the help book
COMMANDS = (
    Command("open", tr_noop("&Open…"), "files.choose", "Ctrl+O", tr_noop("Open an image"), short=tr_noop("Open…")),
    Command(
        "folder",
        tr_noop("Open a &folder…"),
        "files.choose_folder",
        "Ctrl+Shift+O",
        tr_noop("Open all images of a folder"),
    ),
    Command("clear_recent", tr_noop("&Clear this list"), "files.clear_recent"),
    Command("quit", tr_noop("&Quit"), "window.close", "Ctrl+Q"),
    Command(
        "solve", tr_noop("&Solve again"), "presenter.solve", "F5 Ctrl+R", tr_noop("Plate solve the open image again")
    ),
    Command("cancel", tr_noop("&Cancel"), "layout.escape", "Esc", tr_noop("Stop the current task")),
    Command(
        "fit", tr_noop("&Fit to window"), "view.fit", "0 Ctrl+0", tr_noop("Show the whole image"), short=tr_noop("Fit")
    ),
    Command("one", tr_noop("&Actual pixels"), "view.actual_pixels", "1 Ctrl+1", tr_noop("Show the image at 100 %")),
    Command("in", tr_noop("Zoom &in"), "view.zoom_in", "+ = Ctrl++"),
    Command("out", tr_noop("Zoom &out"), "view.zoom_out", "- Ctrl+-"),
    Command(
        "next", tr_noop("N&ext image"), "films.next", "Ctrl+Right", tr_noop("Open the next file of the film strip")
    ),
    Command("previous", tr_noop("&Previous image"), "films.previous", "Ctrl+Left", tr_noop("Open the file before")),
    Command(
        "blink",
        tr_noop("&Blink"),
        "blink.switch",
        "B",
        tr_noop("Show this image and the one before in turn"),
        switch=True,
    ),
    Command(
        "stretch",
        tr_noop("Automatic &stretch"),
        "strip.auto.setChecked",
        "T",
        tr_noop("Stretch the image so that faint stars show"),
        switch=True,
    ),
    Command(
        "histogram",
        tr_noop("Histogra&m"),
        "strip.setVisible",
        "H",
        tr_noop("Show the histogram, black point and midtones"),
        switch=True,
        short=tr_noop("Stretch"),
    ),
    Command("colour", tr_noop("&Colour"), "looks.use_colour", "C", tr_noop("Show in colour or mono"), switch=True),
    Command(
        "objects",
        tr_noop("Deep-sky &objects"),
        "looks.show_mark",
        "O",
        tr_noop("Outlines and names of galaxies, nebulae and clusters"),
        switch=True,
    ),
    Command("names", tr_noop("Star &names"), "looks.show_mark", "N", tr_noop("Names of bright stars"), switch=True),
    Command(
        "bodies",
        tr_noop("&Planets, asteroids, comets"),
        "looks.show_mark",
        "P",
        tr_noop("Bodies of the Solar System in a dated frame"),
        switch=True,
    ),
    Command(
        "figures",
        tr_noop("Constellation &lines"),
        "looks.show_mark",
        "L",
        tr_noop("The figures of the constellations"),
        switch=True,
    ),
    Command(
        "boundaries",
        tr_noop("Constellation &boundaries"),
        "looks.show_mark",
        "",
        tr_noop("The IAU's boundaries"),
        switch=True,
    ),
    Command("ecliptic", tr_noop("E&cliptic"), "looks.show_mark", "", tr_noop("The Sun's path"), switch=True),
    Command("galactic", tr_noop("&Galactic equator"), "looks.show_mark", "", tr_noop("Galactic plane"), switch=True),
    Command(
        "altaz",
        tr_noop("&Alt/Az grid"),
        "looks.show_mark",
        "A",
        tr_noop("Altitude and azimuth, where the frame’s time and site are known"),
        switch=True,
    ),
    Command(
        "layers",
        tr_noop("A&mounts and colours…"),
        "tools.show_layers",
        "",
        tr_noop("How much of each layer, and in which colour"),
    ),
    Command(
        "identified",
        tr_noop("&Identified stars"),
        "looks.show_mark",
        "I",
        tr_noop("Circle identified stars"),
        switch=True,
    ),
    Command(
        "detected",
        tr_noop("&Detected stars"),
        "looks.show_mark",
        "D",
        tr_noop("Circle detected stars that are not identified"),
        switch=True,
    ),
    Command(
        "grid",
        tr_noop("&RA/Dec grid"),
        "looks.show_mark",
        "G",
        tr_noop("Right ascension and declination lines"),
        switch=True,
    ),
    Command(
        "centre", tr_noop("Centre cros&s"), "looks.show_mark", "X", tr_noop("Mark the centre of the frame"), switch=True
    ),
    Command(
        "compass",
        tr_noop("North and &east arrows"),
        "looks.show_mark",
        "E",
        tr_noop("Show north and east"),
        switch=True,
    ),
    Command(
        "night",
        tr_noop("Ni&ght"),
        "appearance.use_night",
        "Ctrl+N",
        tr_noop("Red light only, for dark-adapted eyes"),
        switch=True,
        short=tr_noop("Night"),
        everywhere=True,
    ),
    Command(
        "preferences",
        tr_noop("Pre&ferences…"),
        "tools.show_preferences",
        "Ctrl+,",
        tr_noop("Angles, theme, layers, equipment, folders"),
        short=tr_noop("Settings"),
    ),
    Command(
        "details",
        tr_noop("&Details"),
        "",
        "Ctrl+D",
        tr_noop("Attitude, camera, times, the stars, hints and methods"),
        switch=True,
        short=tr_noop("Details"),
    ),
    Command(
        "fill",
        tr_noop("Maximise the &tool"),
        "layout.fill",
        "Shift+F11",
        tr_noop("Hide the image beside an open tool"),
        switch=True,
    ),
    Command("full", tr_noop("F&ull screen"), "layout.use_full_screen", "F11", switch=True),
    Command("log", tr_noop("&Log"), "window.log.setVisible", "Ctrl+L", tr_noop("Show the log"), switch=True),
    Command("undo", tr_noop("&Undo"), "undo.undo", "Ctrl+Z", tr_noop("Take the last change back")),
    Command("redo", tr_noop("Re&do"), "undo.redo", "Ctrl+Shift+Z Ctrl+Y", tr_noop("Make the change again")),
    Command(
        "search",
        tr_noop("Fi&nd…"),
        "tools.search",
        "Ctrl+K",
        tr_noop("Find a star, an object, coordinates or a command"),
        short=tr_noop("Search   Ctrl+K"),
    ),
    Command(
        "atlas",
        tr_noop("S&ky atlas"),
        "tools.show_atlas",
        "Ctrl+M",
        tr_noop("Star chart with the frame’s outline, framing and mosaics"),
    ),
    Command(
        "copy",
        tr_noop("Copy &RA/Dec"),
        "solution.copy_position",
        "Ctrl+Shift+C",
        tr_noop("Copy the coordinates of the frame's centre"),
    ),
    Command("copy_all", tr_noop("Copy &everything"), "solution.copy_all"),
    Command("tab_solution", tr_noop("Solutio&n"), "layout.show_solution", "Alt+1"),
    Command("tab_stars", tr_noop("Sta&rs"), "layout.show_stars", "Alt+2"),
    Command("tab_hints", tr_noop("&Hints and methods"), "layout.show_hints", "Alt+3"),
    Command("help", tr_noop("&Help"), "help.show", "F1", tr_noop("The help book, at the page of the present mode")),
    Command("tour", tr_noop("&Tour"), "help.show_tour", "", tr_noop("Four cards for the first evening")),
    Command("news", tr_noop("&What’s new"), "help.show_news"),
    Command("keys", tr_noop("&Keyboard"), "help.show_keys", "Shift+F1"),
    Command("about", tr_noop("&About Kochab"), "help.show_about"),
    Command(
        "report",
        tr_noop("Save a &report…"),
        "help.save_report",
        "",
        tr_noop("Pack the journal and versions for a bug report"),
    ),
)
Actions = dict[str, QAction]


def make_actions(window: QMainWindow) -> Actions:
    """All actions by name, with shortcuts that work wherever the focus is in ``window``."""
    made: Actions = {}
    for command in COMMANDS:
        # An icon in the menu would take the place of a switch's tick.
        action = QAction(tr(command.text), window, checkable=command.switch, iconVisibleInMenu=False)
        action.setObjectName(command.name)
        action.setShortcuts([QKeySequence(k) for k in command.keys.split()])
        if command.everywhere:
            action.setShortcutContext(Qt.ShortcutContext.ApplicationShortcut)
        if command.short:
            action.setIconText(tr(command.short))
        keys = f" ({command.keys.split()[0]})" if command.keys else ""
        action.setToolTip(f"{tr(command.tip) or tr(command.text).replace('&', '').rstrip('…')}{keys}")
        made[command.name] = action
        window.addAction(action)
    return made


def connect_actions(actions: Actions, parts: object) -> None:
    """Let every action call the slot of its command, which is one of ``parts``'."""
    for command in (row for row in COMMANDS if row.slot):
        slot: Callable[..., object] = attrgetter(command.slot)(parts)
        if command.name in MARKS:
            slot = partial(slot, command.name)
        if command.switch:
            actions[command.name].toggled.connect(slot)
        else:
            actions[command.name].triggered.connect(lambda _=False, s=slot: s())


def colour_icons(actions: Actions, colours: Colours) -> None:
    """Draw the icons in the theme's colours."""
    for name, action in actions.items():
        if glyphs(colours.text).elementExists(name):
            action.setIcon(icon(name, colours.text, colours.faint))
