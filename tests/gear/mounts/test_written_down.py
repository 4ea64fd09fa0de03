"""What of a mount is written down: its bytes in the journal, its motions in the log, each with its outcome."""

import logging

import pytest

from kochab.core.errors import DeviceError, NoAnswerError, NotStoppedError, RefusedError
from kochab.core.mount import Direction, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import emergency_stop, serial_line
from kochab.gear.mounts.emergency_stop import Watchdog
from kochab.gear.mounts.serial_line import Conversation, SerialLink

from .imaginary import SILENT, at, guarded
from .test_numbers import Line


@pytest.fixture
def written(caplog):
    """The lines of the journal since it was asked last."""
    caplog.set_level(logging.DEBUG, logger="kochab")

    def since():
        lines = [record.getMessage() for record in caplog.records]
        caplog.clear()
        return lines

    return since


def read(link):
    return link.read()


def test_every_byte_of_a_conversation_is_in_the_journal(written, monkeypatch) -> None:
    line = Line(b"1", None, lossy=True)
    talk = Conversation(line)
    talk.ask(b"a", read, bytes)
    assert written() == ["line > b'a'", "line < b'1'"]
    with pytest.raises(NoAnswerError):
        talk.ask(b"b", read, bytes)
    assert written() == ["line > b'b'", "line < nothing: silent"]
    monkeypatch.setattr(line, "discard", lambda quiet_s=0.0: b"late")
    talk.send(b"c")
    assert written() == ["line < b'late' (unexpected)", "line > b'c'"]
    line.replies = [None, b"="]
    talk.send_now((b"stop", (read,)))
    assert written() == ["line > b'stop'"]
    talk.read_pending()
    assert written() == ["line < nothing: silent", "line > b'stop'", "line < b'='"]


SENT, DONE, FAILED, REFUSED = "sent", "done", "failed", "refused"


@pytest.mark.parametrize(
    ("order", "fails", "log"),
    [
        (lambda g: g.sync(*at(-41.0, 40.0), by_hand=True), {}, [("sync", SENT), ("sync", DONE)]),
        (lambda g: g.sync(*at(-41.0, 40.0)), {}, [("sync", REFUSED)]),
        (lambda g: run(g.slew(*at(-41.0, 40.0))), {}, [("goto", SENT), ("goto", DONE)]),
        (lambda g: g.goto(*at(-41.0, -70.0)), {}, [("goto", REFUSED)]),
        (lambda g: g.goto(*at(-41.0, 40.0)), {"goto": RefusedError("No.")}, [("goto", SENT), ("goto", FAILED)]),
        (lambda g: g.goto(*at(-41.0, 40.0)), {"goto": SILENT}, [("goto", SENT), ("stop", SENT), ("goto", FAILED)]),
        (
            lambda g: g.goto(*at(-41.0, 40.0)),
            {"goto": SILENT, "stop": SILENT},
            [("goto", SENT), ("stop", SENT), ("stop", FAILED), ("goto", FAILED)],
        ),
        (lambda g: run(g.rest("park")), {}, [("park", SENT), ("park", DONE)]),
        (lambda g: g.unpark(), {}, [("unpark", SENT)]),
        (lambda g: g.move(Direction.NORTH, 0.5, 61.0), {}, [("move", REFUSED)]),
        (lambda g: g.track(TrackingRate.LUNAR), {"track": RefusedError("No.")}, [("track", SENT), ("track", FAILED)]),
        (lambda g: (g.stop(), g.emergency.confirm()), {}, [("stop", SENT), ("stop", DONE)]),
    ],
)
def test_every_order_is_in_the_log_with_its_outcome(order, fails, log) -> None:
    guard, mount = guarded()
    mount.fails = fails
    if fails or log[-1][1] == REFUSED:
        with pytest.raises(DeviceError):
            order(guard)
    else:
        order(guard)
    assert [(entry.action, entry.outcome) for entry in guard.log.entries] == log
    assert not guard.emergency.moving or "stop" in fails


def test_an_order_is_in_the_log_with_its_numbers() -> None:
    guard, _ = guarded()
    guard.sync(*at(-41.0, 40.0), by_hand=True)
    guard.pulse(Direction.EAST, 250)
    guard.move(Direction.SOUTH, 0.5, 2.0)
    guard.track(TrackingRate.SOLAR)
    ra, dec = at(-41.0, 40.0)
    assert [entry.detail for entry in guard.log.entries] == [
        {"ra_deg": ra, "dec_deg": dec},
        {"read_back_arcsec": pytest.approx(0.0, abs=1e-3)},
        {"direction": "east", "milliseconds": 250},
        {"direction": "south", "rate_deg_s": 0.5, "seconds": 2.0},
        {"rate": "solar"},
    ]


def test_a_stop_is_in_the_journal_after_it_was_sent(written) -> None:
    guard, _ = guarded()
    guard.emergency.halt()
    assert "stop sent" in written()


def test_a_watchdog_s_timer_never_keeps_the_program_and_is_never_set_back(monkeypatch, written) -> None:
    made = []

    class Timer:
        def __init__(self, seconds, function):
            self.seconds, self.run = seconds, function
            self.began = self.ended = False
            made.append(self)

        def start(self):
            self.began = True

        def cancel(self):
            self.ended = True

    monkeypatch.setattr(emergency_stop, "Timer", Timer)
    dog, tries = Watchdog(), []

    def halt():
        tries.append(1)
        raise NoAnswerError("The axis may still turn.")

    for seconds in (0.5, -1.0):
        dog.arm("ra", seconds, halt)
    assert [timer.seconds for timer in made] == [0.5, 0.0]
    assert all(timer.daemon and timer.began for timer in made)
    assert [timer.ended for timer in made] == [True, False]
    assert dog.moving
    made[1].run()
    assert (len(tries), dog.moving) == (3, True)
    assert "The ra motion could not be ended." in written()
    with pytest.raises(NotStoppedError):
        dog.check()
    dog.check()
    dog.arm("dec", 5.0, lambda: None)
    dog.disarm()
    assert (made[2].ended, dog.moving) == (True, False)


@pytest.mark.parametrize(
    ("port", "exclusive"), [("/dev/ttyUSB0", True), ("COM3", None), ("com12", None), ("socket://10.0.0.1:4030", None)]
)
def test_a_port_is_opened_for_this_program_alone_and_read_in_short_slices(monkeypatch, port, exclusive) -> None:
    """A read returns every twentieth of a second, a write that takes two seconds has failed."""
    import serial

    asked = {}
    monkeypatch.setattr(serial, "serial_for_url", lambda name, **how: asked.update({"name": name} | how))
    SerialLink(port, 19200)
    assert asked.pop("exclusive", None) is exclusive
    assert asked == {"name": port, "baudrate": 19200, "timeout": 0.05, "write_timeout": 2.0}
    SerialLink(port)
    assert asked["baudrate"] == 9600


def test_a_closed_link_writes_nothing(monkeypatch) -> None:
    link = object.__new__(SerialLink)
    link.port, link._lost, link._serial = "x", False, None
    with pytest.raises(DeviceError, match="Lost the mount on x"):
        link._guarded(lambda: (_ for _ in ()).throw(TypeError))
    with pytest.raises(DeviceError, match="Port x is closed"):
        link._guarded(lambda: 1)
    assert serial_line.SLICE_S < serial_line.WRITE_S
