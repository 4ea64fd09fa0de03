"""The help book: pages with pictures, searchable, from files beside the program; and what is new.

A page of a person's language stands in a folder of its name, ``help/de/4-live.md``; one that is not there is English.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from PySide6.QtCore import QLocale, Qt, QUrl
from PySide6.QtGui import QColor, QImage, QPainter, QTextDocument
from PySide6.QtWidgets import QDialog, QListWidget, QTextBrowser, QWidget

from kochab.core import data_folder, tr
from kochab.window.dialogs import is_red
from kochab.window.shell.menus import NEWS
from kochab.window.widgets import column, label, named, row, text_field

PICTURE_PX, LIST_PX = 640, 250


@dataclass(frozen=True, slots=True)
class HelpPage:
    """One page: its name, as of the mode that it is about, its title, and its text in Markdown."""

    name: str
    title: str
    text: str

    def has(self, words: str) -> bool:
        """Whether every one of ``words`` is on it."""
        return all(word in self.text.casefold() for word in words.casefold().split())


@cache
def pages() -> list[HelpPage]:
    """The pages in ``resources/help`` by their numbers, and the changelog."""
    folder = data_folder("resources") / "help"
    own = folder / QLocale().name().partition("_")[0]
    files = [p if (p := own / english.name).exists() else english for english in sorted(folder.glob("[0-9]*.md"))]
    texts = {path.stem.partition("-")[2]: path.read_text(encoding="utf-8") for path in files}
    # In the wheel it stands beside the pages, in a checkout at the root.
    news = next((p for p in (folder / "CHANGELOG.md", folder.parents[1] / "CHANGELOG.md") if p.exists()), None)
    made = [HelpPage(name, text.partition("\n")[0].lstrip("# "), text) for name, text in texts.items()]
    return [*made, HelpPage("news", tr(NEWS), news.read_text(encoding="utf-8"))] if news else made


class PageBrowser(QTextBrowser):
    """Shows pages; their pictures no wider than a page, and in red light alone at night."""

    def loadResource(self, kind: int, name: QUrl | str) -> Any:
        image = QImage(str(data_folder("resources") / "screenshots" / Path(QUrl(name).path()).name))
        if kind != QTextDocument.ResourceType.ImageResource.value or image.isNull():
            return None
        image = image.scaledToWidth(PICTURE_PX, Qt.TransformationMode.SmoothTransformation)
        if is_red():
            image = image.convertToFormat(QImage.Format.Format_RGB32)
            painter = QPainter(image)
            painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_Multiply)
            painter.fillRect(image.rect(), QColor(255, 0, 0))
            painter.end()
        return image


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
