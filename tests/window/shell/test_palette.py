"""The search palette: three groups from the first letter, and what each Enter does."""

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QColor, QImage, QRegion
from PySide6.QtWidgets import QWidget

from kochab.core.frame import Site
from kochab.window.atlas.dialog import Atlas
from kochab.window.shell.palette_results import COMMANDS, FRAME, MEANT, MOST, SKY

ALT, SHIFT = Qt.KeyboardModifier.AltModifier, Qt.KeyboardModifier.ShiftModifier


@pytest.fixture
def palette(qtbot, opened):
    """The palette over a solved frame around Alnitak, its names read."""
    commands = opened[1]
    qtbot.waitUntil(lambda: commands.presenter.overlay.tables is not None)
    box = commands.tools.search()
    qtbot.waitUntil(lambda: box._names is not None, timeout=60_000)
    return box, commands


def titles(box, group):
    return [result.title for result in box.results if result.group == group]


def test_it_opens_over_the_middle_of_the_window_and_enter_shows_what_is_in_the_frame(qtbot, palette):
    box, commands = palette
    around = QRect(commands.window.mapToGlobal(QPoint(0, 0)), commands.window.size())
    assert around.contains(box.geometry())
    assert abs(box.geometry().center().x() - around.center().x()) <= 1
    qtbot.keyClicks(box.field, "alnit")
    assert box.chosen.title == "Alnitak"
    assert box.chosen.group == FRAME
    qtbot.keyClick(box.field, Qt.Key.Key_Return)
    assert not box.isVisible()
    assert commands.presenter.overlay.picked.text == "Alnitak"


def test_one_letter_lists_the_frame_the_sky_and_commands(qtbot, palette):
    box, _ = palette
    qtbot.keyClicks(box.field, "a")
    assert "Alnitak" in titles(box, FRAME)
    assert "Sirius" in titles(box, SKY)  # alpha
    assert {"Alt/Az grid", "Actual pixels"} <= set(titles(box, COMMANDS))
    groups = [result.group for result in box.results]
    assert groups == sorted(groups, key=[FRAME, SKY, COMMANDS].index)
    keys = {result.title: result.side for result in box.results}
    assert keys["Alt/Az grid"] == "A"


@pytest.mark.parametrize(
    ("text", "title", "detail"),
    [("horologium dw", "Horologium Dwarf Galaxy", "PGC 14225"), ("large mag", "Large Magellanic Cloud", "ESO 56-115")],
)
def test_what_people_say_comes_before_a_number_that_nobody_does(qtbot, palette, text, title, detail):
    box, _ = palette
    qtbot.keyClicks(box.field, text)
    assert (box.chosen.title, box.chosen.detail.split(" · ")[0]) == (title, detail)


def test_enter_runs_a_command_and_the_arrows_choose(qtbot, palette):
    box, commands = palette
    grid = commands.actions["grid"]
    before = grid.isChecked()
    qtbot.keyClicks(box.field, "grid")
    while box.chosen.action is not grid:
        qtbot.keyClick(box.field, Qt.Key.Key_Down)
    qtbot.keyClick(box.field, Qt.Key.Key_Return)
    assert grid.isChecked() != before
    assert not box.isVisible()


def test_what_is_outside_has_its_distance_and_opens_on_the_chart(qtbot, palette):
    box, commands = palette
    qtbot.keyClicks(box.field, "vega")
    assert box.chosen.group == SKY
    assert box.chosen.side.endswith(("north", "north-east", "north-west"))
    vega = box.chosen.vector
    qtbot.keyClick(box.field, Qt.Key.Key_Return)
    atlas = commands.window.findChild(Atlas)
    assert atlas.chart.centre @ vega > 0.999999
    box = commands.tools.search()
    qtbot.waitUntil(lambda: box._names is not None)
    qtbot.keyClicks(box.field, "alnitak")
    qtbot.keyClick(box.field, Qt.Key.Key_Return, SHIFT)
    assert atlas.chart.centre @ vega < 0.5
    atlas.close()


def test_the_altitude_is_the_sites_now(qtbot, opened):
    """From the poles of the Earth declination is altitude, whenever it is: Vega stands at 38.8°."""
    commands = opened[1]
    for latitude, side in ((89.999, "alt 39°"), (-89.999, "below the horizon")):
        commands.services.settings.keep_site(Site(latitude, 0.0))
        box = commands.tools.search()
        qtbot.waitUntil(lambda box=box: box._names is not None, timeout=60_000)
        qtbot.keyClicks(box.field, "vega")
        assert box.chosen.side.endswith(f" · {side}")
        box.reject()


def test_alt_enter_slews_where_the_mount_may(qtbot, palette, monkeypatch):
    box, _ = palette
    asked = []
    box._aim = lambda *order: asked.append(order)
    qtbot.keyClicks(box.field, "vega")
    qtbot.keyClick(box.field, Qt.Key.Key_Return, ALT)
    assert box.isVisible()
    assert "Connect a mount first" in box.message.text()
    assert asked == []
    assert not box.slew.isEnabled()
    monkeypatch.setattr("kochab.window.shell.palette.reasons_against", lambda situation: {"goto": ""})
    qtbot.keyClick(box.field, Qt.Key.Key_Return, ALT)
    assert not box.isVisible()
    assert [order[0] for order in asked] == ["goto"]
    assert asked[0][1].startswith("279.2")


def test_an_export_is_a_command_while_there_is_a_solution(qtbot, palette):
    """Of all commands the exports alone could not be found."""
    box, commands = palette
    qtbot.keyClicks(box.field, "expo")
    assert [title.partition(":")[0] for title in titles(box, COMMANDS)] == ["Export"] * MOST[COMMANDS]
    commands.session.known.result = None
    commands.session.idle.emit()
    box.field.setText("export")
    assert titles(box, COMMANDS) == []


def test_a_slip_of_the_pen_is_answered_with_what_was_meant(qtbot, palette):
    box, _ = palette
    qtbot.keyClicks(box.field, "Betelgeuze")
    qtbot.waitUntil(lambda: bool(titles(box, MEANT) or titles(box, FRAME) or titles(box, SKY)))
    assert box.results[0].title == "Betelgeuse"
    box.field.setText("Planet of the apes")
    qtbot.waitUntil(lambda: box.message.text() != "")
    assert box.message.text() == "No object, star or command is called Planet of the apes."
    assert box.results == []


def test_coordinates_and_bodies_are_places(qtbot, palette):
    box, _ = palette
    box.field.setText("05h35m -5 23")
    assert [result.vector is not None for result in box.results] == [True]
    qtbot.waitUntil(lambda: len(box._around.bodies) > 0, timeout=60_000)
    box.field.setText("jup")
    assert "Jupiter" in titles(box, SKY)
    box.field.setText("433")  # a minor planet, which no list of names holds
    qtbot.waitUntil(lambda: any("Eros" in result.title for result in box.results), timeout=60_000)


def test_it_works_with_no_image(qtbot, make_window, engine):
    _, commands = make_window(engine)
    box = commands.tools.search()
    qtbot.waitUntil(lambda: box._names is not None, timeout=60_000)
    qtbot.keyClicks(box.field, "m 31")
    assert box.chosen.title == "Andromeda Galaxy"
    assert titles(box, FRAME) == []
    assert box.atlas.isEnabled()
    box.reject()


def test_a_screen_reader_is_told_the_line(qtbot, palette):
    box, _ = palette
    qtbot.keyClicks(box.field, "vega")
    assert box.field.accessibleDescription().startswith("Vega, ")
    box.reject()


def test_what_is_found_after_it_was_closed_is_told_to_nobody(qtbot, palette):
    box, commands = palette
    qtbot.keyClicks(box.field, "no such thing")
    box._wait.stop()
    box._seek()
    gone = []
    box.destroyed.connect(lambda: gone.append(True))
    box.reject()
    qtbot.waitUntil(lambda: bool(gone))
    assert commands.session.jobs.join(60.0)
    qtbot.wait(50)  # a signal that is still queued would reach labels that are gone


@pytest.mark.parametrize("theme", ["dark", "light", "night"])
def test_its_round_corners_show_what_is_behind_it(qtbot, palette, theme):
    """In the light theme white corners stood out on the dark image."""
    box, commands = palette
    commands.appearance.use_night(theme == "night")
    if theme != "night":
        commands.appearance.use_theme(theme)
    qtbot.waitUntil(lambda: commands.appearance.settled)
    seen = QImage(box.size(), QImage.Format.Format_ARGB32)
    seen.fill(QColor("magenta"))
    box.render(seen, QPoint(), QRegion(), QWidget.RenderFlag.DrawChildren | QWidget.RenderFlag.DrawWindowBackground)
    right, low = seen.width() - 1, seen.height() - 1
    for x, y in ((0, 0), (right, 0), (0, low), (right, low)):
        assert seen.pixelColor(x, y) == QColor("magenta")
    assert seen.pixelColor(right // 2, low // 2) != QColor("magenta")
    commands.appearance.use_night(False)
    commands.appearance.use_theme("dark")
    qtbot.waitUntil(lambda: commands.appearance.settled)
