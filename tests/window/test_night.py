"""Night mode is red light alone: no pixel of the window has any green or blue in it."""

from dataclasses import asdict

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, Qt, QTimer
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QLineEdit, QMenu, QMessageBox, QPushButton, QToolTip

from kochab.core.frame import Frame
from kochab.window.dialogs import ask_frames, ask_save, tell
from kochab.window.shell.preferences import Preferences
from kochab.window.themes import THEMES
from tests.window.fakes import FakeEngine, no_solution, star_field


def colours(widget):
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    bits = np.frombuffer(image.constBits(), np.uint8).copy()  # the image dies with this function
    return bits.reshape(image.height(), image.bytesPerLine() // 4, 4)[:, : image.width(), :3]


def assert_red(widget):
    assert_all_red(colours(widget))


def assert_all_red(bgr):
    assert bgr[..., 2].max() > 150, "nothing is shown"
    wrong = np.argwhere(bgr[..., :2].any(axis=2))
    assert not len(wrong), f"{len(wrong)} px are not red, first at {wrong[0][::-1]}"


@pytest.fixture
def colour_frame():
    grey = star_field()
    tint = np.stack([grey.pixels // 2, grey.pixels, grey.pixels // 3], axis=-1)
    return Frame(grey.pixels, colour=tint)


@pytest.fixture
def night(qtbot, make_window, a_file, colour_frame):
    window, commands = make_window(FakeEngine(colour_frame))
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    yield window, commands
    commands.appearance.use_theme("dark", "normal")


def test_day_is_not_red(opened):
    assert colours(opened[0])[..., :2].max() > 150


def test_every_pane_is_red(qtbot, night):
    window, _ = night
    window.log.show()
    for tab in range(3):
        window.workspace.tabs.setCurrentIndex(tab)
        window.workspace.stars.select(2)
        qtbot.wait(20)
        assert_red(window)


def test_the_welcome_page_and_a_failure_are_red(qtbot, make_window, a_file):
    window, commands = make_window(FakeEngine(result=no_solution()))
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    assert_red(window)
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    assert_red(window)
    commands.appearance.use_theme("dark")


def test_menus_lists_boxes_and_tips_are_red(qtbot, night):
    window, commands = night
    for menu in (window.menus.recent, window.menus.export, *window.bar.menus.findChildren(QMenu)):
        assert_red(menu)
    box = window.workspace.hints.method
    window.workspace.tabs.setCurrentIndex(2)
    box.showPopup()
    assert_red(box.view().window())
    box.hidePopup()
    for name in ("about", "keys", "preferences"):
        commands.actions[name].trigger()
        (dialog,) = [d for d in window.findChildren(QDialog) if d.isVisible()]
        assert_red(dialog)
        dialog.close()
    tell(window, "Export", "Can't write it.")
    (message,) = window.findChildren(QMessageBox)
    assert_red(message)
    message.close()
    QToolTip.showText(window.mapToGlobal(window.rect().center()), "A tip", window)
    tips = [w for w in QApplication.topLevelWidgets() if w.inherits("QTipLabel") and w.isVisible()]
    for tip in tips:
        assert_red(tip)
    QToolTip.hideText()


def test_the_menu_of_a_place_and_the_layers_in_the_preferences_are_red(qtbot, night):
    window, commands = night
    qtbot.waitUntil(lambda: commands.presenter.overlay.tables is not None)
    menu = commands.menu.show((300.0, 200.0, 5.0), QPoint(20, 20))
    assert_red(menu)
    online = menu.findChildren(QMenu)[0]
    online.popup(QPoint(30, 30))
    assert_red(online)
    menu.close()
    commands.actions["layers"].trigger()
    dialog = window.findChild(Preferences)
    box = dialog.layers.colours["figures"]
    box.setCurrentIndex(3)
    box.activated.emit(3)
    box.showPopup()
    assert_red(box.view().window())
    box.hidePopup()
    assert_red(dialog)
    assert_red(window)
    dialog.close()


def test_states_of_controls_are_red(qtbot, night):
    window, _ = night
    panes = window.workspace
    panes.tabs.setCurrentIndex(2)
    panes.hints.fov.setText("selected")
    for widget in (
        panes.hints.fov,
        panes.hints.method,
        panes.hints.header,
        panes.strip.black,
        panes.view,
        window.log.lines,
        panes.tabs.tabBar(),
    ):
        widget.setFocus(Qt.FocusReason.TabFocusReason)
        qtbot.wait(5)
        assert_red(window)
    assert_red(window)
    panes.hints.fov.selectAll()
    panes.hints.ra.setText("5h")
    panes.strip.setEnabled(False)
    panes.hints.method.setEnabled(False)
    assert_red(window)


def test_the_file_dialogs_are_red_and_give_their_answer(qtbot, night, a_file):
    window, _ = night
    looked = []

    def look(then):
        dialog = window.findChildren(QFileDialog)[-1]
        dialog.findChild(QLineEdit).setText(str(a_file))
        looked.append(colours(dialog))
        QTimer.singleShot(0, getattr(dialog, then))

    def end():  # whatever happened, no dialog may stay and wait for a person
        for widget in QApplication.topLevelWidgets():
            if isinstance(widget, QDialog):
                widget.done(0)

    guard = QTimer()
    guard.timeout.connect(end)
    guard.start(5000)
    QTimer.singleShot(50, lambda: look("accept"))
    assert ask_frames(window, str(a_file.parent), "Open images", "All files (*)") == [a_file]
    QTimer.singleShot(50, lambda: look("reject"))
    assert ask_save(window, a_file.with_name("new.csv"), "CSV (*.csv)") is None
    for seen in looked:
        assert_all_red(seen)
    assert len(looked) == 2


def test_a_working_window_is_red(qtbot, night):
    from kochab.core.progress import Progress

    window, _ = night
    for fraction in (None, 0.4):
        window.bar.show_progress(Progress("identify", fraction, "patterns"))
        window.workspace.card.show_working(Progress("identify", fraction, "patterns"))
        qtbot.wait(20)
        assert_red(window)


def test_the_corners_of_a_field_are_as_dark_as_what_is_around_it(qtbot, night):
    window, _ = night
    window.workspace.tabs.setCurrentIndex(2)
    field = window.workspace.hints.fov
    corner = field.mapTo(window, field.rect().topLeft())
    qtbot.wait(20)
    assert colours(window)[corner.y(), corner.x(), 2] < 60


def test_night_is_left_for_the_theme_of_before(qtbot, night):
    window, commands = night
    commands.appearance.use_theme("light")
    commands.actions["night"].trigger()
    assert commands.looks.is_night
    commands.actions["night"].trigger()
    assert commands.settings.text("theme", "") == "light"
    qtbot.waitUntil(lambda: commands.appearance.settled)
    assert colours(window)[..., :2].max() > 150


def test_the_night_palette_holds_red_alone_and_is_readable():
    night = asdict(THEMES["night"])
    assert all(colour[3:] == "0000" for colour in night.values())


def luminance(colour):
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
        for c in (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a, b):
    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", THEMES)
def test_text_can_be_read_in_every_theme(theme):
    c = THEMES[theme]
    for ground in (c.window, c.surface):
        assert contrast(c.text, ground) >= 4.5
        # Red alone on black cannot pass 5.3, so that secondary text has less to give.
        assert contrast(c.muted, ground) >= (3.5 if theme == "night" else 4.5)
        assert contrast(c.bad, ground) >= 4.5
    assert contrast(c.on_accent, c.accent) >= 4.5
    for mark in (c.detected, c.identified, c.grid_text, c.centre):
        assert contrast(mark, c.sky) >= 2.9


class Painted(QObject):
    """Counts how often a widget is painted by itself, which a grab would hide."""

    def __init__(self, widget):
        super().__init__(widget)
        self.times = 0
        widget.installEventFilter(self)

    def eventFilter(self, watched, event):  # noqa: N802
        self.times += event.type() == QEvent.Type.Paint
        return False


def test_the_screen_shows_the_new_theme_and_goes_on_to_be_painted(qtbot, opened):
    window, commands = opened
    qtbot.wait(100)
    painted = Painted(window.workspace.view)
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    qtbot.waitUntil(lambda: painted.times > 0)
    before = painted.times
    window.workspace.view.update()
    qtbot.waitUntil(lambda: painted.times > before)
    commands.appearance.use_theme("dark", "normal")


def test_no_dialog_shows_the_icons_of_the_system(qtbot, night):
    window, commands = night
    # As a desktop has it; the screenless one of the tests has no icons by itself.
    window.setStyleSheet("QDialogButtonBox { dialogbuttonbox-buttons-have-icons: 1; }")
    unmended = QMessageBox(QMessageBox.Icon.NoIcon, "", "", QMessageBox.StandardButton.Ok, window)
    assert not unmended.buttons()[0].icon().isNull(), "this test could not fail"
    unmended.deleteLater()
    tell(window, "Export", "It could not be written.")
    for name in ("about", "keys"):
        commands.actions[name].trigger()
    shown = [d for d in window.findChildren(QDialog) if d.isVisible()]
    assert len(shown) == 3
    for dialog in shown:
        assert all(b.icon().isNull() for b in dialog.findChildren(QPushButton))
        dialog.close()
