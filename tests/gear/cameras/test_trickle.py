"""Servers that send one byte at a time: an exchange has one time limit, however often a byte comes."""

import socket
import threading
from contextlib import closing, contextmanager, suppress

import pytest

from kochab.core.errors import LineLostError, NoAnswerError, PortError
from kochab.core.frame import Site
from kochab.gear.cameras import open_camera
from kochab.gear.mounts.drivers.indi import IndiMount
from kochab.gear.servers.address import NetAddress
from kochab.gear.servers.alpaca_link import AlpacaLink

from .test_indi_hostile import BLOB, CAMERA, exposed

PAUSE_S = 0.02
OK, LONG = b"HTTP/1.1 200 OK\r\n", b"x" * 700
VALUE = b'{"Value":7}'
WHOLE = {
    "status line": b"HTTP/1.1 200 " + LONG + b"\r\nContent-Length: 11\r\n\r\n" + VALUE,
    "headers": OK + b"X: " + LONG + b"\r\nContent-Length: 11\r\n\r\n" + VALUE,
    "size of a chunk": OK + b"Transfer-Encoding: chunked\r\n\r\nb;" + LONG + b"\r\n" + VALUE + b"\r\n0\r\n\r\n",
    "body": OK + b"Content-Length: 711\r\n\r\n" + VALUE + b" " * 700,
}
"""Answers that are valid when one waits for all of them."""


@contextmanager
def server(*talks, pause_s=PAUSE_S):
    """Sends each line's ``(at once, byte by byte)``, the last of them again and again."""
    ear, over = socket.create_server(("127.0.0.1", 0)), threading.Event()

    def serve(line, at_once, trickled):
        with line, suppress(OSError):
            line.recv(1 << 16)
            line.sendall(at_once)
            for byte in trickled:
                if over.wait(pause_s):
                    return
                line.sendall(bytes([byte]))
            over.wait(30)

    def accept():
        with suppress(OSError):
            for number in range(100):
                talk = talks[min(number, len(talks) - 1)]
                threading.Thread(target=serve, args=(ear.accept()[0], *talk), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield ear.getsockname()[1]
    finally:
        over.set()
        ear.close()


@pytest.mark.parametrize("part", WHOLE)
def test_an_alpaca_server_that_trickles_has_one_limit_for_its_answer(part) -> None:
    with server((b"", WHOLE[part])) as port, pytest.raises(PortError, match="does not answer"):
        AlpacaLink(NetAddress("127.0.0.1", port)).get("camera/0/gain", limit_s=0.3)


def test_a_kept_line_that_was_closed_gets_no_second_limit() -> None:
    """The first answer comes; the line is then closed, and the next one trickles."""
    with server((OK + b"Content-Length: 11\r\n\r\n" + VALUE, b""), (b"", WHOLE["headers"])) as port:
        link = AlpacaLink(NetAddress("127.0.0.1", port))
        assert link.get("camera/0/gain") == 7
        assert link._http.sock is not None
        link._http.sock.shutdown(socket.SHUT_RDWR)
        with pytest.raises(LineLostError, match="Lost the Alpaca server"):
            link.get("camera/0/gain", limit_s=0.3)


def test_an_indi_server_that_trickles_what_it_has(monkeypatch) -> None:
    pytest.importorskip("indipyclient")
    monkeypatch.setattr("kochab.gear.servers.indi_link.TELL_S", 0.5)
    with server((b"", CAMERA.encode())) as port, pytest.raises(PortError, match="has no camera"):
        open_camera("indi", f"127.0.0.1:{port}")


def test_an_indi_server_that_trickles_a_picture(monkeypatch) -> None:
    pytest.importorskip("indipyclient")
    monkeypatch.setattr("kochab.gear.cameras.server_camera.DOWNLOAD_S", 0.3)
    monkeypatch.setattr("kochab.gear.servers.indi_link.SET_S", 0.3)
    # the first line only knocks, to see that somebody listens
    talks = (b"", b""), (CAMERA.encode(), (BLOB + "QUJD" * 1000).encode())
    with server(*talks) as port, pytest.raises(LineLostError, match="sent no image"):
        exposed(f"127.0.0.1:{port}")


TOLD = 'device="T" state="Ok"'
ANSWERS = f"""
<setNumberVector {TOLD} name="EQUATORIAL_EOD_COORD"><oneNumber name="RA">2</oneNumber><oneNumber name="DEC">20</oneNumber>
</setNumberVector>
<setSwitchVector {TOLD} name="TELESCOPE_ABORT_MOTION"><oneSwitch name="ABORT">Off</oneSwitch></setSwitchVector>
<setNumberVector {TOLD} name="GEOGRAPHIC_COORD"><oneNumber name="LAT">48</oneNumber></setNumberVector>
<setSwitchVector {TOLD} name="TELESCOPE_PARK"><oneSwitch name="PARK">On</oneSwitch></setSwitchVector>
"""
TELESCOPE = f"""
<defTextVector {TOLD} perm="ro" name="DRIVER_INFO"><defText name="DRIVER_INTERFACE">1</defText></defTextVector>
<defSwitchVector {TOLD} perm="rw" rule="OneOfMany" name="CONNECTION"><defSwitch name="CONNECT">On</defSwitch>
</defSwitchVector>
<defNumberVector {TOLD} perm="rw" name="EQUATORIAL_EOD_COORD">
<defNumber name="RA" format="%g" min="0" max="24" step="0">1</defNumber>
<defNumber name="DEC" format="%g" min="-90" max="90" step="0">10</defNumber></defNumberVector>
<defSwitchVector {TOLD} perm="rw" rule="OneOfMany" name="ON_COORD_SET"><defSwitch name="SYNC">On</defSwitch>
<defSwitch name="TRACK">On</defSwitch></defSwitchVector>
<defSwitchVector {TOLD} perm="rw" rule="AtMostOne" name="TELESCOPE_ABORT_MOTION"><defSwitch name="ABORT">Off</defSwitch>
</defSwitchVector>
<defNumberVector {TOLD} perm="rw" name="GEOGRAPHIC_COORD">
<defNumber name="LAT" format="%g" min="-90" max="90" step="0">0</defNumber></defNumberVector>
<defSwitchVector {TOLD} perm="rw" rule="OneOfMany" name="TELESCOPE_PARK"><defSwitch name="PARK">Off</defSwitch>
</defSwitchVector>
"""
CHATTER = '<message device="T" message="still here"/>' * 140
"""Half a minute of it, byte by byte, a whole message every fifth of a second."""
EXCHANGES = {
    "sync": lambda mount: mount.sync(30.0, 20.0),
    "goto": lambda mount: mount.goto(30.0, 20.0),
    "stop": lambda mount: mount.stop(),
    "site": lambda mount: mount.set_site(Site(48.0, 11.0, 0.0)),
    "park": lambda mount: mount.park(),
}


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_an_indi_mount_whose_server_trickles_has_one_limit_for_the_answer(monkeypatch, exchange) -> None:
    """What it says meanwhile gives it no more time; the answer comes after all, behind half a minute of that."""
    pytest.importorskip("indipyclient")
    for name, limit_s in {"CALL_S": 0.4, "SET_S": 1.0, "STOP_S": 1.0}.items():
        monkeypatch.setattr(f"kochab.gear.mounts.drivers.indi.{name}", limit_s)
    talks = (b"", b""), (TELESCOPE.encode(), (CHATTER + ANSWERS).encode())
    with (
        server(*talks, pause_s=0.005) as port,
        closing(IndiMount(f"127.0.0.1:{port}/T")) as mount,
        pytest.raises(NoAnswerError, match="does not answer"),
    ):
        EXCHANGES[exchange](mount)


def test_an_indi_server_that_trickles_its_telescope(monkeypatch) -> None:
    pytest.importorskip("indipyclient")
    monkeypatch.setattr("kochab.gear.servers.indi_link.TELL_S", 0.5)
    with server((b"", TELESCOPE.encode())) as port, pytest.raises(PortError, match="has no telescope"):
        IndiMount(f"127.0.0.1:{port}")
