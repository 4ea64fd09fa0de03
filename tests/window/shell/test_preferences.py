"""The Preferences: each is applied at once, kept for the next start, and reached by key and on the rail."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from PySide6.QtCore import QSettings, Qt

from kochab.core.frame import Hint, Site
from kochab.gear.profiles import current_profile, load_profile
from kochab.sky.horizon import Horizon
from kochab.sky.layer import AMOUNTS
from kochab.text.angle_text import AngleStyle
from kochab.window.settings import WindowSettings
from kochab.window.shell.preferences import OFFLINE, Preferences
from kochab.window.themes import HUES
from tests.window.mount_bench import connected
from tests.window.person import choose, type_in


@pytest.fixture(autouse=True)
def own_profiles(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))


@pytest.fixture
def shown(qtbot, opened):
    window, commands = opened
    window.activateWindow()
    qtbot.keyClick(window, Qt.Key.Key_Comma, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: window.findChild(Preferences) is not None)
    yield window, commands, window.findChild(Preferences)
    commands.appearance.use_theme("dark", "normal")


def test_settings_stands_on_the_rail(opened):
    window, commands = opened
    button = window.rail.widgetForAction(commands.actions["preferences"])
    assert (button.text(), button.isVisible()) == ("Settings", True)
    button.click()
    assert window.findChild(Preferences).isVisible()
    button.click()
    assert len(window.findChildren(Preferences)) == 1


def test_angles_theme_and_layers_are_applied_at_once_and_kept(qtbot, shown, tmp_path):
    window, commands, dialog = shown
    card = window.workspace.card
    assert card.ra.text() == "05h 36m 12.00s"
    choose(dialog.general.angles, AngleStyle.DECIMAL)
    assert card.ra.text() == "84.05000°"
    choose(dialog.general.theme, "night")
    assert commands.looks.is_night
    assert commands.actions["night"].isChecked()
    choose(dialog.general.text, "large")
    dialog.layers.layers["grid"].click()
    assert not commands.presenter.overlay.layers.on["grid"]
    commands.actions["detected"].trigger()  # by its own key, the box follows
    assert dialog.layers.layers["detected"].isChecked() == commands.presenter.overlay.layers.on["detected"]
    commands.settings.write()
    again = WindowSettings(QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat))
    assert again.angle_style is AngleStyle.DECIMAL
    assert (again.text("theme", ""), again.text("text_size", "")) == ("night", "large")
    assert not again.flag("sky/grid", True)


def test_layers_have_amounts_and_colours_that_are_kept_and_drawn(qtbot, shown, make_window, engine):
    _window, commands, dialog = shown
    commands.actions["layers"].trigger()
    assert dialog.tabs.currentWidget() is dialog.layers_page
    layers = commands.presenter.overlay.layers
    assert {*dialog.layers.colours} == {*layers.on}
    assert {*dialog.layers.amounts} == {*layers.amount}
    assert {box.currentText() for box in dialog.layers.colours.values()} == {"Default"}
    dialog.layers.amounts["objects"].setValue(90)
    choose(dialog.layers.colours["figures"], HUES["Green"])
    choose(dialog.layers.colours["grid"], HUES["Pink"])
    choose(dialog.layers.colours["grid"], "")
    assert (layers.amount["objects"], layers.colour) == (0.9, {"figures": HUES["Green"]})
    dialog.close()
    again = make_window(engine)[1].presenter.overlay.layers
    assert (again.amount["objects"], again.amount["names"]) == (0.9, 0.5)
    assert again.colour == {"figures": HUES["Green"]}


def test_samples_of_colours_are_not_shown_in_red_light(qtbot, shown):
    _, _commands, dialog = shown
    assert not dialog.layers.colours["grid"].itemIcon(2).isNull()
    choose(dialog.general.theme, "night")
    assert all(box.itemIcon(k).isNull() for box in dialog.layers.colours.values() for k in range(box.count()))


@pytest.mark.parametrize("kept", ['{"objects": 7.0, "names": "x", "grid": [1]}', "[]", "{", '{"objects": NaN}'])
def test_damaged_amounts_and_colours_read_as_none(make_window, engine, settings, kept):
    settings.keep("sky/amounts", kept)
    settings.keep("sky/colours", kept.replace("7.0", '"red; }"'))
    layers = make_window(engine)[1].presenter.overlay.layers
    assert (layers.amount, layers.colour) == (AMOUNTS, {})


def test_a_grid_of_the_horizon_says_what_it_lacks(qtbot, opened):
    window, commands = opened
    commands.actions["altaz"].trigger()
    assert "time or your site" in window.status.currentMessage()
    assert commands.presenter.overlay.layers.on["altaz"]
    known, told = commands.session.known, Hint(time_utc=datetime(2026, 1, 15, 22, 0, tzinfo=UTC), site=Site(50.0, 8.0))
    known.frame = replace(known.frame, hint=told)
    assert commands.field.horizon() == Horizon(told.site, told.time_utc)
    known.frame = replace(known.frame, hint=replace(told, time_of_file=True))  # which may be years later
    assert commands.field.horizon() is None


def test_a_new_profile_with_its_telescope_is_kept_and_stands_in_the_bar(qtbot, shown):
    window, _, dialog = shown
    assert not dialog.equipment.focal.isEnabled()
    type_in(qtbot, dialog.equipment.profile.lineEdit(), "RedCat & 533")
    assert window.bar.equipment.text() == "RedCat && 533"
    type_in(qtbot, dialog.equipment.focal, "250")
    type_in(qtbot, dialog.equipment.pixel, "3.76")
    type_in(qtbot, dialog.equipment.site, "48.14, 11.58")
    kept = load_profile("RedCat & 533")
    assert (kept.focal_length_mm, kept.pixel_size_um, kept.site) == (250.0, 3.76, Site(48.14, 11.58))
    assert dialog.equipment.scale.text() == "3.1″/px"
    assert "250 mm" in window.bar.equipment.toolTip()
    type_in(qtbot, dialog.equipment.focal, "long")
    assert "focal length" in dialog.wrong.text()
    assert load_profile("RedCat & 533") == kept


def test_the_bar_chooses_among_profiles(opened):
    window, commands = opened
    for name in ("Newton", "RedCat"):
        commands.equipment.choose(name)
    menu = window.bar.equipment.menu()
    menu.aboutToShow.emit()
    offered = {action.text(): action for action in menu.actions() if action.isCheckable()}
    assert list(offered) == ["No profile", "Newton", "RedCat"]
    assert offered["RedCat"].isChecked()
    offered["Newton"].trigger()
    assert current_profile(commands.settings).name == "Newton"
    assert window.bar.equipment.text() == "Newton"


def test_a_connected_mount_keeps_its_profile(qtbot, opened):
    """Another one's limits would be shown, and overwritten, while the guard holds these."""
    window, commands = opened
    commands.equipment.choose("Newton")
    commands.equipment.choose("RedCat")
    with connected(qtbot, commands):
        commands.equipment.choose("Newton")
        assert current_profile(commands.settings).name == "RedCat"
        assert "Disconnect" in window.status.currentMessage()
        window.bar.equipment.menu().aboutToShow.emit()
        newton = next(a for a in window.bar.equipment.menu().actions() if a.text() == "Newton")
        assert not newton.isEnabled()
        commands.services.mount.disconnect_mount()
        qtbot.waitUntil(lambda: not commands.equipment.locked)
        commands.equipment.choose("Newton")
        assert current_profile(commands.settings).name == "Newton"


def test_images_are_looked_for_in_the_chosen_folder(shown, tmp_path, monkeypatch):
    _, commands, dialog = shown
    lights = tmp_path / "lights"
    lights.mkdir()
    monkeypatch.setattr("kochab.window.shell.preferences.ask_folder", lambda *_: lights)
    dialog.folders.choose.click()
    asked = []
    monkeypatch.setattr("kochab.window.frame.files.ask_frames", lambda _, start, *rest: asked.append(start) or [])
    commands.files.choose()
    assert asked == [str(lights)]
    dialog.folders.fixed.click()
    commands.files.choose()
    assert asked[1] == str(tmp_path)  # of the file opened last


def test_the_data_is_told_to_be_offline(qtbot, shown):
    dialog = shown[2]
    qtbot.waitUntil(lambda: "stars" in dialog.folders.data.text())
    assert OFFLINE in dialog.folders.data.text()
    assert "Small-field index" in dialog.folders.data.text()


def test_on_windows_the_windows_settings_lie_beside_the_rest(tmp_path, monkeypatch) -> None:
    """Qt's own folder there is the roaming one, where an uninstaller and a person would not look."""
    from kochab.folders import config_folder
    from kochab.window.settings import own_store

    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    monkeypatch.setattr("sys.platform", "win32")
    assert Path(own_store().fileName()) == config_folder() / "window.ini"
