"""The serial doctor names the mount or says what to do, and never sends what could move one."""

import os
import re
import threading
from contextlib import contextmanager, suppress
from time import monotonic

import pytest
from serial.tools.list_ports_common import ListPortInfo

from kochab.core.errors import NoAnswerError, PortError
from kochab.core.progress import run
from kochab.gear.mounts import probe
from kochab.gear.mounts.probe import list_ports, port_info, probe_port
from kochab.gear.mounts.protocols import nexstar
from kochab.simulate.responders import RESPONDERS
from tests.gear.mounts.bench import moved, simulated
from tests.simulate.dialects import DIALECT_RESPONDERS

MOVES = re.compile(rb":M[SPnsewgA]|:h|:R|:CM|:U#|r[0-9A-F]{8}|s[0-9A-F]{8}|:[GHIJ][12]..|:MS1|:[mZ]|T[\x00-\x03]")


@pytest.fixture(autouse=True)
def _impatient(monkeypatch):
    monkeypatch.setattr(probe, "PATIENCE_S", 0.6)


@pytest.mark.parametrize("driver", [*RESPONDERS, *DIALECT_RESPONDERS])
def test_it_names_every_simulated_mount_by_questions_only(driver) -> None:
    with simulated(driver) as bench:
        before = bench.telescope.axes_deg()[1]
        diagnosis = run(probe_port(bench.port))
        sent = b"".join(data for way, data in bench.line.transcript if way == "<")
        assert diagnosis.found
        assert diagnosis.driver == driver
        assert diagnosis.name
        assert not bench.telescope.log
        assert not moved(bench.telescope)
        assert bench.telescope.axes_deg()[1] == before
        assert not MOVES.search(sent.replace(b":MountInfo#", b"")), sent


def test_an_unaligned_hand_control_is_told_so() -> None:
    with simulated("nexstar", aligned=False) as bench:
        assert "do its alignment" in run(probe_port(bench.port)).advice


def test_a_silent_port_says_what_to_check() -> None:
    with simulated("lx200") as bench:
        bench.faults.chance("silence", 1.0)
        diagnosis = run(probe_port(bench.port))
        assert not diagnosis.found
        assert (diagnosis.driver, diagnosis.baud, diagnosis.name) == ("", 0, "")
        # A socket in the place of a pseudo-terminal has none.
        assert ("9600, 115200, 230400 baud" in diagnosis.advice) is not bench.port.startswith("socket:")
        assert "Switch the mount on" in diagnosis.advice


def test_garbage_is_no_mount() -> None:
    with simulated("lx200") as bench:
        bench.faults.chance("garbage", 1.0)
        assert not run(probe_port(bench.port)).found


@contextmanager
def saying(text, pause_s):
    """A pseudo-terminal on which somebody says the same without end, whatever is asked."""
    import tty

    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    over = threading.Event()

    def talk() -> None:
        while not over.wait(pause_s):
            with suppress(BlockingIOError):
                os.write(master, text)
            with suppress(BlockingIOError):
                os.read(master, 4096)

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        over.set()
        thread.join()
        os.close(master)
        os.close(slave)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
@pytest.mark.parametrize("text", [b"=000000\r", b"=020304\r"])
def test_a_line_that_speaks_unasked_is_no_sky_watcher(text) -> None:
    with saying(text, 0.005) as port:
        assert run(probe_port(port)).driver != "skywatcher"


@pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals")
def test_a_line_that_trickles_is_left_when_the_time_for_all_questions_is_over(monkeypatch) -> None:
    """It took 97 s: every question waited for its answer, and before it for silence. Asked are those in time alone."""
    asked = []
    ask = probe.Conversation.ask
    monkeypatch.setattr(
        probe.Conversation, "ask", lambda talk, *words: (asked.append(monotonic()), ask(talk, *words))[1]
    )
    monkeypatch.setattr(probe, "PROBE_S", 2.0)
    with saying(b"x", 0.1) as port:
        begun = monotonic()
        assert not run(probe_port(port)).found
    assert asked
    assert max(asked) - begun < 3.0  # the last was begun in time


def test_the_bus_of_a_celestron_that_trickles_is_read_for_the_time_of_one_answer(monkeypatch) -> None:
    """256 bytes at three a second were waited for, 88 s in all."""
    now, read = [0.0], []
    monkeypatch.setattr("kochab.gear.mounts.protocols.nexstar.monotonic", lambda: now[0])

    class Trickling:
        def read_exact(self, count, timeout_s):
            now[0] += 0.3
            read.append(count)
            return b"x" * count

    with pytest.raises(NoAnswerError):
        nexstar.aux_reader(nexstar.aux(nexstar.AZM, nexstar.AUX_VERSION), 0.8)(Trickling())
    assert len(read) == 3


def test_a_port_that_cannot_be_opened_is_its_own_advice() -> None:
    def refuses(port, baud):
        raise PortError("You may not open it.")

    (diagnosis,) = run(probe.probe(["/dev/x"], refuses))
    assert diagnosis.advice == "You may not open it."


def test_every_question_is_a_cancel_point() -> None:
    with simulated("ioptron") as bench:
        steps = list(probe_port(bench.port))
        assert len(steps) >= 4
        assert "ioptron" in steps[-1].detail
        task = probe_port(bench.port)
        next(task)
        task.close()  # gives the port back
        assert run(probe_port(bench.port)).found


def test_nexstar_is_asked_before_any_word_that_it_could_take_for_an_order() -> None:
    first = [questions[0].__name__ for _, questions in probe.QUESTIONS[:1]]
    assert first == ["ask_nexstar"]
    assert probe.ALL[0] is probe.ask_nexstar
    assert NoAnswerError  # silence is what makes it go on


def test_usb_descriptions_become_hints() -> None:
    def info(port, description, **usb):
        found = ListPortInfo(port)
        vars(found).update(description=description, **usb)
        return port_info(found)

    ftdi = {"manufacturer": "FTDI", "product": "FT232R USB UART", "vid": 0x0403, "pid": 0x6001}
    known = info("/dev/ttyUSB0", "USB Serial", **ftdi)
    assert (known.usb, known.description) == ("0403:6001", "FTDI FT232R USB UART")
    assert "EQDIR" in known.hint
    celestron = {"manufacturer": "Celestron", "product": "NexStar+", "vid": 0x067B, "pid": 0x2303}
    assert info("COM3", "Celestron HC (COM3)", **celestron).hint == "a mount by celestron"
    assert info("/dev/ttyS0", "n/a").hint == ""


def test_the_list_of_ports_is_a_list() -> None:
    assert all(port.port for port in list_ports())


@pytest.mark.parametrize(
    "fault", [AttributeError("function 'CM_MapCrToWin32Err' not found"), OSError(5, "Access is denied")]
)
def test_a_system_that_lists_no_ports_is_one_sentence(monkeypatch, capsys, fault) -> None:
    """As pyserial's listing fails on a Windows that lacks one function of it."""
    from kochab.cli.main import main
    from kochab.gear.mounts.probe import Diagnosis
    from kochab.gear.session import find_mounts

    def fail():
        raise fault

    monkeypatch.setattr("serial.tools.list_ports.comports", fail)
    monkeypatch.setattr(probe, "find_served", list)
    monkeypatch.setattr("kochab.gear.session.find_served", list)
    with pytest.raises(PortError, match=r"^The serial ports cannot be listed \(.*\)\. Give the port by name"):
        run(find_mounts(""))
    assert main(["mount", "list"]) == 1
    first, *others = capsys.readouterr().out.splitlines()
    assert first.startswith("The serial ports cannot be listed")
    assert others[0].startswith("drivers: ")
    assert main(["mount", "list", "--json"]) == 1
    assert '"error": "The serial ports cannot be listed' in capsys.readouterr().out
    # A port that was typed is asked, and what answers in the network is found.
    monkeypatch.setattr("kochab.gear.session.find_served", lambda: [Diagnosis("host:1/Mount", "indi", "Mount", "")])
    assert [one.port for one in run(find_mounts("/nowhere/COM3"))[1]] == ["/nowhere/COM3", "host:1/Mount"]
    assert [one.port for one in run(find_mounts(""))[1]] == ["host:1/Mount"]
