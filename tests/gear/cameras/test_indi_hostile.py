"""An INDI server that sends what no camera would."""

import io
import re
import socket
import threading
from contextlib import closing, contextmanager, suppress

import numpy as np
import pytest
from astropy.io import fits

from kochab.core.capture import CaptureSettings
from kochab.core.errors import DeviceError, LineLostError, PortError
from kochab.gear.cameras import open_camera
from kochab.gear.servers.address import NetAddress, chosen, net_address
from kochab.gear.servers.indi_link import IndiLink

pytest.importorskip("indipyclient")

ABOUT = 'device="C" label="a" group="g" state="Ok" perm="rw" timestamp="2026-01-01T00:00:00"'
CAMERA = f"""
<defTextVector {ABOUT} name="DRIVER_INFO"><defText name="DRIVER_INTERFACE">2</defText></defTextVector>
<defSwitchVector {ABOUT} name="CONNECTION" rule="OneOfMany"><defSwitch name="CONNECT">On</defSwitch>
</defSwitchVector>
<defNumberVector {ABOUT} name="CCD_EXPOSURE"><defNumber name="CCD_EXPOSURE_VALUE" format="%g"
 min="0" max="3600" step="1">1</defNumber></defNumberVector>
<defBLOBVector {ABOUT} name="CCD1"><defBLOB name="CCD1"/></defBLOBVector>
"""
BLOB = '<setBLOBVector device="C" name="CCD1" state="Ok"><oneBLOB name="CCD1" size="9" format=".fits">'


@contextmanager
def server(told: str, then: bytes):
    """Tells of a camera, and after the client's first wish sends ``then`` for ever."""
    ear = socket.create_server(("127.0.0.1", 0))
    over = threading.Event()

    def serve(line: socket.socket) -> None:
        with line, suppress(OSError):
            line.recv(1000)
            line.sendall(told.encode())
            while then and not over.is_set() and line.recv(1 << 16).find(b"enableBLOB") < 0:
                pass
            while then and not over.is_set():
                line.sendall(then)
            over.wait(30)

    def accept() -> None:
        with suppress(OSError):
            while True:
                threading.Thread(target=serve, args=(ear.accept()[0],), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield f"127.0.0.1:{ear.getsockname()[1]}/C"
    finally:
        over.set()
        ear.close()


def exposed(address: str) -> None:
    camera = open_camera("indi", address, CaptureSettings(exposure_s=0.1))
    try:
        for _ in range(200):
            camera.next_frame(0.1)
    finally:
        camera.close()


def test_a_picture_without_an_end_is_given_up(monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.servers.indi_link.LARGEST_BYTES", 3_000_000)
    with server(CAMERA, b"QUJD" * 16384) as address, pytest.raises(LineLostError):
        exposed(address)
    with server(CAMERA + BLOB, b"QUJD" * 16384) as address, pytest.raises(LineLostError):
        exposed(address)


@pytest.mark.parametrize("told", ["<defTextVector ", ""])
def test_a_vector_without_an_end_is_given_up_long_before_a_picture_is(told) -> None:
    """INDI's own drivers define a telescope in some 30 kB."""
    with (
        server(CAMERA + told + "x" * 6_000_000, b"") as address,
        closing(IndiLink(net_address(address, 7624))) as link,
        pytest.raises(LineLostError, match="never ends its reply"),
    ):
        link.wait(lambda: False, 60.0)


def test_devices_without_an_end_are_given_up(monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.servers.indi_link.MOST_VECTORS", 50)
    told = "".join(CAMERA.replace('"C"', f'"C{k}"') for k in range(60))
    with (
        server(told, b"") as address,
        closing(IndiLink(net_address(address, 7624))) as link,
        pytest.raises(LineLostError, match="never ends its reply"),
    ):
        link.wait(lambda: False, 60.0)


@pytest.mark.parametrize(("rest", "said"), [("", "more than one"), ("X", "no camera X")])
def test_a_sentence_names_ten_of_a_servers_devices_at_most(rest, said) -> None:
    """A server that defines without an end had 20,000 of them in one."""
    where = NetAddress("localhost", 7624, rest)
    for count, cut in ((10, False), (5000, True)):
        with pytest.raises(PortError, match=said) as told:
            chosen([(f"C{k}", f"C{k}") for k in range(count)], where, "INDI")
        assert ("C9, …" in str(told.value)) is cut
        assert "C9" in str(told.value)
        assert len(str(told.value)) < 200


@pytest.mark.parametrize("kind", ["[ERROR]", "[INFO]"])
def test_what_a_server_says_is_shown_with_escapes_and_cut(kind) -> None:
    """U+009B begins an order to a terminal, and U+202E turns the rest of the line round."""
    told = f'<message device="C" message="{kind} no &#x9b;31m way&#x202e; {"x" * 50_000}"/>'
    with server(CAMERA + told, b"") as address, closing(IndiLink(net_address(address, 7624))) as link:
        assert link.wait(lambda: "way" in link.last_word, 60.0)
        assert link.last_word.startswith("no \\x9b31m way\\u202e x")
        assert len(link.last_word) <= 200
        assert link.message == (link.last_word if kind == "[ERROR]" else "")


@pytest.mark.parametrize("name", ["C" * 65, "C&#x202e;"])
def test_a_device_whose_name_is_none_of_indi_s_is_not_offered(name) -> None:
    told = CAMERA + CAMERA.replace('"C"', f'"{name}"')
    with server(told, b"") as address, closing(IndiLink(net_address(address, 7624))) as link:
        assert link.named(2, "D") == ["C"]


@pytest.mark.parametrize("value", ["x", "--1"])
@pytest.mark.parametrize("place", ['max="3600"', ">1</defNumber>"])
def test_numbers_that_are_none_are_a_sentence(value, place, monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.servers.indi_link.POWER_UP_S", 0.5)
    wrong = re.sub("3600|(?<=>)1(?=<)", value, place)
    with server(CAMERA.replace(place, wrong), b"") as address, pytest.raises(DeviceError) as caught:
        open_camera("indi", address, CaptureSettings(exposure_s=0.1))
    assert str(caught.value)[-1] in ".?"


MORE = f"""
<defNumberVector {ABOUT} name="CCD_BINNING"><defNumber name="HOR_BIN" format="%g" min="1" max="4" step="1">1</defNumber>
<defNumber name="VER_BIN" format="%g" min="1" max="4" step="1">1</defNumber></defNumberVector>
<defSwitchVector {ABOUT} name="CCD_ABORT_EXPOSURE" rule="AtMostOne"><defSwitch name="ABORT">Off</defSwitch>
</defSwitchVector>
"""


def picture(binning: int) -> tuple[bytes, str]:
    out, header = io.BytesIO(), fits.Header({"XBINNING": binning})
    fits.PrimaryHDU(np.full((20, 30), binning, np.uint16), header).writeto(out)
    return out.getvalue(), ".fits"


def test_a_picture_on_its_way_when_its_exposure_was_aborted_is_left_out_once(monkeypatch) -> None:
    monkeypatch.setattr("kochab.gear.cameras.indi.SET_S", 0.1)
    with (
        server(CAMERA + MORE, b"") as address,
        closing(open_camera("indi", address, CaptureSettings(exposure_s=0.1))) as camera,
    ):
        assert camera.next_frame(0.0) is None  # one is under way
        camera.configure(CaptureSettings(exposure_s=0.2))  # and is aborted
        arriving = [picture(2), picture(1), picture(2)]
        monkeypatch.setattr(camera._link, "take_blob", lambda timeout_s: arriving and arriving.pop(0))
        assert camera.next_frame(0.0) is None
        assert [camera.next_frame(0.0).header["XBINNING"] for _ in range(2)] == [1, 2]
