"""Where our motor-board driver says the axes are, against INDI's EQMod and the board that it simulates itself.

Neither the driver nor the simulated board there is ours: the counters at home, which way they count, and the side of
the pier are EQMod's.
"""

import json
import os
import shutil
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest

from kochab.core.attitude import apart_deg, wrapped
from kochab.core.frame import Site
from kochab.core.mount import Home, PierSide
from kochab.gear.mounts.drivers.motor_mount import natural_side, to_axes, to_sky
from kochab.gear.mounts.drivers.skywatcher import SkyWatcher
from kochab.sky.horizon import sidereal_deg
from tests.simulate.test_indi import own_network, still_running

HOURS_AND_DECS = ((-60.0, 80.0), (-40.0, 70.0), (75.0, 80.0))  # from home, beside it, and across the meridian
PATIENCE_S = 100.0


@pytest.mark.parametrize("latitude", [50.0, -33.0])
def test_counters_at_home_and_at_targets_are_those_of_eqmod(latitude, tmp_path) -> None:
    network = own_network()
    if shutil.which("indi_eqmod_telescope") is None:
        pytest.skip("indi_eqmod_telescope is not there: apt-get install indi-eqmod")
    site = Site(latitude, 8.0)
    south, meridian = latitude < 0.0, sidereal_deg(site, datetime.now(UTC))
    targets = [((meridian - hour) % 360.0, -dec if south else dec) for hour, dec in HOURS_AND_DECS]
    script = Path(__file__).with_name("eqmod_axes.py")
    plan = {"site": (latitude, 8.0), "targets": targets, "patience_s": PATIENCE_S}
    ran = subprocess.run(
        [*network, sys.executable, str(script)],
        input=json.dumps(plan),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S + 10.0,
        env={**os.environ, "HOME": str(tmp_path)},
    )
    assert ran.returncode == 0, ran.stderr
    assert still_running(tmp_path) == []
    home, *there = json.loads(ran.stdout)
    assert home["steps"] == [0x800000, 0x800000 + home["turn"] / 4]
    assert len(there) == len(targets)
    for seen, target in zip(there, targets, strict=True):
        zero = SkyWatcher.zeros_at[Home.EQMOD]
        axes = tuple(
            wrapped((s - 0x800000) / seen["turn"] * 360.0 + z) for s, z in zip(seen["steps"], zero, strict=True)
        )
        hour, dec, side = to_sky(axes, south)
        sidereal = sidereal_deg(site, datetime.fromtimestamp(seen["unix_s"], UTC))
        assert apart_deg(((sidereal - hour) % 360.0, dec), tuple(seen["place"])) < 0.03
        assert apart_deg(tuple(seen["place"]), target) < 0.03
        assert (side is PierSide.WEST) is seen["west"]
        assert side is natural_side(hour)
        assert to_axes(hour, dec, side, south) == pytest.approx(axes, abs=1e-6)
