"""What is taken back by Ctrl+Z: cleared lists and hints, a closed film strip, Preferences; never a motion."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from kochab.__main__ import main
from kochab.gear.profiles import current_profile, load_profile, saved_profiles
from kochab.sky.layer import AMOUNTS
from kochab.text.angle_text import AngleStyle
from kochab.window.devices.equipment import LOCKED
from kochab.window.settings import languages
from kochab.window.shell import preferences
from kochab.window.shell.preferences import Preferences
from kochab.window.themes import HUES
from tests.window.fakes import FakeEngine
from tests.window.mount_bench import connected
from tests.window.person import choose, type_in

CTRL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


@pytest.fixture(autouse=True)
def own_profiles(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))


@pytest.fixture
def dialog(opened):
    window, commands = opened
    commands.tools.show_preferences()
    yield window.findChild(Preferences)
    commands.appearance.use_theme("dark", "normal")


def test_before_anything_was_changed_there_is_nothing_to_undo(opened):
    undo, redo = (opened[1].actions[name] for name in ("undo", "redo"))
    assert [(a.text(), a.isEnabled()) for a in (undo, redo)] == [("&Undo", False), ("Re&do", False)]


def test_colours_and_amounts_of_layers_come_back(opened, dialog):
    commands = opened[1]
    layers, undo, redo = commands.presenter.overlay.layers, commands.actions["undo"], commands.actions["redo"]
    dialog.layers.amounts["names"].setValue(90)
    choose(dialog.layers.colours["grid"], HUES["Pink"])
    assert undo.text() == "&Undo: change a colour"
    dialog.layers.reset.click()
    assert (layers.amount, layers.colour) == (AMOUNTS, {})
    assert (dialog.layers.amounts["names"].value(), dialog.layers.colours["grid"].currentText()) == (50, "Default")
    undo.trigger()
    assert (layers.amount["names"], layers.colour) == (0.9, {"grid": HUES["Pink"]})
    assert (dialog.layers.amounts["names"].value(), dialog.layers.colours["grid"].currentText()) == (90, "Pink")
    dialog.layers.amounts["names"].setValue(20)
    undo.trigger()
    assert (layers.amount["names"], layers.colour) == (0.2, {})
    redo.trigger()
    assert layers.colour == {"grid": HUES["Pink"]}


def test_the_list_of_recent_files_comes_back(qtbot, opened, a_file):
    window, commands = opened
    commands.actions["clear_recent"].trigger()
    assert commands.settings.recent == []
    assert commands.actions["undo"].text() == "&Undo: clear the list of recent files"
    window.activateWindow()
    qtbot.keyClick(window, Qt.Key.Key_Z, CTRL)
    assert commands.settings.recent == [a_file]
    assert any(a_file.name in action.text() for action in window.menus.recent.actions())
    assert commands.actions["redo"].text() == "Re&do: clear the list of recent files"
    qtbot.keyClick(window, Qt.Key.Key_Z, CTRL | SHIFT)
    assert commands.settings.recent == []


def test_cleared_hints_come_back_with_the_method_and_its_options(qtbot, opened):
    window, commands = opened
    hints = window.workspace.hints
    for field in (hints.fov, hints.scale, hints.ra, hints.dec, hints.radius, hints.timeout):
        field.setText("5")
    hints.header.setChecked(False)
    hints.method.setCurrentIndex(1)
    typed = hints.typed()
    hints.clear_wanted.emit()
    assert (hints.fov.text(), hints.header.isChecked(), hints.method.currentIndex()) == ("", True, 0)
    commands.actions["undo"].trigger()
    assert hints.typed() == typed
    assert hints.method.currentIndex() == 1
    commands.actions["undo"].trigger()  # nothing more
    assert hints.typed() == typed


def test_typing_in_a_field_is_undone_by_the_field_alone(qtbot, opened):
    window, commands = opened
    commands.actions["clear_recent"].trigger()
    commands.actions["tab_hints"].trigger()
    field = window.workspace.hints.fov
    field.setFocus()
    qtbot.keyClicks(field, "12")
    qtbot.keyClick(field, Qt.Key.Key_Z, CTRL)
    assert field.text() == ""
    assert commands.settings.recent == []


def test_a_film_strip_that_another_file_closed_comes_back_with_its_results(qtbot, make_window, tmp_path, a_file):
    _, commands = make_window(FakeEngine())
    paths = [tmp_path / f"{name}.fits" for name in "abc"]
    for path in paths:
        path.write_bytes(b"")
    commands.files.open_all(paths)
    qtbot.waitUntil(lambda: not commands.batch.waiting and not commands.session.busy)
    commands.files.open(paths[1])
    qtbot.waitUntil(lambda: not commands.session.busy)
    results = [state.result for state in commands.batch.files.values()]
    commands.files.open(a_file)
    qtbot.waitUntil(lambda: commands.session.known.path == a_file and not commands.session.busy)
    assert not commands.films.isVisible()
    assert commands.actions["undo"].text() == "&Undo: close the film strip (3 files)"
    commands.actions["undo"].trigger()
    assert list(commands.batch.files) == paths
    assert all(s.result is before for s, before in zip(commands.batch.files.values(), results, strict=True))
    qtbot.waitUntil(lambda: commands.session.known.path == paths[1] and not commands.session.busy)
    assert commands.films.isVisible()
    assert commands.films.list.currentItem().text() == "b.fits"
    commands.actions["redo"].trigger()
    qtbot.waitUntil(lambda: commands.session.known.path == a_file and not commands.session.busy)
    assert not commands.films.isVisible()


def test_preferences_are_undone_where_they_were_changed_and_after(qtbot, opened, dialog):
    window, commands = opened
    card = window.workspace.card
    choose(dialog.general.angles, AngleStyle.DECIMAL)
    choose(dialog.general.theme, "light")
    choose(dialog.general.text, "large")
    dialog.activateWindow()
    for _ in range(2):
        qtbot.keyClick(dialog, Qt.Key.Key_Z, CTRL)
    assert (dialog.general.text.currentData(), dialog.general.theme.currentData()) == ("normal", "dark")
    assert card.ra.text() == "84.05000°"
    dialog.close()
    qtbot.waitUntil(lambda: not window.findChildren(Preferences))
    commands.actions["undo"].trigger()
    assert card.ra.text() == "05h 36m 12.00s"
    assert commands.settings.angle_style is AngleStyle.SEXAGESIMAL


def test_the_folder_of_images_is_undone(opened, dialog, tmp_path):
    _, commands = opened
    before = commands.settings.image_folder
    dialog.folders.fixed.click()
    dialog.folders._begin_in(str(tmp_path / "nights"))
    assert (dialog.folders.folder.text(), dialog.folders.fixed.isChecked()) == (str(tmp_path / "nights"), True)
    commands.undo.undo()
    assert commands.settings.text("start_folder", "") == str(before)
    assert dialog.folders.fixed.isChecked()
    commands.undo.undo()
    assert (commands.settings.text("start_folder", ""), dialog.folders.fixed.isChecked()) == ("", False)


def test_frames_to_measure_that_were_cleared_come_back_in_their_sweeps(opened, tmp_path):
    _, commands = opened
    commands.views.show("polar")
    setup = commands.views.docks["polar"].view.setup
    first, second = [tmp_path / "a.fits", tmp_path / "b.fits"], [tmp_path / "c.fits"]
    setup.frames.files.add(first)
    setup.frames.files.add(second, 1)
    setup.frames.clear.click()
    assert setup.frames.files.count() == 0
    assert commands.actions["undo"].text() == "&Undo: clear the frames to measure"
    commands.actions["undo"].trigger()
    assert [setup.frames.files.paths(sweep) for sweep in (0, 1)] == [tuple(first), tuple(second)]


def test_equipment_is_undone_in_its_own_profile(qtbot, opened, dialog):
    window, commands = opened
    commands.equipment.choose("Newton")
    type_in(qtbot, dialog.equipment.focal, "750")
    type_in(qtbot, dialog.equipment.focal, "760")
    type_in(qtbot, dialog.equipment.site, "48.1, 11.6")
    assert window.workspace.hints.site.text() == "48.1, 11.6"
    commands.equipment.choose("RedCat")
    commands.undo.undo()
    assert current_profile(commands.settings).name == "Newton"
    commands.undo.undo()
    assert window.workspace.hints.site.text() == ""
    commands.undo.undo()
    assert (dialog.equipment.focal.text(), load_profile("Newton").focal_length_mm) == ("750", 750.0)
    commands.undo.redo()
    assert load_profile("Newton").focal_length_mm == 760.0
    assert load_profile("RedCat").focal_length_mm == 760.0  # begun with what was used then


def test_a_removed_profile_comes_back_whole(qtbot, opened, dialog):
    _, commands = opened
    assert not dialog.equipment.remove.isEnabled()
    commands.equipment.choose("Newton & Co")
    type_in(qtbot, dialog.equipment.focal, "750")
    before = load_profile("Newton & Co")
    dialog.equipment.remove.click()
    assert load_profile("Newton & Co") is None
    assert (dialog.equipment.profile.currentText(), dialog.equipment.remove.isEnabled()) == ("", False)
    assert commands.actions["undo"].text() == "&Undo: remove the profile Newton && Co"
    commands.actions["undo"].trigger()
    assert load_profile("Newton & Co") == before
    assert (dialog.equipment.profile.currentText(), dialog.equipment.focal.text()) == ("Newton & Co", "750")
    commands.actions["redo"].trigger()
    assert saved_profiles() == ([], [])


def test_nothing_that_a_mount_does_is_undone_and_its_equipment_stays(qtbot, opened):
    _, commands = opened
    commands.equipment.choose("Newton")
    commands.equipment.keep(focal_length_mm=750.0)
    commands.equipment.choose("RedCat")
    said = []
    commands.equipment.refused.connect(said.append)
    with connected(qtbot, commands, "onstep") as mount:
        mount.view.buttons.rests["park"].click()
        qtbot.waitUntil(lambda: mount.telescope.parked and not mount.control.known.busy)
        assert commands.actions["undo"].text() == "&Undo: use RedCat"  # still: no step came of it
        mount.telescope.log.clear()
        commands.actions["undo"].trigger()
        assert said == [LOCKED]
        assert current_profile(commands.settings).name == "RedCat"
        assert not commands.actions["redo"].isEnabled()  # nothing was undone
        assert commands.actions["undo"].text() == "&Undo: change the equipment"  # in the other profile
        commands.actions["undo"].trigger()
        assert said == [LOCKED, LOCKED]
        assert load_profile("Newton").focal_length_mm == 750.0
        assert not commands.actions["redo"].isEnabled()
        assert mount.telescope.parked
        assert not mount.telescope.log
    assert commands.actions["undo"].text() == "&Undo: use Newton"


def test_a_language_is_offered_where_there_is_one_and_kept_for_the_next_start(tmp_path, monkeypatch, opened):
    _, commands = opened
    commands.tools.show_preferences()
    assert "Language" not in [text.text() for text in commands.window.findChild(Preferences).findChildren(QLabel)]
    (tmp_path / "kochab_de.qm").write_bytes(b"")
    monkeypatch.setattr(preferences, "languages", lambda: languages(tmp_path))
    dialog = Preferences(commands.window, commands.services, commands.appearance)
    box = dialog.general.language
    assert [box.itemText(i) for i in range(box.count())] == ["As the system", "English", "Deutsch"]
    choose(box, "de")
    assert commands.settings.text("language", "") == "de"
    commands.actions["undo"].trigger()
    assert (commands.settings.text("language", ""), box.currentText()) == ("", "As the system")
    dialog.close()


@pytest.mark.parametrize("file", [[], ["orion.fits"]])
def test_the_language_of_the_window_is_an_option(monkeypatch, file):
    asked = []
    monkeypatch.setattr("kochab.window.display_check.trouble", lambda: None)
    monkeypatch.setattr("kochab.window.application.run", lambda *told: asked.append(told) or 0)
    assert main(["--language", "de", *file]) == 0
    assert (asked[0][0], asked[0][2]) == (file, "de")
