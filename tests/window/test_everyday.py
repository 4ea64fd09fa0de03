"""What a person meets on an ordinary evening: menus, long names, several files, old answers."""

import numpy as np
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QMenu, QToolButton

from kochab.sky.layer import MARKS
from kochab.text.angle_text import breakable, short_name, unbroken
from kochab.window.image.thumbnails import HEIGHT, WIDTH
from kochab.window.panels.hints_panel import LIMIT_S
from kochab.window.shell.actions import COMMANDS
from tests.window.fakes import FakeEngine, no_solution

LONG = "light_" + "x" * 190 + "_0042.fits"


def picture_of(menu, action):
    image = menu.grab(menu.actionGeometry(action)).toImage()
    image = image.convertToFormat(QImage.Format.Format_Grayscale8)
    return np.frombuffer(image.constBits(), np.uint8).copy()


def test_the_menu_shows_what_is_switched_on(qtbot, opened):
    window, commands = opened
    marks = next(menu for menu in window.findChildren(QMenu) if menu.title() == "La&yers")
    for name in MARKS:
        action = commands.actions[name]
        action.setChecked(True)
        on = picture_of(marks, action)
        action.setChecked(False)
        assert (on != picture_of(marks, action)).any(), name


def test_every_switch_leaves_room_for_its_tick(opened):
    for spec in COMMANDS:
        if spec.switch:
            assert not opened[1].actions[spec.name].isIconVisibleInMenu(), spec.name


def test_a_very_long_name_leaves_the_window_as_it_is(qtbot, make_window, tmp_path):
    long = tmp_path / LONG
    long.write_bytes(b"")
    window, commands = make_window(FakeEngine())
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(long)
    before = window.workspace.tabs.minimumSizeHint().width()
    commands.session._engine.result = no_solution()
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.presenter.solve()
    assert window.workspace.card.old.isVisible()
    commands.presenter._failed(f"Can't open {LONG}: not a supported image.")
    assert window.workspace.tabs.minimumSizeHint().width() <= before
    window.menus.recent.ensurePolished()
    assert window.menus.recent.sizeHint().width() < 600
    window.pages.setCurrentWidget(window.welcome)
    assert window.welcome._inside.minimumSizeHint().width() < 680


def test_names_and_numbers_are_shortened_and_parted_with_care():
    assert short_name("m42.fits") == "m42.fits"
    short = short_name(LONG)
    assert len(short) == 44
    assert short.startswith("light_xxx")
    assert short.endswith("_0042.fits")
    assert unbroken("read 5 ms, 71 stars, 0.9 %") == "read 5\u00a0ms, 71 stars, 0.9\u00a0%"
    assert breakable("short words stay") == "short words stay"
    assert breakable("x" * 100).replace("\u200b", "") == "x" * 100
    assert max(map(len, breakable("x" * 100).split("\u200b"))) <= 44


def test_without_a_frame_there_is_nothing_to_zoom(qtbot, make_window, a_file, tmp_path):
    window, commands = make_window(FakeEngine())
    zooms = [commands.actions[name] for name in ("fit", "one", "in", "out")]
    assert not any(action.isEnabled() for action in zooms)
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    assert all(action.isEnabled() for action in zooms)
    assert commands.actions["fit"].iconText().startswith("Fit 1")
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(tmp_path / "missing.fits")
    assert not any(action.isEnabled() for action in zooms)
    assert not window.workspace.strip.isEnabled()
    assert (window.status.frame.text(), commands.actions["fit"].iconText()) == ("", "Fit")
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    assert window.workspace.strip.isEnabled()


def test_an_old_pointing_is_not_as_bright_as_a_new_one(qtbot, opened, engine):
    window, commands = opened
    panel = window.workspace.card
    assert panel.ra.property("role") == "value"
    engine.result = no_solution()
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.presenter.solve()
    assert panel.ra.property("role") == panel.dec.property("role") == "value_old"
    engine.result = None
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.presenter.solve()
    assert panel.ra.property("role") == "value"


def test_a_hint_can_be_typed_at_once(qtbot, opened, engine):
    window, commands = opened
    engine.result = no_solution()
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.presenter.solve()
    window.workspace.card.hints.click()
    assert window.focusWidget() is window.workspace.hints.fov


def test_clear_takes_back_everything_but_the_site(opened):
    hints = opened[0].workspace.hints
    for field in (hints.fov, hints.scale, hints.ra, hints.dec, hints.radius, hints.timeout):
        field.setText("5")
    hints.site.setText("48, 11")
    hints.header.setChecked(False)
    hints.clear()
    assert hints.timeout.text() == LIMIT_S
    assert hints.header.isChecked()
    assert not hints.fov.text()
    assert hints.site.text() == "48, 11"


def test_recent_files_come_before_the_samples(qtbot, make_window, settings, a_file):
    settings.add_recent(a_file)
    window, _ = make_window(FakeEngine())
    welcome = window.welcome
    qtbot.wait(50)
    assert welcome._recent_title.y() < welcome.samples[0].y()
    first = welcome._recent.itemAt(0).widget()
    assert welcome._recent_title.y() < first.y() < welcome.samples[0].y()


def test_the_names_of_a_few_stars_leave_room_for_their_places(opened):
    table = opened[0].workspace.stars
    longest = max((s.name for s in table.model._stars), key=len)
    assert table.table.columnWidth(0) < table.table.fontMetrics().horizontalAdvance(longest) + 40


def test_a_slider_is_moved_for_this_evening_the_switch_for_all(opened, settings):
    window, commands = opened
    strip = window.workspace.strip
    strip.bright.setValue(strip.bright.value() + 50)
    assert not strip.auto.isChecked()
    assert not commands.actions["stretch"].isChecked()
    assert settings.flag("stretch", True)
    commands.actions["stretch"].trigger()
    assert strip.auto.isChecked()
    commands.actions["stretch"].trigger()
    assert not strip.auto.isChecked()
    assert not settings.flag("stretch", True)


def test_a_fits_copy_is_offered_of_fits_alone(qtbot, make_window, tmp_path):
    window, commands = make_window(FakeEngine())
    copy = next(a for a in window.menus.export.actions() if a.objectName() == "export_fits")
    for name, able in (("a.fits", True), ("b.jpg", False), ("c.FIT", True), ("d.odd", True)):
        path = tmp_path / name
        path.write_bytes(b"not read by the fake engine")
        with qtbot.waitSignal(commands.session.idle, timeout=10_000):
            commands.files.open(path)
        assert copy.isEnabled() == able, name
    assert all(a.isEnabled() for a in window.menus.export.actions())


def test_the_welcome_page_leaves_room_for_a_tool_on_a_small_screen(make_window, settings, a_file):
    settings.add_recent(a_file)
    window, _ = make_window(FakeEngine())
    assert window.welcome.minimumSizeHint().width() <= 500  # a tool takes up to 520 of 1024
    link = window.welcome._recent.itemAt(0).widget()
    order = [window.welcome.first]
    while order[-1] is not window.welcome.samples[0] and len(order) < 20:
        order.append(order[-1].nextInFocusChain())
    assert order.index(window.welcome.practice) < order.index(link)


def test_nothing_moves_when_the_picture_of_a_sample_comes(qtbot, make_window, tmp_path):
    window, _ = make_window(FakeEngine())
    sample = window.welcome.samples[0]
    qtbot.wait(50)
    before = sample.geometry()
    picture = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    window.welcome.add_pictures({tmp_path / "sample.fits": picture}, red=False)
    assert not sample.icon().isNull()
    qtbot.wait(50)
    assert sample.geometry() == before


def test_the_place_under_the_cursor_is_not_that_of_the_frame_before(qtbot, opened, a_file):
    window, commands = opened
    window.workspace.view.hovered.emit((10.0, 10.0))
    assert "x 10.0" in window.status.place.text()
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.files.open(a_file)
    assert not window.status.place.text()


def test_the_layers_button_is_one_button(qtbot) -> None:
    """Qt 6.7, the lowest version, makes two of it, its arrow apart and black, when its action brings the menu."""
    from PySide6.QtGui import QAction

    from kochab.window.shell.menus import button_of

    menu = QMenu("Layers")
    menu.addAction(QAction("Grid", menu))
    qtbot.addWidget(menu)
    qtbot.addWidget(made := button_of(menu.menuAction(), menu))
    assert made.popupMode() == QToolButton.ToolButtonPopupMode.InstantPopup


def test_layers_are_one_click_away_and_stay_open_while_they_are_switched(qtbot, opened):
    """Every switch of a layer closed the menu: five layers were ten clicks."""
    window, commands = opened
    menu = window.menus.layers
    made = next(b for b in window.workspace.findChildren(QToolButton) if b.accessibleName() == "Layers")
    qtbot.waitUntil(made.isVisible)
    seen = []

    def person():
        seen.append(menu.isVisible())
        for name in ("grid", "names"):
            action = commands.actions[name]
            before = action.isChecked()
            qtbot.mouseClick(menu, Qt.MouseButton.LeftButton, pos=menu.actionGeometry(action).center())
            seen.extend((menu.isVisible(), action.isChecked() is not before))
        menu.setActiveAction(commands.actions["grid"])
        qtbot.keyClick(menu, Qt.Key.Key_Space)
        seen.append(menu.isVisible())
        qtbot.keyClick(menu, Qt.Key.Key_Escape)
        seen.append(not menu.isVisible())

    QTimer.singleShot(200, person)
    qtbot.mouseClick(made, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: len(seen) == 7)
    assert all(seen), seen


def test_a_broken_file_leaves_a_way_on(qtbot, make_window, engine, tmp_path, monkeypatch):
    window, commands = make_window(engine)
    commands.files.open(tmp_path / "gone.fits")
    card = window.workspace.card
    qtbot.waitUntil(card.open.isVisible)
    asked = []
    monkeypatch.setattr("kochab.window.frame.files.ask_frames", lambda *_: asked.append(True) or [])
    card.open.click()
    assert asked
