"""The menu of a place of the open frame: go there, copy it, look it up."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from PySide6.QtCore import QPoint
from PySide6.QtGui import QContextMenuEvent, QDesktopServices
from PySide6.QtWidgets import QApplication, QMenu

from kochab.core.attitude import apart_deg
from kochab.gear.actions import CONNECT, Need
from kochab.text.translation import tr
from kochab.window.frame.place_menu import links
from kochab.window.frame.search import sought
from tests.window.image.test_frame_view import jupiter_at
from tests.window.mount_bench import connected


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
