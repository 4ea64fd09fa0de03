"""What is under the cursor is told, and a click opens its card."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QContextMenuEvent, QDesktopServices
from PySide6.QtWidgets import QApplication, QMenu

from kochab.core import tr
from kochab.core.angle_text import AngleStyle
from kochab.core.attitude import apart_deg, unit_vectors
from kochab.core.frame import Site
from kochab.gear.actions import CONNECT, Need
from kochab.sky.horizon import Horizon, Refraction
from kochab.sky.layer import in_frame
from kochab.sky.sky_tables import sky_tables
from kochab.sky.solar_system import BodyKind
from kochab.window.frame.place_menu import links
from kochab.window.frame.search import sought
from kochab.window.image.object_card import facts, heights
from kochab.window.image.overlay import Overlay
from tests.window.fakes import fake_solution
from tests.window.image.test_frame_view import jupiter_at, painted
from tests.window.mount_bench import connected

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


@pytest.mark.parametrize(
    ("hip", "arcsec", "pa_deg", "mag"),
    [(65378, 14.4, 152.0, 3.9), (36850, 3.1, 76.0, 3.0), (50583, 4.6, 125.0, 3.6), (86228, 6.5, 315.0, 5.4)],
    ids=["Mizar", "Castor", "Algieba", "theta Sco"],
)
def test_a_double_stars_card_has_its_companion_as_in_the_wds_of_1991(hip, arcsec, pa_deg, mag):
    """WDS 13239+5456, 07346+3153, 10200+1950 and 17373-4300, observed in 1991."""
    stars, solution = sky_tables().stars, fake_solution(600, 400)
    row = stars.hip.tolist().index(hip)
    assert stars.pair[row] == pytest.approx((arcsec, pa_deg, mag), abs=1.0)
    assert stars.pair[row, 0] == pytest.approx(arcsec, abs=0.1)
    told = facts(sky_tables(), replace(mark_of("Alnilam")[0], row=row), solution, AngleStyle.SEXAGESIMAL, None)
    assert told["Double"].startswith(f"{stars.pair[row, 0]:.1f}″ at {stars.pair[row, 1]:.0f}°, ")
    single = facts(sky_tables(), mark_of("Alnilam")[0], solution, AngleStyle.SEXAGESIMAL, None)
    assert "Double" not in single


@pytest.mark.parametrize(
    ("hip", "said"),
    [
        (10826, "Mira star, V 2–10.1, period 331.96 d"),
        (14576, "eclipsing, V 2.12–3.39, period 2.8673 d"),
        (110991, "Cepheid, V 3.48–4.37, period 5.3662 d"),
        (92207, "GCVS type RCB, V 8.3"),
    ],
    ids=["omicron Cet", "Algol", "delta Cep", "V CrA"],
)
def test_a_variables_card(hip, said):
    """The GCVS's own lines of them; V CrA's minimum is only known to be below 16.5."""
    stars = sky_tables().stars
    mark = replace(mark_of("Alnilam")[0], row=stars.hip.tolist().index(hip))
    assert facts(sky_tables(), mark, fake_solution(600, 400), AngleStyle.SEXAGESIMAL, None)["Variable"] == said
    assert "Variable" not in facts(
        sky_tables(), mark_of("Alnitak")[0], fake_solution(600, 400), AngleStyle.DECIMAL, None
    )


def test_a_planets_card_tells_where_it_was():
    told = facts(sky_tables(), jupiter_at(9.0, 9.0), fake_solution(600, 400), AngleStyle.SEXAGESIMAL, None)
    assert "Uncertainty (1σ)" not in told
    assert (told[""], told["Magnitude"], told["Diameter"], told["Distance"]) == ("Planet", "-2.5", "46.1″", "4.2 au")
    assert told["RA, Dec"].startswith("05h 36m")


def test_a_satellites_card_has_kilometres_and_its_uncertainty():
    jupiter = jupiter_at(9.0, 9.0)
    iss = replace(jupiter.body, kind=BodyKind.SPACECRAFT, distance_au=6e-6, magnitude=np.nan, sigma_arcsec=900.0)
    mark = replace(jupiter, kind="satellite", body=iss)
    told = facts(sky_tables(), mark, fake_solution(600, 400), AngleStyle.SEXAGESIMAL, None)
    assert (told[""], told["Distance"], told["Uncertainty (1σ)"]) == ("Satellite", "898 km", "900.0″")
    assert "Magnitude" not in told


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
    overlay.layers.on["names"] = False
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
    assert commands.picker.card.isVisible()
    assert commands.picker.card.title.text() == "Alnilam"
    assert "HIP 26311" in commands.picker.card.body.text()
    card = commands.picker.card
    assert card.height() >= card.title.height() + card.body.heightForWidth(card.body.width())  # nothing is cut off
    view.hovered.emit(tuple(star.xy))
    assert window.status.place.text().startswith("Alnilam")
    view.clicked.emit(-500.0, -500.0, 14.0)
    assert not commands.picker.card.isVisible()


def entries(menu):
    return {action.text().replace("&", ""): action for action in menu.actions() if action.text()}


@pytest.fixture
def sky(qtbot, opened):
    """A window with a solved frame and the sky over it."""
    window, commands = opened
    qtbot.waitUntil(lambda: commands.presenter.overlay.tables is not None, timeout=20_000)
    window.workspace.view.repaint()
    return window, commands


def ask(qtbot, view, x, y):
    """A right click at a place of the image."""
    sx, sy = (round(v) for v in view.viewport.to_screen(np.array([x, y])))
    at = QPoint(sx, sy)
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, view.mapToGlobal(at))
    QApplication.sendEvent(view, event)


def shown_menu(window):
    (menu,) = [m for m in window.findChildren(QMenu) if m.isVisible()]
    return menu


def test_a_right_click_names_what_is_there_and_copies_it(qtbot, sky, monkeypatch):
    window, commands = sky
    opened_pages = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: opened_pages.append(url.toString()))
    mark = next(mark for mark in commands.presenter.overlay.sky.marks if mark.short == "NGC 2024")
    ask(qtbot, window.workspace.view, *mark.xy)
    menu = shown_menu(window)
    offered = entries(menu)
    assert next(iter(offered)) == "NGC 2024 Flame Nebula"
    assert commands.presenter.overlay.picked is mark
    offered["Copy name"].trigger()
    assert QApplication.clipboard().text() == "NGC 2024 Flame Nebula"
    offered["Copy coordinates"].trigger()
    assert QApplication.clipboard().text().startswith("05:41:")
    online = entries(offered["Search online"].menu())
    assert opened_pages == []  # until it is asked for
    online["Copy the link to Simbad"].trigger()
    assert QApplication.clipboard().text() == "https://simbad.cds.unistra.fr/simbad/sim-id?Ident=NGC+2024"
    assert opened_pages == []
    online["Open Aladin Lite in the browser"].trigger()
    (page,) = opened_pages
    assert page.startswith("https://aladin.cds.unistra.fr/AladinLite/?target=85.4")
    menu.close()


def test_bare_sky_has_coordinates_and_no_name(qtbot, sky):
    window, commands = sky
    view = window.workspace.view
    overlay = commands.presenter.overlay
    xy = next(p for p in np.mgrid[20:580:7, 20:380:7].reshape(2, -1).T if overlay.mark_at(*p, 20.0) is None)
    ask(qtbot, view, *xy)
    menu = shown_menu(window)
    offered = entries(menu)
    assert "Copy name" not in offered
    offered["Copy coordinates"].trigger()
    ra, dec = QApplication.clipboard().text().split()
    place = sought(f"{ra} {dec}").vector
    assert np.hypot(*(overlay.solution.pixels_of(place[None])[0] - xy)) < 1.5
    assert "sim-coo?Coord=" in links(overlay.tables, overlay.picked, place, 1.0)["Simbad"]
    menu.close()


def test_without_a_mount_the_menu_says_why_nothing_goes_there(qtbot, sky):
    _window, commands = sky
    commands.picker.find(300.0, 200.0, 5.0)
    menu = commands.menu.show(None, QPoint(50, 50))  # by the keyboard
    offered = entries(menu)
    assert (offered["Go to"].isEnabled(), offered["Centre"].isEnabled()) == (False, False)
    assert tr(CONNECT).replace("&", "") in offered
    menu.close()


def test_go_to_is_given_to_the_mount_through_its_guard(qtbot, sky):
    window, commands = sky
    mark = next(mark for mark in commands.presenter.overlay.sky.marks if mark.short == "Alnilam")
    with connected(qtbot, commands) as mount:
        ask(qtbot, window.workspace.view, *mark.xy)
        menu = shown_menu(window)
        offered = entries(menu)
        assert offered["Go to"].isEnabled()
        assert not offered["Centre"].isEnabled()  # for which there is no camera
        assert tr(Need.CAMERA.value) in offered
        offered["Go to"].trigger()
        menu.close()
        qtbot.waitUntil(lambda: [e[0] for e in mount.telescope.log] == ["goto"])
        qtbot.waitUntil(lambda: not mount.control.known.busy)
        assert apart_deg(mount.control.known.report.icrs_deg, (84.05339, -1.20192)) < 0.01  # SIMBAD's Alnilam


def test_a_body_of_another_night_is_no_target(qtbot, sky):
    window, commands = sky
    planet = jupiter_at(150.0, 100.0)
    commands.presenter.overlay.show_bodies((planet,))
    with connected(qtbot, commands):
        for taken, able in ((datetime(2023, 11, 3, tzinfo=UTC), False), (datetime.now(UTC), True)):
            frame = commands.session.known.frame
            commands.session.known.frame = replace(frame, hint=replace(frame.hint, time_utc=taken))
            window.workspace.view.repaint()
            menu = commands.menu.show((150.0, 100.0, 5.0), QPoint(50, 50))
            offered = entries(menu)
            assert next(iter(offered)) == "Jupiter"
            assert offered["Go to"].isEnabled() == able
            assert ("Jupiter has moved since the frame was taken." in offered) != able
            assert "Copy the link to Simbad" not in entries(offered["Search online"].menu())
            menu.close()
        trail = ((84.0, 0.0), (85.0, 1.0))
        commands.presenter.overlay.show_bodies((replace(planet, body=replace(planet.body, trail=trail)),))
        menu = commands.menu.show((150.0, 100.0, 5.0), QPoint(50, 50))
        assert not entries(menu)["Go to"].isEnabled()  # a satellite is gone within seconds
        menu.close()
