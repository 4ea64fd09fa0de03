"""The limits of a mount in its view: the horizon is drawn, read and kept, and the guard goes by it at once."""

import numpy as np
import pytest
from PySide6.QtCore import Qt

from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.profiles import current_profile
from kochab.window.mount.limits import HorizonPicture
from kochab.window.themes import THEME_TITLES, theme_colours
from tests.gear.mounts.bench import place
from tests.window.mount_bench import connected


def pixel_at(picture, azimuth_deg, altitude_deg):
    return picture._at(azimuth_deg, altitude_deg).toPoint()


def draw(qtbot, picture, button, *places):
    """A mouse drag across azimuths and altitudes."""
    points = [pixel_at(picture, *place) for place in places]
    qtbot.mousePress(picture, button, pos=points[0])
    for point in points[1:]:
        qtbot.mouseMove(picture, point)
    qtbot.mouseRelease(picture, button, pos=points[-1])


def test_a_drawn_horizon_is_kept_and_stops_a_goto_behind_it(qtbot, opened, settings):
    _, commands = opened
    with connected(qtbot, commands, "onstep") as mount:
        view, picture = mount.view, mount.view.limits.picture
        altitude, azimuth = mount.control.known.report.altaz_deg
        assert f"the mount is {altitude:.0f}° high at azimuth {azimuth:.0f}°" in picture.accessibleName()
        picture.resize(720, 200)
        target = place(-20.0, 30.0, mount.bench.clock)
        there = mount.opening.guard.policy.altaz_deg(
            mount.opening.guard.position().__class__(*target, mount.opening.guard.epoch)
        )
        assert mount.opening.guard.preview_goto(*target).allowed
        draw(
            qtbot, picture, Qt.MouseButton.LeftButton, *((there[1] + step, there[0] + 20.0) for step in range(-10, 11))
        )
        kept = dict(current_profile(settings).horizon_deg)
        assert len(kept) == 72
        assert kept[round(there[1] / 5.0) * 5.0] == pytest.approx(there[0] + 20.0, abs=2.0)
        assert kept[(round(there[1] / 5.0) * 5.0 + 180.0) % 360.0] == 0.0
        qtbot.waitUntil(lambda: bool(mount.opening.guard.limits.horizon_deg), timeout=10_000)
        qtbot.waitUntil(lambda: not mount.control.known.busy, timeout=10_000)
        view.go.target.setText(f"{target[0]:.4f} {target[1]:.4f}")
        view.go.goto.click()
        qtbot.waitUntil(lambda: any("the limit is" in s for s in mount.said), timeout=20_000)
        assert not mount.telescope.log
        draw(qtbot, picture, Qt.MouseButton.RightButton, *((there[1] + step, 10.0) for step in range(-12, 13)))
        assert current_profile(settings).horizon_deg is None
        qtbot.waitUntil(lambda: not mount.opening.guard.limits.horizon_deg, timeout=10_000)


def test_a_quick_stroke_leaves_no_gap_and_goes_the_way_of_the_pointer(qtbot):
    picture = HorizonPicture()
    qtbot.addWidget(picture)
    picture.resize(720, 200)
    drawn = []
    picture.drawn.connect(lambda horizon: drawn.append(dict(horizon)))
    draw(qtbot, picture, Qt.MouseButton.LeftButton, (100.0, 20.0), (160.0, 50.0))
    assert [drawn[0][azimuth] for azimuth in range(100, 161, 5)] == pytest.approx(np.linspace(20.0, 50.0, 13), abs=1.0)
    assert sum(drawn[0].values()) == pytest.approx(13 * 35.0, abs=13.0), "and nowhere else"
    draw(qtbot, picture, Qt.MouseButton.LeftButton, (130.0, 20.0), (130.0, 10.0))
    assert drawn[1][130.0] == pytest.approx(10.0, abs=1.0)
    draw(qtbot, picture, Qt.MouseButton.RightButton, (160.0, 50.0), (100.0, 20.0))
    assert drawn[2] == {}
    draw(qtbot, picture, Qt.MouseButton.LeftButton, (340.0, 30.0), (400.0, 30.0))  # out of the drawing, past north
    assert {azimuth for azimuth, height in drawn[3].items() if height} == {340.0, 345.0, 350.0, 355.0, 0.0}


def test_fields_and_a_file_set_the_limits_before_a_mount_is_connected(qtbot, opened, settings, tmp_path):
    _, commands = opened
    commands.views.show("mount")
    box = commands.views.docks["mount"].view.limits
    for field, value in ((box.lowest, 12.0), (box.past, 3.0)):
        field.setValue(value)
        field.editingFinished.emit()
    limits = current_profile(settings).limits
    assert (limits.lowest_altitude_deg, limits.past_meridian_deg) == (12.0, 3.0)
    assert not box.clear.isEnabled()
    path = tmp_path / "garden.txt"
    path.write_text("# house\n0 5\n90 41\n180 5\n", "utf-8")
    box.read(str(path))
    assert current_profile(settings).limits.horizon_deg == ((0.0, 5.0), (90.0, 41.0), (180.0, 5.0))
    assert "to 41° (azimuth 90°)" in box.picture.accessibleName()
    box.clear.click()
    assert current_profile(settings).limits.horizon_deg == ()
    said = []
    box.message.connect(lambda sentence, role: said.append(sentence))
    path.write_text("trees", "utf-8")
    box.read(str(path))
    assert "is not a horizon" in said[0]


def test_what_is_forbidden_and_where_the_mount_points_is_seen(qtbot, use_theme):
    picture = HorizonPicture()
    qtbot.addWidget(picture)
    picture.resize(800, 240)
    picture.show_limits(
        Limits(horizon_deg=((0.0, 0.0), (80.0, 0.0), (90.0, 60.0), (100.0, 0.0)), highest_altitude_deg=80.0)
    )
    for theme in THEME_TITLES:
        use_theme(theme)
        colours = theme_colours()

        def colour(azimuth, altitude):
            return picture.grab().toImage().pixelColor(pixel_at(picture, azimuth, altitude)).name()

        assert colour(90.0, 40.0) == colour(200.0, 2.0) == colour(200.0, 85.0) == colours.hover
        assert colour(90.0, 70.0) == colour(200.0, 20.0) == colours.window
        picture.show_mount((30.0, 200.0))
        assert colour(200.0, 30.0) == colours.accent
        picture.show_mount(None)
