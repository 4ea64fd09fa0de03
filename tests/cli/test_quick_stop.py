"""``kochab mount stop`` has Stop on the line before it has imported what the rest of it needs."""

import os
import socket
import subprocess
import sys
import time
import xml.etree.ElementTree
from datetime import UTC, datetime

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.mount import Direction
from kochab.gear import quick_stop
from kochab.gear.mounts import DRIVERS, SERVERS
from kochab.gear.profiles import EquipmentProfile, save_profile
from kochab.gear.session import MountSelection, guarded
from kochab.sky.horizon import sidereal_deg
from tests.boards import BOARDS, served
from tests.gear.mounts.bench import COUNTERS, SITE, alpaca, indi, place, simulated, still
from tests.gear.mounts.indi_server import indi_server
from tests.gear.mounts.test_conformance import wait_for

pty, tty = (pytest.importorskip(name) for name in ("pty", "tty"))  # Windows has none

FIRST_OPEN = """
import sys, serial
def opened(port, baudrate, **more):
    heavy = {'numpy', 'erfa', 'logging', 'argparse', 'zipfile', 'kochab.gear.mounts'} & set(sys.modules)
    print(port, baudrate, sorted(heavy))
    raise SystemExit(0)
serial.serial_for_url = opened
from kochab.__main__ import main
main(sys.argv[1:])
"""


@pytest.fixture
def terminal():
    """A pseudo-terminal: the end that a mount would read, and its port."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for end in (master, slave):
        os.close(end)


def test_its_table_is_that_of_the_drivers() -> None:
    lines = {name: driver for name, driver in DRIVERS.loaded().items() if name not in SERVERS}
    assert {name: (driver.bauds[0], driver.blind_stop) for name, driver in lines.items()} == quick_stop.STOPS


@pytest.mark.parametrize("driver", quick_stop.STOPS)
def test_the_bytes_of_each_driver_go_out(terminal, driver) -> None:
    master, port = terminal
    quick_stop.send_first_stop(["mount", "stop", f"--port={port}", "--driver", driver])
    assert os.read(master, 64) == quick_stop.STOPS[driver][1]


@pytest.mark.parametrize("driver", sorted(quick_stop.STOPS.keys() - COUNTERS))
def test_they_end_a_move_that_a_killed_program_left(driver) -> None:
    """No timer of ours knows of it. INDI's CelestronGPS::Abort and iOptron's language 3.10: ``M``, ``:Q#`` end slews alone."""
    with simulated(driver) as bench:
        for direction in (Direction.NORTH, Direction.EAST):
            bench.telescope.move(direction, 0.5)
        quick_stop.send_first_stop(["mount", "stop", "--port", bench.port, "--driver", driver])
        wait_for(lambda: still(bench.telescope))


def test_port_driver_and_baud_come_from_the_profile_and_what_is_typed_goes_before_it(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    save_profile(EquipmentProfile("Newton", port="/dev/no", driver="ioptron", baud=230400))
    for typed, expected in (([], "/dev/no 230400 []"), (["--port", "/dev/other", "--baud=9600"], "/dev/other 9600 []")):
        command = [sys.executable, "-c", FIRST_OPEN, "mount", "stop", "--profile", "Newton", *typed]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert ran.stdout.strip() == expected, ran.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--port", "/dev/null"],
        ["--driver", "lx200"],
        ["--port", "/no/such/port", "--driver", "lx200"],
        ["--port", "x", "--driver", "none"],
        ["--port", "x", "--driver", "lx200", "--baud", "fast"],
        ["--profile", "none"],
        ["--profile", " "],
        ["--profile"],
        ["--port", "udp://127.0.0.1:1", "--driver", "skywatcher"],
    ],
)
def test_without_a_port_and_a_driver_it_is_left_to_the_command(arguments, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    quick_stop.send_first_stop(["mount", "stop", *arguments])


def bytes_of(read, count):
    got = b""
    while len(got) < count:
        got += read()
    return got


def test_without_a_driver_every_stop_goes_out_that_harms_no_other_make(terminal, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    master, port = terminal
    quick_stop.send_first_stop(["mount", "stop", "--port", port])
    sent = b"".join(stop for _, stop in quick_stop.HARMLESS)
    assert bytes_of(lambda: os.read(master, 64), len(sent)) == sent
    for driver, (baud, stop) in quick_stop.STOPS.items():
        assert (stop in dict(quick_stop.HARMLESS)[baud]) is (driver != "ioptron"), driver
    assert b"R" not in sent, "a NexStar's goto"
    assert b"r" not in sent


@pytest.mark.parametrize("kind", BOARDS)
def test_the_harmless_stops_begin_nothing_on_any_board_and_end_what_runs(kind) -> None:
    """Whatever else they are to it, in one piece as on a network without baud rates."""
    with served(kind) as board:
        board.align(-40.0, 40.0)
        with board.lock:
            board.go_home() if kind == "ioptron" else board.move(0, 1.0)  # its moves have a Stop of their own
            before = list(board.orders)
            for _, stop in quick_stop.HARMLESS:
                board.receive(stop)
            assert board.orders == before
        wait_for(lambda: not board.moving)
        with board.lock:
            for _, stop in quick_stop.HARMLESS:
                board.receive(stop)
            assert board.orders == before
        assert not board.moving


def test_the_mount_that_was_used_last_is_stopped_first(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    with served("ioptron", tcp=True) as board:
        guarded(MountSelection(board.port, "ioptron"), board.site).close()
        with board.lock:
            board.transcript.clear()
        for typed in ([], ["--port", board.port]):
            quick_stop.send_first_stop(["mount", "stop", *typed])
        heard = lambda: b"".join(data for _, mark, data in board.transcript if mark == ">")  # noqa: E731 (a thunk)
        wait_for(lambda: heard() == 2 * quick_stop.STOPS["ioptron"][1])


def test_what_was_used_last_may_be_damaged(terminal, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    master, port = terminal
    quick_stop.last_used_path().parent.mkdir(parents=True)
    for text in ("", "[]", '{"port": 3, "driver": []}', "\xff"):
        quick_stop.last_used_path().write_text(text, "latin-1")
        quick_stop.send_first_stop(["mount", "stop", "--port", port])
        sent = b"".join(stop for _, stop in quick_stop.HARMLESS)
        assert bytes_of(lambda: os.read(master, 64), len(sent)) == sent, text


def test_a_damaged_profile_is_left_to_the_command(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    path = save_profile(EquipmentProfile("Newton"))
    for text in ("", "[]", '{"port": 3, "driver": []}', "\xff"):
        path.write_text(text, "latin-1")
        quick_stop.send_first_stop(["mount", "stop", "--profile", "Newton"])


def test_the_program_itself_sends_it_first(terminal) -> None:
    """How soon, is told here; a busy machine must not fail a test: it is well before the program ends."""
    master, port = terminal
    begun = time.monotonic()
    ran = subprocess.Popen(
        [sys.executable, "-m", "kochab", "mount", "stop", "--port", port, "--driver", "lx200"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert os.read(master, 4) == b"#:Q#"
    first_s = time.monotonic() - begun
    again = os.read(master, 4)
    assert again == b"#:Q#", "the command sends it again"
    again_s = time.monotonic() - begun
    ran.communicate(timeout=60)
    print(f"first byte {1000 * first_s:.0f} ms, the command's own {1000 * again_s:.0f} ms")
    assert first_s < again_s


# -- over a network ----------------------------------------------------------------------------


def program(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "kochab", "mount", "stop", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def test_a_motor_board_on_its_wifi_is_stopped_first_by_datagrams_of_one_command() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        board.bind(("127.0.0.1", 0))
        board.settimeout(60.0)
        begun = time.monotonic()
        ran = program("--port", f"udp://127.0.0.1:{board.getsockname()[1]}", "--driver", "skywatcher")
        heard = [board.recv(64)]
        first_s = time.monotonic() - begun
        heard += [board.recv(64) for _ in range(5)]
        ran.kill()
        ran.communicate(timeout=60)
    print(f"first datagram after {1000 * first_s:.0f} ms")
    assert heard == 3 * [b":L1\r", b":L2\r"], "some datagrams are lost"


def first_bytes(driver, device):
    """What a server hears first of the program, and how soon."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(60.0)
        begun = time.monotonic()
        ran = program("--port", f"127.0.0.1:{server.getsockname()[1]}{device}", "--driver", driver)
        connection, _ = server.accept()
        heard = b""
        while not heard.endswith((b"</newSwitchVector>", b"ClientTransactionID=1")):
            heard += connection.recv(4096)
        print(f"{driver}: first bytes after {1000 * (time.monotonic() - begun):.0f} ms")
        connection.close()
        ran.kill()
        ran.communicate(timeout=60)
    return heard


def test_a_server_is_told_to_stop_before_anything_is_asked_of_it() -> None:
    indi = xml.etree.ElementTree.fromstring(b"<all>" + first_bytes("indi", "/EQMod Mount") + b"</all>")
    vector = indi.find("newSwitchVector")
    assert (vector.get("device"), vector.get("name")) == ("EQMod Mount", "TELESCOPE_ABORT_MOTION")
    assert (vector.find("oneSwitch").get("name"), vector.find("oneSwitch").text) == ("ABORT", "On")
    head, _, body = first_bytes("alpaca", "/3").partition(b"\r\n\r\n")
    assert head.startswith(b"PUT /api/v1/telescope/3/abortslew HTTP/1.1\r\n")
    assert f"Content-Length: {len(body)}".encode() in head


def test_indis_ioptron_driver_ends_a_move_by_the_first_bytes_alone(tmp_path) -> None:
    """Its ABORT is ``:Q#``, which ends slews alone."""
    pytest.importorskip("indipyclient")
    with indi(tmp_path) as bench:
        mount = bench.open()
        mount.move(Direction.NORTH, 0.5, 60.0)
        wait_for(lambda: not still(bench.telescope))
        quick_stop.send_first_stop(["mount", "stop", "--port", bench.address, "--driver", "indi"])
        wait_for(lambda: still(bench.telescope))
        mount.close()


@pytest.mark.parametrize("address", ["/0", ""])
def test_an_alpaca_server_stops_its_telescope_by_the_first_bytes_alone(tmp_path, address) -> None:
    with alpaca(tmp_path) as bench:
        bench.open()
        bench.telescope.goto(*place(40.0, 60.0, bench.clock))
        server = bench.port.partition("/")[0]
        quick_stop.send_first_stop(["mount", "stop", "--port", server + address, "--driver", "alpaca"])
        assert not bench.telescope.slewing


def test_indis_own_server_stops_its_telescope_by_the_first_bytes_alone(tmp_path) -> None:
    pytest.importorskip("indipyclient")
    device = "Telescope Simulator"
    with indi_server(tmp_path, "indi_simulator_telescope") as server:
        for wish in ("CONNECTION.CONNECT=On", "GEOGRAPHIC_COORD.LAT;LONG;ELEV=50;8;120", "TELESCOPE_PARK.UNPARK=On"):
            server.set(f"{device}.{wish}")
        server.set(f"{device}.ON_COORD_SET.TRACK=On")
        now = datetime.now(UTC)
        ra = (sidereal_deg(SITE, now) + 60.0) % 360.0 / 15.0
        server.set(f"{device}.EQUATORIAL_EOD_COORD.RA;DEC={ra};70")
        wait_for(lambda: server.get(f"{device}.EQUATORIAL_EOD_COORD._STATE") == "Busy")
        quick_stop.send_first_stop(["mount", "stop", "--port", f"{server.address}/{device}", "--driver", "indi"])
        wait_for(lambda: server.get(f"{device}.EQUATORIAL_EOD_COORD._STATE") != "Busy")
        there = (
            float(server.get(f"{device}.EQUATORIAL_EOD_COORD.RA")),
            float(server.get(f"{device}.EQUATORIAL_EOD_COORD.DEC")),
        )
        assert apart_deg((there[0] * 15.0, there[1]), (ra * 15.0, 70.0)) > 1.0, "it was stopped on its way"
