"""Help: the book with its pages and what is new, the tour, the keys, the version, and a report of a fault.

A page of a person's language stands in a folder of its name, ``help/de/4-live.md``; one that is not there is English.
"""

import re
from functools import cache
from pathlib import Path
from typing import Any

from PySide6.QtCore import QLocale, QObject, Qt, QUrl
from PySide6.QtGui import QImage, QTextDocument
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QListWidget, QTextBrowser, QWidget

from kochab.core import __version__
from kochab.core.values import frozen
from kochab.folders import data_folder
from kochab.gear.journal import save_report
from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import ask_save, is_red, reddened, save_task, tell, without_icons
from kochab.window.job import Jobs
from kochab.window.settings import WindowSettings
from kochab.window.shell.actions import COMMANDS, NEWS
from kochab.window.shell.main_window import MainWindow
from kochab.window.shell.tour import Tour
from kochab.window.shell.views import VIEWS, Views
from kochab.window.widgets import Part, bring_to_front, column, grid, label, named, row, text_field

PICTURE_PX, LIST_PX = 640, 250


@frozen
class HelpPage:
    """One page: its name, as of the mode that it is about, its title, and its text in Markdown."""

    name: str
    title: str
    text: str

    def has(self, words: str) -> bool:
        """Whether every one of ``words`` is on it."""
        return all(word in self.text.casefold() for word in words.casefold().split())


def _number(page: Path) -> int:
    return int(page.name.partition("-")[0])


@cache
def pages() -> list[HelpPage]:
    """The pages in ``resources/help`` by their numbers, and the changelog."""
    folder = data_folder("resources") / "help"
    own = folder / QLocale().name().partition("_")[0]
    files = [
        p if (p := own / english.name).exists() else english
        for english in sorted(folder.glob("[0-9]*.md"), key=_number)
    ]
    texts = {path.stem.partition("-")[2]: path.read_text(encoding="utf-8") for path in files}
    # In the wheel it stands beside the pages, in a checkout at the root.
    news = next((p for p in (folder / "CHANGELOG.md", folder.parents[1] / "CHANGELOG.md") if p.exists()), None)
    made = [HelpPage(name, text.partition("\n")[0].lstrip("# "), text) for name, text in texts.items()]
    return [*made, HelpPage("news", tr(NEWS), parted(news.read_text(encoding="utf-8")))] if news else made


def parted(text: str) -> str:
    """Markdown with an empty line before every line in bold: after a list it would end the list's last line."""
    return re.sub(r"(?m)^(?=\*\*.+\*\*$)", "\n", text)


class PageBrowser(QTextBrowser):
    """Shows pages; their pictures no wider than a page, and in red light alone at night."""

    def loadResource(self, kind: int, name: QUrl | str) -> Any:
        image = QImage(str(data_folder("resources") / "screenshots" / Path(QUrl(name).path()).name))
        if kind != QTextDocument.ResourceType.ImageResource.value or image.isNull():
            return None
        image = image.scaledToWidth(PICTURE_PX, Qt.TransformationMode.SmoothTransformation)
        return reddened(image) if is_red() else image


class HelpBook(QDialog):
    """A list of pages that a search narrows, and the page that is read."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle(tr("Help"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.search = text_field(tr("Search the help"), tr("Search"))
        self.search.setClearButtonEnabled(False)  # its icon is in no theme's colours
        self.list = named(QListWidget(), tr("Pages"))
        self.list.setFixedWidth(LIST_PX)
        self.none = label(tr("No page has these words."), "muted", wrap=True)
        self.browser = named(PageBrowser(), tr("Page"))
        self.browser.setOpenLinks(False)
        left = column(self.search, self.list, self.none)
        row(left, (self.browser, 1), on=self, spacing=10, margins=(10, 10, 10, 10))
        self.search.textChanged.connect(self._narrow)
        self.search.returnPressed.connect(self.list.setFocus)
        self.list.currentTextChanged.connect(self._read)
        self._narrow("")
        self.resize(1000, 680)

    def turn_to(self, name: str) -> None:
        """Open the page ``name``, else the first."""
        self.search.clear()
        self.list.setCurrentRow(next((row for row, page in enumerate(pages()) if page.name == name), 0))

    def _narrow(self, words: str) -> None:
        fit = [page.title for page in pages() if page.has(words)]
        self.list.clear()
        self.list.addItems(fit)
        self.none.setVisible(not fit)
        self.list.setCurrentRow(0)

    def _read(self, title: str) -> None:
        page = next((page for page in pages() if page.title == title), HelpPage("", "", ""))
        self.browser.setMarkdown(page.text)
        if words := self.search.text().split():
            self.browser.find(words[0])


LEAST_PX = 380  # a minimum of the box itself would keep it from growing with its letters


ABOUT = (
    f"Kochab {__version__}",
    tr_noop("Plate solving, polar alignment and mount control. Nothing to download."),
    tr_noop("Free software under the GNU General Public License, version 3 or later."),
)


KEYS = [
    ("F7", tr_noop("Adjuster display, in Polar alignment")),
    ("Esc", tr_noop("Stop the connected mount, from any view")),
    (tr_noop("Arrows"), tr_noop("Pan the image or chart that has focus")),
    ("Home", tr_noop("Show the whole chart")),
    ("Tab", tr_noop("Next control")),
]


def about_dialog(parent: QWidget) -> QDialog:
    """Version and licence."""
    lines = zip(ABOUT, ("title", "", "muted"), strict=True)
    return _box(parent, tr("About Kochab"), *(label(tr(text), role, wrap=True) for text, role in lines))


def keyboard(parent: QWidget) -> QDialog:
    """Every keyboard shortcut."""
    rows = [(c.keys.replace(" ", ", "), tr(c.text).replace("&", "").rstrip("…")) for c in COMMANDS if c.keys]
    rows += [(mode.key, tr(mode.title).replace("&", "")) for mode in VIEWS.values()]
    rows += [(tr(key), tr(what)) for key, what in KEYS]
    half = (len(rows) + 1) // 2
    lines = ([*rows[i], *(rows[half + i] if half + i < len(rows) else ())] for i in range(half))
    cells = ([label(text, "" if i % 2 else "muted") for i, text in enumerate(line)] for line in lines)
    return _box(parent, tr("Keyboard"), grid(*cells, across=18, down=3))


def _box(parent: QWidget, title: str, *parts: Part) -> QDialog:
    """A dialog of these parts above a button that closes it."""
    box = QDialog(parent)
    box.setWindowTitle(title)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
    without_icons(buttons.buttons())
    buttons.rejected.connect(box.reject)
    column(*parts, row(LEAST_PX, None), buttons, on=box, spacing=12, margins=(20, 20, 20, 16))
    return box


class Help(QObject):
    """Opens what helps a person."""

    def __init__(self, window: MainWindow, views: Views, settings: WindowSettings, jobs: Jobs) -> None:
        super().__init__(window)
        self._window, self._views, self._settings, self._jobs = window, views, settings, jobs
        window.log.report_wanted.connect(self.save_report)

    def show(self, page: str = "") -> None:
        """Open the help book at a page, or at that of the present mode."""
        book = self._window.findChild(HelpBook) or HelpBook(self._window)
        docked = next((name for name in self._views.docked if name in VIEWS), "")
        book.turn_to(page or docked)
        bring_to_front(book)

    def show_news(self) -> None:
        """The help book at what is new."""
        self.show("news")

    def show_tour(self) -> None:
        """Four cards over the window."""
        self._settings.keep("toured", True)
        if self._window.findChild(Tour) is None:
            Tour(self._window)

    def show_about(self) -> None:
        """Version and licence."""
        about_dialog(self._window).open()

    def show_keys(self) -> None:
        """Every keyboard shortcut."""
        keyboard(self._window).open()

    def save_report(self) -> None:
        """Ask where to, and pack the journal, versions and settings there."""
        if (path := ask_save(self._window, Path.home() / "kochab-report.zip", "ZIP (*.zip)")) is not None:
            settings, say = self._settings.as_dict(), self._window.say
            job = self._jobs.run(save_task(lambda: save_report(path, settings), path), "report")
            job.succeeded.connect(lambda p: say(tr("Saved {name}. Attach it to your bug report.", name=p.name)))
            job.failed.connect(lambda sentence: tell(self._window, tr("Report"), sentence))
