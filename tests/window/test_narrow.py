"""A small screen: the window never outgrows it, and nothing on it is lost."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QLabel

from kochab.window.mount.status import MountStatus
from kochab.window.shell.views import VIEWS


def resize(qtbot, window, width, height=600):
    window.resize(width, height)
    qtbot.wait(30)


@pytest.mark.parametrize("name", VIEWS)
def test_a_tool_beside_a_frame_fits_on_1024_by_600(qtbot, opened, name):
    window, commands = opened
    resize(qtbot, window, 1024)
    commands.views.show(name)
    qtbot.wait(50)
    resize(qtbot, window, 1024)
    assert (window.width(), window.height()) == (1024, 600)
    dock = commands.views.docks[name]
    inside = dock.widget()
    assert inside.widget().minimumSizeHint().width() <= inside.viewport().width(), "cut at the right"


def test_where_both_have_no_room_the_frame_stays_and_keys_bring_the_side(qtbot, opened):
    window, commands = opened
    panes = window.workspace
    resize(qtbot, window, 1200)
    assert panes.tabs.isVisible()
    assert panes.view.isVisible()
    commands.views.show("laboratory")
    resize(qtbot, window, 1024)
    assert not panes.tabs.isVisible()
    assert panes.view.isVisible()
    qtbot.keyClick(window, Qt.Key.Key_2, Qt.KeyboardModifier.AltModifier)
    assert panes.tabs.isVisible()
    assert panes.tabs.currentWidget() is panes.stars
    assert not panes.view.isVisible()
    qtbot.keyClick(window, Qt.Key.Key_1, Qt.KeyboardModifier.AltModifier)
    assert panes.tabs.isVisible()
    qtbot.keyClick(window, Qt.Key.Key_1, Qt.KeyboardModifier.AltModifier)
    assert panes.view.isVisible()
    assert not panes.tabs.isVisible()
    commands.views.toggle("laboratory")
    qtbot.waitUntil(panes.tabs.isVisible)
    assert panes.view.isVisible()
    assert panes.tabs.width() >= 320


@pytest.mark.parametrize("letters", ["normal", "huge"])
@pytest.mark.parametrize("name", [None, "mount"])
def test_stop_and_the_pointing_are_whole_however_much_the_status_bar_has_to_say(qtbot, opened, name, letters):
    """At scale 2 the window grew to 1,673 x 700 on a screen of 1024 x 700, and Stop was outside."""
    window, commands = opened
    commands.looks.use_theme(text_size=letters)
    qtbot.waitUntil(lambda: commands.looks.settled)
    if name is not None:
        commands.views.show(name)
    status = MountStatus(commands.services.mount, window)
    status.stop.setVisible(True)
    status.text.setText("Practice mount: centring the target")
    window.status.background.setText("Building the small-field index: 42 %, about 38 s left")
    window.status.place.setText(
        "05h 36m 12.00s  −01° 12′ 00.0″    alt +45.12°  az 123.12°    x 1234.5  y 234.6  value 12345"
    )
    resize(qtbot, window, 1024, 700)
    resize(qtbot, window, 1024, 700)
    assert (window.width(), window.height()) == (1024, 700)
    for shown in (status.stop, window.status.doing):
        assert shown.width() >= shown.sizeHint().width()
        assert shown.visibleRegion().boundingRect() == shown.rect()
    assert "05h 36m" in window.status.doing.text()
    commands.looks.use_theme(text_size="normal")
    qtbot.waitUntil(lambda: commands.looks.settled)


def test_a_side_that_was_away_when_the_window_closed_comes_back(qtbot, opened, make_window, engine):
    window, commands = opened
    commands.views.show("laboratory")
    resize(qtbot, window, 1024)
    assert not window.workspace.tabs.isVisible()
    state = window.workspace.saveState()
    again, _ = make_window(engine)
    again.workspace.restoreState(state)
    again.show_frame_page()
    resize(qtbot, again, 1366)
    assert again.workspace.tabs.isVisible()
    assert again.workspace.tabs.width() >= 320


def test_a_page_that_is_not_seen_takes_no_room(opened):
    window, _ = opened
    wide = window.welcome.minimumSizeHint().width()
    window.welcome.setMinimumWidth(wide + 800)
    assert window.pages.minimumSizeHint() == window.workspace.minimumSizeHint()
    window.pages.setCurrentWidget(window.welcome)
    assert window.pages.minimumSizeHint() == window.welcome.minimumSizeHint()


def test_the_list_of_keys_is_whole_with_huge_letters(qtbot, opened):
    window, commands = opened
    commands.looks.use_theme(text_size="huge")
    qtbot.waitUntil(lambda: commands.looks.settled)
    commands.actions["keys"].trigger()
    (dialog,) = [d for d in window.findChildren(QDialog) if d.isVisible()]
    qtbot.wait(50)
    for text in dialog.findChildren(QLabel):
        assert text.width() >= text.sizeHint().width(), text.text()
    dialog.close()
    widest = max(made.sizeHint().width() for made in window.welcome.samples)
    assert window.welcome._inside.maximumWidth() >= widest
    commands.looks.use_theme(text_size="normal")
    qtbot.waitUntil(lambda: window.welcome._inside.maximumWidth() == 680)
