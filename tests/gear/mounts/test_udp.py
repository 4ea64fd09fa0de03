"""The Wi-Fi of Sky-Watcher mounts: UDP 11880, a command a datagram, over real sockets that lose some.

What a datagram may hold is measured on a Star Adventurer GTi (L92); the answers to L90 and L95 are the mounts' own.
"""

import random
import re
import select
import socket
import threading
from contextlib import contextmanager, nullcontext
from math import inf
from types import SimpleNamespace

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import DeviceError, NoAnswerError, PortError
from kochab.core.mount import Direction, Home
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.probe import probe_port
from kochab.gear.mounts.serial_line import Conversation, SerialLink, UdpPort
from kochab.simulate.responders.skywatcher import SkyWatcherResponder
from tests.gear.mounts.bench import SITE, Night, place
from tests.gear.mounts.test_conformance import wait_for
from tests.simulate.bench_telescope import BenchTelescope

COMMAND = re.compile(rb":[A-Za-z][12][0-9A-F]*\r(\n)?")  # L92: nothing before it, nothing after it but a line feed


class UdpBoard:
    """A mount's Wi-Fi module before ``answer``; ``loss`` of the datagrams of either way are lost."""

    def __init__(self, answer, loss=0.0, seed=1):
        self.answer, self.loss, self._random = answer, loss, random.Random(seed)
        self.heard, self.dropped, self.lost = [], [], 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port = f"udp://127.0.0.1:{self._socket.getsockname()[1]}"
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        while not self._ends.is_set():
            if not select.select([self._socket], [], [], 0.02)[0]:
                continue
            data, sender = self._socket.recvfrom(2048)
            if self._is_lost():
                continue
            if not COMMAND.fullmatch(data):
                self.dropped.append(data)
                continue
            self.heard.append(data)
            reply = self.answer(data.rstrip(b"\n"))
            if reply and not self._is_lost():
                self._socket.sendto(reply, sender)

    def _is_lost(self):
        lost = self._random.random() < self.loss
        self.lost += lost
        return lost

    def stop(self):
        self._ends.set()
        self._thread.join()
        self._socket.close()


@contextmanager
def wifi(loss=0.0, seed=1, slew_deg_s=60.0):
    """A simulated telescope at home behind a mount's Wi-Fi."""
    clock = Night()
    telescope = BenchTelescope(SITE.latitude_deg, SITE.longitude_deg, slew_deg_s, clock.unix)
    telescope.tracking = False
    far_end = SkyWatcherResponder(telescope)
    board = UdpBoard(far_end.feed, loss, seed)
    opened = []

    def connect(**told):
        opened.append(open_mount("skywatcher", board.port, site=SITE, clock=clock, **told))
        return opened[-1]

    try:
        yield SimpleNamespace(telescope=telescope, board=board, clock=clock, connect=connect)
    finally:
        for mount in opened:
            mount.close()
        board.stop()


def test_a_datagram_holds_one_command_and_nothing_else() -> None:
    """L92. Two commands written together, like the Stop sent on opening a line, travel as two datagrams."""
    with wifi() as w:
        link = SerialLink(w.board.port)
        link.write(b":L1\r:L2\r")
        assert [link.read_until(b"\r", 16, 1.0) for _ in range(2)] == [b"=\r", b"=\r"]
        link.write(b":e1\r")
        assert link.read_until(b"\r", 16, 1.0) == b"=020300\r"
        assert (w.board.heard, w.board.dropped) == ([b":L1\r", b":L2\r", b":e1\r"], [])
        for refused in (b":e1", b":e1\r\0\0", b"\xff:e1\r"):
            link._serial._socket.send(refused)
        with pytest.raises(NoAnswerError):
            link.read_until(b"\r", 16, 0.2)
        assert len(w.board.dropped) == 3
        link.close()
        with pytest.raises(DeviceError):
            link.write(b":e1\r")


def test_what_has_come_is_counted_and_thrown_away() -> None:
    with wifi() as w:
        link = SerialLink(w.board.port)
        assert link.discard() == b""
        link.write(b":e1\r")
        wait_for(lambda: link._serial.in_waiting == 8)
        assert link.read_exact(3, 1.0) == b"=02"
        assert link.discard() == b"0300\r"
        link.close()


@pytest.mark.parametrize("port", ["udp://", "udp://host", "udp://127.0.0.1:99999", "udp://no.such.host.invalid:11880"])
def test_a_wrong_address_is_told(port) -> None:
    with pytest.raises(PortError, match=r"udp://|cannot be reached"):
        SerialLink(port)
    with pytest.raises((OSError, ValueError)):
        UdpPort(port)


def test_where_nobody_listens_is_told_and_not_waited_for() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = f"udp://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(DeviceError):
        open_mount("skywatcher", port, site=SITE)


def test_the_probe_asks_a_udp_address_for_a_motor_board_alone() -> None:
    with wifi() as w:
        found = run(probe_port(w.board.port))
        assert (found.driver, found.port, found.name) == (
            "skywatcher",
            w.board.port,
            "Sky-Watcher motor board, version 0203",
        )
        assert (w.board.heard, w.board.dropped) == ([b":e1\r", b":j1\r"], [])


def arrived(mount):
    """A start of tracking that was lost is told, not repeated; the next question orders it again."""
    try:
        return mount.state().slewing is False
    except NoAnswerError:
        return False


@pytest.mark.parametrize(("loss", "seed"), [(0.0, 1), (0.1, 2), (0.25, 3)])
def test_a_slew_arrives_and_stop_stops_whatever_is_lost(loss, seed) -> None:
    with wifi(loss, seed, slew_deg_s=15.0) as w:
        mount = w.connect(home=Home.NOW)
        guard = Guard(mount, SITE, Limits(), clock=w.clock)
        target = place(-25.0, 45.0, w.clock)
        mount.goto(*target)
        wait_for(lambda: arrived(mount), 60.0)
        here = mount.position()
        assert apart_deg((here.ra_deg, here.dec_deg), target) < 0.05  # lost answers cost time, and the sky turns
        assert apart_deg(w.telescope.believed_deg(), target) < 0.05
        mount.goto(*place(-50.0, 20.0, w.clock))
        guard.stop()
        guard.emergency.confirm()
        assert not w.telescope.slewing
        assert not any(w.telescope._rates)
        assert w.board.lost > 0 or loss == 0.0


@pytest.mark.parametrize(("lost", "missed"), [(1, 0), (inf, 1)], ids=["one datagram", "every one"])
def test_a_datagram_that_is_lost_is_no_silence_and_a_question_that_stays_unanswered_is_one(lost, missed) -> None:
    """On a network that loses some each silence would call for a look at the mount's clock; after a real one it must."""
    with wifi() as w:
        mount = w.connect(home=Home.NOW)
        left = [lost]
        feed = w.board.answer

        def losing(command):
            if command == b":j1\r" and left[0] > 0:
                left[0] -= 1
                return b""
            return feed(command)

        w.board.answer = losing
        with pytest.raises(NoAnswerError) if missed else nullcontext():
            mount.position()
        assert left[0] in (0, inf)
        assert mount.missed == missed


@pytest.mark.parametrize("lost", [{b":L1\r": 2}, {b":L2\r": 2}, {b":L1\r": 1, b":L2\r": 3}])
def test_a_stop_that_is_lost_is_sent_again_until_both_motors_have_answered(lost) -> None:
    """The answers do not say which motor they are of, so that both are stopped again."""
    left = dict(lost)
    with wifi() as w:
        mount = w.connect(home=Home.NOW)
        mount.goto(*place(-50.0, 20.0, w.clock))
        feed = w.board.answer

        def losing(command):
            if left.get(command, 0) > 0:
                left[command] -= 1
                return b""
            return feed(command)

        w.board.answer = losing
        mount.stop()
        mount.talk.read_pending()
        assert not any(left.values())
        assert not w.telescope.slewing


def test_the_end_of_a_move_is_sent_again_when_it_is_lost() -> None:
    with wifi() as w:
        mount = w.connect(home=Home.NOW)
        feed, left = w.board.answer, [3]

        def losing(command):
            if command == b":K2\r" and left[0]:
                left[0] -= 1
                return b""
            return feed(command)

        mount.move(Direction.NORTH, 0.5, 0.3)
        w.board.answer = losing
        wait_for(lambda: not mount.watchdog.moving)
        assert left == [0]
        assert not any(w.telescope._rates)


def test_the_answers_of_the_real_mount_at_its_first_connection() -> None:
    """L90: 3628800 and 2903040 steps a turn, ``:g1`` of two digits, not initialised; L91: refused while it brakes."""
    answers = {
        b":e1\r": b"=03300C\r",
        b":a1\r": b"=005F37\r",
        b":a2\r": b"=004C2C\r",
        b":b1\r": b"=0024F4\r",
        b":b2\r": b"=0024F4\r",
        b":g1\r": b"=01\r",
        b":g2\r": b"=01\r",
        b":f1\r": b"=100\r",
        b":f2\r": b"=100\r",
        b":j1\r": b"=000080\r",
        b":j2\r": b"=FFFF7F\r",
    }
    board = UdpBoard(lambda command: answers.get(command, b"!0\r"))
    try:
        mount = open_mount("skywatcher", board.port, site=SITE, home=Home.POWER_ON)
        assert mount.identify() == "Sky-Watcher motor board, version 3.48"
        assert [motor.steps_turn for motor in mount.motors] == [3628800, 2903040]
        assert mount.position().dec_deg == pytest.approx(90.0, abs=0.001)
        assert isinstance(mount.talk, Conversation)
        mount.close()
    finally:
        board.stop()
