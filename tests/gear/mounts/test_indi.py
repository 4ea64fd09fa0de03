"""Mounts behind INDI's own server: its telescope simulator, its EQMod and its LX200 driver, behind our guard."""

import json
import socket
import threading
import time
from contextlib import closing, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from kochab.cli.main import main
from kochab.core.attitude import apart_deg
from kochab.core.errors import LineLostError, NoAnswerError, PortError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, Epoch, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.probe import find_served, probe
from kochab.sky.horizon import sidereal_deg
from tests.gear.mounts.bench import LIMITS, SITE, place, simulated

from .indi_server import indi_server

pytest.importorskip("indipyclient")
SIMULATOR, EQMOD = "Telescope Simulator", "EQMod Mount"
PROGRAMS = {SIMULATOR: "indi_simulator_telescope", EQMOD: "indi_eqmod_telescope"}
PLACE = f"GEOGRAPHIC_COORD.LAT;LONG;ELEV={SITE.latitude_deg};{SITE.longitude_deg};120"
CLOSE_DEG = 60.0 / 3600.0  # the drivers look at their mount once a second
ARRIVES_DEG = 0.04  # and their simulated mounts are that good


def now():
    """The drivers' clock, by which they reckon hour angles."""
    return datetime.now(UTC)


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with indi_server(tmp_path_factory.mktemp("indi"), *PROGRAMS.values()) as server:
        server.set(f"{EQMOD}.SIMULATION.ENABLE=On")
        for device in PROGRAMS:
            for wish in ("CONNECTION.CONNECT=On", PLACE, "TELESCOPE_PARK.UNPARK=On"):
                server.set(f"{device}.{wish}")
        # else a sync adds a point to EQMod's model of the sky, and taking it back another
        server.set(f"{EQMOD}.ALIGNSYNCMODE.ALIGNSTANDARDSYNC=On")
        yield server


@pytest.fixture(params=PROGRAMS)
def guard(server, request):
    mount = open_mount("indi", f"{server.address}/{request.param}", site=SITE, clock=now)
    with Guard(mount, SITE, LIMITS, clock=now) as guard:
        guard.device = request.param
        yield guard


def at(hour_angle_deg, dec_deg):
    return (sidereal_deg(SITE, now()) - hour_angle_deg) % 360.0, dec_deg


def away(guard, target):
    here = guard.position()
    return apart_deg((here.ra_deg, here.dec_deg), target)


def start(guard):
    """At a place in the east that the Sun never comes near."""
    run(guard.slew(*at(-30.0, 60.0)))


def reported(server, device):
    """Where INDI's own client reads that it points."""
    ra, dec = (float(server.get(f"{device}.EQUATORIAL_EOD_COORD.{member}")) for member in ("RA", "DEC"))
    return ra * 15.0, dec


def wait_for(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.05)


def test_a_goto_arrives_where_indi_s_own_client_reads_it(server, guard) -> None:
    target = at(-30.0, 60.0)
    run(guard.slew(*target))
    assert away(guard, target) < ARRIVES_DEG
    assert apart_deg(reported(server, guard.device), target) < ARRIVES_DEG
    state = guard.state()
    assert (state.slewing, state.parked, state.tracking) == (False, False, True)
    assert guard.position().epoch is Epoch.DATE


def test_a_sync_is_believed_and_taken_back(server, guard) -> None:
    start(guard)
    here = guard.position()
    target = here.ra_deg, here.dec_deg + 1.0
    guard.sync(*target, by_hand=True, confirmed=True)
    assert away(guard, target) < CLOSE_DEG
    assert apart_deg(reported(server, guard.device), target) < CLOSE_DEG
    guard.undo_sync()
    assert away(guard, (here.ra_deg, here.dec_deg)) < CLOSE_DEG


def test_a_mount_that_has_parked_tells_a_place_and_can_be_stopped_and_unparked(guard) -> None:
    """A sync before lets EQMod's declination count on beyond the pole: 90.9976 there was "no valid position"."""
    guard.limits = replace(LIMITS, sun_cone_deg=1.0)  # at some hours the way to rest passes the Sun
    start(guard)
    here = guard.position()
    guard.sync(here.ra_deg, here.dec_deg + 1.0, by_hand=True, confirmed=True)
    run(guard.rest("park"))
    try:
        assert abs(guard.position().dec_deg) <= 90.0
        assert guard.state().parked
        guard.stop()
        guard.emergency.confirm()
    finally:
        guard.unpark()
    assert not guard.state().parked
    start(guard)
    guard.undo_sync()


def test_stop_from_another_thread_ends_a_slew(guard) -> None:
    start(guard)
    target = at(-80.0, 65.0)
    guard.goto(*target)
    assert guard.state().slewing
    thread = threading.Thread(target=guard.stop)
    begun = time.monotonic()
    thread.start()
    thread.join()
    assert time.monotonic() - begun < 1.0
    guard.emergency.confirm()
    assert not guard.state().slewing
    assert away(guard, target) > 5.0


def test_a_motion_ordered_before_a_stop_does_not_begin(guard, monkeypatch) -> None:
    start(guard)
    device = guard.mount._device
    send = device.send

    def stopped_first(vector, members):
        if vector.startswith("EQUATORIAL"):
            monkeypatch.setattr(device, "send", send)
            guard.stop()
        return send(vector, members)

    monkeypatch.setattr(device, "send", stopped_first)
    target = at(-80.0, 65.0)
    with pytest.raises(RefusedError, match="stopped"):
        guard.goto(*target)
    guard.emergency.confirm()
    assert away(guard, target) > 5.0


def test_the_guard_keeps_its_limits(guard) -> None:
    with pytest.raises(RefusedError, match="the limit is 5°"):
        guard.goto(*at(0.0, -44.0))
    guard.site, guard.limits = None, Limits()
    with pytest.raises(RefusedError, match="site"):
        guard.goto(*at(-30.0, 60.0))


def test_it_tells_its_site_and_side_and_does_what_it_says(server, guard) -> None:
    start(guard)
    site = guard.site_report().site
    assert (site.latitude_deg, site.longitude_deg) == pytest.approx((SITE.latitude_deg, SITE.longitude_deg), abs=1e-3)
    assert guard.state().pier_side is not None
    assert not {Ability.PULSE, Ability.MOVE, Ability.TRACKING, Ability.PARK, Ability.SITE} & set(guard.lacks)
    for on in (False, True):
        guard.track(TrackingRate.SIDEREAL if on else TrackingRate.OFF)
        assert guard.state().tracking is on
        assert server.get(f"{guard.device}.TELESCOPE_TRACK_STATE.TRACK_{'ON' if on else 'OFF'}") == "On"
    guard.pulse(Direction.NORTH, 200)


@pytest.mark.parametrize("direction", Direction)
def test_a_move_goes_the_right_way_and_ends_by_itself(server, guard, direction) -> None:
    start(guard)
    before = guard.position()

    def along() -> float:
        after = guard.position()
        east, north = (after.ra_deg - before.ra_deg + 180.0) % 360.0 - 180.0, after.dec_deg - before.dec_deg
        moved = {"north": north, "south": -north, "east": east, "west": -east}[direction.value]
        # Beyond the pole the simulator's keys for north and south are exchanged.
        return abs(moved) if guard.device == SIMULATOR and direction.in_dec else moved

    def it_moves() -> bool:
        """Whether it is seen to have, at the latest when the driver has looked at its mount a few times.

        A busy machine may hand the driver the beginning and the end of a move at once.
        """
        guard.move(direction, 0.5, 1.0)
        wait_for(lambda: not guard.mount.watchdog.moving and not guard.state().slewing)
        with suppress(AssertionError):
            wait_for(lambda: along() > 0.01, 5.0)
        return along() > 0.01

    assert any(it_moves() for _ in range(10))
    assert along() < 6.0
    axis = "NS" if direction.in_dec else "WE"
    assert server.get(f"{guard.device}.TELESCOPE_MOTION_{axis}.MOTION_{direction.name}") == "Off"


def test_parked_by_another_program_it_refuses_to_move(server, guard) -> None:
    server.set(f"{guard.device}.TELESCOPE_PARK.PARK=On")
    wait_for(lambda: guard.state().parked and not guard.state().slewing)
    with pytest.raises(RefusedError, match="parked"):
        guard.goto(*at(-30.0, 60.0))
    with pytest.raises(RefusedError, match=r"does not begin the goto|refuses the goto"):
        guard.mount.goto(*at(-30.0, 60.0))  # as the driver says itself
    server.set(f"{guard.device}.TELESCOPE_PARK.UNPARK=On")
    wait_for(lambda: not guard.state().parked)


def test_servers_are_found_and_named(server, capsys) -> None:
    ports = [f"{server.address}/{device}" for device in PROGRAMS]
    assert sorted(one.port for one in find_served()) == sorted(ports)
    assert [(one.driver, one.name) for one in run(probe([ports[0]]))] == [("indi", SIMULATOR)]
    (several,) = run(probe([server.address]))
    assert all(port in several.advice for port in ports)
    with pytest.raises(PortError, match="more than one telescope"):
        open_mount("indi", server.address)
    with pytest.raises(PortError, match="has no telescope Dome"):
        open_mount("indi", f"{server.address}/Dome")
    assert main(["mount", "position", "--json", "--port", ports[0]]) == 0  # the driver is found
    told = json.loads(capsys.readouterr().out)
    assert (told["driver"], told["name"], told["epoch"]) == ("indi", SIMULATOR, "of date")
    assert main(["mount", "list", "--json"]) == 0
    assert sorted(one["port"] for one in json.loads(capsys.readouterr().out)["servers"]) == sorted(ports)
    assert main(["mount", "stop", "--json", "--driver", "indi", "--port", ports[0]]) == 0


def test_a_classic_lx200_without_pulses_says_what_it_lacks(tmp_path) -> None:
    with simulated("lx200") as bench, indi_server(tmp_path, "indi_lx200basic") as server:
        device = "LX200 Basic"
        server.set(f"{device}.DEVICE_AUTO_SEARCH.INDI_DISABLED=On", f"{device}.DEVICE_PORT.PORT={bench.port}")
        mount = open_mount("indi", server.address, site=SITE, clock=bench.clock)  # which connects it
        with Guard(mount, SITE, LIMITS, clock=bench.clock) as guard:
            assert away(guard, bench.start) < CLOSE_DEG
            with pytest.raises(RefusedError, match="TELESCOPE_TIMED_GUIDE_NS"):
                guard.pulse(Direction.NORTH, 100)
            assert Ability.PULSE in guard.lacks
            target = place(-25.0, 45.0, bench.clock)
            run(guard.slew(*target))
            assert apart_deg(bench.telescope.believed_deg(), target) < CLOSE_DEG


def test_a_dead_server_and_a_lost_mount_are_told_with_one_sentence(tmp_path) -> None:
    with indi_server(tmp_path, PROGRAMS[SIMULATOR]) as server:
        server.set(f"{SIMULATOR}.CONNECTION.CONNECT=On")
        mount = open_mount("indi", "", site=SITE)  # the only telescope of this computer
        server.set(f"{SIMULATOR}.CONNECTION.DISCONNECT=On")
        wait_for(lambda: mount._device.value("CONNECTION", "CONNECT") == "Off")
        with pytest.raises(LineLostError, match=f"Lost {SIMULATOR} on the INDI server: it was disconnected"):
            mount.position()
        mount.close()
        mount = open_mount("indi", "", site=SITE)
        server.end()
        wait_for(lambda: mount._link._lost, 5.0)
        for order in (mount.position, mount.stop, mount.state, lambda: mount.goto(10.0, 10.0)):
            with pytest.raises(LineLostError, match="The INDI server localhost:7624 disconnected"):
                order()
        mount.close()
        with pytest.raises(PortError, match=r"No INDI server at localhost:7624\. Start indiserver there"):
            open_mount("indi", "localhost")


def test_indis_simulator_parks_on_the_horizon_where_it_says_it_does_and_nowhere_below(server) -> None:
    """By default at an hour angle of -6 h on the equator, which the horizon limit of 5 deg kept it from."""
    mount = open_mount("indi", f"{server.address}/{SIMULATOR}", site=SITE, clock=now)
    anywhere = Limits(crosses_meridian=True, sun_up_deg=90.0)  # the Sun is near its way at some hours
    with Guard(mount, SITE, anywhere, clock=now) as guard:
        start(guard)
        assert guard.park_altitude_deg() == pytest.approx(0.0, abs=0.1)
        server.set(f"{SIMULATOR}.TELESCOPE_PARK_POSITION.PARK_HA;PARK_DEC=-6;-30")
        assert wait_until(lambda: guard.park_altitude_deg() < -20.0)
        with pytest.raises(RefusedError, match="23° below the horizon"):
            run(guard.rest("park"))
        server.set(f"{SIMULATOR}.TELESCOPE_PARK_POSITION.PARK_HA;PARK_DEC=-6;0")
        assert wait_until(lambda: abs(guard.park_altitude_deg()) < 0.1)
        run(guard.rest("park"))
        assert guard.state().parked
        here = guard.position()
        assert away(guard, (here.ra_deg, 0.0)) < 1.0
        guard.unpark()
        start(guard)
    mount = open_mount("indi", f"{server.address}/{EQMOD}", site=SITE, clock=now)
    assert mount.park_altitude_deg() is None, "it tells the counts of its encoders"
    mount.close()


def wait_until(condition):
    end = time.monotonic() + 90.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.1)
    return condition()


def test_its_clock_and_site_are_set_as_indis_own_client_reads_them(server, guard) -> None:
    guard.clock_and_site.trust()
    guard.set_site(Site(48.25, -11.5, 300.0))
    place = [float(server.get(f"{guard.device}.GEOGRAPHIC_COORD.{name}")) for name in ("LAT", "LONG", "ELEV")]
    assert place == pytest.approx([48.25, 348.5, 300.0], abs=1e-3)
    now = datetime.now(UTC)
    guard.set_clock(now - timedelta(hours=1))
    utc = datetime.fromisoformat(server.get(f"{guard.device}.TIME_UTC.UTC")).replace(tzinfo=UTC)
    assert abs((utc - now).total_seconds() + 3600.0) < 10.0
    guard.clock_and_site.forget()
    assert "its clock is 1.0 h slow (summer time or zone?) and its site is 48.25, -11.5" in guard.clock_doubt()
    with pytest.raises(RefusedError, match="contradicts"):
        guard.goto(*at(-30.0, 60.0))
    guard.set_clock()
    guard.set_site(Site(SITE.latitude_deg, SITE.longitude_deg, 120.0))
    assert guard.clock_doubt() == ""


ABOUT = 'device="T" state="Ok" perm="rw"'
OFF = f"""
<defTextVector {ABOUT} name="DRIVER_INFO"><defText name="DRIVER_INTERFACE">1</defText></defTextVector>
<defSwitchVector {ABOUT} name="CONNECTION" rule="OneOfMany"><defSwitch name="CONNECT">Off</defSwitch>
<defSwitch name="DISCONNECT">On</defSwitch></defSwitchVector>
<defNumberVector {ABOUT} name="EQUATORIAL_EOD_COORD"><defNumber name="RA" format="%g" min="0" max="24" step="0">0</defNumber>
<defNumber name="DEC" format="%g" min="-90" max="90" step="0">0</defNumber></defNumberVector>
"""
ON = """<setSwitchVector device="T" name="CONNECTION" state="Ok"><oneSwitch name="CONNECT">On</oneSwitch>
<oneSwitch name="DISCONNECT">Off</oneSwitch></setSwitchVector>"""
READ = """<setNumberVector device="T" name="EQUATORIAL_EOD_COORD" state="Ok"><oneNumber name="RA">5.5</oneNumber>
<oneNumber name="DEC">-5</oneNumber></setNumberVector>"""
ZERO = READ.replace("Ok", "Idle").replace("5.5", "0").replace("-5", "0")


@pytest.mark.parametrize(("tells", "reads"), [("", READ), (ZERO, READ), ("", "")])
def test_a_driver_just_turned_on_is_believed_when_it_has_read_its_mount_however_late(tells, reads, monkeypatch) -> None:
    """A driver begins at 0 h, 0 deg; LX200 Basic says so itself before it has asked its mount."""
    monkeypatch.setattr("kochab.gear.mounts.drivers.indi.CALL_S", 0.4)
    monkeypatch.setattr("kochab.gear.mounts.drivers.indi.POWER_UP_S", 20.0 if reads else 0.5)
    with socket.create_server(("127.0.0.1", 0)) as ear:

        def serve(line: socket.socket) -> None:
            with line, suppress(OSError):
                line.recv(1000)
                line.sendall(OFF.encode())
                while b"newSwitchVector" not in (heard := line.recv(1 << 16)):
                    if not heard:  # gone
                        return
                line.sendall(ON.encode())
                time.sleep(0.75)
                line.sendall(tells.encode())
                time.sleep(0.75)
                line.sendall(reads.encode())
                while line.recv(1 << 16):
                    pass

        def accept() -> None:
            with suppress(OSError):
                while True:
                    threading.Thread(target=serve, args=(ear.accept()[0],), daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()
        address = f"127.0.0.1:{ear.getsockname()[1]}"
        if reads:
            with closing(open_mount("indi", address, site=SITE, clock=now)) as mount:
                here = mount.position()
            assert (here.ra_deg, here.dec_deg) == (82.5, -5.0)
        else:
            with pytest.raises(NoAnswerError, match="does not report where it points"):
                open_mount("indi", address, site=SITE, clock=now)
        with suppress(OSError):  # closed alone, it goes on listening for the thread that waits there
            ear.shutdown(socket.SHUT_RDWR)
