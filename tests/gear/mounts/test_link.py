"""The line itself: opened for ourselves alone, lost at once when it breaks, clear when it fails."""

import os
import socket
import stat
import threading
from contextlib import nullcontext, suppress
from itertools import count

import pytest
from serial import SerialException, SerialTimeoutException

from kochab.core.errors import LineLostError, NoAnswerError, PortError
from kochab.gear.mounts import open_mount, serial_line
from kochab.gear.mounts.serial_line import SerialLink, not_opened

pty, tty = (pytest.importorskip(name) for name in ("pty", "tty"))  # Windows has none


@pytest.fixture
def ends():
    """A pseudo-terminal: its master's descriptor, and the path of its slave."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    state = {"master": master}
    yield state, os.ttyname(slave)
    for fd in (state["master"], slave):
        with suppress(OSError):
            os.close(fd)


def test_bytes_go_both_ways(ends) -> None:
    state, port = ends
    link = SerialLink(port)
    link.write(b":GR#")
    assert os.read(state["master"], 10) == b":GR#"
    os.write(state["master"], b"05:30:00#12")
    assert link.read_until(b"#", 16, 1.0) == b"05:30:00#"
    assert link.read_exact(2, 1.0) == b"12"
    link.close()


def test_silence_and_half_an_answer_are_told_apart(ends) -> None:
    state, port = ends
    link = SerialLink(port)
    with pytest.raises(NoAnswerError, match="did not answer within"):
        link.read_exact(1, 0.1)
    os.write(state["master"], b"05:3")
    with pytest.raises(NoAnswerError, match=r"stopped after b'05:3'"):
        link.read_until(b"#", 16, 0.2)
    os.write(state["master"], b"x" * 20)
    with pytest.raises(NoAnswerError, match="never ends its reply"):
        link.read_until(b"#", 16, 1.0)
    link.close()


def test_wine_s_time_out_is_silence_not_a_lost_line(ends, monkeypatch) -> None:
    """Seen under Wine 10 on a COM port that leads to a pseudo-terminal; Windows' own read returns nothing there."""
    state, port = ends
    link = SerialLink(port)
    read, empty = link._serial.read, iter(range(2))

    def wine_s(number):
        if next(empty, None) is not None:
            raise SerialException("GetOverlappedResult failed (OSError(22, 'Timeout.', None, 1460))")
        return read(number)

    monkeypatch.setattr(link._serial, "read", wine_s)
    os.write(state["master"], b"1")
    assert link.read_exact(1, 5.0) == b"1"
    empty = count()
    with pytest.raises(NoAnswerError, match=r"did not answer within 0\.2 s"):
        link.read_exact(1, 0.2)
    monkeypatch.setattr(link._serial, "read", lambda number: pulled())
    with pytest.raises(LineLostError):
        link.read_exact(1, 0.2)
    link.close()


def pulled():
    raise SerialException("GetOverlappedResult failed (OSError(22, 'Access is denied.', None, 5))")


def test_stale_bytes_are_thrown_away_until_the_line_is_quiet(ends) -> None:
    state, port = ends
    link = SerialLink(port)
    os.write(state["master"], b"late#")
    threading.Timer(0.15, os.write, (state["master"], b"later#")).start()
    assert link.discard(0.4) == b"late#later#"
    link.close()


@pytest.mark.parametrize("action", ["read", "write", "discard"])
def test_a_pulled_cable_is_said_at_once(ends, action) -> None:
    state, port = ends
    link = SerialLink(port)
    os.close(state["master"])
    # the slave of the fixture stays open: only the hang-up itself may be noticed
    does = {
        "read": lambda: link.read_exact(1, 60.0),
        "write": lambda: link.write(b":Q#"),
        "discard": lambda: link.discard(60.0),
    }
    with pytest.raises(LineLostError, match="cable"):
        does[action]()
    with pytest.raises(LineLostError):
        link.write(b":Q#")
    link.close()


@pytest.mark.parametrize(("passed_s", "lost"), [(2.1, True), (30.0, False)])
def test_a_computer_that_slept_while_it_wrote_has_not_lost_its_line(ends, monkeypatch, passed_s, lost) -> None:
    """pyserial looks at its clock once the bytes are handed over."""
    state, port = ends
    link = SerialLink(port)
    write, clock = link._serial.write, [0.0]

    def slept(data):
        write(data)
        clock[0] = passed_s
        raise SerialTimeoutException("Write timeout")

    monkeypatch.setattr(link._serial, "write", slept)
    monkeypatch.setattr(serial_line, "monotonic", lambda: clock[0])
    with pytest.raises(LineLostError) if lost else nullcontext():
        link.write(b":Q#")
    assert os.read(state["master"], 10) == b":Q#"
    assert link._lost is lost
    link.close()


def test_a_reader_that_waits_notices_the_cable(ends) -> None:
    state, port = ends
    link = SerialLink(port)
    threading.Timer(0.2, os.close, (state["master"],)).start()
    with pytest.raises(LineLostError):
        link.read_until(b"#", 16, 60.0)
    link.close()


def test_a_server_that_goes_is_a_lost_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = SerialLink(f"socket://127.0.0.1:{server.getsockname()[1]}")
        peer, _ = server.accept()
        link.write(b"e")
        assert peer.recv(1) == b"e"
        peer.sendall(b"#")
        assert link.read_exact(1, 5.0) == b"#"
        peer.close()
        with pytest.raises(LineLostError):
            link.read_exact(1, 60.0)
        link.close()


def test_a_closed_link_is_lost_and_closing_twice_is_nothing(ends) -> None:
    link = SerialLink(ends[1])
    link.close()
    link.close()
    with pytest.raises(LineLostError, match="closed"):
        link.write(b":Q#")


def test_a_port_in_use_is_said(ends) -> None:
    link = SerialLink(ends[1])
    with pytest.raises(PortError, match="in use: close the other program"):
        SerialLink(ends[1])
    link.close()


@pytest.mark.parametrize(
    ("port", "advice"),
    [
        ("/dev/ttyUSB77", "plug in the USB cable"),
        ("mount", "kochab mount list"),
        ("socket://127.0.0.1:1", "No answer at"),
        ("socket://127.0.0.1:99999", "socket://HOST:PORT"),
        ("tcp://192.168.0.5:abc", "tcp://HOST:PORT"),
        ("tcp://[fe80::1", "tcp://HOST:PORT"),
        ("nonsense://x", "tcp://HOST:PORT"),
    ],
)
def test_a_port_that_is_not_there_is_one_sentence_with_the_fix(port, advice) -> None:
    with pytest.raises(PortError, match=advice) as caught:
        open_mount("lx200", port)
    assert "\n" not in str(caught.value)


def test_a_file_is_no_port(tmp_path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    with pytest.raises(PortError, match="cannot be used as a serial port"):
        SerialLink(str(path))


def test_a_permission_names_the_group_that_owns_the_port(monkeypatch) -> None:
    error = PermissionError(13, "Permission denied")
    monkeypatch.setattr(serial_line, "_group", lambda port: "dialout")
    said = str(not_opened("/dev/ttyUSB0", error))
    assert "(group dialout)" in said
    assert "sudo usermod -aG dialout $USER" in said
    monkeypatch.setattr(serial_line, "_group", lambda port: "root")
    assert "administrator" in str(not_opened("/dev/ttyUSB0", error))


def test_the_group_is_read_from_the_device(tmp_path) -> None:
    import grp

    path = tmp_path / "port"
    path.touch(stat.S_IRUSR)
    assert serial_line._group(str(path)) == grp.getgrgid(path.stat().st_gid).gr_name
    assert serial_line._group(str(tmp_path / "none")) == ""


def test_windows_says_access_is_denied() -> None:
    error = OSError("could not open port 'COM3': PermissionError(13, 'Access is denied.', None, 5)")
    assert "in use" in str(not_opened("COM3", error))
    error = OSError("could not open port 'COM9': FileNotFoundError(2, ...)")
    assert "plug in" in str(not_opened("COM9", error))
