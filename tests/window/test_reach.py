"""The keyboard reaches everything, and a screen reader hears what it is."""

from itertools import combinations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import (
    QAbstractButton,
    QComboBox,
    QDialog,
    QLabel,
    QLineEdit,
    QMenu,
    QPlainTextEdit,
    QSlider,
    QTableView,
    QToolButton,
    QWidget,
)

from kochab.window.shell.actions import COMMANDS

REACHABLE = (QAbstractButton, QComboBox, QLineEdit, QPlainTextEdit, QSlider, QTableView)


def tab_stops(qtbot, window):
    """Every widget that the Tab key stops at, round the window once."""
    window.activateWindow()
    start = window.focusWidget() or window
    seen = [start]
    for _ in range(200):
        qtbot.keyClick(window.focusWidget() or window, Qt.Key.Key_Tab)
        now = window.focusWidget()
        if now in seen:
            break
        seen.append(now)
    return seen


def usable(widget):
    own = widget.objectName().startswith("qt_") or widget.inherits("QScrollBar")
    return widget.isVisible() and widget.isEnabled() and not own


def test_tab_stops_at_every_control(qtbot, opened):
    window, commands = opened
    opened[1].views.show("details")
    commands.actions["log"].trigger()
    for tab in range(3):
        window.workspace.tabs.setCurrentIndex(tab)
        stops = tab_stops(qtbot, window)
        missed = [
            w
            for w in window.findChildren(QWidget)
            if isinstance(w, REACHABLE)
            and usable(w)
            and w not in stops
            and not w.inherits("QDockWidgetTitleButton")
            and not isinstance(w.parent(), QComboBox)
            and w.objectName() != "qt_toolbar_ext_button"
            and not w.inherits("QTableCornerButton")
        ]
        assert not missed, [(w.metaObject().className(), w.accessibleName() or w.objectName()) for w in missed]
        assert window.workspace.view in stops


def test_every_control_says_what_it_is(opened):
    window, _ = opened
    opened[1].views.show("details")
    for tab in range(3):
        window.workspace.tabs.setCurrentIndex(tab)
        silent = [
            w
            for w in window.findChildren(QWidget)
            if isinstance(w, REACHABLE)
            and usable(w)
            and not (w.accessibleName() or getattr(w, "text", str)())
            and not isinstance(w.parent(), QComboBox)
            and not w.inherits("QTableCornerButton")
        ]
        assert not silent, [w.metaObject().className() for w in silent]


def test_no_two_actions_share_a_key():
    for a, b in combinations([s for s in COMMANDS if s.keys], 2):
        assert not set(a.keys.split()) & set(b.keys.split()), (a.name, b.name)
    for spec in COMMANDS:
        for key in spec.keys.split():
            assert not QKeySequence(key).isEmpty()


def test_every_action_is_in_a_menu(opened):
    window, commands = opened

    def walk(menu):
        for action in menu.actions():
            if action.menu() is not None:
                yield from walk(action.menu())
            else:
                yield action

    listed = [a for top in window.bar.menus.actions() for a in walk(top.menu())]
    missing = [n for n, a in commands.actions.items() if a not in listed]
    assert missing == []


def mnemonic(text):
    at = text.replace("&&", "").find("&")
    return text.replace("&&", "")[at + 1].lower() if at >= 0 else None


def test_mnemonics_in_a_menu_differ(opened):
    window, _ = opened
    for menu in [*window.findChildren(QMenu), window.bar.menus]:
        letters = [m for a in menu.actions() if (m := mnemonic(a.text()))]
        assert len(letters) == len(set(letters)), (menu.title() if isinstance(menu, QMenu) else "bar", letters)


def test_mnemonics_in_sight_differ(opened):
    window, _ = opened
    opened[1].views.show("details")
    panes = window.workspace
    for tab in range(3):
        panes.tabs.setCurrentIndex(tab)
        texts = [
            b.text() for b in window.findChildren(QAbstractButton) if b.isVisible() and not isinstance(b, QToolButton)
        ]
        texts += [w.text() for w in window.findChildren(QLabel) if w.isVisible() and w.buddy()]
        texts += [panes.tabs.tabText(i) for i in range(3)]
        texts += [a.text() for a in window.bar.menus.actions()]
        letters = sorted(m for t in texts if (m := mnemonic(t)))
        assert len(letters) == len(set(letters)), letters


def test_typing_in_a_field_does_not_set_off_single_key_actions(qtbot, opened):
    window, commands = opened
    window.workspace.tabs.setCurrentIndex(2)
    field = window.workspace.hints.ra
    field.setFocus()
    qtbot.keyClicks(field, "10d")
    assert field.text() == "10d"
    assert not commands.actions["detected"].isChecked()


def test_alt_numbers_change_tabs_and_take_the_focus_along(qtbot, opened):
    window, commands = opened
    for index, name in enumerate(("tab_solution", "tab_stars", "tab_hints")):
        commands.actions[name].trigger()
        assert window.workspace.tabs.currentIndex() == index
    assert window.focusWidget() is window.workspace.hints.fov


def test_full_screen_by_f11_and_escape_leaves_it(qtbot, opened):
    window, _ = opened
    qtbot.keyClick(window, Qt.Key.Key_F11)
    assert window.isFullScreen()
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert not window.isFullScreen()


def test_help_boxes_open_and_close_by_key(qtbot, opened):
    window, _ = opened
    qtbot.keyClick(window, Qt.Key.Key_F1, Qt.KeyboardModifier.ShiftModifier)
    (box,) = [d for d in window.findChildren(QDialog) if d.isVisible()]
    assert any("Ctrl+O" in w.text() for w in box.findChildren(QLabel))
    qtbot.keyClick(box, Qt.Key.Key_Escape)
    assert not [d for d in window.findChildren(QDialog) if d.isVisible()]


@pytest.mark.parametrize("size", ["small", "huge"])
def test_text_size_changes_everything(qtbot, opened, size):
    window, commands = opened
    before = window.bar.doing.fontMetrics().height()
    commands.appearance.use_theme(text_size=size)
    qtbot.waitUntil(lambda: commands.appearance.settled)
    after = window.bar.doing.fontMetrics().height()
    assert (after < before) if size == "small" else (after > before * 1.3)
    commands.appearance.use_theme(text_size="normal")
