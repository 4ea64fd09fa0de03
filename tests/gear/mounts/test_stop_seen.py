"""A Stop is looked at: the mount is seen to stand, or it is said in capitals that it may move."""

import threading
import time

import pytest

from kochab.core.errors import LineLostError, NoAnswerError, NotSentError, NotStoppedError, RefusedError
from kochab.core.mount import Direction, MountState
from kochab.core.progress import run
from kochab.gear.mounts import standing
from kochab.gear.mounts.emergency_stop import MAY_STILL_MOVE
from kochab.gear.mounts.guard import Guard
from kochab.simulate.responders import RESPONDERS
from kochab.simulate.serial_line import Fault
from tests.gear.mounts.bench import LIMITS, SITE, simulated, still
from tests.gear.mounts.imaginary import SILENT, at, guarded
from tests.gear.mounts.test_conformance import own, place, wait_for
from tests.gear.mounts.test_faults import said
from tests.simulate.bench_telescope import BenchTelescope


def runs_on(mount, stops_heeded):
    """Let it move by a quarter of a degree from look to look until so many Stops have come."""
    real = mount.position

    def position():
        if mount.did.count(("stop",)) < stops_heeded:
            mount.here = (mount.here[0], mount.here[1] + 0.25)
        return real()

    mount.position = position


def test_a_mount_that_stands_is_seen_to() -> None:
    guard, mount = guarded()
    assert not guard.emergency.unconfirmed
    guard.stop()
    assert guard.emergency.unconfirmed
    guard.emergency.confirm()
    assert not guard.emergency.unconfirmed
    assert mount.did == [("stop",)]
    assert guard.log.entries[-1].outcome == "done"


def test_a_mount_that_runs_on_is_stopped_once_more() -> None:
    guard, mount = guarded()
    runs_on(mount, 2)
    guard.stop()
    guard.emergency.confirm()
    assert mount.did == [("stop",), ("stop",)]


@pytest.mark.parametrize("trouble", ["runs", "says it slews", "silent"])
def test_a_mount_that_is_not_seen_to_stand_is_said_in_capitals(trouble) -> None:
    guard, mount = guarded()
    if trouble == "runs":
        runs_on(mount, 99)
    elif trouble == "says it slews":
        mount.now = MountState(slewing=True)
    else:
        mount.state = lambda: (_ for _ in ()).throw(SILENT)
    guard.stop()
    with pytest.raises(NotStoppedError, match="THE MOUNT MAY STILL MOVE: CUT ITS POWER"):
        guard.emergency.confirm()
    assert mount.did == [("stop",), ("stop",)]
    assert not guard.emergency.unconfirmed, "it is said once"


def test_a_mount_that_does_not_track_stands_though_the_sky_passes() -> None:
    """15 arcsec a second, and a mount's coordinates that are rounded to 15 arcsec."""
    guard, mount = guarded()
    begun, steps = time.monotonic(), 15.0 / 3600.0
    start = mount.here[0]
    guard.emergency.wait = time.sleep
    real = mount.position

    def position():
        passed = (time.monotonic() - begun) * 15.04 / 3600.0
        mount.here = (start + round(passed / steps) * steps, mount.here[1])
        return real()

    mount.position = position
    guard.stop()
    guard.emergency.confirm()
    assert mount.did == [("stop",)]


def test_a_motion_that_is_asked_for_later_is_not_stopped() -> None:
    guard, mount = guarded()
    guard.stop()
    guard.goto(*at(-45.0, 42.0))
    assert not guard.emergency.unconfirmed
    assert mount.did[-1][0] == "goto"


def stopped_and_left(guard, error):
    with guard:
        guard.halt()
        raise error


def test_leaving_a_guard_looks_at_a_stop_that_nobody_looked_at() -> None:
    """As a command does whose slew failed or that Ctrl-C ended."""
    guard, mount = guarded()
    runs_on(mount, 99)
    with pytest.raises(NotStoppedError):
        stopped_and_left(guard, KeyboardInterrupt())
    assert mount.did[-1] == ("close",)
    lost, mount = guarded()
    with pytest.raises(LineLostError):
        stopped_and_left(lost, LineLostError("The line broke."))
    assert mount.did == [("stop",), ("close",)]


@pytest.mark.parametrize("driver", RESPONDERS)
def test_every_driver_is_seen_to_stand_after_a_slew_and_after_a_move(driver) -> None:
    with simulated(driver, slew_deg_s=2.0) as bench:
        bench.driver, bench.mount = driver, bench.open()
        guard = Guard(bench.mount, SITE, LIMITS, clock=bench.clock)
        guard.goto(*own(bench, *place(-60.0, 50.0, bench.clock)))
        wait_for(lambda: bench.telescope.slewing)
        guard.stop()
        guard.emergency.confirm()
        assert still(bench.telescope)
        guard.move(Direction.NORTH, 0.5, 30.0)
        guard.stop()
        guard.emergency.confirm()
        assert still(bench.telescope)
        assert len(guard.log.sent("stop")) == 2
        guard.close()


@pytest.mark.parametrize("driver", RESPONDERS)
def test_a_mount_that_ignores_stop_is_found_out(driver, monkeypatch) -> None:
    """The axes of the telescope go on turning, whatever its controller answers."""
    heeds, real = ({"stop": True, "turn_axis": True}, {n: getattr(BenchTelescope, n) for n in ("stop", "turn_axis")})
    for name in heeds:  # before its controller is made, which keeps what it calls
        monkeypatch.setattr(
            BenchTelescope, name, lambda self, *a, n=name, **k: real[n](self, *a, **k) if heeds[n] else None
        )
    monkeypatch.setattr(standing, "LOOK_S", 0.2)
    with simulated(driver, slew_deg_s=0.4) as bench:
        bench.driver, bench.mount = driver, bench.open()
        guard = Guard(bench.mount, SITE, LIMITS, clock=bench.clock)
        guard.goto(*own(bench, *place(-60.0, 50.0, bench.clock)))
        wait_for(lambda: bench.telescope.slewing)
        heeds.update(stop=False, turn_axis=False)
        guard.stop()
        with pytest.raises(NotStoppedError, match=MAY_STILL_MOVE):
            guard.emergency.confirm()
        assert bench.telescope.slewing
        guard.mount.close()


def test_stop_does_not_wait_for_the_look_of_another_thread() -> None:
    with simulated("nexstar") as bench:
        guard = Guard(bench.open(), SITE, LIMITS, clock=bench.clock)
        bench.faults.chance(Fault.SILENCE, 1.0)
        guard.stop()
        looking = threading.Thread(target=said, args=(guard.emergency.confirm,))
        looking.start()
        time.sleep(0.1)
        begun = time.monotonic()
        guard.stop()
        assert time.monotonic() - begun < 0.5
        assert looking.is_alive()
        guard.mount.talk.link.close()
        looking.join()
        guard.mount.close()


def test_a_slew_that_fails_leaves_its_stop_to_be_looked_at() -> None:
    guard, _ = guarded()
    slew = guard.slew(*at(-45.0, 42.0))
    next(slew)
    slew.close()
    assert guard.emergency.unconfirmed
    guard.emergency.confirm()
    run(guard.slew(*at(-45.0, 42.0)))
    assert not guard.emergency.unconfirmed


@pytest.mark.parametrize(
    ("error", "before", "looks"), [(NotSentError, False, 0), (NotSentError, True, 1), (RefusedError, False, 1)]
)
def test_a_session_whose_order_its_driver_would_not_send_ends_without_an_alarm(
    error, before, looks, monkeypatch
) -> None:
    """Unless something that it ordered before has not been seen to end; a mount that refuses may move all the same."""
    guard, mount = guarded()
    if before:
        guard.goto(*at(-30.0, 45.0))
        guard.stop()
    mount.fails["goto"] = error("It hears nothing.")
    assert said(lambda: guard.goto(*at(-40.0, 45.0))) == "It hears nothing."
    looked = []
    monkeypatch.setattr(guard.emergency, "confirm", lambda: looked.append(1) or "")
    guard.see_stopped()
    assert len(looked) == looks


@pytest.mark.parametrize("lag_s", [0.0, 1.0])
def test_the_word_of_a_server_whose_mount_is_silent_parks_nothing(lag_s) -> None:
    """INDI's StarBook driver says that it has parked a mount that lost its power; a parked Autostar itself is silent."""
    guard, mount = guarded()
    mount.lag_s = lag_s
    park = mount.park

    def parks():
        park()
        mount.position = lambda: (_ for _ in ()).throw(SILENT)

    mount.park = parks
    if lag_s:
        with pytest.raises(NoAnswerError):
            run(guard.rest("park"))
    else:
        run(guard.rest("park"))


@pytest.mark.parametrize("comes_back", [True, False])
def test_a_session_whose_stop_finds_the_line_broken_opens_it_again_to_stop(comes_back) -> None:
    guard, mount = guarded()
    again = type(mount)(*mount.here)
    if comes_back:
        guard._reopen = lambda: again
    guard.goto(*at(-45.0, 42.0))
    mount.stop = lambda: (_ for _ in ()).throw(LineLostError("The line broke."))
    guard.close()
    assert again.did == ([("stop",), ("close",)] if comes_back else [])
    assert mount.closed
