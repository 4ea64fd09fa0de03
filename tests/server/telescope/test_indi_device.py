"""The INDI device, asked and steered by INDI's own command line and by an INDI client library."""

import contextlib
import queue
import re
import shutil
import subprocess
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import apart_deg
from kochab.core.frame import Site
from kochab.server.telescope.indi import Elements, sexagesimal
from kochab.server.telescope.listening import NotTheProtocol
from kochab.server.telescope.offer import Offer
from tests.server.telescope.conftest import Program, wait_for
from tests.server.telescope.test_offered import from_date, of_date

PLACE = (83.822, -5.391)
NUMBER = r'<defNumber name="(\w+)"[^>]* min="([-\d.]+)" max="([-\d.]+)"[^>]*>\s*([-\d.]+)'
COORDINATES = "Kochab.EQUATORIAL_EOD_COORD"


@pytest.fixture
def telescope(steered):
    return steered


@pytest.fixture
def port(telescope):
    offer = Offer(telescope, {"indi": 0})
    yield offer.ports["indi"]
    offer.stop()


@pytest.fixture
def indi(port):
    """INDI's own command line; skipped where it is not installed."""
    if shutil.which("indi_getprop") is None:
        pytest.skip("indi_getprop is not there: apt-get install indi-bin")

    def call(program, *arguments, patience_s=5):
        command = [program, "-p", str(port), "-t", str(patience_s), *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=60)

    def get(name):
        return call("indi_getprop", "-1", name).stdout.strip()

    def put(wanted):
        done = call("indi_setprop", wanted)
        assert done.returncode == 0, done.stderr

    return get, put


def test_indis_own_command_line_reads_and_steers_it(indi, telescope, mount) -> None:
    get, put = indi
    telescope.see_mount(PLACE)
    assert get("Kochab.CONNECTION.CONNECT") == "Off"
    assert get("Kochab.DRIVER_INFO.DRIVER_INTERFACE") == "1"
    put("Kochab.CONNECTION.CONNECT=On")
    assert get("Kochab.CONNECTION.CONNECT") == "On"
    told = float(get(f"{COORDINATES}.RA")) * 15.0, float(get(f"{COORDINATES}.DEC"))
    assert apart_deg(told, of_date(*PLACE)) * 3600.0 < 0.05
    assert float(get("Kochab.GEOGRAPHIC_COORD.LAT")) == pytest.approx(48.14)
    put(f"{COORDINATES}.RA;DEC=6.5;-12.25")
    assert wait_for(lambda: mount.orders == ["goto"])
    assert apart_deg((telescope.target.ra_deg, telescope.target.dec_deg), from_date(97.5, -12.25)) * 3600.0 < 0.05
    telescope.see_mount(PLACE, slewing=True)
    assert get(f"{COORDINATES}._STATE") == "Busy"
    put("Kochab.TELESCOPE_ABORT_MOTION.ABORT=On")
    put("Kochab.ON_COORD_SET.SYNC=On")
    put(f"{COORDINATES}.RA;DEC=6:30:00;-12:15:00")
    assert wait_for(lambda: mount.orders == ["goto", "stop", "accept_sync"])
    put("Kochab.CONNECTION.DISCONNECT=On")
    assert get("Kochab.CONNECTION.DISCONNECT") == "On"


def test_a_refusal_is_an_alert_with_its_sentence(port, telescope, mount) -> None:
    mount.order = lambda name, make, refuse: make.args[-1].set_result("Below the horizon limit.")
    telescope.see_mount(PLACE)
    client = Program(port)
    with client.line:
        client.say('<getProperties version="1.7"/><newSwitchVector device="Kochab" name="CONNECTION">')
        client.say('<oneSwitch name="CONNECT">On</oneSwitch></newSwitchVector>')
        client.say('<newNumberVector device="Kochab" name="EQUATORIAL_EOD_COORD"><oneNumber name="RA">6.5</oneNumber>')
        client.say('<oneNumber name="DEC">-12.25</oneNumber></newNumberVector>')
        heard, until = "", time.monotonic() + 90.0
        while "Below the horizon limit" not in heard and time.monotonic() < until:
            heard += client.line.recv(4096).decode()
    assert 'state="Alert"' in heard
    assert 'message="Below the horizon limit."' in heard


@pytest.mark.parametrize(("ra", "dec"), [("24", "0"), ("-0.1", "0"), ("6", "90.1"), ("6", "-90:30"), ("six", "1")])
def test_a_place_that_is_none_is_refused_with_its_range_and_nothing_moves(port, telescope, mount, ra, dec) -> None:
    telescope.see_mount(PLACE)
    client = Program(port)
    with client.line:
        client.say('<getProperties version="1.7"/><newSwitchVector device="Kochab" name="CONNECTION">')
        client.say('<oneSwitch name="CONNECT">On</oneSwitch></newSwitchVector>')
        client.say(
            f'<newNumberVector device="Kochab" name="EQUATORIAL_EOD_COORD"><oneNumber name="RA">{ra}</oneNumber>'
        )
        client.say(f'<oneNumber name="DEC">{dec}</oneNumber></newNumberVector>')
        heard, until = "", time.monotonic() + 90.0
        while 'state="Alert"' not in heard and time.monotonic() < until:
            heard += client.line.recv(4096).decode()
    assert "RA is from 0 to 24 h, DEC from -90 to 90 degrees." in heard
    assert mount.orders == []


def test_numbers_are_told_with_their_ranges_and_a_western_site_from_zero_to_360(port, telescope) -> None:
    telescope.site = Site(-24.6, -70.4, 2635.0)
    telescope.see_mount(PLACE)
    client = Program(port)
    with client.line:
        client.say('<getProperties version="1.7"/><newSwitchVector device="Kochab" name="CONNECTION">')
        client.say('<oneSwitch name="CONNECT">On</oneSwitch></newSwitchVector>')
        heard, until = "", time.monotonic() + 90.0
        while heard.count("</defNumber>") < 5 and time.monotonic() < until:
            heard += client.line.recv(4096).decode()
    told = {name: tuple(map(float, numbers)) for name, *numbers in re.findall(NUMBER, heard)}
    assert {name: numbers[:2] for name, numbers in told.items()} == {
        **{"RA": (0.0, 24.0), "DEC": (-90.0, 90.0), "LAT": (-90.0, 90.0), "LONG": (0.0, 360.0)},
        "ELEV": (-200.0, 10000.0),
    }
    assert [told[name][2] for name in ("LAT", "LONG", "ELEV")] == pytest.approx([-24.6, 289.6, 2635.0])


def test_a_client_library_hears_every_move(port, telescope) -> None:
    """indipyclient, by another author: its copy of the device follows the telescope."""
    client_library = pytest.importorskip("indipyclient.queclient")

    telescope.see_mount(PLACE)
    wishes, heard = queue.Queue(4), queue.Queue(1000)
    thread = threading.Thread(target=client_library.runqueclient, args=(wishes, heard, "127.0.0.1", port), daemon=True)
    thread.start()

    known = {}

    def newest():
        while not heard.empty():
            for name, vector in (heard.get().snapshot.get("Kochab") or {}).items():
                known[name] = dict(vector)
        return known

    try:
        assert wait_for(lambda: "CONNECTION" in newest())
        wishes.put(("Kochab", "CONNECTION", {"CONNECT": "On", "DISCONNECT": "Off"}))
        assert wait_for(lambda: "EQUATORIAL_EOD_COORD" in newest())
        for dec in (10.0, 20.0, 30.0):
            telescope.see_mount((10.0, dec))
            there = of_date(10.0, dec)[1]
            assert wait_for(lambda wanted=there: abs(float(newest()["EQUATORIAL_EOD_COORD"]["DEC"]) - wanted) < 1e-4)
    finally:
        wishes.put(None)
        thread.join(20)


@pytest.mark.parametrize(
    "noise",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        b"<getProperties" + b" " * 40_000,
        b'<!DOCTYPE x [<!ENTITY a "b">]><getProperties/>',
        b"<a>" * 9000,
        b"</indi></indi>",
        b"\xff\xfe" * 100,
    ],
)
def test_what_is_no_indi_ends_with_a_sentence(port, told, noise) -> None:
    client = Program(port)
    with client.line:
        client.line.sendall(noise)
        client.line.settimeout(20)
        try:
            while client.line.recv(4096):
                pass
        except ConnectionResetError:
            pass
    assert wait_for(lambda: any("does not speak" in sentence for sentence in told))


@given(st.binary(max_size=300))
def test_any_bytes_are_elements_or_refused(data) -> None:
    with contextlib.suppress(NotTheProtocol):
        Elements().feed(data)


@pytest.mark.parametrize(
    ("text", "value"), [("6.5", 6.5), ("-12:15:00", -12.25), ("-0:30", -0.5), ("5 30 36", 5.51), ("1e1", 10.0)]
)
def test_numbers_as_indi_writes_them(text, value) -> None:
    assert sexagesimal(text) == pytest.approx(value)
    assert sexagesimal(f"{text}x") != sexagesimal(f"{text}x")  # NaN
