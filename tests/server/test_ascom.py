"""ASCOM drivers over Alpaca: the bridge asked by Kochab's own driver and by ASCOM's client (alpyca), and a real COM server on Windows."""

import importlib.util
import socket
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import pytest

from kochab.cli.main import main
from kochab.core.attitude import apart_deg
from kochab.core.errors import RefusedError
from kochab.core.mount import Direction, Epoch
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.server.alpaca_words import Fault
from kochab.server.ascom import AscomBridge, fault_of, installed
from kochab.server.http_server import HttpServer, Request
from tests.gear.mounts.alpaca_telescope import Refused
from tests.gear.mounts.bench import LIMITS, SITE, alpaca, opened, place
from tests.server import ascom_telescope

ON_WINDOWS = pytest.mark.skipif(
    sys.platform != "win32" or importlib.util.find_spec("win32com") is None, reason="needs Windows and pywin32"
)


class BenchDriver:
    """The test telescope's members of ITelescopeV3, with the types that COM passes: numbers, booleans, dates."""

    name = "Kochab.Bench.Telescope"

    def __init__(self, device):
        self.device = device
        self.heard = []

    def get(self, member):
        value = self._do(self.device.get, member, {})
        return datetime.fromisoformat(value[:26]) if member == "UTCDate" else value

    def put(self, member, value):
        self.heard.append((member, value))
        if not member.startswith(("Site", "UTC")):
            self._do(self.device.put, member, {member: str(value)})

    def call(self, member, *values):
        self.heard.append((member, *values))
        names = ("rightascension", "declination") if member.startswith("Dest") else ("RightAscension", "Declination")
        names = ("Direction", "Duration") if member == "PulseGuide" else names
        told = dict(zip(names, map(str, values), strict=False))
        return self._do(self.device.get if member.startswith("Dest") else self.device.put, member, told)

    def _do(self, do, member, told):
        try:
            return do(member.lower(), told)
        except Refused as error:
            raise Fault(error.number, str(error)) from None


@pytest.fixture
def bench(tmp_path):
    with alpaca(tmp_path) as bench:
        bench.driver = BenchDriver(bench.device)
        bench.bridge = AscomBridge([bench.driver])
        server = HttpServer(bench.bridge.answer)
        bench.port = "{}:{}/0".format(*server.address)
        yield bench
        server.stop()


def test_behind_the_guard_a_com_driver_keeps_its_limits(bench) -> None:
    mount = opened("alpaca", bench.port, bench.clock)
    assert mount.identify() == "Bench Telescope"
    assert mount.epoch is Epoch.DATE
    assert mount.site_report().site.latitude_deg == pytest.approx(SITE.latitude_deg)
    guard = Guard(mount, SITE, LIMITS, clock=bench.clock)
    with pytest.raises(RefusedError, match="the limit is 5°"):
        guard.goto(*place(0.0, -44.0, bench.clock))
    target = place(-25.0, 45.0, bench.clock)
    run(guard.slew(*target))
    assert apart_deg(bench.telescope.believed_deg(), target) < 1e-3
    mount.goto(*place(-60.0, 50.0, bench.clock))
    assert mount.state().slewing
    guard.stop()
    assert not mount.state().slewing
    guard.close()
    bench.bridge.close()
    assert bench.driver.heard[-1] == ("Connected", False)


def test_ascom_s_own_client_reads_the_same_and_hears_the_driver_s_errors(bench) -> None:
    client = pytest.importorskip("alpaca.telescope").Telescope(bench.port.partition("/")[0], 0)
    exceptions = pytest.importorskip("alpaca.exceptions")
    guide = pytest.importorskip("alpaca.telescope").GuideDirections
    with pytest.raises(exceptions.NotConnectedException):
        _ = client.RightAscension
    client.Connected = True
    assert apart_deg((client.RightAscension * 15.0, client.Declination), bench.telescope.believed_deg()) < 1e-3
    assert abs(client.UTCDate.timestamp() - bench.telescope.now_unix()) < 2.0
    assert [int(rate) for rate in client.TrackingRates] == [0, 1, 2, 3]
    with pytest.raises(exceptions.InvalidValueException):
        client.SlewToCoordinatesAsync(5.0, 91.0)
    with pytest.raises(exceptions.NotImplementedException):
        client.CommandBlind("Q", True)
    client.PulseGuide(guide.guideNorth, 50)
    assert ("PulseGuide", 0, 50) in bench.driver.heard


@pytest.mark.parametrize("member", ["setupdialog", "action", "commandstring", "dispose", "moveaxis", "__class__"])
def test_what_is_not_named_never_reaches_the_driver(bench, member) -> None:
    before = list(bench.driver.heard)
    for method in ("GET", "PUT"):
        answer = bench.bridge.answer(Request(method, f"/api/v1/telescope/0/{member}"))
        assert b'"ErrorNumber": 1024' in answer.body
    assert bench.driver.heard == before


def test_a_web_page_elsewhere_steers_nothing(bench) -> None:
    answer = bench.bridge.answer(Request("POST", "/api/v1/telescope/0/abortslew"))
    assert answer.status == 405
    assert bench.driver.heard == []


@pytest.mark.parametrize(
    ("hresult", "details", "number", "text"),
    [
        (0x80020006 - 2**32, None, 0x400, "does not support it"),
        (0x80020009 - 2**32, ("It is parked", "driver", None, 0, 0x80040408 - 2**32), 0x408, "It is parked"),
        (0x80040407, None, 0x407, "said by COM"),  # of a driver written in C++, without a description
        (0x800706BA - 2**32, None, 0x407, "has ended"),
        (0x80020009 - 2**32, (None, None, None, 0, None), 0x500, "said by COM"),
        (0x8000FFFF - 2**32, None, 0x500, "said by COM"),
    ],
)
def test_com_s_numbers_become_ascom_s(hresult, details, number, text) -> None:
    fault = fault_of(hresult, details, "said by COM")
    assert fault.number == number
    assert text in str(fault)


@pytest.mark.skipif(sys.platform == "win32", reason="there are ASCOM drivers on Windows")
def test_elsewhere_one_sentence_says_that_ascom_is_windows(capsys) -> None:
    assert main(["serve", "--ascom"]) == 2
    assert "ASCOM drivers run on Windows" in capsys.readouterr().err
    assert installed() == []


def test_two_faces_at_once_and_the_network_are_refused(capsys) -> None:
    assert main(["serve", "--ascom", "X.Telescope", "--nova"]) == 2
    assert main(["serve", "--ascom", "X.Telescope", "--lan"]) == 2
    assert "this computer alone" in capsys.readouterr().err


# -- Windows -----------------------------------------------------------------------------------

TRIED = """
import sys
from kochab.server.alpaca_words import Fault
from kochab.server.ascom import ComDriver
driver = ComDriver({progid!r})
def refused(do, *given):
    try:
        print("not refused", do(*given))
    except Fault as fault:
        print(hex(fault.number), fault)
refused(driver.get, "RightAscension")
driver.put("Connected", True)
print(driver.get("Name"), driver.get("TrackingRates"), type(driver.get("UTCDate")).__name__, driver.get("Slewing"))
refused(driver.get, "SideOfPier")
refused(driver.call, "SlewToCoordinatesAsync", 25.0, 0.0)
refused(driver.call, "Exit")
refused(driver.get, "RightAscension")
driver.put("Connected", True)
print(driver.get("RightAscension"))
"""


@pytest.fixture
def com_telescope():
    packages = Path(importlib.util.find_spec("win32com").origin).parents[1]
    with ascom_telescope.registered(packages):
        yield ascom_telescope.PROGID


@ON_WINDOWS
def test_a_com_server_is_reached_by_its_name(com_telescope) -> None:
    done = subprocess.run(
        [sys.executable, "-c", TRIED.format(progid=com_telescope)], capture_output=True, text=True, timeout=100
    )
    assert done.stdout.splitlines() == [
        "0x407 Connect first",
        "COM telescope [0, 2] datetime False",
        "0x400 sideofpier is not implemented",
        "0x401 That is no place on the sky.",
        "0x407 The driver has ended.",
        "0x407 The driver has ended.",
        "5.5",
    ], done.stderr


@ON_WINDOWS
def test_kochab_s_mount_slews_a_com_server_through_the_command(com_telescope) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    serving = subprocess.Popen(
        [sys.executable, "-m", "kochab", "serve", "--ascom", com_telescope, "--port", str(port)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert f"127.0.0.1:{port}/0" in serving.stdout.readline()
        mount = open_mount("alpaca", f"127.0.0.1:{port}/0")
        assert mount.identify() == "COM telescope"
        start = mount.position()
        assert (start.ra_deg, start.dec_deg) == (82.5, 20.0)
        mount.goto(97.5, 30.0)
        assert mount.state().slewing
        mount.stop()
        here = mount.position()
        assert not mount.state().slewing
        assert 82.5 < here.ra_deg < 97.5
        mount.sync(90.0, 25.0)
        assert mount.position().ra_deg == pytest.approx(90.0)
        assert mount.site_report().time_utc is not None
        with pytest.raises(RefusedError):
            mount.pulse(Direction.NORTH, 10)
        mount.close()
    finally:
        serving.kill()
        serving.communicate()


@ON_WINDOWS
def test_a_driver_that_is_not_there_is_named(capsys) -> None:
    assert main(["serve", "--ascom", "Nobody.Telescope"]) != 0
    assert "No ASCOM driver is called Nobody.Telescope" in capsys.readouterr().err
