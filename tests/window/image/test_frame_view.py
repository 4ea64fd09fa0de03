"""The frame on the screen: zoom, pan, marks, and the table that follows them."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QPoint, QPointF, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QWheelEvent

from kochab.core.frame import Site
from kochab.frames.export import compass
from kochab.sky.horizon import Horizon
from kochab.sky.layer import BODY_MAG, LINES, MARKS, Layers, Mark
from kochab.sky.sky_tables import sky_tables
from kochab.sky.solar_system import Body, BodyKind
from kochab.window.image.overlay import Overlay
from kochab.window.image.screen_image import Viewport
from kochab.window.themes import HUES, theme_colours
from tests.window.fakes import fake_solution


def wheel(view, at, steps):
    view.wheelEvent(
        QWheelEvent(
            QPointF(at),
            QPointF(view.mapToGlobal(at)),
            QPoint(),
            QPoint(0, 120 * steps),
            Qt.MouseButton.NoButton,
            Qt.KeyboardModifier.NoModifier,
            Qt.ScrollPhase.NoScrollPhase,
            False,
        )
    )


@given(st.floats(0.02, 30), st.floats(-900, 900), st.floats(0, 800), st.floats(0.1, 10))
def test_zoom_holds_the_place_under_the_cursor(scale, dx, at, factor):
    before = Viewport(800, 600, scale, dx, -dx)
    after = before.zoomed(factor, at, at / 2)
    assert after.to_image(at, at / 2) == pytest.approx(before.to_image(at, at / 2), abs=1e-6)


@given(st.floats(0.02, 30), st.floats(-900, 900))
def test_screen_and_image_are_inverse(scale, dx):
    view = Viewport(800, 600, scale, dx, 17.0)
    x, y = view.to_screen(np.array([[12.5, 300.0]]))[0]
    assert view.to_image(x, y) == pytest.approx((12.5, 300.0), abs=1e-6)


def test_the_first_pixels_centre_is_half_a_pixel_in():
    assert Viewport(100, 100, 10.0).to_screen(np.array([[0.0, 0.0]]))[0].tolist() == [5.0, 5.0]


def test_wheel_zooms_at_the_cursor(opened):
    view = opened[0].workspace.view
    at = QPoint(200, 150)
    before, scale = view.viewport.to_image(200, 150), view.viewport.scale
    wheel(view, at, 2)
    assert view.viewport.scale == pytest.approx(scale * 1.25**2)
    assert view.viewport.to_image(200, 150) == pytest.approx(before, abs=1e-6)


def test_drag_pans_and_a_click_does_not(qtbot, opened):
    view = opened[0].workspace.view
    view.actual_pixels()
    view.zoom_in()
    view.zoom_in()
    before = view.viewport
    qtbot.mousePress(view, Qt.MouseButton.LeftButton, pos=QPoint(300, 200))
    qtbot.mouseMove(view, QPoint(280, 190))
    qtbot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=QPoint(280, 190))
    assert view.viewport.dx == pytest.approx(before.dx - 20)
    assert view.viewport.dy == pytest.approx(before.dy - 10)
    moved = view.viewport
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(30, 20))
    assert view.viewport == moved


def test_the_frame_cannot_be_lost_by_panning(opened):
    view = opened[0].workspace.view
    view.actual_pixels()
    view._look(view.viewport.panned(1e5, -1e5))
    corners = view.viewport.to_screen(np.array([[0.0, 0.0], [599.0, 399.0]]))
    assert corners[0, 0] < view.width()
    assert corners[1, 1] > 0


def test_fit_follows_the_window_and_one_to_one_does_not(qtbot, opened):
    window, commands = opened
    view = window.workspace.view
    commands.actions["fit"].trigger()
    window.resize(900, 700)
    qtbot.wait(30)
    corners = view.viewport.to_screen(np.array([[-0.5, -0.5], [599.5, 399.5]]))
    assert (corners >= 0).all()
    assert corners[1, 0] <= view.width()
    commands.actions["one"].trigger()
    assert view.viewport.scale == pytest.approx(1.0)
    assert commands.actions["fit"].iconText() == "Fit 100 %"


def test_keys_zoom_move_and_switch(qtbot, opened):
    window, commands = opened
    view = window.workspace.view
    view.setFocus()
    qtbot.keyClick(view, Qt.Key.Key_1)
    scale = view.viewport.scale
    qtbot.keyClick(view, Qt.Key.Key_Plus)
    qtbot.keyClick(view, Qt.Key.Key_Plus)
    assert view.viewport.scale == pytest.approx(scale * 1.5**2)
    dx = view.viewport.dx
    qtbot.keyClick(view, Qt.Key.Key_Right)
    assert view.viewport.dx < dx
    assert commands.actions["grid"].isChecked()
    qtbot.keyClick(view, Qt.Key.Key_G)
    assert not commands.presenter.overlay.layers.on["grid"]


def painted(overlay, view=None):
    image = QImage(600, 400, QImage.Format.Format_RGB32)
    image.fill(Qt.GlobalColor.black)
    painter = QPainter(image)
    overlay.paint(painter, view or Viewport(600, 400))
    painter.end()
    return np.frombuffer(image.constBits(), np.uint8).reshape(400, 600, 4)[..., :3].astype(int)


def jupiter_at(x, y, radius=0.0):
    """Jupiter at a place of the frame, px."""
    body = Body("Jupiter", BodyKind.PLANET, 84.0, -1.2, 4.2, -2.5, 46.1, 0.99, 0.1)
    ring = np.array([[x - radius, y], [x, y + radius], [x + radius, y], [x - radius, y]])
    return Mark("planet", 0, np.array([x, y]), radius, -62.5, "Jupiter", "Jupiter", (ring,), body)


@pytest.mark.parametrize("radius", [0.0, 30.0])  # a dot, and a disc of its own
def test_a_body_is_named_and_drawn_without_the_objects(qtbot, radius):
    overlay = Overlay(Layers(dict.fromkeys(MARKS, False) | {"bodies": True}), tables=sky_tables())
    overlay.show(np.empty((0, 2)), fake_solution(600, 400))
    assert painted(overlay).sum() == 0
    overlay.show_bodies((jupiter_at(150.0, 100.0, radius),))
    assert painted(overlay).sum() > 0
    assert [label.text for label in overlay.labels] == ["Jupiter"]
    assert overlay.mark_at(151.0, 100.0, 5.0).text == "Jupiter"
    overlay.layers.on |= {"bodies": False, "objects": True}
    painted(overlay)
    assert "Jupiter" not in [label.text for label in overlay.labels]
    overlay.show(np.empty((0, 2)), fake_solution(600, 400))
    assert overlay.bodies == ()  # the frame before's


def everything():
    """An overlay with all marks on, over Orion's belt in a winter's night."""
    night = Horizon(Site(50.0, 8.0), datetime(2026, 1, 15, 22, 0, tzinfo=UTC))
    overlay = Overlay(Layers(dict.fromkeys(MARKS, True)), lambda: night, tables=sky_tables())
    overlay.show(np.array([[300.0, 50.0]]), fake_solution(600, 400))
    overlay.show_bodies((jupiter_at(150.0, 100.0),))
    return overlay


@pytest.mark.parametrize("mark", sorted({*MARKS} - {"ecliptic", "galactic"}))
def test_each_mark_can_be_switched(qtbot, mark):
    overlay = everything()
    every = painted(overlay)
    overlay.layers.on[mark] = False
    without = painted(overlay)
    assert (every != without).any()
    assert every.sum() > without.sum() or mark in (
        "names",
        "objects",
        "bodies",
        "grid",
        "altaz",
    )  # whose dark edges may cover more


def test_without_time_or_site_there_is_no_horizon_to_draw(qtbot):
    overlay = everything()
    overlay.layers.on = dict.fromkeys(MARKS, False) | {"altaz": True}
    assert painted(overlay).sum() > 0
    overlay.horizon = lambda: None
    assert painted(overlay).sum() == 0


@pytest.mark.parametrize("layer", sorted(LINES))
def test_more_of_a_layer_of_lines_is_stronger(layer):
    layers = Layers()
    strengths = []
    for layers.amount[layer] in (0.0, 0.25, 0.5, 0.75, 1.0):
        strengths.append(layers.opaque(layer))
    assert strengths == sorted(strengths)
    assert (strengths[2], strengths[-1]) == (LINES[layer][1], 255)
    assert 0 < strengths[0] < 100


def test_fewer_bodies_are_the_brighter_ones(qtbot):
    overlay = Overlay(Layers(dict.fromkeys(MARKS, False) | {"bodies": True}), tables=sky_tables())
    overlay.show(np.empty((0, 2)), fake_solution(600, 400))
    faint = replace(jupiter_at(300.0, 300.0), text="Alcathous", short="Alcathous", mag=15.0 - BODY_MAG)
    overlay.show_bodies((jupiter_at(150.0, 100.0), faint))
    painted(overlay)
    assert [label.text for label in overlay.labels] == ["Jupiter", "Alcathous"]
    overlay.layers.amount["bodies"] = 0.5
    painted(overlay)
    assert [label.text for label in overlay.labels] == ["Jupiter"]


@pytest.mark.parametrize("layer", sorted({*MARKS} - {"ecliptic", "galactic"}))
def test_a_layer_has_the_colour_that_was_chosen_and_at_night_red_alone(qtbot, use_theme, layer):
    overlay = everything()
    overlay.layers.on = dict.fromkeys(MARKS, False) | {layer: True}
    overlay.layers.colour[layer] = HUES["Violet"]
    assert shows(painted(overlay), QColor(HUES["Violet"]))
    use_theme("night")
    assert painted(overlay)[..., 2].max() > 0
    assert painted(overlay)[..., :2].max() == 0


def test_nothing_is_marked_when_everything_is_off(qtbot):
    overlay = everything()
    overlay.layers.on = dict.fromkeys(MARKS, False)
    assert painted(overlay).sum() == 0


def test_at_first_names_are_the_catalogues_and_no_star_is_circled(qtbot):
    overlay = Overlay(tables=sky_tables())
    overlay.show(np.array([[300.0, 50.0]]), fake_solution(600, 400))
    amber, blue = (QColor(colour) for colour in (theme_colours().detected, theme_colours().identified))
    overlay.layers.on |= {"compass": False, "objects": True}
    image = painted(overlay)
    assert not shows(image, amber)
    assert not shows(image, blue)
    texts = [label.text for label in overlay.labels]
    assert {"Alnilam", "Alnitak", "Mintaka", "NGC 2024 Flame Nebula"} <= {*texts}
    assert not [text for text in texts if text.startswith(("J0", "HIP", "HD"))]


def test_no_name_lies_over_the_card_or_another_name(qtbot):
    overlay = everything()
    overlay.covered = [QRect(0, 200, 600, 200)]
    painted(overlay)
    boxes = [QRectF(*label.box) for label in overlay.labels]
    assert len(boxes) > 3
    assert not [box for box in boxes if box.intersects(QRectF(0, 200, 600, 200))]
    assert not [1 for k, box in enumerate(boxes) for other in boxes[:k] if box.intersects(other)]


def test_a_name_that_the_tables_lack_is_no_loss(qtbot):
    """Before the tables are read the frame is shown without them."""
    overlay = everything()
    overlay.tables = None
    assert overlay.sky is None
    painted(overlay)


@pytest.mark.parametrize("scale", [0.5, 1.0, 4.0])
def test_circles_lie_on_their_star_and_keep_their_size(qtbot, scale):
    overlay = Overlay(Layers(dict.fromkeys(MARKS, True)))
    overlay.show(np.array([[40.0, 30.0]]), None)
    view = Viewport(600, 400, scale, 20.0, 30.0)
    ys, xs = np.nonzero(painted(overlay, view).sum(axis=2) > 200)
    x, y = view.to_screen(np.array([[40.0, 30.0]]))[0]
    assert (xs.min() + xs.max() + 1) / 2 == pytest.approx(x, abs=0.6)
    assert (ys.min() + ys.max() + 1) / 2 == pytest.approx(y, abs=0.6)
    assert np.ptp(xs) == pytest.approx(10, abs=1.5)


def test_a_star_is_circled_once_unless_identified_ones_are_off(qtbot):
    solution = fake_solution(600, 400, stars=1)
    overlay = Overlay(Layers(dict.fromkeys(MARKS, True)))
    overlay.show(np.array([[s.x, s.y] for s in solution.stars]), solution)
    for mark in ("names", "grid", "centre", "compass"):
        overlay.layers.on[mark] = False
    amber = QColor(theme_colours().detected)
    assert not shows(painted(overlay), amber)
    overlay.layers.on["identified"] = False
    assert shows(painted(overlay), amber)


def shows(image, colour):
    want = np.array([colour.blue(), colour.green(), colour.red()])
    hue = image / np.maximum(image.max(axis=2, keepdims=True), 1)
    return bool(((np.abs(hue - want / want.max()) < 0.08).all(axis=2) & (image.max(axis=2) > 100)).any())


def test_north_and_east_of_an_unrotated_frame(qtbot):
    from kochab.core.attitude import attitude_from

    solution = replace(fake_solution(600, 400), attitude=attitude_from(84.0, 20.0, 0.0))
    north, east = compass(solution)
    assert north == pytest.approx((0.0, -1.0), abs=1e-3)
    assert east == pytest.approx((-1.0, 0.0), abs=1e-3)
    mirrored = replace(solution, camera=replace(solution.camera, mirrored=True))
    assert compass(mirrored)[1] == pytest.approx((1.0, 0.0), abs=1e-3)


def test_a_row_selects_its_star_in_the_frame_and_back(qtbot, opened):
    window, commands = opened
    table, view = window.workspace.stars, window.workspace.view
    table.table.selectRow(3)
    star = table.selected
    assert commands.presenter.overlay.selected == star
    other = commands.session.known.result.stars[7]
    x, y = view.viewport.to_screen(np.array([[other.x, other.y]]))[0]
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(round(x), round(y)))
    assert table.selected == 7
    assert commands.presenter.overlay.selected == 7


def test_a_click_on_empty_sky_selects_nothing(qtbot, opened):
    window, commands = opened
    window.workspace.stars.select(2)
    window.workspace.view.clicked.emit(-500.0, -500.0, 14.0)
    assert commands.presenter.overlay.selected is None
    assert window.workspace.stars.selected is None


def test_selecting_a_star_out_of_sight_brings_it_into_sight(opened):
    window, commands = opened
    view = window.workspace.view
    view.actual_pixels()
    for _ in range(6):
        view.zoom_in()
    star = max(commands.session.known.result.stars, key=lambda s: s.x)
    window.workspace.stars.select(commands.session.known.result.stars.index(star))
    x, y = view.viewport.to_screen(np.array([[star.x, star.y]]))[0]
    assert 0 < x < view.width()
    assert 0 < y < view.height()


def test_the_table_sorts_by_value_not_by_text(opened):
    window, commands = opened
    table = window.workspace.stars
    stars = commands.session.known.result.stars
    for column, key in ((2, "mag"), (3, "ra_deg"), (4, "dec_deg"), (5, "x")):
        table.table.sortByColumn(column, Qt.SortOrder.DescendingOrder)
        values = [getattr(stars[r], key) for r in table.model.order]
        assert values == sorted(values, reverse=True), key


def test_a_selected_star_stays_selected_while_the_table_is_sorted(opened):
    table = opened[0].workspace.stars
    table.select(9)
    for column in range(8):
        table.table.sortByColumn(column, Qt.SortOrder.DescendingOrder)
        assert table.selected == 9
    index = table.table.selectionModel().selectedRows()[0]
    assert index.siblingAtColumn(1).data() == "HIP 25333"


def test_a_star_that_the_filter_hides_is_selected_no_more(qtbot, opened):
    table = opened[0].workspace.stars
    table.select(5)
    with qtbot.waitSignal(table.picked, check_params_cb=lambda star: star is None):
        table.filter.setText("rigel")
    assert table.selected is None
    table.filter.clear()
    assert not table.table.selectionModel().selectedRows()


def test_catalogue_numbers_sort_as_numbers(qtbot):
    from kochab.core.solution import NamedStar
    from kochab.window.panels.star_table import StarModel

    model = StarModel()
    model.set_stars(tuple(NamedStar(0, 0, i, "", 1, 0, 0, 0) for i in ("HIP 100", "HIP 9", "HIP 20")))
    model.sort(1)
    assert [model.index(r, 1).data() for r in range(3)] == ["HIP 9", "HIP 20", "HIP 100"]


@pytest.mark.parametrize("typed", ["θ", "Theta", "theta1 ori", "26221"])
def test_the_filter_finds_a_greek_letter_however_it_is_typed(qtbot, typed):
    from kochab.core.solution import NamedStar
    from kochab.window.panels.star_table import StarTable

    table = StarTable()
    qtbot.addWidget(table)
    names = {"HIP 26221": "θ¹ Ori C", "HIP 27989": "Betelgeuse"}
    table.set_stars(tuple(NamedStar(0, 0, i, name, 1, 0, 0, 0) for i, name in names.items()))
    table.filter.setText(typed)
    assert table.model.rowCount() == 1


def test_the_filter_finds_by_name_and_selection_clears_it(opened):
    table = opened[0].workspace.stars
    table.filter.setText("rigel")
    assert table.model.rowCount() == 1
    table.select(5)
    assert table.filter.text() == ""
    assert table.selected == 5


def test_sliders_and_auto_stretch(qtbot, opened):
    window, commands = opened
    strip, view = window.workspace.strip, window.workspace.view
    bright = view.grab().toImage()
    commands.actions["stretch"].trigger()
    assert not strip.auto.isChecked()
    assert strip.stretch.mid == pytest.approx(0.5)
    linear = view.grab().toImage()
    assert mean(bright) > mean(linear) + 10
    strip.bright.setValue(900)
    assert strip.stretch.mid < 0.01
    commands.actions["stretch"].trigger()
    assert mean(view.grab().toImage()) == pytest.approx(mean(bright), abs=0.5)


def test_moving_a_slider_leaves_automatic_from_where_it_was(opened):
    strip = opened[0].workspace.strip
    automatic = strip.stretch
    strip.black.setValue(strip.black.value() + 1)
    assert not strip.auto.isChecked()
    assert strip.stretch.mid == pytest.approx(automatic.mid, rel=0.02)


def mean(image):
    image = image.convertToFormat(QImage.Format.Format_Grayscale8)
    bits = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
    return float(bits[:, : image.width()].mean())


def test_the_compass_keeps_clear_of_the_buttons(qapp):
    """In a narrow room the buttons stand at the top, and covered the letter of north."""
    overlay = Overlay(Layers(dict.fromkeys(MARKS, False) | {"compass": True}))
    overlay.show(np.empty((0, 2)), fake_solution(600, 400))
    buttons = QRect(300, 8, 260, 40)
    assert painted(overlay)[8:48, 300:560].any()
    overlay.covered.append(buttons)
    assert not painted(overlay)[8:48, 300:560].any()
    assert painted(overlay)[48:160, 400:].any()
