"""Stop while another thread hammers the mount with questions: its bytes leave at once.

Proved on the wire's own record, not by the clock: between the moment that Stop is asked for and its
bytes there is at most the one exchange that was already under way.
"""

import threading

import pytest

from kochab.core.errors import DeviceError
from kochab.gear.mounts.guard import Guard
from kochab.simulate.responders import RESPONDERS
from tests.gear.mounts.bench import LIMITS, SITE, simulated, still
from tests.gear.mounts.test_conformance import own, place, wait_for
from tests.gear.mounts.test_faults import said

STOPS = {"lx200": b":Q#", "onstep": b":Q#", "nexstar": b"M", "synscan": b"M", "ioptron": b":Q#", "skywatcher": b":L1\r"}


class Recorder:
    """What leaves through the link, in order, with a mark of our own among it."""

    def __init__(self, link):
        self.wrote = []
        self._write = link.write
        link.write = self.write

    def write(self, data):
        self.wrote.append(data)
        self._write(data)


@pytest.mark.parametrize("driver", RESPONDERS)
def test_stop_leaves_within_one_exchange_of_a_busy_line(driver) -> None:
    with simulated(driver, slew_deg_s=0.2) as bench:
        bench.driver = driver
        mount = bench.mount = bench.open()
        guard = Guard(mount, SITE, LIMITS, clock=bench.clock)
        recorder = Recorder(mount.talk.link)
        errors, done = [], threading.Event()
        target = own(bench, *place(-60.0, 50.0, bench.clock))

        def hammer():
            while not done.is_set():
                try:
                    guard.position()
                    guard.state()
                except DeviceError as error:  # an answer must never be lost to the Stop
                    errors.append(error)
                    return

        stopping = mount.talk.stopping

        def marked():
            stopping()
            recorder.wrote.append("asked to stop")

        mount.talk.stopping = marked
        hammering = threading.Thread(target=hammer)
        guard.goto(*target)  # before the hammering: one thread owns the port
        hammering.start()
        try:
            for _ in range(5):
                before = len(recorder.wrote)
                wait_for(lambda before=before: len(recorder.wrote) > before + 3 or errors)
                guard.stop()
                wrote = recorder.wrote[before:]
                after = wrote[wrote.index("asked to stop") + 1 :]
                assert STOPS[driver] in after[:2], after[:4]
            wait_for(lambda: still(bench.telescope))
        finally:
            done.set()
            hammering.join()
        assert not errors
        assert guard.state().slewing is False
        guard.close()


@pytest.mark.parametrize("driver", RESPONDERS)
def test_stop_does_not_wait_for_a_mount_that_is_silent(driver) -> None:
    """A question waits for its answer: Stop is on the wire before that wait ends."""
    with simulated(driver) as bench:
        mount = bench.open()
        recorder = Recorder(mount.talk.link)
        bench.faults.chance("silence", 1.0)
        waiting = threading.Thread(target=said, args=(mount.position,))
        waiting.start()
        wait_for(lambda: recorder.wrote)
        mount.stop()
        assert waiting.is_alive(), "the question still waits"
        assert STOPS[driver] in recorder.wrote
        mount.talk.link.close()  # or it would wait for seconds
        waiting.join()
        mount.close()


def test_a_goto_that_is_being_prepared_is_not_begun_after_a_stop() -> None:
    with simulated("lx200") as bench:
        mount = bench.open()
        link = mount.talk.link
        read, wrote = link.read_exact, Recorder(link).wrote

        def stop_between(count, timeout_s):
            answer = read(count, timeout_s)
            if wrote[-1].startswith(b":Sd"):
                mount.stop()
            return answer

        link.read_exact = stop_between
        with pytest.raises(DeviceError, match="stopped before it began"):
            mount.goto(*place(-25.0, 45.0, bench.clock))
        assert not [entry for entry in bench.telescope.log if entry[0] == "goto"]
        mount.close()
