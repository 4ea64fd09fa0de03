"""What is under the cursor is told, and a click opens its card."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from kochab.core.angle_text import AngleStyle
from kochab.core.attitude import unit_vectors
from kochab.core.frame import Site
from kochab.polar.horizon import Horizon, Refraction
from kochab.sky.layer import in_frame
from kochab.sky.sky_tables import sky_tables
from kochab.window.image.object_card import facts, heights
from kochab.window.image.overlay import Overlay
from tests.window.fakes import fake_solution
from tests.window.image.test_frame_view import jupiter_at, painted

EVENING = datetime(2026, 1, 12, 19, 0, tzinfo=UTC)
PLACES = {"Munich": Site(48.1, 11.6, 500.0), "Sydney": Site(-33.9, 151.2, 10.0), "Quito": Site(-0.2, -78.5, 2800.0)}


def mark_of(name):
    solution = fake_solution(600, 400)
    return next(mark for mark in in_frame(sky_tables(), solution).marks if mark.short == name), solution


def test_an_objects_card():
    mark, solution = mark_of("NGC 2024")
    told = facts(sky_tables(), mark, solution, AngleStyle.SEXAGESIMAL, None)
    assert told[""] == "Nebula"
    assert told["In"] == "Orion"
    assert told["Size"] == "30′ × 30′"
    assert "Tank Tracks Nebula" in told["Also"]
    assert "Sh2-277" in told["Also"]
    assert "Now" not in told


def test_a_stars_card():
    mark, solution = mark_of("Alnilam")
    told = facts(sky_tables(), mark, solution, AngleStyle.SEXAGESIMAL, Horizon(PLACES["Munich"], EVENING))
    assert (told[""], told["V"], told["Catalogue"], told["Residual"]) == ("Star", "1.69", "HIP 26311", "not matched")
    assert told["Now"].endswith("° high")
    assert told["Highest"].startswith("41° at ")  # 90 - 48.1 - 1.2, and refraction


def test_a_planets_card_tells_where_it_was():
    told = facts(sky_tables(), jupiter_at(9.0, 9.0), fake_solution(600, 400), AngleStyle.SEXAGESIMAL, None)
    assert (told[""], told["Magnitude"], told["Diameter"], told["Distance"]) == ("Planet", "-2.5", "46.1″", "4.2 au")
    assert told["RA, Dec"].startswith("05h 36m")


@pytest.mark.parametrize("place", sorted(PLACES))
@pytest.mark.parametrize(("ra", "dec"), [(84.0, -1.2), (10.7, 41.3), (200.0, -62.0), (37.9, 89.3)])
def test_nothing_is_higher_at_any_time_of_the_day_than_at_its_best(place, ra, dec):
    vector = unit_vectors(ra, dec)
    horizon = Horizon(PLACES[place], EVENING, Refraction(pressure_hpa=0.0))
    times = (EVENING + timedelta(minutes=5 * k) for k in range(288))
    highest = max(Horizon(PLACES[place], when, horizon.refraction).altaz_deg(vector)[0] for when in times)
    _, best = heights(vector, horizon)
    assert (best == "never rises") == (highest < 0.0)
    assert highest < 0.0 or float(best.split("°")[0]) == pytest.approx(highest, abs=0.6)


def test_the_smallest_thing_under_the_cursor_is_meant(qtbot):
    overlay = Overlay(tables=sky_tables())
    overlay.show(np.empty((0, 2)), fake_solution(600, 400))
    painted(overlay)
    flame, star = mark_of("NGC 2024")[0], mark_of("Alnitak")[0]
    assert overlay.mark_at(*flame.xy, 5.0).short == "NGC 2024"
    assert overlay.mark_at(*star.xy, 5.0).short == "Alnitak"
    overlay.on["names"] = False
    painted(overlay)
    assert getattr(overlay.mark_at(*star.xy, 5.0), "kind", "") != "star"


def test_a_click_opens_the_card_and_one_beside_it_closes_it(qtbot, opened):
    window, commands = opened
    presenter, view = commands.presenter, window.workspace.view
    qtbot.waitUntil(lambda: presenter.overlay.tables is not None, timeout=20_000)
    view.repaint()
    star = next(mark for mark in presenter.overlay.sky.marks if mark.short == "Alnilam")
    x, y = view.viewport.to_screen(star.xy)
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=QPoint(round(x), round(y)))
    assert presenter.object_card.isVisible()
    assert presenter.object_card.title.text() == "Alnilam"
    assert "HIP 26311" in presenter.object_card.body.text()
    card = presenter.object_card
    assert card.height() >= card.title.height() + card.body.heightForWidth(card.body.width())  # nothing is cut off
    view.hovered.emit(tuple(star.xy))
    assert window.status.place.text().startswith("Alnilam")
    view.clicked.emit(-500.0, -500.0, 14.0)
    assert not presenter.object_card.isVisible()
