"""Everything that can be done, as actions in menus and on the toolbar."""

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow

from app.ui.glyphs import GLYPHS, icon
from app.ui.palette import Colours


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
    Spec("open", "&Open…", "Ctrl+O", "Open a frame", short="Open"),
    Spec("clear_recent", "&Clear this list"),
    Spec("quit", "&Quit", "Ctrl+Q"),
    Spec("solve", "&Solve again", "F5 Ctrl+R", "Solve the open frame again", short="Solve"),
    Spec("cancel", "&Cancel", "Esc", "Stop what is under way", short="Cancel"),
    Spec("fit", "&Fit to window", "0 Ctrl+0", "Show the whole frame", short="Fit"),
    Spec("one", "&Actual pixels", "1 Ctrl+1", "One pixel of the frame to one of the screen",
         short="1:1"),
    Spec("in", "Zoom &in", "+ = Ctrl++", "Larger", short="In"),
    Spec("out", "Zoom &out", "- Ctrl+-", "Smaller", short="Out"),
    Spec("stretch", "Automatic &stretch", "T", "Make faint stars visible", True, "Stretch"),
    Spec("colour", "&Colour", "C", "Colour or mono", True, "Colour"),
    Spec("detected", "&Detected stars", "D", "Circle every detected star", True, "Detected"),
    Spec("identified", "&Identified stars", "I", "Circle identified stars", True, "Identified"),
    Spec("names", "&Names", "N", "Name or number of identified stars", True, "Names"),
    Spec("grid", "RA/Dec &grid", "G", "Lines of right ascension and declination", True, "Grid"),
    Spec("centre", "&Centre cross", "X", "The middle of the frame", True, "Centre"),
    Spec("compass", "North and &east arrows", "E", "Where north and east are", True, "N/E"),
    Spec("night", "Ni&ght", "Ctrl+N", "Red light only, for dark-adapted eyes", True, "Night"),
    Spec("fill", "Tool fills the &window", "Shift+F11", "Hide the frame beside an open tool", True),
    Spec("full", "F&ull screen", "F11", "", True),
    Spec("log", "&Log", "Ctrl+L", "What happened, and a report to copy", True),
    Spec("copy", "Copy &RA/Dec", "Ctrl+Shift+C", "Where the frame points, as text", short="Copy"),
    Spec("copy_all", "Copy &everything"),
    Spec("tab_solution", "Solutio&n", "Alt+1"),
    Spec("tab_stars", "Sta&rs", "Alt+2"),
    Spec("tab_hints", "&Hints and methods", "Alt+3"),
    Spec("about", "&About Kochab"),
    Spec("keys", "&Keyboard", "F1"),
)  # fmt: skip
MARKS = ("detected", "identified", "names", "grid", "centre", "compass")


def make_actions(window: QMainWindow) -> dict[str, QAction]:
    """All actions by name, with shortcuts that work wherever the focus is in ``window``."""
    made: dict[str, QAction] = {}
    for spec in SPECS:
        action = QAction(spec.text, window)
        action.setObjectName(spec.name)
        action.setCheckable(spec.switch)
        action.setIconVisibleInMenu(False)  # it would stand where the tick of a switch does
        action.setShortcuts([QKeySequence(k) for k in spec.keys.split()])
        if spec.short:
            action.setIconText(spec.short)
        keys = f" ({spec.keys.split()[0]})" if spec.keys else ""
        action.setToolTip(f"{spec.tip or spec.text.replace('&', '').rstrip('…')}{keys}")
        made[spec.name] = action
        window.addAction(action)
    return made


def dress(actions: dict[str, QAction], colours: Colours) -> None:
    """Draw the icons in the theme's colours."""
    for name, action in actions.items():
        if name in GLYPHS:
            action.setIcon(icon(name, colours.text, colours.faint))


def connect(actions: dict[str, QAction], slots: dict[str, Callable[..., object]]) -> None:
    """Connect by name; switches hand over their state."""
    for name, slot in slots.items():
        action = actions[name]
        if action.isCheckable():
            action.toggled.connect(slot)
        else:
            action.triggered.connect(lambda _=False, s=slot: s())
