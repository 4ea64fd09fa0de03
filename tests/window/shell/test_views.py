"""The modes of the rail: docks that cost nothing until seen and come back after a restart."""

import threading

import pytest
from PySide6.QtCore import Qt

from kochab.core.progress import Progress
from kochab.window.shell import views
from kochab.window.shell.actions import COMMANDS


def test_a_view_is_built_when_it_is_first_seen_and_once(qtbot, opened, monkeypatch):
    window, commands = opened
    dock = commands.views.docks["laboratory"]
    assert dock.isHidden()
    assert dock.view is None
    qtbot.keyClick(window, Qt.Key.Key_F6)
    built = dock.view
    assert built is not None
    assert dock.isHidden()  # shown in a turn of its own
    qtbot.waitUntil(dock.isVisible)
    assert commands.views.actions["laboratory"].isChecked()
    qtbot.keyClick(window, Qt.Key.Key_F6)
    assert dock.isHidden()
    assert not commands.views.actions["laboratory"].isChecked()
    commands.views.actions["laboratory"].trigger()
    assert dock.view is built


def test_every_mode_of_the_rail_has_its_icon_from_the_start(make_window, engine):
    window, commands = make_window(engine)
    modes = [
        commands.views.image,
        *(commands.views.actions[name] for name, mode in views.VIEWS.items() if mode.on_rail),
    ]
    assert not [mode.text() for mode in modes if window.rail.widgetForAction(mode).icon().isNull()]


def test_an_open_view_is_open_after_a_restart(make_window, engine):
    window, commands = make_window(engine)
    commands.views.show("laboratory")
    window.close()
    again, new = make_window(engine)
    assert new.views.docks["laboratory"].isVisible()
    assert new.views.docks["laboratory"].view is not None
    assert new.views.actions["laboratory"].isChecked()
    new.views.toggle("laboratory")
    again.close()
    _, last = make_window(engine)
    assert last.views.docks["laboratory"].isHidden()


def test_one_view_at_a_time_stands_beside_the_image(qtbot, opened):
    window, commands = opened
    views, wide = commands.views, window.workspace.view.width()
    for name in ("details", "laboratory", "polar", "image"):
        views.show(name)
        assert views.docked == [name] * (name != "image")
        assert views.image.isChecked() == (name in ("image", "details"))
        assert views.actions["polar"].isChecked() == (name == "polar")
    qtbot.waitUntil(lambda: window.workspace.view.width() == wide)
    views.docks["polar"].setFloating(True)
    views.show("polar")
    views.show("details")
    assert views.docked == ["details"]
    assert views.docks["polar"].isVisible()  # on a screen of its own
    assert not views.image.isChecked() or views.docked == ["details"]
    views.docks["polar"].setFloating(False)


def test_the_image_has_the_focus_when_a_view_goes(opened):
    window, commands = opened
    window.activateWindow()
    commands.views.show("laboratory")
    commands.views.toggle("laboratory")
    assert window.focusWidget() is window.workspace.view


def test_a_click_on_the_rail_changes_the_mode(qtbot, opened):
    window, commands = opened
    buttons = {a.objectName(): window.rail.widgetForAction(a) for a in window.rail.actions()}

    def checked():
        return [name for name, made in buttons.items() if name.startswith("view_") and made.isChecked()]

    for name in ("view_polar", "view_laboratory", "view_image"):
        qtbot.mouseClick(buttons[name], Qt.MouseButton.LeftButton)
        qtbot.waitUntil(lambda name=name: checked() == [name])
    assert commands.views.docked == []


def test_the_mode_chosen_last_stays_while_another_is_made(qtbot, opened):
    _, commands = opened
    commands.views.show("live")
    commands.views.toggle("laboratory")
    commands.views.toggle("live")
    qtbot.wait(50)
    assert commands.views.docked == []
    commands.views.toggle("polar")
    commands.views.toggle("polar")  # a second click before it is there
    qtbot.wait(50)
    assert commands.views.docked == ["polar"]


def test_a_view_fits_a_small_screen(qtbot, make_window, engine):
    window, commands = make_window(engine)
    window.resize(1280, 700)
    commands.views.show("laboratory")
    qtbot.wait(50)
    assert window.height() <= 700
    assert window.width() <= 1280


def test_the_window_grows_for_no_change_of_views(qtbot, opened):
    """1366 x 768 at 150 %; for a moment two views and a room stand in it."""
    window, commands = opened
    commands.views.show("live")
    window.resize(911, 512)
    qtbot.waitUntil(lambda: window.width() == 911)
    for name in ("polar", "live", "mount", "polar", "laboratory", "image"):
        commands.views.show(name)
        qtbot.wait(50)
        assert (name, window.width()) == (name, 911)


def test_keys_of_views_are_nobody_elses():
    taken = {key for spec in COMMANDS for key in spec.keys.split()}
    keys = [mode.key for mode in views.VIEWS.values()]
    assert len(keys) == len(set(keys))
    assert not taken & set(keys)


@pytest.mark.parametrize("ends", ["by itself", "with the window"])
def test_a_view_s_job_is_heard_and_ends_with_the_window(qtbot, opened, ends):
    window, commands = opened
    closed, told = threading.Event(), []
    commands.services.jobs.closing.connect(lambda: told.append("closing"))

    def task():
        try:
            while ends == "with the window":
                yield Progress("wait")
            yield Progress("nothing")
        finally:
            closed.set()
        return 7

    job = commands.services.jobs.run(task(), "test")
    job.succeeded.connect(told.append)
    if ends == "by itself":
        qtbot.waitUntil(lambda: told == [7], timeout=5000)
    window.close()
    assert closed.wait(60)
    assert not job.running
    assert "closing" in told


def test_services_offer_the_sky_and_a_word(qtbot, opened):
    window, commands = opened
    services = commands.services
    assert services.session.known.frame is not None
    services.say("Done.")
    assert window.status.currentMessage() == "Done."


def test_the_image_keeps_half_of_a_window_that_is_made_smaller(qtbot, opened):
    """A view shown on a large screen used to take two thirds of a small one."""
    window, commands = opened
    window.resize(2600, 1000)
    commands.views.show("laboratory")
    dock = commands.views.docks["laboratory"]
    qtbot.waitUntil(lambda: dock.width() > 600)
    window.resize(1100, 700)
    qtbot.waitUntil(lambda: dock.width() <= 550)
    assert window.workspace.view.width() > 400


def test_a_picture_that_belongs_to_a_tool_is_not_maximised_away(qtbot, opened):
    """The polar error, both knobs and their buttons stand on it: they were gone, from one start to the next."""
    window, commands = opened
    commands.views.show("laboratory")
    commands.actions["fill"].trigger()
    assert window.pages.isHidden()
    commands.views.show("polar")
    assert not window.pages.isHidden()
    assert not commands.actions["fill"].isChecked()
    commands.actions["fill"].trigger()
    assert not window.pages.isHidden()
    assert not commands.actions["fill"].isChecked()


def test_a_dock_that_was_polished_empty_takes_the_theme_of_the_night(qtbot, make_window, engine):
    """Qt polishes a widget once: the dock had kept the sheet of the day, and so had the view in it."""
    _, commands = make_window(engine)
    dock = commands.views.docks["mount"]
    dock.ensurePolished()
    day = dock.styleSheet()
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    commands.views.show("mount")
    assert dock.styleSheet() not in ("", day)
    assert dock.styleSheet() == commands.views.docks["details"].parentWidget().bar.styleSheet()
    commands.appearance.use_theme("dark", "normal")
