"""Everything that goes wrong on a line: one clear sentence, in time, and nothing left moving."""

import threading
import time

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import DeviceError, LineLostError, NoAnswerError
from kochab.core.mount import Direction
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.emergency_stop import CANNOT_STOP
from kochab.gear.mounts.guard import Guard
from kochab.simulate.responders import RESPONDERS
from kochab.simulate.serial_line import Fault, socket_line
from tests.gear.mounts.bench import COUNTERS, LIMITS, SITE, moved, opened, simulated, still, where
from tests.gear.mounts.test_conformance import CLOSE_DEG, own, place, wait_for

BAD_ANSWERS = [Fault.SILENCE, Fault.GARBAGE, Fault.LATE, Fault.WRONG]


@pytest.fixture(params=RESPONDERS)
def bench(request, monkeypatch):
    """A driver that waits 0.8 s for an answer; the late fault is later than that."""
    with simulated(request.param) as bench:
        bench.driver = request.param
        bench.mount = bench.open()
        monkeypatch.setattr(type(bench.mount), "timeout_s", 0.8)
        bench.guard = Guard(
            bench.mount, SITE, LIMITS, clock=bench.clock, reopen=bench.open, wait=lambda seconds: time.sleep(0.02)
        )
        yield bench
        bench.faults.none()
        bench.guard.close()


def said(action):
    """The one sentence of what went wrong, None when nothing did."""
    try:
        action()
    except DeviceError as error:
        return checked(str(error))
    return None


def one_sentence(caught):
    checked(str(caught.value))


def checked(text):
    assert "\n" not in text
    assert "Traceback" not in text
    assert text.rstrip(")").endswith(".")
    return text


@pytest.mark.parametrize("fault", BAD_ANSWERS)
def test_a_bad_answer_to_every_question_is_one_sentence(bench, fault) -> None:
    bench.faults.chance(fault, 1.0)
    begun = time.monotonic()
    sentence = said(bench.mount.position)
    if fault in (Fault.SILENCE, Fault.GARBAGE):  # an earlier answer of the same kind may be right
        assert sentence
    assert time.monotonic() - begun < 20.0  # bounded, not timed
    assert not moved(bench.telescope)


@pytest.mark.parametrize("fault", [*BAD_ANSWERS, Fault.SPLIT])
def test_after_a_bad_answer_the_next_is_right(bench, fault) -> None:
    bench.faults.next(fault, 1)
    said(bench.mount.position)
    wait_for(lambda: bench.faults.happened[fault] == 1)
    wait_for(lambda: not bench.line._outgoing)  # a late one is on its way
    here = bench.mount.position()
    assert apart_deg((here.ra_deg, here.dec_deg), own(bench, *where(bench))) < CLOSE_DEG


@pytest.mark.parametrize("fault", [Fault.SILENCE, Fault.GARBAGE, Fault.REFUSAL])
def test_a_goto_with_faults_leaves_nothing_moving(bench, fault) -> None:
    """Whether it was understood or not: the mount stands, and the goto is not sent again."""
    bench.telescope._slew_deg_s = 1.0
    target = own(bench, *place(-25.0, 45.0, bench.clock))
    here, state = bench.guard.position(), bench.guard.state()
    assert bench.guard.policy.goto(here, state, target)[1].allowed
    bench.guard.supervisor.position, bench.guard.supervisor.state = lambda: here, lambda: state
    # the fault is to hit the goto itself
    bench.faults.next(fault, 1 if fault is Fault.REFUSAL else 3)
    if said(lambda: bench.guard.goto(*target)):
        bench.faults.none()
        wait_for(lambda: still(bench.telescope))
    assert len(bench.guard.log.sent("goto")) == 1
    bench.faults.none()
    bench.guard.stop()
    wait_for(lambda: still(bench.telescope))


def test_a_mount_that_falls_silent_during_a_slew_is_stopped(bench) -> None:
    bench.telescope._slew_deg_s = 0.5
    slew = bench.guard.slew(*own(bench, *place(-40.0, 45.0, bench.clock)))
    next(slew)
    wait_for(lambda: bench.telescope.slewing)
    bench.faults.chance(Fault.SILENCE, 1.0)
    with pytest.raises(NoAnswerError) as caught:
        run(slew)
    one_sentence(caught)
    wait_for(lambda: still(bench.telescope))
    assert bench.guard.log.sent("stop")


def test_unplugging_during_a_slew_is_said_and_stop_is_sent_again_on_reconnect(bench) -> None:
    bench.telescope._slew_deg_s = 0.5
    slew = bench.guard.slew(*own(bench, *place(-40.0, 45.0, bench.clock)))
    next(slew)
    wait_for(lambda: bench.telescope.slewing)
    bench.line.unplug()
    with pytest.raises(LineLostError, match="cut its power") as caught:
        run(slew)
    assert CANNOT_STOP in str(caught.value)
    assert bench.guard.emergency.unfinished
    assert bench.telescope.slewing  # as a real mount would
    reconnect(bench)
    wait_for(lambda: still(bench.telescope))
    assert not bench.guard.emergency.unfinished
    assert len(bench.guard.log.sent("goto")) == 1  # never repeated


def reconnect(bench):
    """Plug the cable in again and open the mount as a person's program would."""
    bench.line.plug()
    bench.guard._reopen = lambda: opened(bench.driver, bench.line.port, bench.clock)
    if bench.driver in COUNTERS:
        bench.guard._reopen = lambda: open_mount(bench.driver, bench.line.port, site=SITE, clock=bench.clock)
    bench.guard.reconnect()


def test_a_move_whose_line_broke_is_stopped_on_reconnect(bench) -> None:
    bench.telescope._slew_deg_s = 0.5
    bench.guard.move(Direction.NORTH, 0.5, 30.0)
    wait_for(lambda: not still(bench.telescope))
    bench.line.unplug()
    wait_for(lambda: "Lost the mount" in str(said(bench.guard.position)))
    assert not still(bench.telescope)  # as a real mount would
    reconnect(bench)
    wait_for(lambda: still(bench.telescope))


@pytest.fixture(params=["serial", "network"])
def each_line(request, monkeypatch):
    """The kind of line that the bench has; it comes before the bench among a test's arguments."""
    if request.param == "network":
        monkeypatch.setattr("tests.gear.mounts.bench.own_line", socket_line)


def test_unplugging_during_a_move_leaves_one_sentence(each_line, bench) -> None:
    """A closed TCP connection accepts one more write: the stop at the end of the move was lost, and nobody was told."""
    bench.guard.move(Direction.NORTH, 0.5, 1.0)
    bench.mount.position()
    bench.line.unplug()
    wait_for(lambda: bench.mount.watchdog.failure)
    with pytest.raises(LineLostError, match="cut its power") as caught:
        bench.guard.position()
    one_sentence(caught)
    assert bench.guard.emergency.unfinished
    reconnect(bench)
    bench.telescope.halt()
    bench.telescope.turn_axis(1, 0.0)


def test_an_unaligned_nexstar_is_said_before_anything_is_sent() -> None:
    with simulated("nexstar", aligned=False) as bench:
        guard = Guard(bench.open(), SITE, LIMITS, clock=bench.clock)
        with pytest.raises(DeviceError, match="not aligned"):
            guard.goto(*place(-25.0, 45.0, bench.clock))
        assert not moved(bench.telescope)
        guard.close()


def test_a_move_that_waited_behind_another_exchange_past_its_time_is_ended(bench) -> None:
    """Its end was sent first: without another one it would move for good."""
    bounded = bench.mount.bounded

    def behind_another(*order):
        taken = threading.Event()

        def exchange():
            with bench.mount.talk._exchange:
                taken.set()
                time.sleep(0.3)

        threading.Thread(target=exchange).start()
        taken.wait()
        return bounded(*order)

    bench.mount.bounded = behind_another
    bench.mount.move(Direction.NORTH, 0.5, 0.05)
    wait_for(lambda: not bench.mount.watchdog.moving)
    wait_for(lambda: still(bench.telescope))
