"""INDI's own drivers, written by other people, drive the simulated mounts.

They run in a network of their own, since indiserver would listen to the whole of ours, and in a
process namespace that takes every driver with it when it ends.
"""

import contextlib
import json
import math
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from kochab.core.errors import RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Home, TrackingRate
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.drivers.skywatcher import SkyWatcher
from kochab.simulate.mechanics.geometry import MountConfig
from kochab.simulate.mechanics.mount import EquatorialMount
from kochab.simulate.night_sky import SimulatedClock
from kochab.simulate.serial_line import pty_line
from tests.simulate.autostar import AutostarResponder
from tests.simulate.bench_telescope import BenchTelescope
from tests.simulate.dialects import open_any

FAMILIES = {
    "indi_lx200basic": ("LX200 Basic", "lx200"),
    "indi_lx200generic": ("Standard LX200", "lx200"),
    "indi_lx200autostar": ("LX200 Autostar", "autostar"),
    "indi_lx200_OnStep": ("LX200 OnStep", "onstep"),
    "indi_celestron_gps": ("Celestron GPS", "nexstar"),
    "indi_synscan_telescope": ("SynScan", "synscan"),
    "indi_ioptronv3_telescope": ("iOptronV3", "ioptron"),
    "indi_eqmod_telescope": ("EQMod Mount", "skywatcher"),
    "indi_lx200am5": ("ZWO AM5", "am5"),
    "indi_lx200_10micron": ("10micron", "10micron"),
    "indi_lx200gemini": ("Losmandy Gemini", "gemini"),
    "indi_lx200_TeenAstro": ("LX200 TeenAstro", "teenastro"),
    "indi_lx200ap": ("AstroPhysics", "astrophysics"),
    "indi_rainbow_telescope": ("Rainbow", "rainbow"),
}
ALSO = (("indi_celestron_gps", "starsense"),)  # a program of the above with another far end, in a test of its own
GOTO_ONLY = {"indi_eqmod_telescope"}  # a sync of EQMod's stays in EQMod
SYNC_ONLY = {"indi_rainbow_telescope"}  # its slew ends by a message that is not asked for
STOPS_TRACKING = {"indi_lx200ap"}  # when it connects
PATIENCE_S = 240.0
NAMESPACE = ["--net", "--pid", "--fork", "--kill-child"]
# A telescope that tracks goes on while a driver asks, and an LX200 counts whole seconds of time.
TOLERANCE_DEG = 0.02
# INDI takes aberration and nutation (20.5 and up to 18 arcsec) out of what it tells a mount that
# counts in J2000, and puts them back when it reads; a mount's computer knows precession alone.
BELIEF_DEG = {"indi_synscan_telescope": 0.015}


def apart_deg(one, other):
    """The larger difference of the two coordinates."""
    return max(abs((one[0] - other[0] + 180) % 360 - 180), abs(one[1] - other[1]))


def own_network():
    """The command that gives a command its own network; the test is skipped without."""
    if sys.platform != "linux":
        pytest.skip("INDI's drivers are run in a network namespace, which only Linux has")
    for program, package in (("indiserver", "indi-bin"), ("unshare", "util-linux"), ("ip", "iproute2")):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not there: apt-get install {package}")
    for unshare in (["unshare"], ["unshare", "--user", "--map-root-user"]):
        command = [*unshare, *NAMESPACE]
        tried = subprocess.run([*command, "ip", "link", "set", "lo", "up"], capture_output=True)
        if tried.returncode == 0:
            return command
    pytest.skip(
        "a network namespace of one's own is not permitted here: run the tests as root, or allow "
        "unprivileged user namespaces (sysctl kernel.unprivileged_userns_clone=1)"
    )


def still_running(home):
    """Processes whose home this is."""
    found = []
    for environ in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if f"HOME={home}\0".encode() in environ.read_bytes():
                found.append(environ.parent.name)
    return found


def bench():
    """A telescope that remembers its orders."""
    return BenchTelescope(slew_deg_s=60.0)


def mechanics():
    """The mount of the practice night, in good order and quick, and in the south."""
    config = MountConfig(slew_deg_s=30.0, acceleration_deg_s2=60.0)
    return EquatorialMount(config, Site(-33.0, 151.0), SimulatedClock(time.time()))


def begin(responder_name, telescope):
    """A responder over the telescope, and where to sync and go: all well above the horizon."""
    meridian = telescope.sidereal_deg()
    side = math.copysign(1.0, telescope.latitude_deg)
    if responder_name != "skywatcher":  # which is switched on at home, and must stand there
        telescope.tracking = True
        telescope.sync((meridian - 10.0) % 360.0, side * 38.0)
    responder = AutostarResponder(telescope) if responder_name == "autostar" else open_any(responder_name, telescope)
    sync = (meridian - 12.0) % 360.0, side * 36.5
    return responder, sync, ((meridian - 20.0) % 360.0, side * 41.0)


@pytest.fixture(scope="module", params=[bench, mechanics])
def driven(request, tmp_path_factory):
    """Every installed driver's tale, and the telescope it drove."""
    network = own_network()
    plans, telescopes, lines = [], {}, []
    try:
        for driver, (device, name) in FAMILIES.items():
            if shutil.which(driver) is None:
                continue
            telescope = request.param()
            responder, sync, goto = begin(name, telescope)
            lines.append(pty_line(responder))
            site = telescope.latitude_deg, telescope.longitude_deg
            plans.append(
                {
                    "driver": driver,
                    "device": device,
                    "port": lines[-1].port,
                    "site": site,
                    "sync": None if driver in GOTO_ONLY else sync,
                    "goto": None if driver in SYNC_ONLY else goto,
                    "track": driver in STOPS_TRACKING,
                }
            )
            telescopes[driver] = telescope
        home = tmp_path_factory.mktemp("indi")
        told = drive(plans, network, home)
        assert still_running(home) == []
        yield told, {plan["driver"]: plan for plan in plans}, telescopes
    finally:
        for line in lines:
            line.stop()


def drive(plans, network, home):
    """What INDI's drivers tell of their plans."""
    ran = subprocess.run(
        [*network, sys.executable, str(Path(__file__).with_name("responder_indi.py"))],
        input=json.dumps({"drivers": plans, "patience_s": PATIENCE_S}),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S + 30.0,
        env={**os.environ, "HOME": str(home)},
    )
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


@pytest.mark.parametrize("driver", ["indi_lx200_OnStep", "indi_ioptronv3_telescope"])
def test_a_driver_of_indi_tracks_the_moon_and_parks(driver, tmp_path):
    network = own_network()
    if shutil.which(driver) is None:
        pytest.skip(f"{driver} is not there: apt-get install indi-bin")
    device, name = FAMILIES[driver]
    telescope = bench()
    responder, place, _ = begin(name, telescope)
    telescope.sync(*place)
    line = pty_line(responder)
    plan = {"driver": driver, "device": device, "port": line.port, "sync": None, "goto": None, "rest": True}
    plan["site"] = telescope.latitude_deg, telescope.longitude_deg
    try:
        told = drive([plan], network, tmp_path)[driver]
        assert told == {"TRACK_LUNAR": "Ok", "PARK": "Ok"}
        assert responder.tracking_rate is TrackingRate.LUNAR
        deadline = time.monotonic() + 90.0
        while not telescope.parked and time.monotonic() < deadline:
            time.sleep(0.1)
        assert telescope.parked
    finally:
        line.stop()


def test_indis_celestron_driver_syncs_a_starsense_of_version_1_18(tmp_path):
    """Which it would not by a NexStar's versions: those have a sync since 4.10."""
    network = own_network()
    if shutil.which("indi_celestron_gps") is None:
        pytest.skip("indi_celestron_gps is not there: apt-get install indi-bin")
    telescope = bench()
    responder, sync, goto = begin("starsense", telescope)
    line = pty_line(responder)
    plan = {"driver": "indi_celestron_gps", "device": "Celestron GPS", "port": line.port, "sync": sync, "goto": goto}
    plan["site"] = telescope.latitude_deg, telescope.longitude_deg
    try:
        told = drive([plan], network, tmp_path)["indi_celestron_gps"]
        assert "error" not in told, told["error"]
        assert apart_deg(told["sync"], sync) < TOLERANCE_DEG
        assert apart_deg(telescope.believed_deg(), goto) < TOLERANCE_DEG
        assert responder.version == (1, 18)
    finally:
        line.stop()


@pytest.mark.parametrize("driver", FAMILIES)
def test_a_driver_of_indi_connects_syncs_goes_and_reads_back(driven, driver):
    told, plans, telescopes = driven
    if driver not in plans:
        package = "indi-eqmod" if "eqmod" in driver else "indi-bin"
        pytest.skip(f"{driver} is not there: apt-get install {package}")
    assert "error" not in told[driver], told[driver]["error"]
    plan, telescope = plans[driver], telescopes[driver]
    for act in ("sync", "goto"):
        if plan[act] is None:
            continue
        assert apart_deg(told[driver][act], plan[act]) < TOLERANCE_DEG
    believed = BELIEF_DEG.get(driver, TOLERANCE_DEG)
    assert apart_deg(telescope.believed_deg(), plan["goto"] or plan["sync"]) < believed
    if isinstance(telescope, BenchTelescope):
        begun = [entry[0] for entry in telescope.log if entry[0] in ("sync", "goto", "turn to")]
        if driver in GOTO_ONLY:
            assert set(begun) == {"turn to"}  # twice or more: EQMod looks again and corrects
        elif driver in SYNC_ONLY:
            assert begun == ["sync", "sync"]
        else:
            assert begun == ["sync", "sync", "goto"]  # the first is our own


def test_after_eqmod_our_own_driver_finds_the_telescope_where_it_is(driven):
    """EQMod's Init has set the counters; what it left on the board is taken over, or found by a solved position."""
    _, plans, telescopes = driven
    if "indi_eqmod_telescope" not in plans:
        pytest.skip("indi_eqmod_telescope is not there: apt-get install indi-eqmod")
    plan, telescope = plans["indi_eqmod_telescope"], telescopes["indi_eqmod_telescope"]

    def connect(**told):
        return open_mount("skywatcher", plan["port"], site=Site(*plan["site"]), **told)

    mount = connect(home=Home.EQMOD)
    here = mount.position()
    assert apart_deg((here.ra_deg, here.dec_deg), telescope.believed_deg()) < 0.03
    mount.close()
    mount = connect()
    assert mount.state().home_confirmed is False
    with pytest.raises(RefusedError, match="home is not confirmed"):
        mount.goto(*telescope.believed_deg())
    mount.sync(*telescope.believed_deg())
    assert mount.offset_deg == pytest.approx(SkyWatcher.zeros_at[Home.EQMOD], abs=0.05)
    mount.close()
