"""The Live view's Push-to tab: off by default, the way to a target, and programs told on screen."""

import json
import threading
import time
from concurrent.futures import Future
from contextlib import closing
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from kochab.core.attitude import apart_deg
from kochab.core.mount import MountState
from kochab.core.progress import run
from kochab.gear.mount_events import Connected, OrderFailed, PositionReport
from kochab.server.phone_page import PhonePage
from kochab.server.telescope.offer import Offer
from kochab.window.application import build
from kochab.window.devices.mount_task import MountTask
from kochab.window.frame.session import WorkflowEngine
from kochab.window.tones import Cue
from kochab.workflows.goto_target import target_at
from kochab.workflows.session.wiring import Wiring
from kochab.workflows.sync_mount import SyncDone
from kochab.workflows.telescope.offered import _sync
from tests.gear.dsc_box import DscBox
from tests.gear.phyphox_phone import PhyphoxPhone
from tests.server.telescope.conftest import Program
from tests.server.telescope.test_stellarium_remote import Stellarium
from tests.window.fakes import close_windows
from tests.window.polar.test_phone import ask, switch_on
from tests.window.test_night import assert_red
from tests.workflows.live_sources import solution

LIMIT_MS, BEGAN_S = 15_000, time.monotonic()
ports = {}


def offered(telescope, lan, stellarium_remote):
    made = Offer(telescope, {"lx200": 0}, lan, stellarium_remote)
    ports.update(made.ports)
    return made


@pytest.fixture
def view(qtbot, settings):
    window, commands = build(WorkflowEngine(), settings, [], Wiring(phone_page=PhonePage, offer_telescope=offered))
    qtbot.addWidget(window)
    window.show()
    commands.views.show("live")
    view = commands.views.docks["live"].view
    view.phone._host = "127.0.0.1"
    view.commands = commands
    yield view
    close_windows(commands)


def seen(view, number, *place):
    """The newest solved frame of the stream."""
    shot = SimpleNamespace(number=number, shutter_s=time.monotonic())
    view.push.see(SimpleNamespace(shot=shot, track=SimpleNamespace(solution=solution(*place))))


def test_it_is_off_until_switched_on_and_tells_who_is_there(qtbot, view) -> None:
    push = view.push
    assert not push.offer.isChecked()
    assert not push.move_mount.isChecked()
    assert not push.lan.isChecked()
    push.offer.setChecked(True)
    qtbot.waitUntil(lambda: "127.0.0.1" in push.state.text(), timeout=LIMIT_MS)
    assert push.programs.text() == "No program connected."
    seen(view, 1, 83.0, -4.0)
    meade = Program(ports["lx200"])
    with meade.line:
        qtbot.waitUntil(lambda: push.programs.text() == "Connected: LX200 (127.0.0.1).", timeout=LIMIT_MS)
        assert meade.ask(":GR#").startswith(b"05:33:")
        assert meade.ask(":Sr05:40:00#", 1) + meade.ask(":Sd-02*00:00#", 1) + meade.ask(":MS#", 1) == b"110"
        qtbot.waitUntil(lambda: push.words.text().startswith("Push "), timeout=LIMIT_MS)
    qtbot.waitUntil(lambda: push.programs.text() == "No program connected.", timeout=LIMIT_MS)
    push.offer.setChecked(False)
    assert push.state.text() == "Off."
    assert push.programs.text() == ""
    with pytest.raises(ConnectionRefusedError):
        Program(ports["lx200"])


def test_the_way_is_shown_and_played_until_it_is_there(qtbot, view, monkeypatch) -> None:
    push, played = view.push, []
    monkeypatch.setattr(push.cues, "play", played.append)
    assert "Set a target" in push.words.text()
    push.target.setText("83.0 -4.0")
    push.set.click()
    qtbot.waitUntil(lambda: "Start the camera" in push.words.text(), timeout=LIMIT_MS)
    for number, dec in enumerate((6.0, 1.0, 4.0, -4.0), 1):
        seen(view, number, 83.0, dec)
        if dec > -4.0:
            assert push.words.text().endswith(" south.")
            assert push.arrow.way.distance_deg == pytest.approx(dec + 4.0)
    assert played == [Cue.NEARER, Cue.FURTHER, Cue.STOP]
    assert "in the eyepiece" in push.words.text()


def test_the_phone_shows_the_same(qtbot, view) -> None:
    url = switch_on(qtbot, view)
    view.push._aim(target_at(83.0, -4.0))
    seen(view, 1, 83.0, 6.0)
    told = json.loads(ask(url, more="now.json")[1])
    assert told["words"] == view.push.words.text()
    assert told["total"] == view.push.distance.text()
    assert told["altitude"] == "S 10.00°"
    assert told["old"] is False
    assert b"<title>Kochab: Push-to</title>" in ask(url)[1]
    view.phone.switch.setChecked(False)
    qtbot.waitUntil(lambda: not view.phone.page.url, timeout=LIMIT_MS)


def test_orders_of_programs_reach_the_mount_only_when_they_may(qtbot, view, monkeypatch) -> None:
    push, mount, orders = view.push, view.commands.services.mount, []

    def order(self, name, make):
        orders.append((name, threading.current_thread()))
        return MountTask(name, self.stop, self)

    monkeypatch.setattr(type(mount), "order", order)
    mount.known.hear(Connected("Test", {}, None, None))
    mount.known.hear(PositionReport((10.0, 20.0), MountState(slewing=False)))
    mount.changed.emit()
    assert push.telescope.seen.icrs_deg == (10.0, 20.0)
    threading.Thread(target=partial(push.telescope.goto, (1.0, 2.0), "X")).start()
    qtbot.waitUntil(lambda: "X set a target" in push.message.text(), timeout=LIMIT_MS)
    assert not orders
    push.move_mount.setChecked(True)
    threading.Thread(target=partial(push.telescope.goto, (1.0, 2.0), "X")).start()
    qtbot.waitUntil(lambda: bool(orders), timeout=LIMIT_MS)
    assert orders == [("goto", threading.main_thread())]  # whoever asked in whichever thread
    assert apart_deg((1.0, 2.0), (push.telescope.target.ra_deg, push.telescope.target.dec_deg)) < 1e-9
    for why, stopped in (("Below the horizon.", False), ("Stopped.", True)):
        before = len(orders)
        refused = push.telescope.goto((1.0, 2.0), "X")
        qtbot.waitUntil(lambda before=before: len(orders) > before, timeout=LIMIT_MS)
        assert not refused.done()
        mount.findChildren(MountTask)[-1].end(OrderFailed("goto", why, stopped))
        assert refused.result(0) == why
    monkeypatch.undo()
    refused = push.telescope.goto((1.0, 2.0), "X")  # by the window itself: there is no line
    qtbot.waitUntil(refused.done, timeout=LIMIT_MS)
    assert refused.result()
    mount.known.phase = "off"


def test_it_is_red_at_night(qtbot, view) -> None:
    view.commands.actions["night"].trigger()
    qtbot.waitUntil(lambda: view.commands.appearance.settled)
    view.tabs.setCurrentIndex(2)
    view.push._aim(target_at(83.0, -4.0))
    for dec in (6.0, -4.0):
        seen(view, int(dec), 83.0, dec)
        qtbot.wait(50)
        assert_red(view.commands.window)
    view.commands.appearance.use_theme("dark")


def test_the_window_hears_of_a_programs_sync_as_of_its_own(view) -> None:
    """The offsets seen before it are of another alignment."""
    synced = []
    guard = SimpleNamespace(to_mount=lambda *place: place, sync=lambda *place, by_hand: synced.append((place, by_hand)))
    verdict: Future = Future()
    done = run(_sync((10.0, 20.0), verdict, guard))
    assert (verdict.result(), synced) == ("", [((10.0, 20.0), True)])
    assert isinstance(done, SyncDone)


def test_stellariums_view_follows_when_switched_on(qtbot, view) -> None:
    """It is asked at its address, and a wrong address is a sentence."""
    push = view.push
    push.remote.setChecked(True)
    with closing(Stellarium()) as stellarium:
        push.remote_address.setText(f"127.0.0.1:{stellarium.port}")
        seen(view, 1, 83.0, -4.0)
        push.offer.setChecked(True)
        assert not push.remote.isEnabled()
        qtbot.waitUntil(lambda: bool(stellarium.views), timeout=LIMIT_MS)
        assert apart_deg(stellarium.views[-1], (83.0, -4.0)) < 1e-6
        qtbot.waitUntil(lambda: "Stellarium" in push.programs.text(), timeout=LIMIT_MS)
        push.offer.setChecked(False)
    push.remote_address.setText("127.0.0.1/path")
    push.offer.setChecked(True)
    qtbot.waitUntil(lambda: "is not an address" in push.state.text(), timeout=LIMIT_MS)
    assert push.remote.isEnabled()


def test_encoders_move_the_arrow_between_two_frames(qtbot, view) -> None:
    push, angles = view.push, [0.0, 0.0]
    push.aid.setChecked(True)
    assert "Give the port" in push.message.text()
    assert not push.aid.isChecked()
    push._aim(target_at(83.0, -4.0))
    with DscBox(lambda: tuple(angles)) as box:
        push.aid_address.setText(box.port)
        push.aid.setChecked(True)
        qtbot.waitUntil(lambda: "Encoders connected" in push.message.text(), timeout=LIMIT_MS)
        for number, (west, north) in enumerate(((0.0, 0.0), (8.0, 6.0), (-5.0, 3.0), (4.0, -8.0)), 1):
            angles[:] = west, north
            qtbot.wait(2500)  # as long as a telescope stands still for a frame
            seen(view, number, *on_sky(west, north))
        assert "±" not in push.distance.text()
        angles[:] = 6.0, -3.0
        true = apart_deg(on_sky(6.0, -3.0), (83.0, -4.0))
        qtbot.waitUntil(lambda: abs(push.arrow.way.distance_deg - true) < 0.1, timeout=LIMIT_MS)
        assert "±" in push.distance.text()
        push.aid.setChecked(False)
        assert "±" not in push.distance.text()
        assert push.aid_address.isEnabled()


def test_what_encoders_or_a_gyroscope_alone_tell_is_said_and_is_no_alarm(view) -> None:
    push = view.push
    push._aim(target_at(83.0, -4.0))
    seen(view, 1, 83.0, 6.0)
    assert push.age.text() == ""
    push.telescope.aid = SimpleNamespace(see=lambda *_: None, pointing=lambda _: felt)
    felt = SimpleNamespace(icrs_deg=(83.0, 5.0), at_s=time.monotonic(), sigma_deg=0.07)
    push.telescope.see_solution(None, time.monotonic() - 45.0)
    push.write()
    assert push.age.text() == "Last solved 45 s ago; position since then from encoders or gyroscope (± 4.2′)."
    assert push.age.property("role") == "muted"
    push.telescope.aid = None


def on_sky(west, north):
    """ICRS degrees of an equatorial mount without a drive that was turned so far."""
    turned = 15.041 * (time.monotonic() - BEGAN_S) / 3600.0
    return 90.0 - west + turned, 2.0 + north


def test_a_phone_on_the_tube_is_asked_in_the_same_field(qtbot, view) -> None:
    push = view.push
    with PhyphoxPhone(lambda: np.eye(3)) as phone:
        push.aid_address.setText(f"http://{phone.address}/")
        push.aid.setChecked(True)
        qtbot.waitUntil(lambda: "gyroscope is connected" in push.message.text(), timeout=LIMIT_MS)
        assert phone.measuring
        phone.pull()
        qtbot.waitUntil(lambda: "Lost the phone" in push.message.text(), timeout=LIMIT_MS)
    push.aid.setChecked(False)
    assert push.aid_address.isEnabled()
