"""A nudge when the program is killed: on every driver the mount itself ends it, or the driver says that it does not."""

import json
import os
import select
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress

import pytest

from kochab.gear.mounts import DRIVERS, SERVERS
from tests.gear.mounts.bench import alpaca, indi, place, simulated, still
from tests.gear.mounts.test_conformance import wait_for

IMPORTS = """
import json, os, signal, sys, time
from datetime import UTC, datetime, timedelta
from kochab.core.mount import Direction, Home
from kochab.core.progress import run
from kochab.core.errors import StoppedError
from kochab.gear.mounts import open_mount, slew_supervisor
from kochab.gear.mounts.guard import Guard
from kochab.workflows.nudge import nudge
from tests.gear.mounts.bench import COUNTERS, LIMITS, SITE, place
"""
FORKS = """
import erfa
from kochab.gear.mounts import DRIVERS
DRIVERS.loaded()

def bury(*_):
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        pass

signal.signal(signal.SIGCHLD, bury)
for line in iter(sys.stdin.readline, ""):
    child = os.fork()
    if not child:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        sys.argv[1:] = json.loads(line)
        break
    print(child, flush=True)
else:
    sys.exit()
"""
"""Where a process can part: one imports all, and each program is a fork of it, which saves a quarter of a second."""
DO = """
driver, port, ahead_s, what = sys.argv[1:]
slew_supervisor.SLEPT_S = 1.0
clock = lambda: datetime.now(UTC) + timedelta(seconds=float(ahead_s))
mount = open_mount(driver, port, site=SITE, clock=clock, home=Home.NOW)
if driver in COUNTERS:
    mount.sync(*place(-60.0, 40.0, clock))
if what == "move":
    mount.move(Direction.NORTH, 1.0, 2.0)
elif what == "nudge":
    run(nudge(Guard(mount, SITE, LIMITS, clock=clock), Direction.NORTH, 18000.0))
else:
    guard = Guard(mount, SITE, LIMITS, clock=clock)
    try:
        for dec_deg in [60.0, 40.0] * 4:
            run(guard.slew(*place(-60.0, dec_deg, clock)) if what == "goto" else nudge(guard, Direction.NORTH, 18000.0))
    except StoppedError as told:
        print(told, flush=True)
time.sleep(100.0)
"""


class Fork:
    """A program that another process has made, with what these tests ask of `subprocess.Popen`."""

    def __init__(self, pid):
        self.pid = pid

    def poll(self):
        """None while it is there."""
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return 0
        return None

    def kill(self):
        """At once, if it is there."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def communicate(self, timeout):
        """Wait for its end."""
        wait_for(lambda: self.poll() is not None, timeout)


def program(*arguments, stdin=None, code=IMPORTS + DO):
    """A process of its own."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.Popen(command, env=environment, stdin=stdin, stdout=subprocess.PIPE, text=True)


@pytest.fixture(scope="module")
def begin():
    """Begin a program: a fork of one that has imported everything, where there are forks."""
    if not hasattr(os, "fork"):
        yield program
        return
    nursery = program(stdin=subprocess.PIPE, code=IMPORTS + FORKS + DO)

    def fork(driver, *arguments):
        if driver == "indi":  # whose server is in a network of this process alone
            return program(driver, *arguments)
        print(json.dumps([driver, *arguments]), file=nursery.stdin, flush=True)
        return Fork(int(nursery.stdout.readline()))

    yield fork
    nursery.communicate(timeout=60)


@contextmanager
def slow(driver, home):
    """A telescope of 1 deg/s at the end of any driver."""
    if driver not in SERVERS:
        with simulated(driver, slew_deg_s=1.0) as bench:
            yield bench
        return
    with {"indi": indi, "alpaca": alpaca}[driver](home) as bench:
        bench.telescope._slew_deg_s = 1.0
        if driver == "indi":
            bench.open().close()  # the server's driver has connected
            bench.port = bench.address
        yield bench


@contextmanager
def moving(bench, driver, what, begin=program):
    """Begin a motion in another process, and wait until the telescope moves: where it began, and the process."""
    before = bench.telescope.axes_deg()[1]
    ahead_s = (bench.clock() - type(bench.clock()).now(bench.clock().tzinfo)).total_seconds()
    child = begin(driver, bench.port, str(ahead_s), what)
    try:
        wait_for(lambda: abs(bench.telescope.axes_deg()[1] - before) > 0.02 or child.poll() is not None, 60.0)
        assert child.poll() is None
        yield before, child
    finally:
        child.kill()
        child.communicate(timeout=120)


def killed(bench, driver, what, begin):
    """The same, and kill that process; where the telescope was before."""
    with moving(bench, driver, what, begin) as (before, _):
        return before


@pytest.mark.parametrize("driver", DRIVERS)
def test_a_nudge_of_a_killed_program_ends_within_two_degrees(driver, tmp_path, begin) -> None:
    with slow(driver, tmp_path) as bench:
        bench.telescope.sync(*place(-60.0, 40.0, bench.clock))
        before = killed(bench, driver, "nudge", begin)
        wait_for(lambda: still(bench.telescope))
        went = abs(bench.telescope.axes_deg()[1] - before)
        print(f"{driver:12} a nudge of 5 deg ended after {went:.2f} deg")
        assert went < 2.05


@pytest.mark.parametrize("driver", DRIVERS)
def test_what_a_driver_says_of_its_moves_is_so(driver, tmp_path, begin) -> None:
    """Kochab warns during moves that would run on; there a nudge without a chosen rate is a goto."""
    with slow(driver, tmp_path) as bench:
        bench.telescope.sync(*place(-60.0, 40.0, bench.clock))
        killed(bench, driver, "move", begin)
        time.sleep(4.0)  # a move of two seconds
        alone = DRIVERS.load(driver).ends_alone
        print(f"{driver:12} a move of 2 deg {'ended' if still(bench.telescope) else 'ran on'} without the program")
        assert still(bench.telescope) is alone


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGSTOP")
@pytest.mark.parametrize(
    ("driver", "what"), [("nexstar", "sleepy nudge"), ("skywatcher", "sleepy nudge"), ("lx200", "goto")]
)
def test_a_computer_that_slept_during_a_motion_says_so_and_has_stopped_it(driver, what) -> None:
    """Asleep (SIGSTOP) it sends nothing: a nudge ends by the mount, a goto where it was to end.

    A sleep that falls into an exchange, not between two, is not noticed; then it falls asleep again.
    """
    with simulated(driver, slew_deg_s=1.0) as bench:
        bench.telescope.sync(*place(-60.0, 40.0, bench.clock))
        with moving(bench, driver, what) as (before, child):
            for _ in range(8):
                child.send_signal(signal.SIGSTOP)
                wait_for(lambda: still(bench.telescope), 60.0)
                slept = abs(bench.telescope.axes_deg()[1] - before)
                assert slept < (20.05 if what == "goto" else 2.05)
                time.sleep(2.0)
                child.send_signal(signal.SIGCONT)
                if select.select([child.stdout], [], [], 4.0)[0]:
                    break
                before = bench.telescope.axes_deg()[1]
            assert "The computer stood still for" in child.stdout.readline()
            wait_for(lambda: still(bench.telescope))
        assert abs(bench.telescope.axes_deg()[1] - before) == pytest.approx(slept, abs=0.05)
