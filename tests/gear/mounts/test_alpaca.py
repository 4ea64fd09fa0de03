"""Mounts behind an Alpaca server that is written from ASCOM's reference, and checked by ASCOM's own client."""

import http.client
import json
import socket
import threading
import time

import pytest

from kochab.cli.main import main
from kochab.core.attitude import apart_deg
from kochab.core.errors import LineLostError, NoAnswerError, PortError, RefusedError
from kochab.core.mount import Ability, Direction, Epoch, PierSide, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.coordinates import reported_epoch
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.probe import find_served, probe
from kochab.gear.servers.address import net_address
from kochab.gear.servers.alpaca_link import AlpacaLink
from tests.gear.mounts.bench import LIMITS, SITE, alpaca, opened, place

from .alpaca_telescope import alpaca_server


@pytest.fixture
def bench(tmp_path):
    with alpaca(tmp_path) as bench:
        bench.mount = bench.open()
        yield bench
        bench.mount.close()


def test_ascom_s_own_client_reads_the_same(bench) -> None:
    client = pytest.importorskip("alpaca.telescope").Telescope(bench.port.partition("/")[0], 0)
    target = place(-25.0, 45.0, bench.clock)
    bench.mount.goto(*target)
    while bench.mount.state().slewing:
        time.sleep(0.05)
    assert apart_deg((client.RightAscension * 15.0, client.Declination), target) < 1e-3
    here, state = bench.mount.position(), bench.mount.state()
    assert apart_deg((here.ra_deg, here.dec_deg), (client.RightAscension * 15.0, client.Declination)) < 1e-3
    assert (client.Tracking, client.AtPark, client.Slewing) == (state.tracking, state.parked, state.slewing)
    assert client.SideOfPier.name == "pierWest"
    assert state.pier_side is PierSide.WEST
    far = place(-60.0, 50.0, bench.clock)
    client.SlewToCoordinatesAsync(*(far[0] / 15.0, far[1]))
    assert bench.mount.state().slewing  # another program's slew is seen, and ended
    bench.mount.stop()
    assert not client.Slewing


@pytest.mark.parametrize(("system", "epoch"), [(0, Epoch.DATE), (1, Epoch.DATE), (2, Epoch.J2000)])
def test_the_server_tells_the_epoch_and_the_user_knows_better(bench, system, epoch) -> None:
    bench.device.fixed["equatorialsystem"] = system
    assert opened("alpaca", bench.port, bench.clock).position().epoch is epoch
    assert open_mount("alpaca", bench.port, epoch=Epoch.J2000).epoch is Epoch.J2000
    assert reported_epoch(bench.mount) is None  # this one has no altitude


def test_a_goto_turns_tracking_on_and_a_parked_mount_refuses(bench) -> None:
    bench.mount.track(TrackingRate.OFF)
    bench.mount.goto(*place(-25.0, 45.0, bench.clock))
    assert bench.telescope.tracking
    bench.mount.stop()
    bench.telescope.parked = True
    while not bench.telescope.parked:  # it goes there
        time.sleep(0.05)
    with pytest.raises(RefusedError, match="The telescope refused: The telescope is parked"):
        bench.mount.goto(*place(-25.0, 45.0, bench.clock))
    bench.mount.stop()  # refused too, but nothing moves
    assert bench.mount.state().parked


def test_a_name_that_steers_a_terminal_is_printed_with_escapes_and_cut(bench, capsys) -> None:
    bench.device.fixed["name"] = "\x1b[2Jscope\u202e" + "long" * 25_000
    (one,) = find_served(bench.port.partition("/")[0])
    assert one.name.startswith(r"\x1b[2Jscope\u202elong")
    assert (len(one.name), bench.mount.identify()) == (64, one.name)
    assert main(["mount", "probe", "--port", bench.port.partition("/")[0]]) == 0
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert len(out) < 500


def test_an_answer_without_an_end_is_left_after_some_kilobytes(bench, monkeypatch) -> None:
    """909 MB were taken within the time of one question; and what a refusal says is cut."""
    taken = []
    read = http.client.HTTPResponse.read1
    monkeypatch.setattr(http.client.HTTPResponse, "read1", lambda a, n: (taken.append(part := read(a, n)), part)[1])
    bench.device.fixed["name"] = "x" * 20_000_000
    with pytest.raises(NoAnswerError, match="never ends its reply"):
        bench.mount.identify()
    with pytest.raises(NoAnswerError, match="never ends its reply"):
        AlpacaLink(net_address(bench.port.partition("/")[0], 0), "telescope").devices()
    assert sum(map(len, taken)) < 2 * 2 * 257_000  # a piece begun is read to its end
    bench.device.fixed["name"] = "Bench Telescope"
    monkeypatch.setattr(bench.telescope, "goto", lambda *_: "\x1bno" * 10_000)
    with pytest.raises(RefusedError) as caught:
        bench.mount.goto(*place(-25.0, 45.0, bench.clock))
    assert len(str(caught.value)) < 300


def test_a_stop_that_is_refused_while_it_slews_is_told(bench) -> None:
    bench.telescope._slew_deg_s = 0.5
    bench.mount.goto(*place(-60.0, 50.0, bench.clock))
    bench.device.absent.add("abortslew")
    with pytest.raises(RefusedError, match="abortslew"):
        bench.mount.stop()


def test_a_move_that_would_flip_the_mount_is_refused(bench) -> None:
    bench.mount.sync(*place(3.0, 40.0, bench.clock))  # past the meridian, and still on the west of the pier
    bench.telescope.log.clear()
    with pytest.raises(RefusedError, match="would flip"):
        bench.mount.move(Direction.NORTH, 0.1, 1.0)
    bench.device.absent.add("destinationsideofpier")
    with pytest.raises(RefusedError, match="does not tell whether it would flip"):
        bench.mount.move(Direction.NORTH, 0.1, 1.0)
    assert not bench.telescope.log
    bench.device.fixed["alignmentmode"] = 1  # a fork
    bench.mount.move(Direction.NORTH, 0.1, 1.0)
    assert [entry[0] for entry in bench.telescope.log] == ["goto"]


def test_a_motion_ordered_before_a_stop_does_not_begin(bench, monkeypatch) -> None:
    bench.telescope._slew_deg_s = 0.5
    slew = bench.device.put_slewtocoordinatesasync

    def stopped_first(**place):
        bench.mount.stop()  # over a connection of its own, while the order is under way
        slew(**place)

    monkeypatch.setattr(bench.device, "put_slewtocoordinatesasync", stopped_first, raising=False)
    with pytest.raises(RefusedError, match="stopped before it began"):
        bench.mount.goto(*place(-60.0, 50.0, bench.clock))
    assert not bench.telescope.slewing


def test_what_it_cannot_do_is_known_when_it_is_opened(bench) -> None:
    bench.device.fixed |= {"cansync": False, "canslewasync": False, "canpulseguide": False, "cansettracking": False}
    bench.device.absent |= {"sitelatitude", "utcdate", "sideofpier"}
    mount = bench.open()
    assert set(mount.lacks) == set(Ability) - {Ability.STOP}
    assert mount.site_report().site is None
    assert mount.state().pier_side is None


def test_behind_the_guard_it_keeps_its_limits(bench) -> None:
    guard = Guard(bench.mount, SITE, LIMITS, clock=bench.clock)
    with pytest.raises(RefusedError, match="the limit is 5°"):
        guard.goto(*place(0.0, -44.0, bench.clock))
    target = place(-25.0, 45.0, bench.clock)
    run(guard.slew(*target))
    assert apart_deg(bench.telescope.believed_deg(), target) < 1e-3
    guard.sync(target[0], target[1] + 1.0, by_hand=True, confirmed=True)
    guard.undo_sync()
    guard.close()


def test_servers_are_found_and_named(bench, capsys, monkeypatch) -> None:
    server = bench.port.partition("/")[0]
    monkeypatch.setattr("kochab.gear.mounts.drivers.alpaca.discover", lambda: [server])
    assert bench.port in [one.port for one in find_served()]
    (one,) = run(probe([server]))
    assert (one.port, one.driver, one.name) == (bench.port, "alpaca", "Bench Telescope")
    with pytest.raises(PortError, match=r"has no telescope 3; there is 0 \(Bench Telescope\)"):
        open_mount("alpaca", f"{server}/3")
    assert main(["mount", "position", "--json", "--port", bench.port, "--driver", "alpaca"]) == 0
    assert json.loads(capsys.readouterr().out)["name"] == "Bench Telescope"
    assert main(["mount", "stop", "--json", "--port", bench.port, "--driver", "alpaca"]) == 0
    assert bench.telescope.log[-1] == ("stop",)


def test_a_dead_server_a_silent_one_and_a_foreign_one_are_told_with_one_sentence(bench, monkeypatch) -> None:
    with alpaca_server(bench.device) as server:
        port = f"127.0.0.1:{server.port}"
        mount = open_mount("alpaca", port)  # the only telescope there
    with pytest.raises(LineLostError, match=f"Lost the Alpaca server {port}"):
        mount.position()
    with pytest.raises(PortError, match=f"No Alpaca server at {port}"):
        mount.stop()
    bench.device.connected = False
    with pytest.raises(LineLostError, match="The telescope is no longer connected to its server"):
        bench.mount.position()
    monkeypatch.setattr("kochab.gear.mounts.drivers.alpaca.POWER_UP_S", 0.3)
    monkeypatch.setattr("kochab.gear.servers.alpaca_link.ANSWER_S", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as ear:
        begun = time.monotonic()
        with pytest.raises(PortError, match="does not answer"):
            open_mount("alpaca", f"127.0.0.1:{ear.getsockname()[1]}")
        assert time.monotonic() - begun < 2.0


@pytest.mark.parametrize("value", [None, "x", {}, float("nan"), 99.0])
def test_a_position_that_is_none_is_told(bench, monkeypatch, value) -> None:
    monkeypatch.setattr(bench.device, "get_declination", lambda: value, raising=False)
    with pytest.raises(NoAnswerError):
        bench.mount.position()


def test_stop_does_not_wait_behind_a_hung_exchange(bench, monkeypatch) -> None:
    asked, hang = threading.Event(), threading.Event()

    def hung() -> float:
        asked.set()
        hang.wait(60.0)
        return 40.0

    monkeypatch.setattr(bench.device, "get_declination", hung, raising=False)
    asking = threading.Thread(target=bench.mount.position)
    asking.start()
    assert asked.wait(60.0)
    bench.mount.stop()
    assert asking.is_alive()
    hang.set()
    asking.join()
