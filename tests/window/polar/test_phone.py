"""The phone's page: off until switched on, read only, gone with the window."""

import http.client
import json
from urllib.parse import urlsplit

import numpy as np
import pytest

from kochab.server.phone_page import PhonePage
from kochab.window.application import build
from kochab.window.frame.session import WorkflowEngine
from kochab.window.phone import QrCode, serving
from kochab.window.themes import THEMES
from kochab.workflows.session.wiring import Wiring
from tests.window.fakes import close_windows
from tests.window.polar_cases import adjusting
from tests.window.test_night import assert_red

LIMIT_MS = 15_000


@pytest.fixture
def view(qtbot, settings):
    window, commands = build(WorkflowEngine(), settings, [], Wiring(phone_page=PhonePage))
    qtbot.addWidget(window)
    window.show()
    commands.views.show("polar")
    view = commands.views.docks["polar"].view
    view.phone._host = "127.0.0.1"
    yield view
    close_windows(commands)
    assert not view.phone.page.url


def ask(url, method="GET", more=""):
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=60)
    try:
        connection.request(method, parts.path + more)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


def switch_on(qtbot, view):
    view.phone.switch.setChecked(True)
    qtbot.waitUntil(lambda: bool(view.phone.url.text()), timeout=LIMIT_MS)
    return view.phone.url.text()


def test_off_by_default_and_nothing_is_shown(view):
    assert not view.phone.page.url
    assert view.phone.url.text() == ""
    assert not view.phone.code.rows
    assert view.buttons.phone.text() == "Pho&ne"


def test_on_it_serves_the_numbers_and_says_so_everywhere(qtbot, view):
    url = switch_on(qtbot, view)
    assert view.buttons.phone.text() == "Pho&ne: on"
    assert view.buttons.phone.toolTip() == url
    assert "On." in view.phone.state.text()
    view.phone.show_state(adjusting(-725.0, 200.0))
    status, body = ask(url)
    assert status == 200
    assert b"Kochab" in body
    status, body = ask(url, more="now.json")
    told = json.loads(body)
    assert status == 200
    assert told["altitude_error_arcsec"] == pytest.approx(-725.0, abs=0.01)
    assert "raise" in told["altitude"]
    assert "Altitude bolt" in told["words"]


def test_it_is_read_only(qtbot, view):
    url = switch_on(qtbot, view)
    for method in ("POST", "PUT", "DELETE"):
        assert ask(url, method)[0] >= 400


def test_off_again_nobody_answers(qtbot, view):
    url = switch_on(qtbot, view)
    view.phone.switch.setChecked(False)
    qtbot.waitUntil(lambda: not view.phone.page.url and view.phone.switch.isEnabled(), timeout=LIMIT_MS)
    with pytest.raises(ConnectionRefusedError):
        ask(url)
    assert view.buttons.phone.text() == "Pho&ne"
    switch_on(qtbot, view)
    assert ask(view.phone.url.text())[0] == 200


def test_it_ends_with_the_window(qtbot, view):
    url = switch_on(qtbot, view)
    view.window().close()
    with pytest.raises(ConnectionRefusedError):
        ask(url)


def test_an_address_that_cannot_be_had_is_one_sentence(qtbot, view):
    view.phone._host = "203.0.113.7"
    view.phone.switch.setChecked(True)
    qtbot.waitUntil(lambda: "Can't serve" in view.phone.state.text(), timeout=LIMIT_MS)
    assert not view.phone.switch.isChecked()


def test_the_code_is_that_of_the_address_in_dark_and_light(qtbot, view):
    import segno

    url = switch_on(qtbot, view)
    rows = np.array(view.phone.code.rows)
    assert np.array_equal(rows[4:-4, 4:-4], np.array(segno.make(url, error="m", micro=False).matrix))
    assert rows.sum() == rows[4:-4, 4:-4].sum(), "four empty modules around it"


def test_the_code_is_red_light_at_night(qtbot, use_theme):
    use_theme("night")
    code = QrCode()
    qtbot.addWidget(code)
    code.resize(300, 300)
    code.setStyleSheet("background: #000000")
    code.rows = ((1, 0), (0, 1))
    assert_red(code)
    assert THEMES["night"].window == "#000000"
    assert callable(serving)
