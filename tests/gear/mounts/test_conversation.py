"""One exchange at a time, and Stop ahead of it."""

import logging
import socket
import threading
import time
from types import SimpleNamespace

import pytest
from serial.urlhandler import protocol_socket

from kochab.core.errors import LineLostError, NoAnswerError, RefusedError
from kochab.gear.mounts import serial_line
from kochab.gear.mounts.protocols.nexstar import parse_done
from kochab.gear.mounts.serial_line import Conversation, ProtocolError, SerialLink, exactly, until
from tests.gear.mounts.scripted import ScriptedLink


class SlowLink:
    """Records what is written; answers come when the test puts them there."""

    port, lossy = "slow", False

    def __init__(self):
        self.written = []
        self.buffer = bytearray()
        self.ready = threading.Condition()

    def write(self, data):
        self.written.append(data)

    def answer(self, data):
        with self.ready:
            self.buffer += data
            self.ready.notify_all()

    def read_exact(self, count, timeout_s):
        with self.ready:
            if not self.ready.wait_for(lambda: len(self.buffer) >= count, timeout_s):
                raise NoAnswerError("silent")
            taken = bytes(self.buffer[:count])
            del self.buffer[:count]
            return taken

    def discard(self, quiet_s=0.0):
        self.buffer.clear()

    def close(self):
        pass


def test_stop_is_written_while_an_exchange_waits_for_its_answer() -> None:
    link = SlowLink()
    talk = Conversation(link)
    answers = []
    reader = threading.Thread(target=lambda: answers.append(talk.ask(b"e", exactly(3, 5.0), bytes)))
    reader.start()
    while not link.written:
        time.sleep(0.001)
    talk.send_now((b"M", (exactly(1, 5.0),)))  # returns although nothing has been answered
    assert link.written == [b"e", b"M"]
    link.answer(b"123")
    link.answer(b"#")
    reader.join()
    assert answers == [b"123"]
    talk.read_pending()
    assert not link.buffer


def test_answers_are_read_in_the_order_of_what_was_sent() -> None:
    link = ScriptedLink([(b"M", b"#"), (b"e", b"123")])
    talk = Conversation(link)
    talk.send_now((b"M", (exactly(1, 1.0),)))
    assert talk.ask(b"e", exactly(3, 1.0), bytes) == b"123"
    link.finished()


def test_a_motion_decided_before_a_stop_is_not_begun_after_it(caplog) -> None:
    caplog.set_level(logging.DEBUG, logger=serial_line.logger.name)
    talk = Conversation(ScriptedLink([(b":Q#", b"")]))
    since = talk.stops
    talk.stopping()
    talk.send_now((b":Q#", ()))
    talk.stopped()
    with pytest.raises(RefusedError, match="stopped before it began"):
        talk.ask(b":MS#", exactly(1, 1.0), bytes, since)
    with pytest.raises(RefusedError):
        talk.send(b":Me#", since)
    said = [record.getMessage() for record in caplog.records]
    assert [line for line in said if "not sent" in line] == [
        f"script: {command!r} was not sent, a Stop came first" for command in (b":MS#", b":Me#")
    ]


def test_a_question_is_repeated_after_nonsense_but_an_order_is_not() -> None:
    link = ScriptedLink([(b"L", b"?"), (b"L", b"#"), (b"s", b"?")])
    talk = Conversation(link)
    talk.query(b"L", exactly(1, 1.0), parse_done)
    with pytest.raises(ProtocolError, match="Unexpected answer"):
        talk.ask(b"s", exactly(1, 1.0), parse_done)
    link.finished()


def test_silence_is_not_asked_again() -> None:
    link = ScriptedLink([(b":GR#", b"")])
    with pytest.raises(NoAnswerError):
        Conversation(link).query(b":GR#", until(b"#", 16, 1.0), bytes)
    link.finished()


def test_what_stop_never_answered_does_not_hold_up_the_next_question() -> None:
    """It is sent once more, for the mount may not have heard it."""
    link = ScriptedLink([(b"M", b""), (b"M", b""), (b"e", b"#")])
    talk = Conversation(link)
    talk.send_now((b"M", (exactly(1, 0.01),)))
    talk.ask(b"e", exactly(1, 1.0), parse_done)
    link.finished()


def test_the_answers_to_a_stop_are_not_waited_for_one_by_one_on_a_mute_line() -> None:
    """A hand control is sent three commands, each with 1 s of patience, and once more."""
    link, asked = Listening([*[(b"M", b""), (b"P1", b""), (b"P2", b"")] * 2, (b"e", b"#")]), []
    talk = Conversation(link)

    def mute(link):
        asked.append(link)
        raise NoAnswerError("silent")

    talk.send_now(*[(command, (mute,)) for command in (b"M", b"P1", b"P2")])
    talk.ask(b"e", exactly(1, 1.0), parse_done)
    assert len(asked) == 2
    assert link.quiet_s[-1] == serial_line.QUIET_S, "what comes late is not taken for the next answer"


def test_a_stop_whose_answers_were_thrown_away_does_not_hold_up_the_next_question() -> None:
    """It came while the line was being cleared."""

    class Cleared(Listening):
        def discard(self, quiet_s=0.0):
            if not self.quiet_s:
                talk.send_now(*[(command, (lambda _: pytest.fail("waited"),)) for command in (b"M", b"P1", b"P2")])
            stale = bytes(self.buffer)
            super().discard(quiet_s)
            return stale

    link = Cleared([(b"M", b"#"), (b"P1", b"#"), (b"P2", b"#"), (b"e", b"#")])
    talk = Conversation(link)
    talk.ask(b"e", exactly(1, 1.0), parse_done)
    assert link.quiet_s == [0.0, serial_line.QUIET_S]
    link.finished()


def test_a_stop_over_udp_is_sent_until_it_is_answered_though_its_first_answer_was_thrown_away() -> None:
    class Cleared(Listening):
        lossy = True

        def discard(self, quiet_s=0.0):
            if not self.quiet_s:
                talk.send_now((b":L1", (exactly(1, 1.0),)))
            stale = bytes(self.buffer)
            super().discard(quiet_s)
            return stale

    link = Cleared([(b":L1", b"="), (b":L1", b"="), (b"e", b"#")])
    talk = Conversation(link)
    talk.ask(b"e", exactly(1, 1.0), parse_done)
    link.finished()


class StalledDisk(logging.Handler):
    """A journal whose disk hangs until the test lets it go on."""

    def __init__(self):
        super().__init__(logging.DEBUG)
        self.stalled, self.goes_on = threading.Event(), threading.Event()

    def emit(self, record):
        self.stalled.set()
        self.goes_on.wait(20.0)


def test_a_stalled_journal_holds_up_no_byte_of_a_stop() -> None:
    """Another thread hangs in the journal; a Stop of two axes is two commands."""
    link, disk = SlowLink(), StalledDisk()
    talk, log = Conversation(link), logging.getLogger("kochab.gear.mounts.serial_line")
    level = log.level
    log.addHandler(disk)
    log.setLevel(logging.DEBUG)
    asking = threading.Thread(target=talk.send, args=(b":j1",))
    stopping = threading.Thread(target=talk.send_now, args=((b":L1", ()), (b":L2", ())))
    try:
        asking.start()
        assert disk.stalled.wait(60.0)
        stopping.start()
        end = time.monotonic() + 60.0
        while len(link.written) < 2 and time.monotonic() < end:
            time.sleep(0.001)
        assert link.written == [b":L1", b":L2"]
    finally:
        disk.goes_on.set()
        asking.join(10.0)
        stopping.join(10.0)
        log.removeHandler(disk)
        log.setLevel(level)
    assert link.written == [b":L1", b":L2", b":j1"]


class Listening(ScriptedLink):
    """Notes how long it was listened to before each exchange."""

    def __init__(self, script):
        super().__init__(script)
        self.quiet_s = []

    def discard(self, quiet_s=0.0):
        self.quiet_s.append(quiet_s)
        self.buffer.clear()
        return b""


@pytest.mark.parametrize("bad", [b"?", b""])
def test_after_a_bad_answer_two_exchanges_begin_with_a_silent_line(bad) -> None:
    """An answer that is late must not be taken for the next."""
    link = Listening([(b"s", bad), *[(b"L", b"#")] * 4])
    talk = Conversation(link)
    with pytest.raises(NoAnswerError):
        talk.ask(b"s", exactly(1, 1.0), parse_done)
    for _ in range(4):
        talk.ask(b"L", exactly(1, 1.0), parse_done)
    assert link.quiet_s == [0.0, serial_line.QUIET_S, serial_line.QUIET_S, 0.0, 0.0]


def test_a_socket_closed_while_it_is_read_is_a_lost_line(monkeypatch) -> None:
    """pyserial has no socket any more between its look for bytes and its read."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        link = SerialLink(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        accepted, _ = listener.accept()
        with accepted, link._serial._socket:
            look = protocol_socket.select.select

            def another_closes_it(*words):
                seen = look(*words)
                link._serial._socket = None
                return seen

            accepted.send(b"x")
            monkeypatch.setattr(protocol_socket, "select", SimpleNamespace(select=another_closes_it, error=OSError))
            with pytest.raises(LineLostError, match="Check its cable and power"):
                link.read_exact(1, 5.0)
