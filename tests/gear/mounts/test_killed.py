"""A nudge when the program is killed: on every driver the mount itself ends it, or the driver says that it does not."""

import os
import signal
import subprocess
import sys
import time

import pytest

from kochab.gear.mounts import DRIVERS
from kochab.simulate.responders import RESPONDERS
from tests.gear.mounts.bench import place, simulated, still
from tests.gear.mounts.test_conformance import wait_for

DO = """
import sys
from datetime import UTC, datetime, timedelta
from kochab.core.mount import Direction, Home
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.workflows.nudge import nudge
from tests.gear.mounts.bench import LIMITS, SITE, place

driver, port, ahead_s, what = sys.argv[1:]
clock = lambda: datetime.now(UTC) + timedelta(seconds=float(ahead_s))
mount = open_mount(driver, port, site=SITE, clock=clock, home=Home.NOW)
if driver == "skywatcher":
    mount.sync(*place(-60.0, 40.0, clock))
if what == "move":
    mount.move(Direction.NORTH, 1.0, 2.0)
else:
    run(nudge(Guard(mount, SITE, LIMITS, clock=clock), Direction.NORTH, 18000.0))
import time
time.sleep(100.0)
"""


def killed(bench, driver, what):
    """Begin a motion in another process, and kill that as soon as the telescope moves; how far it went, in degrees."""
    before = bench.telescope.axes_deg()[1]
    ahead_s = (bench.clock() - type(bench.clock()).now(bench.clock().tzinfo)).total_seconds()
    child = subprocess.Popen(
        [sys.executable, "-c", DO, driver, bench.port, str(ahead_s), what],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
    )
    try:
        wait_for(lambda: abs(bench.telescope.axes_deg()[1] - before) > 0.02 or child.poll() is not None, 60.0)
        assert child.poll() is None
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait(20)
    return before


@pytest.mark.parametrize("driver", RESPONDERS)
def test_a_nudge_of_a_killed_program_ends_within_two_degrees(driver) -> None:
    with simulated(driver, slew_deg_s=1.0) as bench:
        bench.telescope.sync(*place(-60.0, 40.0, bench.clock))
        before = killed(bench, driver, "nudge")
        wait_for(lambda: still(bench.telescope))
        went = abs(bench.telescope.axes_deg()[1] - before)
        print(f"{driver:12} a nudge of 5 deg ended after {went:.2f} deg")
        assert went < 2.05


@pytest.mark.parametrize("driver", RESPONDERS)
def test_what_a_driver_says_of_its_moves_is_so(driver) -> None:
    """Kochab warns during moves that would run on; there a nudge without a chosen rate is a goto."""
    with simulated(driver, slew_deg_s=1.0) as bench:
        bench.telescope.sync(*place(-60.0, 40.0, bench.clock))
        killed(bench, driver, "move")
        time.sleep(4.0)  # a move of two seconds
        alone = DRIVERS.load(driver).ends_alone
        print(f"{driver:12} a move of 2 deg {'ended' if still(bench.telescope) else 'ran on'} without the program")
        assert still(bench.telescope) is alone
