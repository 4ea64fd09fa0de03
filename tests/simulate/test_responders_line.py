"""Simulated mounts over real pseudo-terminals and sockets, and what goes wrong on a line."""

import socket
import sys
import threading
import time

import pytest
import serial

from kochab.core.errors import PortError
from kochab.simulate.responders import RESPONDERS, open_responder
from kochab.simulate.serial_line import IDLE_S, Fault, Faults, pty_line, socket_line
from tests.simulate.bench_telescope import BenchTelescope
from tests.simulate.lines import serve_pty, serve_socket

FIRST = {
    "lx200": (b"\x06", b"P"),
    "onstep": (b":GVP#", b"On-Step#"),
    "nexstar": (b"Kx", b"x#"),
    "synscan": (b"V", b"042705#"),
    "ioptron": (b":MountInfo#", b"0040"),
    "skywatcher": (b":e1\r", b"=020300\r"),
}
WAIT_S = 20.0  # far more than is needed: a busy machine must not fail a test
WITH_PTYS = pytest.mark.skipif(sys.platform == "win32", reason="no ptys there")
KINDS = [pytest.param("pty", marks=WITH_PTYS), "socket"]


def nexstar(telescope=None):
    return open_responder("nexstar", telescope or BenchTelescope())


def open_line(kind, faults=None, responder=None):
    return (pty_line if kind == "pty" else socket_line)(responder or nexstar(), faults)


def port_of(line, timeout=WAIT_S):
    return serial.serial_for_url(line.port, timeout=timeout)


def ask(port, command, count):
    port.write(command)
    return port.read(count)


@pytest.fixture(params=KINDS)
def line(request):
    made = open_line(request.param, Faults(seed=1, late_s=0.3, gap_s=0.01))
    yield made
    made.stop()


@pytest.mark.parametrize("name", RESPONDERS)
@pytest.mark.parametrize("serve", [pytest.param(serve_pty, marks=WITH_PTYS), serve_socket])
def test_every_responder_answers_on_both_kinds_of_line(name, serve):
    command, answer = FIRST[name]
    with serve(open_responder(name, BenchTelescope())) as port, serial.serial_for_url(port, timeout=WAIT_S) as opened:
        assert ask(opened, command, len(answer)) == answer


def test_programs_come_and_go_and_the_mount_remembers(line):
    for _ in range(3):
        with port_of(line) as port:
            assert ask(port, b"T\x00", 1) == b"#"
        with port_of(line) as port:
            assert ask(port, b"t", 2) == b"\x00#"


@WITH_PTYS
def test_every_byte_value_passes_a_pty_untouched():
    class Echo:
        refusal = None

        def feed(self, data):
            return data

        def idle(self):
            pass

    everything = bytes(range(256))
    with serve_pty(Echo()) as path, serial.Serial(path, timeout=WAIT_S) as port:
        assert ask(port, everything, 256) == everything


def test_a_stopped_line_leaves_no_thread_and_no_port(line):
    before = threading.active_count()
    line.stop()
    line.stop()
    assert threading.active_count() == before - 1
    with pytest.raises(serial.SerialException):
        port_of(line)


def test_two_cannot_serve_one_tcp_port():
    line = socket_line(nexstar())
    try:
        with pytest.raises(PortError, match="cannot be used"):
            socket_line(nexstar(), number=int(line.port.rpartition(":")[2]))
    finally:
        line.stop()


def test_a_newer_connection_replaces_the_older():
    line = socket_line(nexstar())
    try:
        host = ("127.0.0.1", int(line.port.rpartition(":")[2]))
        with socket.create_connection(host, timeout=WAIT_S) as older:
            older.sendall(b"Kx")
            assert older.recv(2) == b"x#"
            with socket.create_connection(host, timeout=WAIT_S) as newer:
                newer.sendall(b"Ky")
                assert newer.recv(2) == b"y#"
                assert older.recv(1) == b""
    finally:
        line.stop()


def test_half_a_command_is_forgotten_after_a_pause(line):
    with port_of(line) as port:
        port.write(b"r3AA")
        time.sleep(IDLE_S + 0.3)
        assert ask(port, b"Kx", 2) == b"x#"


def test_silence_for_two_exchanges(line):
    line.faults.next(Fault.SILENCE, 2)
    with port_of(line, timeout=0.2) as port:
        assert [ask(port, b"Kx", 2) for _ in range(2)] == [b"", b""]
        port.timeout = WAIT_S
        assert ask(port, b"Kx", 2) == b"x#"
    assert line.faults.happened[Fault.SILENCE] == 2


def test_garbage_is_of_the_same_length_and_other_bytes(line):
    line.faults.next("garbage", 1)
    with port_of(line) as port:
        garbage = ask(port, b"e", 18)
        assert len(garbage) == 18
        truth = ask(port, b"E", 10)
        assert truth[4:5] + truth[-1:] == b",#"
        assert not garbage.startswith(truth[:4])


def test_late_is_later_than_asked_for_and_the_next_waits_for_it(line):
    line.faults.next(Fault.LATE, 1)
    with port_of(line) as port:
        begun = time.monotonic()
        port.write(b"Ka")
        assert port.read(2) == b"a#"
        assert time.monotonic() - begun >= line.faults.late_s
        assert ask(port, b"Kb", 2) == b"b#"


def test_a_late_answer_does_not_make_the_mount_late(line):
    """A Stop that comes while an answer is held back is obeyed at once."""
    telescope = BenchTelescope()
    other = open_line("socket", Faults(late_s=600.0), nexstar(telescope))
    try:
        other.faults.next(Fault.LATE, 1)
        with port_of(other) as port:
            port.write(b"e")
            port.write(b"M")
            until = time.monotonic() + WAIT_S
            while ("stop",) not in telescope.log and time.monotonic() < until:
                time.sleep(0.01)
        assert ("stop",) in telescope.log
    finally:
        other.stop()


def test_split_answers_come_in_single_bytes(line):
    line.faults.next(Fault.SPLIT, 1)
    with port_of(line) as port:
        assert ask(port, b"V", 3) == b"\x04\x15#"
    sent = [data for way, data in line.transcript if way == ">"]
    assert sent == [b"\x04", b"\x15", b"#"]


def test_a_wrong_answer_is_one_to_an_earlier_command(line):
    with port_of(line) as port:
        assert ask(port, b"V", 3) == b"\x04\x15#"
        line.faults.next(Fault.WRONG, 1)
        assert ask(port, b"Kx", 3) == b"\x04\x15#"
        assert ask(port, b"Kx", 2) == b"x#"


def test_a_refusal_is_in_the_words_of_the_protocol():
    telescope = BenchTelescope()
    telescope.lowest_deg = -90.0
    line = open_line("socket", Faults(), open_responder("onstep", telescope))
    try:
        line.faults.next(Fault.REFUSAL, 1)
        with port_of(line) as port:
            assert ask(port, b":Sr01:00:00#:Sd+10*00:00#", 2) == b"11"
            assert ask(port, b":MS#", 1) == b"6"
            assert telescope.log == []
            assert ask(port, b":MS#", 1) == b"0"
        assert [entry[0] for entry in telescope.log] == ["goto"]
    finally:
        line.stop()


def test_faults_combine_and_can_be_switched_off(line):
    for fault in (Fault.LATE, Fault.SPLIT, Fault.GARBAGE):
        line.faults.chance(fault, 1.0)
    with port_of(line) as port:
        begun = time.monotonic()
        assert ask(port, b"Kx", 2) != b"x#"
        assert time.monotonic() - begun >= line.faults.late_s + line.faults.gap_s
        line.faults.none()
        assert ask(port, b"Kx", 2) == b"x#"


def test_chances_repeat_with_their_seed():
    def run(seed):
        faults = Faults(seed)
        faults.chance(Fault.SILENCE, 0.3)
        faults.chance(Fault.GARBAGE, 0.3)
        return [faults.shape(b"0123#") for _ in range(200)]

    assert run(7) == run(7)
    assert run(7) != run(8)
    silent = sum(pieces == [] for pieces in run(7))
    assert 30 < silent < 90


def lost(port):
    """Whether a read or a write tells within the time that the line is gone."""
    until = time.monotonic() + WAIT_S
    while time.monotonic() < until:
        try:
            port.write(b"Kx")
            port.read(2)
        except (OSError, serial.SerialException):
            return True
    return False


def test_unplugged_in_an_exchange_and_plugged_in_again(line):
    with port_of(line) as port:
        assert ask(port, b"T\x00", 1) == b"#"
        line.faults.next(Fault.UNPLUG, 1)
        port.timeout = 0.2
        assert lost(port)
    line.plug()
    with port_of(line) as port:
        assert ask(port, b"t", 2) == b"\x00#"  # the mount has not been switched off
