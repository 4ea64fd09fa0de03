"""A whole solve by keyboard alone, and what a screen reader is told of every control, asked as it asks."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QAccessible, QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractSpinBox, QComboBox, QDialog, QLabel, QTabBar, QWidget

from kochab.core.solution import Solution
from kochab.window.accessibility import keep_scroll_areas_steady
from kochab.window.shell.views import VIEWS
from kochab.window.widgets import scrolled

CONTROLS = {
    QAccessible.Role.Button,
    QAccessible.Role.ButtonMenu,
    QAccessible.Role.ButtonDropDown,
    QAccessible.Role.CheckBox,
    QAccessible.Role.RadioButton,
    QAccessible.Role.ComboBox,
    QAccessible.Role.EditableText,
    QAccessible.Role.SpinBox,
    QAccessible.Role.Slider,
    QAccessible.Role.List,
    QAccessible.Role.Table,
    QAccessible.Role.Tree,
    QAccessible.Role.PageTabList,
    QAccessible.Role.ProgressBar,
    QAccessible.Role.MenuItem,
}


def nameless(top):
    """Controls in sight, or reached by Tab, that have no name as a screen reader asks for it."""
    found = []
    for widget in [top, *top.findChildren(QWidget)]:
        own = widget.objectName().startswith("qt_") or widget.inherits("QScrollBar")
        if own or not widget.isVisible() or (isinstance(widget, QTabBar) and not widget.count()):
            continue
        asked = QAccessible.queryAccessibleInterface(widget)
        tab = widget.focusPolicy() & Qt.FocusPolicy.TabFocus and widget.isEnabled()
        part = isinstance(widget.parent(), QComboBox | QAbstractSpinBox)
        name, told = (asked.text(what).strip() for what in (QAccessible.Text.Name, QAccessible.Text.Description))
        if isinstance(widget, QLabel) and widget.textFormat() == Qt.TextFormat.PlainText and widget.text() not in name:
            found.append((widget.text(), "is read as", name))
        box = isinstance(widget, QComboBox)  # its name is its choice, as Linux tells it
        if (tab or asked.role() in CONTROLS) and not part and not (told if box else name):
            found.append((widget.metaObject().className(), widget.objectName(), asked.role().name))
    return found


def test_the_welcome_page_has_names(make_window, engine):
    window, _ = make_window(engine)
    assert not nameless(window)


def test_every_control_of_every_mode_has_a_name(qtbot, opened):
    window, commands = opened
    for mode in ("image", "details", *VIEWS):
        commands.views.show(mode)
        if mode != "image":
            qtbot.waitUntil(lambda mode=mode: commands.views.docks[mode].view is not None)
        assert not nameless(window), mode


def test_every_control_of_every_dialog_has_a_name(opened):
    window, commands = opened
    for name in ("preferences", "help", "keys", "about", "tour"):
        commands.actions[name].trigger()
        assert not nameless(window), name
        for tabs in (dialog.tabs for dialog in window.findChildren(QWidget) if dialog.inherits("Preferences")):
            for index in range(tabs.count()):
                tabs.setCurrentIndex(index)
                assert not nameless(tabs), index
        for dialog in window.findChildren(QDialog):
            dialog.close()


def press(window, key, modifier=Qt.KeyboardModifier.NoModifier):
    QTest.keyClick(window.focusWidget() or window, key, modifier)


def test_a_whole_solve_by_keyboard_alone(qtbot, make_window, engine, tmp_path):
    (tmp_path / "sample.fits").touch()
    window, commands = make_window(engine)
    window.activateWindow()
    qtbot.waitUntil(lambda: window.focusWidget() is window.welcome.first)
    for _ in range(20):
        if window.focusWidget() is window.welcome.samples[0]:
            break
        press(window, Qt.Key.Key_Tab)
    with qtbot.waitSignal(commands.session.idle):
        press(window, Qt.Key.Key_Space)
    assert isinstance(commands.session.known.result, Solution)
    card = QAccessible.queryAccessibleInterface(window.workspace.card)
    qtbot.waitUntil(lambda: card.text(QAccessible.Text.Name) == "Orion's Belt in Orion")
    assert "24 stars matched" in card.text(QAccessible.Text.Description)
    press(window, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier)
    assert QGuiApplication.clipboard().text() == "05:36:12.00 -01:12:00.0"
    press(window, Qt.Key.Key_2, Qt.KeyboardModifier.AltModifier)
    press(window, Qt.Key.Key_Down)
    assert commands.presenter.overlay.selected is not None
    press(window, Qt.Key.Key_3, Qt.KeyboardModifier.AltModifier)
    assert window.focusWidget() is window.workspace.hints.fov
    qtbot.keyClicks(window.workspace.hints.fov, "12")
    with qtbot.waitSignal(commands.session.idle):
        press(window, Qt.Key.Key_F5)
    assert engine.asked[-1].hint.scale_arcsec_px is not None


@pytest.mark.parametrize("how", ["Toggle", "Press"])
def test_a_screen_reader_opens_and_closes_a_mode(qtbot, opened, how):
    """Toggle checks the button alone; the menu's own way must still trigger once."""
    window, commands = opened
    action, dock = commands.views.actions["live"], commands.views.docks["live"]
    button = QAccessible.queryAccessibleInterface(window.rail.widgetForAction(action)).actionInterface()
    for isopen in (True, False):
        button.doAction(how)
        qtbot.waitUntil(lambda: dock.isVisible() is isopen and action.isChecked() is isopen)  # noqa: B023
    action.trigger()
    assert dock.isVisible()
    assert action.isChecked()
    button.doAction(how)
    qtbot.waitUntil(lambda: not dock.isVisible())


def test_a_reader_that_counted_the_bars_of_a_scroll_area_may_ask_for_them_when_they_are_gone(qtbot):
    """Asked for the scroll bar that has gone, Qt reads past the end of its list of children."""
    keep_scroll_areas_steady()
    inside = QLabel("\n".join(40 * ["a line"]))
    area = scrolled(inside)
    qtbot.addWidget(area)
    area.resize(200, 100)
    area.show()
    asked = QAccessible.queryAccessibleInterface(area)
    assert area.verticalScrollBar().isVisible()
    counted = asked.childCount()
    inside.clear()
    qtbot.waitUntil(lambda: not area.verticalScrollBar().isVisible())
    assert asked.childCount() == counted
    assert asked.child(counted) is None
    assert asked.role() == QAccessible.Role.Client
    assert asked.child(0).object() is area.viewport()
