"""No text of the window escapes translation: its source is read, and it is seen in a language that marks every text.

That language is made as any other, by Qt's lupdate and lrelease, and is a third longer than English.
"""

import ast
import html
import re
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import closing
from functools import cache
from itertools import product
from pathlib import Path

import pytest
from PySide6.QtCore import QLocale, QSettings, Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QComboBox,
    QDialog,
    QDockWidget,
    QDoubleSpinBox,
    QGroupBox,
    QLabel,
    QLineEdit,
    QListWidget,
    QMenu,
    QPlainTextEdit,
    QTableView,
    QTableWidget,
    QTabWidget,
    QWidget,
)

from kochab.attitude import ESTIMATORS
from kochab.core.errors import KochabError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction
from kochab.detection import DETECTORS
from kochab.folders import data_folder
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.protocols import lx200, require
from kochab.identification import IDENTIFIERS
from kochab.lab.laboratory.comparison import in_words
from kochab.polar.report import History, report_html
from kochab.server.phone_page import PhonePage
from kochab.text.angle_text import AngleStyle
from kochab.text.translation import in_english, number, speak, tr, tr_n
from kochab.window.application import build, tell_of_language, use_language
from kochab.window.dialogs import tell
from kochab.window.frame.session import WorkflowEngine
from kochab.window.mount.pointing import SyncDialog
from kochab.window.panels.log_panel import LogPanel
from kochab.window.settings import WindowSettings
from kochab.window.shell import help_book
from kochab.window.shell.help_book import pages
from kochab.window.shell.preferences import Preferences
from kochab.window.shell.tour import Tour
from kochab.window.shell.views import VIEWS
from kochab.window.widgets import ElidedLabel
from kochab.workflows.session.alignment import AxisTurnedBy
from kochab.workflows.session.wiring import Wiring
from kochab.workflows.solution_text import summary
from tests.gear.mounts.bench import LIMITS, SITE, simulated
from tests.house import sources, tree
from tests.polar.test_drawings import entry
from tests.translations import collect, markers, release
from tests.window.fakes import FakeEngine, close_windows, fake_solution
from tests.window.mount_bench import connected
from tests.window.polar.test_view import Nights, drive
from tests.window.test_narrow import SCREENS, no_larger_than, resize, whole

MARKERS = {"tr", *markers()}

# -- The sources -------------------------------------------------------------------------------

PLAIN = {
    *("kochab.core.solution", "kochab.frames.export"),  # what is copied or written into a file, the same everywhere
    "kochab.window.display_check",  # what the terminal says
}
"""Modules whose f-strings are no sentences for a window."""
NOT_YET = ()
"""Modules of the window whose texts do not go through the translator yet; the list only gets shorter."""
SHOWS = {
    *("setText", "setToolTip", "setWindowTitle", "setPlaceholderText", "setAccessibleName", "setAccessibleDescription"),
    *("setTitle", "setPrefix", "setSuffix", "setSpecialValueText", "setStatusTip", "setIconText", "setTabText"),
    *("addItem", "addMenu", "addAction", "addTab", "showMessage", "drawText", "draw_text", "QLabel", "QPushButton"),
    *("QAction", "QGroupBox", "label", "button", "switch", "named", "text_field", "number_field", "value_label"),
    *(
        "choice_box",
        "narrow_box",
        "tab_pages",
        "form",
        "show_text",
        "tell",
        "say",
        "StreamStatus",
        "TrialCell",
        "Command",
    ),
}
"""What shows a text that it is given."""
SILENT = {
    *("setObjectName", "setProperty", "property", "setStyleSheet", "getLogger", "TypeVar", "QKeySequence", "findChild"),
    *("info", "warning", "debug", "error", "exception", "run", "order", "ask", "keep", "text", "table", "flag"),
    *("do", "partial", "setStyle", "find_spec", "getenv", "get", "compile", "Formatter", "getattr", "icon"),
}
"""What shows none: names, settings, and the log, which is English for whoever reads it in a report."""
A_SENTENCE = re.compile(r"[A-Za-z’']{2,},? [a-z]|[A-Z][a-z]+ [a-z]|^&?[A-Z][&a-z]{2,}[…:]?$|^[A-Z]{3,}: ")
A_WORD = re.compile(r"[A-Za-z]{3,}")
NAMES = {
    "kochab.window.themes": {"Base", "Light", "Text"},  # Qt's own names of colours
    "kochab.window.image.object_card": {"Neb"},  # OpenNGC’s kind
    "kochab.window.frame.place_menu": {"Simbad", "Coord", "Radius", "Ident"},  # a page, its words
    "kochab.window.live.pointing_panel": {"Uncertainty", "Age", "Rates", "Frame rate", "Latency", "Lens"},  # keys
    "kochab.window.live.sky_points": {"Catalogue"},  # a type
    "kochab.window.panels.star_table": {"Zubeneschamali"},  # a star, the longest name
    "kochab.window.mount.actions": {"nudge dec"},  # names of actions
    "kochab.window.mount.gamepad": {"nudge dec"},
    "kochab.window.mount.buttons": {"set clock", "set site"},
    "kochab.window.polar.history": {'<p><img src="0" width="0"></p>'},
    "kochab.window.night.page": {'<p><img src="0"></p>'},
}
EVERYWHERE = {"Kochab", "Esc", "Home", "Tab"}  # the program, and what stands on keys
WITHOUT_WINDOW = (
    "kochab.cli.",
    "kochab.lab.",
    "kochab:",
    "kochab.identification.",
    "kochab.simulate.",
    "kochab.server.",
    "kochab.workflows.astrometry_tables:",  # of other programs' command lines and web pages
    "kochab.workflows.other_solvers:",
)
"""Rooms whose errors reach the terminal, or a window only in the Laboratory and in practice."""
WITHOUT_QT = {"kochab.window.display_check"}  # says on the terminal that there is no window


def parsed(module: str, text: str) -> ast.Module:
    """A module as Python reads it, or a text that only says that it is one."""
    return tree(module) if sources().get(module) == text else ast.parse(text)


def escapes(module: str, text: str) -> Iterator[str]:
    """Texts of a module of the window that people may read and that no translator sees."""
    whole = parsed(module, text)
    above = {id(c): n for n in ast.walk(whole) for c in ast.iter_child_nodes(n)}
    for node in ast.walk(whole):
        said = words_of(node)
        if said is None or isinstance(above[id(node)], ast.JoinedStr | ast.FormattedValue | ast.Expr):
            continue
        call, chain, inside = None, [], node
        while (inside := above.get(id(inside))) is not None:
            chain.append(inside)
            if call is None and isinstance(inside, ast.Call):
                call = inside.func.attr if isinstance(inside.func, ast.Attribute) else getattr(inside.func, "id", "")
        first = chain[0]
        if (call in MARKERS and not isinstance(node, ast.JoinedStr)) or isinstance(
            first, ast.Subscript | ast.Compare | ast.arg | ast.FunctionDef | ast.Assert
        ):
            continue
        if any(isinstance(one, ast.Raise) for one in chain) or (call in SHOWS and call not in SILENT):
            wrong = A_SENTENCE.search(said) or (call in {"setText", "addItem"} and A_WORD.search(said))
        else:
            wrong = A_SENTENCE.search(said) and call not in SILENT
        if wrong and said not in EVERYWHERE | NAMES.get(module, set()):
            yield f"{module}:{node.lineno}: {said!r}"


def words_of(node: ast.AST) -> str | None:
    """The words of a literal, an f-string's without its values."""
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "0" for part in node.values)
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def window_sources() -> dict[str, str]:
    return {name: text for name, text in sources().items() if name.startswith("kochab.window.")}


def test_every_text_of_the_window_is_marked():
    found = [
        one
        for name, text in window_sources().items()
        if name not in NOT_YET and name not in WITHOUT_QT
        for one in escapes(name, text)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "line",
    [
        'made.setText("Ready")',
        'made.setText("waiting")',
        'button("&Open…", act)',
        'TIP = "Open the port. Nothing moves."',
        'raise UsageError(f"Enter both in {place}.")',
        'show_text(made, f"Saved in {path.name}", "muted")',
        'rows = {"Field of view": field}',
    ],
)
def test_a_text_that_is_not_marked_is_found(line):
    assert list(escapes("made.up", line))


@cache
def marked() -> tuple[tuple[str, ast.Call], ...]:
    """Each text that a translator sees, and where it stands."""
    return tuple(
        (f"{name}:{node.lineno}", node)
        for name in sources()
        for node in ast.walk(tree(name))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in MARKERS and node.args
    )


def test_every_place_of_a_text_is_given_its_value():
    """A text whose place has no value would fail where it is shown."""
    for where, call in marked():
        given = {word.arg for word in call.keywords}
        if call.func.id == "tr_n":
            assert all(isinstance(text, ast.Constant) for text in call.args[:2]), where
        if call.func.id == "tr_noop" or not given or None in given:
            continue
        texts = [a.value for a in call.args[: 1 + (call.func.id == "tr_n")] if isinstance(a, ast.Constant)]
        for text in texts:
            asked = set(re.findall(r"\{(\w+)", text.replace("{{", "")))
            assert asked <= given | {"n"}, where
            assert given <= asked, where


def test_no_marked_text_is_put_together():
    """lupdate reads literals alone: tr(f"…") and tr("a" + b) would never reach a translator."""
    glued = {where for where, call in marked() if isinstance(call.args[0], ast.JoinedStr | ast.BinOp)}
    assert not {where for where in glued if not where.startswith(WITHOUT_WINDOW)}


GLUED = re.compile(r"[A-Za-z’']{2,} [a-z]{2,} [a-z]|[A-Z][a-z]+ [a-z]+ ")
FOR_DEVELOPERS = {"ValueError", "TypeError", "AttributeError", "RuntimeError", "LookupError"}


def glued_sentences(module: str, text: str) -> Iterator[str]:
    """Sentences that an f-string puts together from pieces of English."""
    whole = parsed(module, text)
    above = {id(c): n for n in ast.walk(whole) for c in ast.iter_child_nodes(n)}
    for node in ast.walk(whole):
        around = above.get(id(node))
        if not isinstance(node, ast.JoinedStr) or isinstance(around, ast.FormattedValue):
            continue
        inside_error = isinstance(around, ast.Call) and getattr(around.func, "id", "") in FOR_DEVELOPERS
        if GLUED.search(words_of(node)) and not inside_error:
            yield f"{module}:{node.lineno}: {words_of(node)!r}"


WHOLE = re.compile(r"^[A-Z][^\n]*[a-z’']{2,} [a-z]{2,}[^\n]*[.!?]$")


def bare_sentences(module: str, text: str) -> Iterator[str]:
    """Whole sentences that no translator sees, but for docstrings and what is logged."""
    whole = parsed(module, text)
    above = {id(c): n for n in ast.walk(whole) for c in ast.iter_child_nodes(n)}
    for node in ast.walk(whole):
        around = above.get(id(node))
        if not isinstance(node, ast.Constant) or isinstance(around, ast.Expr | ast.JoinedStr):
            continue
        inside = around
        while inside is not None and not isinstance(inside, ast.Call):
            inside = above.get(id(inside))
        call = "" if inside is None else getattr(inside.func, "attr", getattr(inside.func, "id", ""))
        if WHOLE.search(words_of(node) or "") and call not in MARKERS | FOR_DEVELOPERS | LOGS:
            yield f"{module}:{node.lineno}: {node.value!r}"


LOGS = {"add", "info", "warning", "debug", "error", "exception"}


@pytest.mark.parametrize(
    ("escaping", "line"),
    [
        (glued_sentences, 'why = f"The mount is {far} off the target."'),
        (bare_sentences, 'why = "The mount is off the target."'),
    ],
)
def test_no_sentence_that_a_window_shows_is_put_together_or_bare(escaping, line):
    below = {name: text for name, text in sources().items() if not f"{name}:".startswith(WITHOUT_WINDOW)}
    found = [one for name, text in below.items() for one in escaping(name, text) if name not in PLAIN]
    assert not found, "\n".join(found)
    assert list(escaping("made.up", line))


# -- A language that marks every text ----------------------------------------------------------

LONGER = 0.35


def pseudo(text: str) -> str:
    """Every stretch of words between marks and a third longer; what stands in its places stays outside the marks."""
    parts = re.split(r"(\{[^{}]*\})", text)
    return "".join(longer(p) if re.search(r"[^\W\d_]", p) and p[0] != "{" else p for p in parts)


def longer(words: str) -> str:
    more = round(LONGER * len(words))  # in words of eight letters, or a long sentence could not be wrapped
    return f"«{words}{'~~~~~~~~ ' * (more // 9)}{'~' * (more % 9)}»"


@pytest.fixture(scope="module")
def pseudo_language(tmp_path_factory):
    folder = tmp_path_factory.mktemp("translations")
    file = folder / "kochab_eo.ts"
    collect(file)
    tree = ET.parse(file)
    for message in tree.iter("message"):
        text, given = message.findtext("source"), message.find("translation")
        given.attrib.pop("type", None)
        if message.get("numerus") == "yes":
            for k, form in enumerate(given.iter("numerusform")):
                form.text = pseudo(message.findtext("comment") if k else text)
        else:
            given.text = pseudo(text)
    tree.write(file, encoding="utf-8")
    release(file)
    return folder, {message.findtext("source") for message in tree.iter("message")}


@pytest.fixture
def abroad(qapp, pseudo_language):
    before = QLocale()
    use_language(qapp, "eo", pseudo_language[0])
    yield
    speak()
    QLocale.setDefault(before)


def test_lupdate_collects_every_marked_text(pseudo_language):
    literal = [(where, call.args[0].value) for where, call in marked() if isinstance(call.args[0], ast.Constant)]
    assert len(literal) > 1000
    assert not [(where, text) for where, text in literal if text and text not in pseudo_language[1]]


def test_texts_plurals_and_numbers_of_a_language(abroad):
    assert tr("Solve the rest") == pseudo("Solve the rest")
    assert tr("Fit {percent} %", percent=number(12.5, ".1f")) == "«Fit ~~»12,5 %".replace("~~", "~")
    one, many = "{n} star identified, {named} with a name", "{n} stars identified, {named} with a name"
    assert tr_n(one, many, 1, named=0).startswith("1« star identified")
    assert tr_n(one, many, 12, named=0).startswith("12« stars identified")
    with in_english():
        assert tr_n(one, many, 1, named=0) == "1 star identified, 0 with a name"
        assert number(12.5, ".1f") == "12.5"
    assert "«" not in summary(fake_solution(600, 400), AngleStyle.SEXAGESIMAL)  # copied: the same everywhere


@pytest.mark.parametrize(
    ("wanted", "told"), [("eo", "Esperanto"), ("de", "German"), ("en", ""), ("en_GB", ""), ("qq", "qq")]
)
def test_a_language_without_a_file_is_told_once(qapp, tmp_path, wanted, told):
    without = use_language(qapp, wanted, tmp_path)
    assert without == told
    settings = WindowSettings(QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat))
    said = []
    for _ in range(2):  # two starts
        tell_of_language(said.append, settings, without)
    assert said == ([f"Kochab has no {told} texts yet. It stays in English."] if told else [])


def test_a_language_that_is_there_is_not_told(qapp, pseudo_language):
    before = QLocale()
    assert use_language(qapp, "eo", pseudo_language[0]) == ""
    speak()
    QLocale.setDefault(before)


def test_without_a_language_all_stays_english(qapp, tmp_path):
    use_language(qapp, "eo", tmp_path)
    assert tr("Solve the rest") == "Solve the rest"
    assert number(12.5, ".1f") == "12.5"
    assert QLocale().decimalPoint() == "."


ALLOWED = re.compile(
    r"""
    Kochab | mm | µm | new                                     # units, and what stands for the telescope of practice
    | M | Vega | HIP | h | m | s | J                                                      # examples of names and places
    | (F|Ctrl|Alt|Shift|Esc|Tab|Home|Space|Return)(\+\w+|\d+)? | Left | Right      # names of keys
  """,
    re.VERBOSE,
)


SEEN: list[object] = []


@pytest.fixture(autouse=True)
def widgets_stay_in_sight():
    """PySide 6.7 treats a widget as deleted when nothing holds a reference to the objects through which it was reached."""
    yield
    SEEN.clear()


def texts(top: QWidget) -> Iterator[tuple[str, str]]:
    """Every text of a widget and of what it holds: shown, in tips, menus and lists, and read by a screen reader."""
    widgets = [top, *top.findChildren(QWidget)]
    SEEN.extend((w, w.parent()) for w in widgets)
    for w in widgets:
        if isinstance(w, LogPanel) or w.objectName().startswith(("qt_", "Scroll")):  # Qt's own
            continue
        kind = f"{type(w).__name__} {w.objectName() or w.accessibleName()}"
        if not (isinstance(w.parent(), QAbstractSpinBox | QComboBox)):
            yield kind, w.accessibleName()
            yield kind, w.accessibleDescription()
            yield kind, w.toolTip()
        yield kind, w.windowTitle() if w.isWindow() else ""
        if isinstance(w, QLabel | QAbstractButton):
            yield kind, w.text()
        if isinstance(w, QPlainTextEdit) and not any(log.isAncestorOf(w) for log in top.findChildren(LogPanel)):
            yield from ((kind, line) for line in w.toPlainText().splitlines())
        if isinstance(w, QLineEdit):
            yield kind, w.placeholderText()
        if isinstance(w, QGroupBox):
            yield kind, w.title()
        if isinstance(w, QDockWidget):
            yield kind, w.windowTitle()
        if isinstance(w, QDoubleSpinBox):
            yield kind, f"{w.prefix()}{w.suffix()}{w.specialValueText()}"
        if isinstance(w, QComboBox):
            yield from ((kind, w.itemText(i)) for i in range(w.count()))
        if isinstance(w, QListWidget):
            yield from ((kind, w.item(i).text()) for i in range(w.count()))
        if isinstance(w, QTabWidget):
            yield from ((kind, w.tabText(i)) for i in range(w.count()))
            yield from ((kind, w.tabToolTip(i)) for i in range(w.count()))
        if isinstance(w, QTableView) and w.model() is not None:
            model, across = w.model(), Qt.Orientation.Horizontal
            yield from ((kind, str(model.headerData(i, across))) for i in range(model.columnCount()))
        if isinstance(w, QTableWidget):
            cells = (w.item(r, c) for r in range(w.rowCount()) for c in range(w.columnCount()))
            yield from ((kind, cell.text()) for cell in cells if cell)
        if isinstance(w, QMenu):
            yield kind, w.title()
        for action in w.actions():
            yield kind, action.text()
            yield kind, action.toolTip()
            yield kind, action.iconText()


def unmarked(top: QWidget, names: set[str] = frozenset()) -> list[str]:
    """Texts with words that no translator saw, but for ``names``."""
    found = {}
    for where, text in texts(top):
        left = text
        while "«" in left:
            left, before = re.sub("«[^«»]*»", " ", left), left
            if left == before:
                break
        for folder in (Path(__file__).parents[2], Path.home()):
            left = left.replace(str(folder), "//") if " " in str(folder) else left
        left = re.sub(r"\S*[/\\]\S*[/\\]\S*", " ", left)  # a path
        for name in sorted(names, key=len, reverse=True):
            left = left.replace(name, " ")
        words = [word for word in re.findall(r"[A-Za-zµ]{2,}(?:[+]\w+)?", left) if not ALLOWED.fullmatch(word)]
        if words:
            found[text] = f"{where}: {text!r}: {words}"
    return list(found.values())


NAMES_SHOWN = {
    *(
        "orion.fits",
        "sample.fits",
        "A sample",
        "To try",
        "Flame Nebula",
        "Orion's Belt",
        "Orion",
    ),  # of files, samples and the sky
    *map(
        in_words, (*IDENTIFIERS, *DETECTORS, *ESTIMATORS)
    ),  # as on the command line, and beside it without underscores
    *IDENTIFIERS,
    *DETECTORS,
    *ESTIMATORS,
}


@pytest.fixture
def solved_abroad(qtbot, abroad, make_window, engine, a_file):
    window, commands = make_window(engine)
    with qtbot.waitSignal(commands.session.idle):
        commands.files.open(a_file)
    window.setUpdatesEnabled(False)  # texts and their room are no matter of painting
    return window, commands


def test_every_text_of_every_mode_is_translated(qtbot, solved_abroad):
    window, commands = solved_abroad
    for mode in ("image", "details", *VIEWS):
        commands.views.show(mode)
        if mode != "image":
            qtbot.waitUntil(lambda mode=mode: commands.views.docks[mode].view is not None)
        left = unmarked(window, NAMES_SHOWN)
        assert not left, "\n".join([mode, *left])


# -- Dialogs, a connected mount, an alignment that runs -----------------------------------------


def dialogs_of(window: QWidget) -> list[QWidget]:
    return [w for w in [*window.findChildren(QDialog), *window.findChildren(Tour)] if w.isVisible()]


NEAR_ORION = (86.0, -1.5)  # RA and Dec of date, near the fake engine's answer
DIALOGS = {
    "Preferences": lambda c: c.tools.show_preferences(),
    "keyboard": lambda c: c.actions["keys"].trigger(),
    "about": lambda c: c.actions["about"].trigger(),
    "search": lambda c: c.tools.search(),
    "help": lambda c: c.help.show(),
    "results": lambda c: c.files.show_results(),
    "atlas": lambda c: c.tools.show_atlas(),
    "a sentence": lambda c: tell(c.window, tr("Results"), tr("no profile")),
}


QT_TRANSLATES = {"Close", "OK"}  # on its own buttons
MOUNTS_SHOWN = {"Meade LX200 classic", "On-Step", "AVX", "SynScan EQ6", "iOptron CEM40", "Sky-Watcher"}


@pytest.fixture
def help_abroad():
    """The titles of the help book are kept for the program's life."""
    pages.cache_clear()
    yield
    pages.cache_clear()


def test_every_text_of_every_dialog_is_translated(qtbot, solved_abroad, help_abroad):
    window, commands = solved_abroad
    for open_dialog in DIALOGS.values():
        open_dialog(commands)
        (dialog,) = dialogs_of(window)
        if isinstance(dialog, Preferences):
            qtbot.waitUntil(lambda dialog=dialog: dialog.folders.data.text() != "")
        left = unmarked(dialog, NAMES_SHOWN | QT_TRANSLATES | {page.title for page in pages()})
        assert not left, "\n".join(left)
        qtbot.wait(50)
        assert cut(dialog) == []
        dialog.close()


def test_every_card_of_the_tour_is_translated(qtbot, solved_abroad):
    window, commands = solved_abroad
    commands.help.show_tour()
    (tour,) = dialogs_of(window)
    for card in range(len(tour.cards)):
        left = unmarked(tour, NAMES_SHOWN)
        assert not left, "\n".join(left)
        assert cut(tour) == []
        (tour.skip if card == len(tour.cards) - 1 else tour.next).click()


@pytest.mark.parametrize("driver", ["lx200", "onstep", "nexstar", "synscan", "ioptron", "skywatcher"])
def test_every_text_of_a_connected_mount_is_translated(qtbot, solved_abroad, driver):
    window, commands = solved_abroad
    with connected(qtbot, commands, driver, at=NEAR_ORION) as mount:
        names = NAMES_SHOWN | MOUNTS_SHOWN
        left = unmarked(window, names)
        assert not left, "\n".join(left)

        def fits() -> None:
            resize(qtbot, window, 1024, 700)
            assert (window.width(), window.height()) == (1024, 700)

        qtbot.waitUntil(fits)  # what was there before the mount answered may be wider
        assert cut(window) == []
        assert whole(window, mount.view.stop)
        if Ability.SYNC not in mount.opening.guard.lacks:
            mount.view.buttons.sync.click()
            qtbot.waitUntil(lambda: bool(window.findChildren(SyncDialog)))
            (dialog,) = window.findChildren(SyncDialog)
            left = unmarked(dialog, names)
            dialog.reject()
            assert not left, "\n".join(left)


# -- A small window in a language a third longer ------------------------------------------------


def cut(top: QWidget) -> list[str]:
    """Labels and buttons that are seen and narrower, or lower, than their text."""
    found = []
    for w in top.findChildren(QLabel) + top.findChildren(QAbstractButton):
        if not w.isVisible() or w.visibleRegion().isEmpty() or isinstance(w, ElidedLabel) or not w.text():
            continue
        wraps = isinstance(w, QLabel) and w.wordWrap()
        if (not wraps and w.width() < w.minimumSizeHint().width()) or (
            wraps and w.height() < w.heightForWidth(w.width())
        ):
            found.append(f"{type(w).__name__} {w.text()!r}: {w.width()} x {w.height()}, {w.sizeHint().toTuple()}")
    return found


def test_a_longer_language_fits_1024_by_700_beside_the_welcome_page(qtbot, abroad, make_window):
    """Live and the Laboratory asked for 1,167 and 1,257 px there."""
    window, commands = make_window(FakeEngine())
    for mode in VIEWS:
        commands.views.show(mode)
        qtbot.waitUntil(lambda mode=mode: commands.views.docks[mode].view is not None)
        for _ in range(2):
            resize(qtbot, window, 1024, 700)
        assert (window.width(), window.height()) == (1024, 700), mode
        left = cut(window)
        assert not left, "\n".join([mode, *left])


def test_a_longer_language_is_whole_on_1024_by_700(qtbot, solved_abroad):
    window, commands = solved_abroad
    panes, card = window.workspace, window.workspace.card
    for mode in ("image", "details", *VIEWS):
        commands.views.show(mode)
        if mode in VIEWS:
            qtbot.waitUntil(lambda mode=mode: commands.views.docks[mode].view is not None)
        for _ in range(2):
            resize(qtbot, window, 1024, 700)
        assert (window.width(), window.height()) == (1024, 700), mode
        room = window.pages.currentWidget()
        first = (room.number if mode == "polar" else room.card, room.strip) if mode in ("polar", "mount") else ()
        first = (room,) if mode == "last_night" else first
        for shown in first or (card, card.ra, card.dec, panes.buttons):
            assert whole(window, shown), (mode, shown)
        left = cut(window)
        assert not left, "\n".join([mode, *left])
        if mode in VIEWS:
            inside = commands.views.docks[mode].side.area
            assert inside.widget().minimumSizeHint().width() <= inside.viewport().width(), f"{mode} is cut at the right"


def test_a_longer_language_needs_no_more_than_a_small_screen_at_any_scale(qtbot, solved_abroad):
    window, commands = solved_abroad
    for screen, mode in product(SCREENS, ("image", "details", *VIEWS)):
        resize(qtbot, window, *screen)
        commands.views.show("image")
        commands.views.show(mode)
        no_larger_than(qtbot, window, screen)


def test_what_is_cut_is_found(qtbot):
    page = QWidget()
    qtbot.addWidget(page)
    for made in (QLabel("one line that is long", page), QLabel("many lines", page, wordWrap=True)):
        made.setFixedSize(30, 12)
    page.show()
    assert len(cut(page)) == 2


# -- An alignment that runs ---------------------------------------------------------------------


@pytest.fixture
def aligning(qtbot, abroad, settings):
    """The polar view over a practice telescope in the marked language."""
    wiring = Wiring(practice=Nights(), phone_page=PhonePage)
    window, commands = build(WorkflowEngine(), settings, [], wiring)
    qtbot.addWidget(window)
    window.resize(1360, 860)
    window.show()
    commands.views.show("polar")
    yield window, commands
    close_windows(commands)


def test_every_text_of_an_alignment_from_start_to_end_is_translated(qtbot, aligning):
    _, commands = aligning
    view = commands.views.docks["polar"].view
    view.setup.frames.exposure.setValue(1.0)
    view.setup.axis.hand.setCurrentText(tr(AxisTurnedBy.PERSON))
    seen, obeyed, left = set(), [], {}
    view.window().setUpdatesEnabled(False)  # half of all the work, and texts are read all the same
    view.begin()

    def person():
        state = view.alignment.state
        if (now := (state.stage, re.sub(r"\d+", "", state.words))) not in seen:
            seen.add(now)
            left.update(dict.fromkeys(unmarked(view, NAMES_SHOWN), state.stage))
        asked = state.turn_instruction or state.instruction
        if state.hand_needed and not any(asked is one for one in obeyed):
            obeyed.append(asked)
            view.buttons.turn_for_me.click()

    drive(view, person)
    left.update(dict.fromkeys(unmarked(view, NAMES_SHOWN), view.alignment.state.stage))
    assert view.alignment.state.stage == "done", view.message.text()
    assert {"measure", "adjust", "done"} <= {stage for stage, _ in seen}
    assert not left, "\n".join(f"{stage}: {text}" for text, stage in left.items())


def test_every_text_of_a_practice_mount_is_translated(qtbot, aligning):
    _, commands = aligning
    commands.views.practise()
    view, left = commands.views.docks["mount"].view, []
    for act, done in (
        (lambda: None, lambda known: known.report is not None),
        (view.buttons.take.click, lambda known: known.sight is not None),
        (lambda: view.orders.nudge(Direction.NORTH, 60.0), lambda known: not known.slewing),
        (view.buttons.diagnose.click, lambda known: not known.busy),
    ):
        act()
        qtbot.waitUntil(lambda done=done: done(view.control.known) and not view.control.known.busy)
        left += unmarked(view, NAMES_SHOWN | MOUNTS_SHOWN | {"rig"})  # the card names tonight's sky
    assert not left, "\n".join(left)
    view.control.disconnect_mount()
    qtbot.waitUntil(lambda: view.control.known.phase == "off")


def test_what_a_guard_and_a_driver_refuse_is_translated(qtbot, abroad):
    with simulated("onstep") as bench:
        guard = Guard(bench.open(), SITE, LIMITS, bench.clock)
        here = guard.position()
        told = []
        for act in (
            lambda: guard.goto(here.ra_deg, -80.0),
            lambda: guard.move(Direction.NORTH, 1.0, 1e6),
            lambda: guard.pulse(Direction.NORTH, 0),
            lambda: lx200.parse_dec(b"nothing"),
            lambda: require(False, b"1", "time"),
        ):
            with pytest.raises(KochabError) as error:
                act()
            told.append(str(error.value))
        guard.close()
    with simulated("onstep") as bench, closing(bench.open()) as mount:
        here = mount.position()
        with pytest.raises(RefusedError) as refused:
            mount.goto((here.ra_deg + 180.0) % 360.0, -80.0)  # which no guard asked about
        told.append(str(refused.value))
    for text in told:
        assert not unmarked(QLabel(text), NAMES_SHOWN | {"nothing"}), text


# -- Pages for a browser ------------------------------------------------------------------------


def texts_of_a_page(page: str) -> list[str]:
    """What a person reads of HTML: its text, and what attributes hold for a screen reader or for its script."""
    page = re.sub(r"<(style|script)>.*?</\1>", "", page, flags=re.DOTALL)
    shown = re.findall(r"""aria-label="([^"]*)"|data-\w+="([^"]*)"|>([^<>]+)""", page)
    return [html.unescape(text) for found in shown for text in found if text.strip()]


def test_the_report_and_the_phone_page_are_translated(qtbot, abroad):
    measured = [entry(altitude=300.0, azimuth=400.0), entry("instruction", text=tr("Log")), entry(minute=3.0)]
    report = report_html(History(site=Site(-33.4567, 151.2, 100.0), entries=measured))
    phone = PhonePage("token").answer("/token/")[1].decode()
    for page, least in ((report, 25), (phone, 3)):
        told = texts_of_a_page(page)
        assert len(told) >= least
        left = [one for text in told for one in unmarked(QLabel(text), {"UTC", "min"})]
        assert not left, "\n".join(left)


def test_a_help_page_of_the_persons_language_is_shown_in_place_of_the_english(
    qtbot, abroad, help_abroad, tmp_path, monkeypatch
):
    shutil.copytree(data_folder("resources") / "help", tmp_path / "help")
    (tmp_path / "help" / "eo").mkdir()
    (tmp_path / "help" / "eo" / "4-live.md").write_text("# Rekte\n\nBildoj unu post la alia.\n", encoding="utf-8")
    monkeypatch.setattr(help_book, "data_folder", lambda name: tmp_path)
    book = help_book.HelpBook(None)
    qtbot.addWidget(book)
    book.turn_to("live")
    assert book.list.currentItem().text() == "Rekte"
    assert "unu post la alia" in book.browser.toPlainText()
    book.turn_to("mount")
    assert book.list.currentItem().text() == "Mount"
