"""A sync lasts as long as the board is on: the next program takes it over, and no other power cycle does.

The board is simulated from INDI's skywatcher.cpp; what switching it off does, from L90: not initialised, in the middle.
"""

import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import RefusedError
from kochab.core.mount import Direction, Home, TrackingRate
from kochab.core.progress import run
from kochab.gear.mounts.drivers.motor_mount import KeptZero
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.session import MountSelection, guarded
from tests.gear.mounts.bench import SITE, moved, place
from tests.gear.mounts.test_conformance import wait_for
from tests.gear.mounts.test_skywatcher_home import board


def switched_off_and_on(far_end, dec_ticks=0):
    """Power is cut where the telescope stands: L90, Dec may then read a tick less."""
    for motor, ticks in zip(far_end.motors, (0, dec_ticks), strict=True):
        motor.stop()
        motor.initialised = False
        motor.set_steps(0x800000 + ticks)


def synced(b, kept, hour=-25.0, dec=45.0):
    """One program's evening: home, a slew, a sync 1 deg beside it."""
    mount = b.connect(home=Home.NOW, kept=kept)
    mount.goto(*place(hour, dec, b.clock))
    wait_for(lambda: mount.state().slewing is False)
    mount.sync(*place(hour + 1.0, dec + 0.5, b.clock))
    return mount


@pytest.mark.parametrize("tracking", [True, False])
def test_the_next_program_agrees(tmp_path, tracking) -> None:
    with board() as b:
        before = synced(b, tmp_path)
        if not tracking:
            before.track(TrackingRate.OFF)
        there = before.position()
        before.close()
        mount = b.connect(kept=tmp_path)
        assert mount.state().home_confirmed is True
        assert mount.tracking is tracking
        here = mount.position()
        assert apart_deg((here.ra_deg, here.dec_deg), (there.ra_deg, there.dec_deg)) < 0.01
        target = place(-40.0, 30.0, b.clock)
        mount.goto(*target)
        wait_for(lambda: mount.state().slewing is False)
        found = mount.position()
        assert apart_deg((found.ra_deg, found.dec_deg), target) < 0.01


def test_it_holds_while_another_stops_the_tracking_and_after_a_kill(tmp_path) -> None:
    """What is written when the slew ends is enough: nothing was said at the end."""
    with board() as b:
        before = synced(b, tmp_path)
        wait_for(lambda: before.state().tracking and b.telescope._rates[0] > 0.0)
        before.kept = None  # killed: it keeps nothing more
        before.close()
        b.far_end.feed(b":K1\r")
        assert b.connect(kept=tmp_path).state().home_confirmed is True


@pytest.mark.parametrize("ticks", [0, -1])
def test_another_power_cycle_is_asked_again(tmp_path, ticks) -> None:
    with board() as b:
        synced(b, tmp_path).close()
        switched_off_and_on(b.far_end, ticks)
        for other_program in (b"", b":F1\r:F2\r", b":E2806CA2\r"):  # what EQMod's Init sends
            b.far_end.feed(other_program)
            mount = b.connect(kept=tmp_path)
            assert mount.state().home_confirmed is False
            with pytest.raises(RefusedError, match="home is not confirmed"):
                mount.goto(*place(-25.0, 45.0, b.clock))
            mount.close()


def test_a_mount_that_another_program_has_turned_needs_a_solved_frame_and_keeps_its_side(tmp_path) -> None:
    """The counters are of the same power cycle, but nothing shows it; a solved frame that fits the old zero does."""
    with board() as b:
        mount = b.connect(kept=tmp_path, home=Home.NOW)
        mount.offset_deg = (30.0, 25.0)  # it was switched on somewhere: no usual home fits its counters
        mount.goto(*place(-25.0, 45.0, b.clock))
        wait_for(lambda: mount.state().slewing is False)
        mount.close()
        b.telescope.turn_axis_to(1, b.telescope.axes_deg()[1] - 20.0)
        wait_for(lambda: not b.telescope.slewing)
        mount = b.connect(kept=tmp_path)
        assert mount.state().home_confirmed is False
        mount.sync(*place(-25.5, 65.5, b.clock))
        assert mount.state().home_confirmed is True
        assert mount.offset_deg == pytest.approx((30.0, 25.0), abs=1.0)


def test_counters_as_at_power_on_are_of_any_power_cycle(tmp_path) -> None:
    with board() as b:
        b.connect(home=Home.NOW, kept=tmp_path).close()
        b.far_end.feed(b":F1\r:F2\r")
        assert b.connect(kept=tmp_path).state().home_confirmed is False


def test_a_damaged_file_and_a_folder_that_cannot_be_are_none(tmp_path) -> None:
    with board() as b:
        synced(b, tmp_path).close()
        (file,) = tmp_path.iterdir()
        for text in ("", "[]", '{"offset_deg": 1}', "\xff"):
            file.write_text(text, "utf-8")
            mount = b.connect(kept=tmp_path)
            assert mount.state().home_confirmed is False
            mount.close()
        b.far_end.feed(b":L1\r:L2\r")
        blocked = tmp_path / "file"
        blocked.write_text("")
        b.connect(home=Home.NOW, kept=blocked / "folder").close()


def test_tracking_explains_at_most_half_a_turn_and_only_forwards() -> None:
    kept = KeptZero((1.0, 2.0), (10.0, 20.0), tracking=True, unix_s=1000.0)
    rate = 15.0 / 3600.0
    for turned, seconds, holds in ((15.0, 3600.0, True), (0.0, 3600.0, True), (15.3, 3600.0, False)):
        assert kept.holds((10.0 + turned, 20.0), rate, 1000.0 + seconds) is holds
    assert not kept.holds((9.8, 20.0), rate, 4600.0)
    assert kept.holds((5.0, 20.0), -rate, 4600.0), "in the south it counts down"
    assert not kept.holds((190.0, 20.0), rate, 1000.0 + 13 * 3600.0)
    assert not kept.holds((10.0, 20.2), rate, 1000.0)


def test_a_sync_beside_the_pole_confirms_home_but_does_not_turn_the_ra_axis() -> None:
    """At home, the polar axis 1.5 deg off: the sky's hour angle there says nothing of the axis."""
    with board() as b:
        mount = b.connect()
        with pytest.raises(RefusedError, match="Home is confirmed: slew to a star farther from the pole"):
            mount.sync(*place(10.0, 88.5, b.clock))
        assert mount.state().home_confirmed is True
        assert mount.offset_deg == (0.0, 0.0)
        mount.sync(*place(-88.0, 88.5, b.clock))
        mount.sync(*place(93.0, 89.0, b.clock))  # beyond the pole, with hardly a turn
        assert abs(mount.axes()[0]) < 5.0
        mount.move(Direction.NORTH, 0.5, 0.2)
        wait_for(lambda: not mount.watchdog.moving)


def test_the_command_line_and_the_window_keep_it_by_themselves(tmp_path, monkeypatch) -> None:
    """Each opens its mount by :func:`guarded`: two programs, one after the other."""
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    with board() as b:
        for home, confirmed in ((None, False), (Home.NOW, True), (None, True)):
            with guarded(MountSelection(b.port, "skywatcher", home=home), SITE, b.clock) as guard:
                assert guard.state().home_confirmed is confirmed
                if home:
                    guard.mount.goto(*place(-25.0, 45.0, b.clock))
                    wait_for(lambda guard=guard: guard.state().slewing is False)


@pytest.mark.parametrize("doing", ["goto", "track", "nothing"])
def test_a_power_cycle_under_our_hands_is_recognised_and_nothing_goes_on(doing) -> None:
    """L90: not initialised, in the middle. Before, the slew began anew from counters that mean nothing any more."""
    with board(slew_deg_s=10.0) as b:
        mount = b.connect(home=Home.NOW)
        guard = Guard(mount, SITE, Limits(), clock=b.clock)
        slew = guard.slew(*place(-25.0, 45.0, b.clock))
        if doing == "goto":
            wait_for(lambda: next(slew) and b.telescope.slewing)
        else:
            run(slew)
            guard.track(TrackingRate.SIDEREAL if doing == "track" else TrackingRate.OFF)
        switched_off_and_on(b.far_end)
        stood, before = b.telescope.axes_deg(), len(moved(b.telescope))
        there = place(-40.0, 45.0, b.clock)
        do = {"goto": lambda: run(slew), "track": guard.state, "nothing": lambda: mount.goto(*there)}[doing]
        with pytest.raises(RefusedError, match="switched off and on"):
            do()
        for _ in range(3):
            assert guard.state().home_confirmed is False
        assert (b.telescope.axes_deg(), len(moved(b.telescope))) == (stood, before)
        with pytest.raises(RefusedError, match="home is not confirmed"):
            guard.goto(*place(-25.0, 45.0, b.clock))
