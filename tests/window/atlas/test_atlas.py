"""The atlas: its projection beside astropy's, panels of a mosaic, and the chart used by mouse and keyboard."""

import json
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from astropy.wcs import WCS
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor, QGuiApplication, QImage, QPainter, QWheelEvent
from PySide6.QtWidgets import QApplication

from kochab.core.attitude import radec_deg, separation_deg, unit_vectors
from kochab.core.camera import Camera, ChartCamera
from kochab.core.frame import Hint, Site
from kochab.core.progress import run as finish
from kochab.sky.milky_way import MilkyWay
from kochab.window.atlas.chart import SPARE
from kochab.window.atlas.dialog import Atlas
from kochab.window.atlas.mosaic import Mosaic, border, frame_at
from kochab.window.atlas.sky_painting import paint_frame, paint_glow, paint_stars
from kochab.window.atlas.sky_reading import read_sky
from kochab.window.image.screen_image import Viewport
from kochab.window.themes import theme_colours
from tests.window.fakes import fake_solution
from tests.window.test_night import assert_red

BELT = unit_vectors(84.05, -1.2)
SKYFIELD = Path(__file__).parents[2] / "sky" / "solar_system.json"


@pytest.mark.parametrize(("ra", "dec", "field"), [(84.05, -1.2, 120.0), (10.0, 89.0, 180.0), (250.0, -60.0, 3.0)])
def test_the_chart_is_astropys_stereographic_projection(ra, dec, field):
    chart = frame_at(ChartCamera.of(600, 400, field), unit_vectors(ra, dec))
    theirs = WCS(naxis=2)
    theirs.wcs.ctype = ["RA---STG", "DEC--STG"]
    theirs.wcs.crval, theirs.wcs.crpix = (ra, dec), (300.5, 200.5)
    theirs.wcs.cdelt = np.array([-1.0, -1.0]) * np.degrees(1.0 / chart.camera.focal_px)
    rng = np.random.default_rng(1)
    away, around = 195.0 * np.sqrt(rng.random(50)), rng.uniform(0.0, 2.0 * np.pi, 50)
    xy = np.stack([299.5 + away * np.cos(around), 199.5 + away * np.sin(around)], axis=1)
    vectors = chart.sky_at(xy)
    assert theirs.all_world2pix(np.array([radec_deg(v) for v in vectors]), 0) == pytest.approx(xy, abs=1e-6)
    assert chart.pixels_of(vectors) == pytest.approx(xy, abs=1e-6)
    top, low = chart.sky_at(np.array([[299.5, -0.5], [299.5, 399.5]]))
    assert separation_deg(top, low) == pytest.approx(field)
    assert np.isnan(chart.pixels_of(-chart.centre_vector[None])).all()


def test_one_panel_is_the_frame_itself():
    frame = frame_at(Camera.centred(600, 400, 2855.0), BELT, 27.0)
    (panel,) = Mosaic(*frame.camera.fov_deg, rotation_deg=frame.roll_deg).panels(BELT)
    assert np.degrees(np.linalg.norm(border(panel) - border(frame), axis=1)).max() < 2e-3 * frame.camera.fov_deg[0]


@pytest.mark.parametrize("dec", [0.0, 60.0, -88.0])
def test_panels_overlap_as_asked_and_keep_their_position_angle(dec):
    middle = unit_vectors(84.0, dec)
    mosaic = Mosaic(2.0, 1.5, 30.0, columns=3, rows=2, overlap=0.2)
    panels = mosaic.panels(middle)
    assert len(panels) == 6
    assert [panel.roll_deg for panel in panels] == pytest.approx([30.0] * 6)
    centres = [panel.centre_vector for panel in panels]
    assert separation_deg(centres[0], centres[1]) == pytest.approx(0.8 * 2.0, rel=0.003)
    assert separation_deg(centres[0], centres[3]) == pytest.approx(0.8 * 1.5, rel=0.003)
    assert sum(centres) / np.linalg.norm(sum(centres)) == pytest.approx(middle, abs=1e-5)
    upper_left, around = centres[0], frame_at(Camera.centred(400, 300, 1000.0), middle, 30.0)
    assert (around.pixels_of(upper_left[None])[0] < (199.5, 149.5)).all()


@pytest.fixture
def atlas(qtbot, opened):
    """That of a window with a solved frame, the sky read."""
    window, commands = opened
    commands.actions["atlas"].trigger()
    made = window.findChild(Atlas)
    qtbot.waitUntil(lambda: made.chart.catalogue is not None)
    return made


def on_screen(chart, vector):
    x, y = chart.sheet.pixels_of(vector[None])[0] + 0.5
    return QPointF(x, y)


def test_the_open_frame_is_drawn_where_it_lies_with_the_sky_around_it(atlas, opened):
    chart, frame = atlas.chart, opened[1].presenter.overlay.solution
    assert chart.centre == pytest.approx(frame.centre_vector)
    picture, ratio = chart.grab().toImage(), chart.devicePixelRatio()
    line = QColor(theme_colours().identified)
    drawn = 0
    for vector in border(frame):
        at = on_screen(chart, vector)
        near = (
            picture.pixelColor(int(at.x() * ratio) + i, int(at.y() * ratio) + j) for i in (-1, 0, 1) for j in (-1, 0, 1)
        )
        drawn += any(abs(c.red() - line.red()) + abs(c.blue() - line.blue()) < 60 for c in near)
    assert drawn > 0.9 * len(border(frame))
    assert {"Betelgeuse", "Rigel"} <= {label.text for label in chart.overlay.labels}
    assert "Orion" in atlas.description.text()


def test_the_sky_follows_the_mouse_and_the_wheel_zooms(qtbot, atlas):
    chart = atlas.chart
    first, last = QPoint(200, 150), QPoint(260, 190)
    held = chart.sky_at(QPointF(first))
    qtbot.mousePress(chart, Qt.MouseButton.LeftButton, pos=first)
    for share in (0.25, 0.5, 0.75, 1.0):
        qtbot.mouseMove(chart, first + (last - first) * share)
    qtbot.mouseRelease(chart, Qt.MouseButton.LeftButton, pos=last)
    assert (on_screen(chart, held) - QPointF(last)).manhattanLength() < 2.0
    before, middle = chart.field_deg, QPointF(chart.rect().center())
    turn = QWheelEvent(
        middle, chart.mapToGlobal(middle), QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(chart, turn)
    assert chart.field_deg == pytest.approx(before / 1.25)


def test_the_keyboard_turns_zooms_and_comes_back(qtbot, atlas):
    chart = atlas.chart
    home, field = chart.centre, chart.field_deg
    qtbot.keyClick(chart, Qt.Key.Key_Up)
    assert radec_deg(chart.centre)[1] > radec_deg(home)[1] + 1.0
    for _ in range(20):
        qtbot.keyClick(chart, Qt.Key.Key_Minus)
    assert chart.field_deg == 180.0
    assert not chart.grab().isNull()  # a hemisphere is drawn
    qtbot.keyClick(chart, Qt.Key.Key_0)
    assert (chart.centre, chart.field_deg) == (pytest.approx(home), field)


def test_what_is_sought_comes_to_the_middle(qtbot, atlas):
    atlas.sought.setText("Vega")
    qtbot.keyClick(atlas.sought, Qt.Key.Key_Return)
    assert radec_deg(atlas.chart.centre) == pytest.approx((279.23, 38.78), abs=0.02)
    assert "Lyra" in atlas.description.text()
    atlas.sought.setText("Planet of the apes")
    qtbot.keyClick(atlas.sought, Qt.Key.Key_Return)
    assert "called" in atlas.description.text()


def test_a_click_names_a_star(qtbot, atlas):
    atlas.chart.grab()
    at = on_screen(atlas.chart, unit_vectors(88.793, 7.407)).toPoint()
    qtbot.mouseClick(atlas.chart, Qt.MouseButton.LeftButton, pos=at)
    assert atlas.description.text().splitlines()[0] == "Betelgeuse"


def test_the_panels_are_drawn_and_copied(atlas):
    assert not atlas.copy.isEnabled()
    frame = atlas.chart.frame
    assert atlas.wide.value() == pytest.approx(frame.camera.fov_deg[0], abs=0.01)
    assert atlas.turn.value() == pytest.approx(frame.roll_deg, abs=0.1)
    before = atlas.chart.grab().toImage()
    atlas.framing.setChecked(True)
    atlas.columns.setValue(2)
    assert atlas.chart.grab().toImage() != before
    atlas.copy.click()
    lines = QGuiApplication.clipboard().text().splitlines()
    assert len(lines) == 2
    assert re.fullmatch(r"1\t[\d: .+-]+\t27", lines[0])


def test_the_middle_is_centred_by_a_mount_that_can(monkeypatch, atlas, opened):
    sent = []
    monkeypatch.setattr(atlas, "_aim", lambda *order: sent.append(order))
    assert not atlas.centre.isEnabled()
    assert atlas.centre.toolTip()  # says why not
    monkeypatch.setattr("kochab.window.atlas.dialog.reasons_against", lambda _: {"centre": "", "goto": ""})
    atlas.chart.look(BELT)
    assert atlas.centre.isEnabled()
    atlas.centre.click()
    ((action, target),) = sent
    assert action == "centre"
    assert [float(part) for part in target.split()] == pytest.approx([84.05, -1.2], abs=1e-5)


def test_its_menu_names_the_object_and_brings_it_to_the_middle(atlas):
    atlas.chart.grab()
    betelgeuse = unit_vectors(88.793, 7.407)
    menu = atlas._offer(on_screen(atlas.chart, betelgeuse), QPoint(0, 0))
    first, *_, last = menu.actions()
    assert first.text() == "Betelgeuse"
    last.trigger()
    assert separation_deg(atlas.chart.centre, betelgeuse) < 0.01
    menu.close()


def test_at_night_it_is_red(qtbot, atlas, opened):
    commands = opened[1]
    commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: commands.appearance.settled)
    atlas.framing.setChecked(True)
    assert_red(atlas)
    commands.appearance.use_theme("dark")


def test_a_later_frame_leaves_the_chart_where_it_was_turned(atlas):
    atlas.chart.look(unit_vectors(10.0, 40.0), 30.0)
    atlas._services.session.solved.emit(fake_solution(300, 200))
    assert radec_deg(atlas.chart.centre) == pytest.approx((10.0, 40.0))
    assert atlas.chart.frame.camera.width == 300


# -- The Solar System -----------------------------------------------------------------------------


@pytest.fixture
def dated(qtbot, opened):
    """The atlas beside a frame that says when and where it was taken, and skyfield's places of then."""
    told = json.loads(SKYFIELD.read_text("utf-8"))["rows"][4]
    window, commands = opened
    known = commands.session.known
    hint = Hint(time_utc=datetime.fromisoformat(told["utc"]), site=Site(*told["site"]))
    known.frame = replace(known.frame, hint=hint)
    commands.actions["atlas"].trigger()
    made = window.findChild(Atlas)
    qtbot.waitUntil(lambda: made.chart.catalogue is not None and bool(made.chart._bodies))
    return made, told["places"]


def test_planets_stand_where_they_were_when_the_open_frame_was_taken(qtbot, dated):
    atlas, places = dated
    assert "2005-07-11 16:59" in atlas.dated.text()
    chart = atlas.chart
    for name, (ra, dec, *_) in places.items():
        if name == "Pluto":  # fainter than the chart's stars, but always there
            continue
        chart.look(unit_vectors(ra, dec), 60.0)
        chart.grab()
        mark = next(mark for mark in chart.overlay.sky.marks if mark.text == name)
        assert separation_deg(mark.body.vector, unit_vectors(ra, dec)) < 1.0 / 3600.0
        assert np.hypot(*(mark.xy + 0.5 - (chart.width() / 2.0, chart.height() / 2.0))) < 0.1
        assert name in {label.text for label in chart.overlay.labels}


def test_a_planet_is_sought_clicked_and_told(qtbot, dated):
    atlas, places = dated
    atlas.sought.setText("jupiter")
    qtbot.keyClick(atlas.sought, Qt.Key.Key_Return)
    chart = atlas.chart
    assert radec_deg(chart.centre) == pytest.approx(places["Jupiter"][:2], abs=1e-3)
    chart.grab()
    qtbot.mouseClick(chart, Qt.MouseButton.LeftButton, pos=chart.rect().center())
    told = atlas.description.text().splitlines()
    assert told[:3] == ["Jupiter", "Planet", "In  Virgo"]
    assert "Magnitude  -1.9" in told or "Magnitude  −1.9" in told
    assert "Io" not in {mark.text for mark in chart.overlay.sky.marks}
    chart.look(chart.centre, 0.3)
    chart.grab()
    assert {"Io", "Europa", "Ganymede", "Callisto"} <= {mark.text for mark in chart.overlay.sky.marks}


def test_without_a_date_planets_stand_where_they_are(qtbot, atlas):
    qtbot.waitUntil(lambda: bool(atlas.chart._bodies))
    told = re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d", atlas.dated.text()).group()
    assert abs(datetime.now(UTC) - datetime.fromisoformat(f"{told}+00:00")) < timedelta(minutes=30)
    assert {"Sun", "Moon", "Jupiter"} <= {body.name for body in atlas.chart._bodies}


def test_the_open_frame_is_painted_where_its_pixels_lie(qapp):
    """Red grows to the right and blue downwards, through a lens with distortion: so they do along the sky."""
    frame = fake_solution(600, 400)
    camera = replace(frame.camera, k1=-0.1)
    frame = replace(frame, camera=camera)
    sheet = frame_at(ChartCamera.of(500, 400, 20.0), frame.centre_vector)
    pixels = np.zeros((200, 300, 3), np.uint8)
    pixels[:, :, 0] = np.linspace(20, 250, 300)
    pixels[:, :, 2] = np.linspace(20, 250, 200)[:, None]
    image = QImage(pixels.data, 300, 200, 900, QImage.Format.Format_RGB888).copy()
    canvas = QImage(500, 400, QImage.Format.Format_RGB32)
    canvas.fill(0)
    painter = QPainter(canvas)
    paint_frame(painter, image, frame, sheet, Viewport(500, 400))
    painter.end()
    x, y = np.meshgrid(np.linspace(8, camera.width - 9, 25), np.linspace(8, camera.height - 9, 17))
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    for place, at in zip(places.tolist(), sheet.pixels_of(frame.sky_at(places)).tolist(), strict=True):
        red, green, blue, _ = canvas.pixelColor(round(at[0]), round(at[1])).getRgb()
        wanted = [20.0 + 230.0 * place[0] / (camera.width - 1), 20.0 + 230.0 * place[1] / (camera.height - 1)]
        assert [red, blue] == pytest.approx(wanted, abs=4.0), place  # two pixels of the chart
        assert green == 0
    outside = sheet.pixels_of(frame.sky_at(np.array([[-12.0, 100.0], [300.0, -12.0], [camera.width + 12.0, 50.0]])))
    assert [canvas.pixelColor(round(px), round(py)).getRgb()[:3] for px, py in outside.tolist()] == [(0, 0, 0)] * 3


def test_the_chart_holds_the_image_of_the_open_frame(atlas):
    """Its middle is as bright as the frame's, and it is left out where it would be a dot."""
    image = atlas.chart.image()
    assert max(image.width(), image.height()) <= 900
    bright = atlas.chart.grab().toImage()
    atlas.chart.image = lambda: None
    atlas.chart.repaint()
    atlas.chart._picture = None
    assert bright != atlas.chart.grab().toImage()


def test_stars_have_their_colours(atlas, opened):
    """Betelgeuse (B-V 1.85) is orange, Rigel (-0.03) blue; at night there is red light alone."""

    def middle(ra, dec):
        atlas.chart.look(unit_vectors(ra, dec), 10.0)
        image, ratio = atlas.chart.grab().toImage(), atlas.chart.devicePixelRatio()
        x, y = round(atlas.chart.width() / 2 * ratio), round(atlas.chart.height() / 2 * ratio)
        around = (image.pixelColor(x + i, y + j) for i in range(-3, 4) for j in range(-3, 4))  # a figure may cross it
        colour = max(around, key=lambda c: (abs(c.red() - c.blue()), c.red()))
        return colour.red(), colour.green(), colour.blue()

    red, green, blue = middle(88.793, 7.407)
    assert red > green + 30 > blue + 60
    red, green, blue = middle(78.634, -8.202)
    assert blue > red + 30
    opened[1].appearance.use_theme("night")
    assert middle(78.634, -8.202)[1:] == (0, 0)
    opened[1].appearance.use_theme("dark")


def test_the_milky_way_glows_behind_the_stars(atlas, opened):
    """Between its stars the cloud in Cygnus is brighter than the sky beside it, and at night red as all else."""

    def ground(ra, dec):
        atlas.chart.look(unit_vectors(ra, dec), 40.0)
        image = atlas.chart.grab().toImage()
        x, y = image.width() // 2, image.height() // 2
        pixels = [image.pixelColor(x + i, y + j) for i in range(-40, 41, 2) for j in range(-40, 41, 2)]
        return np.median([[c.red(), c.green(), c.blue()] for c in pixels], axis=0)

    cygnus, beside = ground(305.0, 38.0), ground(230.0, 45.0)
    assert (cygnus > beside + 8).all()
    atlas.chart.look(unit_vectors(305.0, 38.0), 3.0)
    opened[1].appearance.use_theme("night")
    assert list(ground(305.0, 38.0)[1:]) == [0, 0]
    opened[1].appearance.use_theme("dark")


class Counted(MilkyWay):
    """Counts the directions that are asked for."""

    __slots__ = ("asked",)

    def brightness(self, vectors):
        object.__setattr__(self, "asked", len(vectors))
        return super().brightness(vectors)


@pytest.mark.parametrize("field", [180.0, 60.0, 12.0])
def test_the_glow_of_a_4k_chart_asks_for_no_more_places_than_its_clouds_have(qapp, monkeypatch, field):
    """At 4K every fifth pixel was a third of a million places, most of the time that a chart takes to draw."""
    longitude, latitude = np.radians(np.arange(360) + 0.5), np.arange(180) - 89.5
    clouds = 0.6 + 0.4 * np.sin(20.0 * longitude)  # as fine as a glow smoothed by 1.8 degrees can be, at full contrast
    light = np.exp(-0.5 * (latitude[:, None] / 6.0) ** 2) * clouds
    glow = Counted(light)
    sheet = frame_at(ChartCamera.of(3840, 2160, field), unit_vectors(266.4, -28.9))

    def drawn():
        image = QImage(3840, 2160, QImage.Format.Format_RGB32)
        image.fill(QColor("#0c0e11"))
        painter = QPainter(image)
        paint_glow(painter, glow, sheet, image.rect(), (QColor("#000000"), QColor("#dce8f6")))
        painter.end()
        return np.frombuffer(image.constBits(), np.uint8).reshape(2160, 3840, 4)[::3, ::3].astype(int)

    seen, asked = drawn(), glow.asked
    monkeypatch.setattr("kochab.window.atlas.sky_painting.GLOW_STEP_PX", (5.0, 5.0))
    finer = drawn()
    assert glow.asked > 330_000
    assert asked < 125_000 if field == 180.0 else asked < 10_000
    assert finer.max() > 50, "there is a glow"
    assert np.abs(seen - finer).max() <= 4, "nobody sees the difference"


@pytest.mark.parametrize(("field", "amount"), [(60.0, 0.5), (37.0, 0.5), (25.0, 0.5), (8.0, 1.0)])
def test_a_chart_names_what_it_would_from_all_tables(atlas, field, amount):
    """It leaves the rest out before it looks for names: at 4K that took half of the time of a turn."""
    chart = atlas.chart
    for layer in ("names", "objects"):
        chart.overlay.layers.amount[layer] = amount

    def named():
        chart.look(BELT, field)
        chart.repaint()
        return [(label.text, label.box) for label in chart.overlay.labels], len(chart.overlay.sky.marks)

    from_some, some = named()
    chart._suiting = {(step, *[min(1.0, amount + SPARE)] * 2): chart._tables for step in range(-20, 100)}
    chart._key = None
    from_all, all_there_are = named()
    assert from_all == from_some
    assert len(from_some) > 10
    assert some < all_there_are


def test_a_star_lies_where_it_is_to_a_quarter_of_a_pixel(qapp):
    """Copies of discs have their places between pixels."""
    image = QImage(40, 30, QImage.Format.Format_RGB32)
    rng = np.random.default_rng(3)
    for place, diameter in zip(rng.uniform(8.0, 22.0, (20, 2)), rng.uniform(1.1, 7.0, 20), strict=True):
        image.fill(QColor("#000000"))
        painter = QPainter(image)
        paint_stars(painter, np.array([place, [np.nan, 1.0]]), np.array([diameter, 3.0]), ["#ffffff", "#ffffff"])
        painter.end()
        light = np.frombuffer(image.constBits(), np.uint8).reshape(30, 40, 4)[..., 0].astype(float)
        x, y = np.meshgrid(np.arange(40) + 0.5, np.arange(30) + 0.5)
        seen = np.array([(light * x).sum(), (light * y).sum()]) / light.sum()
        assert seen == pytest.approx(place, abs=0.27)
        assert light.sum() / 255.0 == pytest.approx(np.pi * diameter**2 / 4.0, rel=0.2, abs=0.4)


def test_a_turning_chart_paints_over_the_picture_before(atlas):
    """To have the memory of another takes a quarter of the time at 4K."""
    chart = atlas.chart
    chart.repaint()
    before = chart._picture[1]
    chart.look(unit_vectors(80.0, 5.0))
    chart.repaint()
    assert chart._picture[1] is before


def test_charts_share_one_count_of_the_milky_way():
    """It takes half a second of processor: the atlas and each mount room counted it anew."""
    first, second = finish(read_sky()), finish(read_sky())
    assert first[2] is second[2]
