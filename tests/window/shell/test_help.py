"""The help book, what is new, and the tour of the first start."""

import re

import pytest
from PySide6.QtCore import QPoint, QRect, Qt, QUrl
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QFrame

from kochab import __version__
from kochab.window.shell.actions import COMMANDS, NEWS
from kochab.window.shell.help_book import HelpBook, pages
from kochab.window.shell.tour import CARDS, Tour
from kochab.window.shell.views import VIEWS
from tests.patterns import REPOSITORY
from tests.window.test_night import assert_red

SCREENSHOTS = REPOSITORY / "resources" / "screenshots"


@pytest.fixture
def book(qtbot, opened):
    window, _ = opened
    window.activateWindow()
    qtbot.keyClick(window, Qt.Key.Key_F1)
    return window.findChild(HelpBook)


def test_f1_opens_the_first_page(book):
    assert book.isVisible()
    assert book.browser.toPlainText().startswith("Solve an image")
    files = list((REPOSITORY / "resources" / "help").glob("[0-9]*.md"))
    assert book.list.count() == len(pages()) == len(files) + 1  # and what is new


def test_the_tenth_page_stands_after_the_ninth(tmp_path, monkeypatch):
    (tmp_path / "help").mkdir()
    for number, name in enumerate(("image", "many", "live", "mount", "polar", "lab", "night", "sky", "dome", "moon")):
        (tmp_path / "help" / f"{number + 1}-{name}.md").write_text(f"# {name}\n")
    monkeypatch.setattr("kochab.window.shell.help_book.data_folder", lambda _: tmp_path)
    named = [page.name for page in pages.__wrapped__()]
    assert named == ["image", "many", "live", "mount", "polar", "lab", "night", "sky", "dome", "moon"]


def test_f1_opens_the_page_of_each_mode(qtbot, opened):
    window, commands = opened
    for mode in VIEWS:
        commands.views.show(mode)
        commands.actions["help"].trigger()
        assert window.findChild(HelpBook).list.currentItem().text().lower().startswith(mode.replace("_", " "))


def test_a_search_leaves_the_pages_with_all_words_and_finds_the_first(qtbot, book):
    qtbot.keyClicks(book.search, "horizon MERIDIAN")
    assert [book.list.item(i).text() for i in range(book.list.count())] == ["Mount", NEWS]
    assert book.browser.textCursor().selectedText().lower() == "horizon"
    book.search.setText("qwxyz")
    assert book.none.isVisible()
    assert book.list.count() == 0


def test_what_is_new_is_the_changelog(opened):
    window, commands = opened
    commands.actions["news"].trigger()
    text = window.findChild(HelpBook).browser.toPlainText()
    assert __version__.partition(".dev")[0].partition("+")[0] in text
    lines = text.splitlines()
    assert "Polar alignment" in lines  # it ended the last line of the list before


@pytest.mark.parametrize("page", pages()[:-1], ids=lambda page: page.title)
def test_its_pictures_and_keys_are_those_of_the_program(page):
    """The pictures are those that the scripts of the tests take."""
    assert all((SCREENSHOTS / name).exists() for name in re.findall(r"!\[.*?\]\((.*?)\)", page.text))
    keys = {key for spec in COMMANDS for key in spec.keys.split()} | {mode.key for mode in VIEWS.values()}
    keys |= {"F7", "Esc"}
    named = re.findall(r"\b(?:Ctrl\+(?:Shift\+)?(?:\w+|,)|Alt\+\d|Shift\+F\d+|F\d{1,2})(?!\w)", page.text)
    assert set(named) <= keys


def test_its_pictures_are_shown_and_red_at_night(qtbot, opened):
    window, commands = opened
    commands.appearance.use_theme("night")
    qtbot.waitUntil(lambda: commands.appearance.settled)
    commands.actions["help"].trigger()
    book = window.findChild(HelpBook)
    picture = book.browser.loadResource(QTextDocument.ResourceType.ImageResource.value, QUrl("window.png"))
    assert 0 < picture.width() <= book.browser.width()
    assert_red(book)
    commands.appearance.use_theme("dark")


def test_the_tour_is_four_cards_by_keyboard_once(qtbot, opened):
    window, commands = opened
    window.activateWindow()
    commands.help.show_tour()
    tour = window.findChild(Tour)
    asked = []
    commands.actions["open"].triggered.disconnect()
    commands.actions["open"].triggered.connect(lambda: asked.append("open"))
    for at, (title, *_) in enumerate(CARDS, 1):
        assert (tour.title.text(), tour.count.text()) == (title, f"{at} of 4")
        assert window.rect().contains(tour.geometry())
        target = tour.target()
        box = QRect(target.mapTo(window, QPoint(0, 0)), target.size())
        assert tour.outline.isVisible()
        assert tour.outline.geometry().intersected(box).size() == box.intersected(window.rect()).size()
        assert not tour.geometry().intersects(box), "it stands beside what it speaks of"
        assert asked == []
        qtbot.keyClick(tour.open if at == 4 else tour.next, Qt.Key.Key_Space)
    assert asked == ["open"], "it ends on what comes next"
    qtbot.waitUntil(lambda: window.findChild(Tour) is None)
    qtbot.waitUntil(lambda: not [f for f in window.findChildren(QFrame) if f.objectName() == "outline"])
    assert commands.settings.flag("toured", False)


def test_escape_ends_the_tour(qtbot, opened):
    window, commands = opened
    commands.actions["tour"].trigger()
    qtbot.keyClick(window.findChild(Tour).next, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: window.findChild(Tour) is None)


def test_without_a_frame_the_tour_ends_at_the_button_that_opens_one(make_window, engine):
    """There is no card of an image yet: the second of four cards pointed at nothing."""
    window, commands = make_window(engine)
    commands.help.show_tour()
    tour = window.findChild(Tour)
    for at in (1, 2, 3):
        assert tour.count.text() == f"{at} of 3"
        assert tour.outline.isVisible()
        if at < 3:
            tour.next.click()
    assert tour.target() is window.welcome.first
    tour.skip.click()


def test_the_window_keeps_within_a_small_screen(make_window, engine):
    """At scale 1.5 a screen of 1600 px has 1067: the window was 1360 wide, and hung 293 px out of it."""
    window, _ = make_window(engine)
    window.move(400, 300)
    room = QRect(0, 24, 1067, 696)
    window.keep_within(room)
    assert room.contains(window.frameGeometry())
    size = window.size()
    window.keep_within(room)
    assert window.size() == size
