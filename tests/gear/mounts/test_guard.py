"""The table of what can go wrong with a mount, row by row, and the guard against each."""

import gc
import logging
import re
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from datetime import timedelta
from math import floor
from pathlib import Path

import pytest

from kochab.core.errors import LineLostError, NoAnswerError, RefusedError, StoppedError, StrayedError
from kochab.core.mount import Direction, Epoch, PierSide, Pointing
from kochab.core.progress import run
from kochab.gear.mounts import guard as guarding
from kochab.gear.mounts import slew_supervisor
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.emergency_stop import CANNOT_STOP
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits, SyncEvidence
from kochab.workflows.nudge import nudge
from tests.gear.mounts.imaginary import NIGHT, NOON, SILENT, SITE, Imaginary, at, guarded


def evidence(place_of_date, apart_arcsec=10.0, rms=0.3, false_alarm=-12.0, count=2):
    """Solves that agree on a place, given of date."""
    ra, dec = from_mount_epoch(Pointing(*place_of_date, Epoch.DATE), NIGHT)
    centres = tuple((ra, dec + k * apart_arcsec / 3600.0) for k in range(count))
    return SyncEvidence(centres, (rms,) * count, (false_alarm,) * count)


# -- a sync on a wrong solution ---------------------------------------------------------------


def test_sync_needs_two_solves() -> None:
    guard, mount = guarded()
    target = at(-41.0, 40.0)
    for given, count in ((None, 0), (evidence(target, count=1), 1)):
        with pytest.raises(RefusedError, match=f"not {count}"):
            guard.sync(*target, given)
    assert mount.did == []
    guard.sync(*target, evidence(target))
    assert mount.did == [("sync", *target)]


def test_sync_needs_solves_that_agree() -> None:
    guard, mount = guarded()
    target = at(-41.0, 40.0)
    with pytest.raises(RefusedError, match=r"differ by 600″ \(limit 120″\)"):
        guard.sync(*target, evidence(target, apart_arcsec=600.0))
    assert mount.did == []


def test_sync_must_be_to_where_the_solves_are() -> None:
    guard, mount = guarded()
    with pytest.raises(RefusedError, match="from the solved position"):
        guard.sync(*at(-42.0, 40.0), evidence(at(-41.0, 40.0)))
    assert mount.did == []


@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        ({"rms": 5.0}, "residual is 5.0 px .limit 2 px"),
        ({"false_alarm": -2.0}, "Possible chance match"),
        ({"rms": float("nan")}, "residual"),
        ({"false_alarm": float("nan")}, "chance"),
    ],
)
def test_sync_needs_solves_that_are_good(bad, sentence) -> None:
    guard, mount = guarded()
    target = at(-41.0, 40.0)
    with pytest.raises(RefusedError, match=sentence):
        guard.sync(*target, evidence(target, **bad))
    assert mount.did == []


def test_sync_shows_its_offset_before() -> None:
    guard, mount = guarded()
    preview = guard.preview_sync(*at(-41.0, 40.5), by_hand=True)
    assert preview.offset_deg == pytest.approx(0.912, abs=0.01)
    assert preview.east_deg == pytest.approx(0.760, abs=0.01)
    assert preview.north_deg == pytest.approx(0.5)
    assert preview.allowed
    assert mount.did == []


def test_sync_beyond_5_deg_asks_for_a_yes() -> None:
    guard, mount = guarded()
    target = at(-40.0, 46.0)
    assert "by 6.0 deg: confirm" in guard.preview_sync(*target, evidence(target)).confirmations[0]
    with pytest.raises(RefusedError, match="confirm"):
        guard.sync(*target, evidence(target))
    assert mount.did == []
    guard.sync(*target, evidence(target), confirmed=True)
    assert mount.here == target


def test_sync_beyond_20_deg_is_refused_unless_armed() -> None:
    guard, mount = guarded()
    target = at(-40.0, 61.0)
    with pytest.raises(RefusedError, match=r"21\.0°, more than 20°"):
        guard.sync(*target, evidence(target), confirmed=True)
    assert mount.did == []
    guard.allow_large_sync = True
    with pytest.raises(RefusedError, match=r"by 21\.0 deg: confirm"):
        guard.sync(*target, evidence(target))
    assert mount.did == []
    guard.allow_large_sync = True
    guard.sync(*target, evidence(target), confirmed=True)
    assert mount.here == target
    assert not guard.allow_large_sync, "armed for one sync only"
    guard.undo_sync()  # as far as it went: nobody has to arm that
    assert mount.here == pytest.approx(at(-40.0, 40.0))


def test_sync_below_the_horizon_is_refused() -> None:
    guard, mount = guarded(dec_deg=-31.0)
    target = at(-40.0, -34.0)
    with pytest.raises(RefusedError, match="below the horizon"):
        guard.sync(*target, evidence(target))
    assert mount.did == []


@pytest.mark.parametrize("state", ["parked", "slewing"])
def test_sync_while_parked_or_slewing_is_refused(state) -> None:
    guard, mount = guarded()
    mount.now = replace(mount.now, **{state: True})
    with pytest.raises(RefusedError, match=state):
        guard.sync(*at(-41.0, 40.0), by_hand=True)
    assert mount.did == []


def test_sync_can_be_taken_back_wherever_the_mount_has_gone_since() -> None:
    guard, mount = guarded()
    before = mount.here
    guard.sync(*at(-42.0, 41.0), by_hand=True)
    guard.goto(*at(-52.0, 51.0))
    guard.undo_sync()
    ra, dec = at(-50.0, 50.0)
    assert mount.here == (pytest.approx(ra), pytest.approx(dec))
    assert before == at(-40.0, 40.0)
    with pytest.raises(RefusedError, match="No sync to undo"):
        guard.undo_sync()


@pytest.mark.parametrize(("before_deg", "synced_deg"), [(359.5, 0.5), (0.5, 359.5)])
def test_a_sync_across_right_ascension_zero_is_taken_back_to_where_it_was(before_deg, synced_deg) -> None:
    guard, mount = guarded()
    mount.here = before_deg, 60.0
    guard.sync(synced_deg, 60.0, by_hand=True, confirmed=True)
    guard.undo_sync()
    assert mount.did[-1] == ("sync", pytest.approx(before_deg), pytest.approx(60.0))


# -- a sync refused by the mount --------------------------------------------------------------


def test_sync_not_taken_by_the_mount_is_read_back_and_an_offset_slew_is_named() -> None:
    guard, mount = guarded()
    mount.takes_syncs = False
    target = at(-42.0, 40.0)
    with pytest.raises(RefusedError, match=r"still off by \d+\.\d′.*Slew by the offset"):
        guard.sync(*target, evidence(target))
    assert not guard.can_undo
    assert guard.log.entries[-1].outcome == "failed"


# -- a sync that changes the side of the pier -------------------------------------------------


def test_sync_across_the_meridian_is_refused() -> None:
    guard, mount = guarded(hour_angle_deg=-1.0)
    with pytest.raises(RefusedError, match="across the meridian"):
        guard.sync(*at(1.0, 40.0), by_hand=True)
    assert mount.did == []
    fork, mount = guarded(hour_angle_deg=-1.0, crosses_meridian=True)
    fork.sync(*at(1.0, 40.0), by_hand=True)
    assert mount.did


def test_sync_near_the_pole_is_warned_of() -> None:
    guard, _ = guarded(dec_deg=88.0)
    assert any("right ascension" in w for w in guard.preview_sync(*at(-41.0, 88.0), by_hand=True).warnings)
    assert not guard.preview_sync(*at(-41.0, 80.0), by_hand=True).warnings


# -- the telescope hits pier or tripod --------------------------------------------------------


def test_goto_below_the_altitude_limit_is_refused() -> None:
    guard, mount = guarded()
    with pytest.raises(RefusedError, match=r"is 4\.\d° high, the limit is 5°"):
        guard.goto(*at(-40.0, -27.8))
    assert mount.did == []


def test_goto_whose_way_dips_is_refused_though_both_ends_are_high() -> None:
    guard, mount = guarded(hour_angle_deg=-150.0, dec_deg=65.0, lowest_altitude_deg=26.0)
    target = at(150.0, 65.0)  # both ends are 27 deg high, below the pole it is 25
    preview = guard.preview_goto(*target)
    assert any("path would dip" in r for r in preview.refusals)
    with pytest.raises(RefusedError):
        guard.goto(*target)
    assert mount.did == []


def test_goto_above_the_upper_limit_is_refused() -> None:
    guard, _ = guarded(highest_altitude_deg=80.0)
    with pytest.raises(RefusedError, match="upper limit of 80"):
        guard.goto(*at(-5.0, 50.0))


def test_goto_from_too_low_may_only_go_up() -> None:
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=-30.0)  # 0 deg high
    guard.goto(*at(-40.0, 10.0))
    assert mount.did


def test_goto_from_too_high_may_go_down() -> None:
    guard, mount = guarded(hour_angle_deg=-5.0, dec_deg=50.0, highest_altitude_deg=80.0)
    guard.goto(*at(-40.0, 10.0))
    assert mount.did


def test_goto_beyond_the_hour_angle_limits_is_refused() -> None:
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=60.0)
    guard.limits = Limits(hour_angle_deg=(-90.0, 90.0))
    with pytest.raises(RefusedError, match=r"hour angle -8\.0 h, the limits are -6\.0 to \+6\.0 h"):
        guard.goto(*at(-120.0, 60.0))
    assert mount.did == []


def test_goto_longer_than_the_cap_is_refused() -> None:
    guard, mount = guarded(longest_slew_deg=30.0)
    with pytest.raises(RefusedError, match=r"31\.0 deg is longer than the 30"):
        guard.goto(*at(-40.0, 9.0))
    assert mount.did == []


def test_goto_never_flips_by_itself() -> None:
    guard, mount = guarded(hour_angle_deg=-10.0)
    mount.now = replace(mount.now, pier_side=PierSide.WEST)
    with pytest.raises(RefusedError, match="would flip the mount from the west side"):
        guard.goto(*at(10.0, 40.0))
    assert mount.did == []
    guard.limits = Limits(allow_flip=True)
    assert any("flip" in w for w in guard.preview_goto(*at(10.0, 40.0)).warnings)
    guard.goto(*at(10.0, 40.0))
    assert mount.did


@pytest.mark.parametrize("state", ["parked", "slewing"])
def test_goto_while_parked_or_slewing_is_refused(state) -> None:
    guard, mount = guarded()
    mount.now = replace(mount.now, **{state: True})
    with pytest.raises(RefusedError, match=state):
        guard.goto(*at(-41.0, 40.0))
    assert mount.did == []


def test_without_a_site_nothing_moves_unless_told() -> None:
    guard, mount = guarded(site=None)
    for action in (
        lambda: guard.goto(*at(-41.0, 40.0)),
        lambda: guard.sync(*at(-41.0, 40.0), by_hand=True),
        lambda: guard.move(Direction.NORTH, 0.5, 1.0),
    ):
        with pytest.raises(RefusedError, match="No site set"):
            action()
    assert mount.did == []
    guard, mount = guarded(site=None, allow_without_site=True)
    assert "horizon" in guard.preview_goto(*at(-41.0, 40.0)).warnings[0]
    guard.goto(*at(-41.0, 40.0))
    assert mount.did


# -- runaway ----------------------------------------------------------------------------------


def test_moves_and_pulses_are_bounded() -> None:
    guard, mount = guarded()
    for action, sentence in (
        (lambda: guard.move(Direction.NORTH, 0.5, 61.0), "at most 60 s"),
        (lambda: guard.move(Direction.WEST, 4.0, 30.0), "at most 95°"),
        (lambda: guard.move(Direction.WEST, 1.0, 0.0), "out of range"),
        (lambda: guard.move(Direction.WEST, 1.0, float("inf")), "out of range"),
        (lambda: guard.pulse(Direction.NORTH, 5001), "1 to 5000 ms"),
        (lambda: guard.pulse(Direction.NORTH, 0), "1 to 5000 ms"),
    ):
        with pytest.raises(RefusedError, match=sentence):
            action()
    assert mount.did == []
    guard.move(Direction.NORTH, 0.5, 2.0)
    guard.pulse(Direction.EAST, 500)
    assert [d[0] for d in mount.did] == ["move", "pulse"]


def test_moves_are_judged_by_where_they_end_at_the_rate_the_mount_really_has() -> None:
    guard, mount = guarded(dec_deg=-15.0)  # 15 deg high
    mount.rates_deg_s = (0.1,)
    guard.move(Direction.SOUTH, 0.1, 20.0)
    mount.rates_deg_s = (1.0,)  # the nearest it has
    with pytest.raises(RefusedError, match="the limit is 5°"):
        guard.move(Direction.SOUTH, 0.1, 20.0)
    assert len(mount.did) == 1


@pytest.mark.parametrize(("rates", "angle_deg"), [((), 0.9), ((1.0,), 1.8)])
def test_a_move_has_room_for_four_times_its_angle_or_two_seconds_without_its_end(rates, angle_deg) -> None:
    """Nine degrees high, of which five are the limit; at an unknown rate, and at one of a degree a second."""
    for more, allowed in ((0.0, True), (0.3, False)):
        guard, mount = guarded(hour_angle_deg=0.0, dec_deg=-31.0, crosses_meridian=True)
        mount.rates_deg_s = rates
        if allowed:
            guard.move(Direction.SOUTH, 1.0, angle_deg + more)
        else:
            with pytest.raises(RefusedError, match="the limit is 5°"):
                guard.move(Direction.SOUTH, 1.0, angle_deg + more)
        assert bool(mount.did) is allowed


@pytest.mark.parametrize(("rates", "stopped"), [((), True), ((0.1,), False)])
def test_a_move_at_an_unknown_rate_is_stopped_before_it_is_too_low(rates, stopped, monkeypatch) -> None:
    """Nine degrees high and seen to go 5 in a second, it would be below the limit of 5 at the next look."""
    monkeypatch.setattr(slew_supervisor, "monotonic", lambda: 0.0)
    guard, mount = guarded(hour_angle_deg=0.0, dec_deg=-26.0, crosses_meridian=True)
    mount.rates_deg_s = rates
    guard.move(Direction.SOUTH, 0.1, 20.0)
    mount.here, now = at(0.0, -31.0), NIGHT + timedelta(seconds=1)
    guard.policy.clock = guard.supervisor._clock = lambda: now
    if stopped:
        with pytest.raises(StrayedError, match=r"would dip to 1.* the limit is 5°"):
            guard.position()
    else:
        guard.position()
    assert (("stop",) in mount.did) is stopped


@pytest.mark.parametrize("which", ["monotonic", "wall"])
@pytest.mark.parametrize(
    "begin", [lambda g, _: g.slew(*at(-41.0, 40.0)), lambda g, wait: nudge(g, Direction.NORTH, 3600.0, wait)]
)
def test_a_computer_that_slept_stops_what_nobody_watched(which, begin, monkeypatch) -> None:
    """A minute that only one of its two clocks counted."""
    guard, mount = guarded()
    mount.rates_deg_s, seconds = (0.5,), [0.0]
    monkeypatch.setattr(slew_supervisor, "monotonic", lambda: seconds[0] * (which == "monotonic"))
    guard.supervisor._clock = lambda: NIGHT + timedelta(seconds=seconds[0] * (which == "wall"))

    def asleep(_):
        seconds[0] += 60.0

    guard.emergency.wait = asleep
    with pytest.raises(StoppedError, match="stood still for 60 s"):
        run(begin(guard, asleep))
    assert mount.did[-1] == ("stop",)
    assert any("stood still" in entry.sentence for entry in guard.log.entries)


def test_a_slew_without_end_is_stopped() -> None:
    guard, mount = guarded(slew_timeout_s=0.0)
    slew = guard.slew(*at(-41.0, 40.0))
    next(slew)
    mount.now = replace(mount.now, slewing=True)
    with pytest.raises(NoAnswerError, match="did not end within 0 s and was stopped"):
        run(slew)
    assert mount.did[-1] == ("stop",)


class TellsNoSlew(Imaginary):
    """It does not report whether it slews; each look finds it a fifth of a degree nearer to where it was sent."""

    target = None

    def goto(self, ra_deg, dec_deg):
        self._do("goto", ra_deg, dec_deg)
        self.target = ra_deg, dec_deg

    def position(self):
        if self.target is not None:
            ra, dec = self.target
            self.here = ra, min(dec, self.here[1] + 0.2)
        return super().position()

    def state(self):
        return replace(self.now, slewing=None)


def test_a_mount_that_reports_no_slewing_has_arrived_when_it_stands_still() -> None:
    """Within half a degree of its target it still moves, by more than 3.6 arcsec between two looks."""
    mount = TellsNoSlew(*at(-41.0, 40.0))
    guard = Guard(mount, SITE, Limits(), clock=lambda: NIGHT, wait=lambda s: None)
    run(guard.slew(mount.here[0], 41.0))
    assert mount.here[1] == 41.0
    assert [did[0] for did in mount.did] == ["goto"]


def test_a_cancelled_slew_is_stopped() -> None:
    guard, mount = guarded()
    slew = guard.slew(*at(-41.0, 40.0))
    next(slew)
    slew.close()
    assert mount.did[-1] == ("stop",)


def test_an_exception_during_a_slew_stops_it() -> None:
    guard, mount = guarded()
    slew = guard.slew(*at(-41.0, 40.0))
    next(slew)
    with pytest.raises(ZeroDivisionError):
        slew.throw(ZeroDivisionError())
    assert mount.did[-1] == ("stop",)


def began_and_failed(guard):
    with guard:
        guard.goto(*at(-41.0, 40.0))
        raise ZeroDivisionError


def test_an_exception_around_a_guard_stops_what_moves() -> None:
    guard, mount = guarded()
    with pytest.raises(ZeroDivisionError):
        began_and_failed(guard)
    assert [d[0] for d in mount.did] == ["goto", "stop", "close"]


def test_a_slew_that_somebody_stops_has_not_arrived() -> None:
    guard, mount = guarded()
    slew = guard.slew(*at(-41.0, 40.0))
    next(slew)
    guard.stop()
    with pytest.raises(RefusedError, match="was stopped"):
        run(slew)
    assert guard.log.entries[-1].action == "stop"
    assert mount.did[-1] == ("stop",)


@pytest.mark.parametrize(
    "begin",
    [
        lambda guard: guard.pulse(Direction.NORTH, 500),
        lambda guard: guard.move(Direction.NORTH, 0.1, 1.0),
        lambda guard: guard.goto(*at(-30.0, 45.0)),
        lambda guard: guard.park(),
        lambda guard: run(guard.rest("park")),
        lambda guard: guard.go_home(),
    ],
    ids=["pulse", "move", "goto", "park", "rest", "home"],
)
def test_a_stop_while_a_motion_is_prepared_lets_nothing_begin(begin, monkeypatch) -> None:
    """Its position and its state are asked for first; on a slow line a person is quicker."""
    guard, mount = guarded()
    asked = mount.state
    monkeypatch.setattr(mount, "state", lambda: (guard.stop(), asked())[1])
    with pytest.raises(StoppedError):
        begin(guard)
    assert {name for name, *_ in mount.did} == {"stop"}
    assert not guard.emergency.moving
    monkeypatch.undo()
    begin(guard)
    assert mount.did[-1][0] != "stop"


@pytest.mark.parametrize("order", ["goto", "go_home"])
def test_a_stop_while_a_motion_is_sent_is_no_arrival(order) -> None:
    """Home is not reported, so standing still would do."""
    guard, mount = guarded()
    mount.now = replace(mount.now, at_home=None)
    setattr(mount, order, lambda *_: guard.stop())
    with pytest.raises(StoppedError, match="was stopped"):
        run(guard.slew(*at(-41.0, 40.0)) if order == "goto" else guard.rest("home"))


def test_a_guard_that_is_forgotten_stops_what_moves() -> None:
    guard, mount = guarded()
    guard.goto(*at(-41.0, 40.0))
    del guard
    gc.collect()
    assert mount.did[-1] == ("stop",)


def test_a_program_that_ends_stops_what_moves(repository) -> None:
    """Once more where it is not seen to stand."""
    code = (
        "from tests.gear.mounts.imaginary import Imaginary, at, guarded\n"
        "Imaginary.stop = lambda self: print('STOPPED')\n"
        "guard, mount = guarded()\n"
        "guard.goto(*at(-41.0, 40.0))\n"
        "raise SystemExit(3)"
    )
    ended = subprocess.run([sys.executable, "-c", code], cwd=repository, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 3, ended.stderr
    assert ended.stdout in ("STOPPED\n", 2 * "STOPPED\n")


# -- the line is lost -------------------------------------------------------------------------


def test_a_goto_without_an_answer_is_stopped_and_never_repeated() -> None:
    guard, mount = guarded()
    mount.fails["goto"] = SILENT
    with pytest.raises(NoAnswerError):
        guard.goto(*at(-41.0, 40.0))
    assert [d[0] for d in mount.did] == ["goto", "stop"]


def test_a_mount_that_cannot_be_stopped_is_said_to_need_its_power_cut() -> None:
    guard, mount = guarded()
    guard.goto(*at(-41.0, 40.0))
    mount.fails["stop"] = LineLostError("The line broke.")
    with pytest.raises(LineLostError) as caught:
        guard.stop()
    assert str(caught.value).startswith(CANNOT_STOP)
    assert guard.emergency.unfinished


def test_stop_is_the_first_word_after_a_reconnect_and_no_motion_is_repeated() -> None:
    guard, mount = guarded()
    guard.goto(*at(-41.0, 40.0))
    mount.fails["stop"] = LineLostError("The line broke.")
    with pytest.raises(LineLostError):
        guard.stop()
    fresh = Imaginary(*mount.here)
    guard._reopen = lambda: fresh
    guard.reconnect()
    assert fresh.did == [("stop",)]
    assert not guard.emergency.unfinished
    guard.reconnect()
    assert fresh.did == [("stop",), ("close",)]


def test_without_a_way_to_open_it_again_the_lost_line_is_said() -> None:
    guard, _ = guarded()
    with pytest.raises(LineLostError, match="Reconnect"):
        guard.reconnect()


# -- the Sun ----------------------------------------------------------------------------------


def sun_at_noon():
    """RA and Dec of the Sun at the solstice of 2026: 6 h, 23.4 deg, to a quarter of a degree."""
    return 90.0, 23.4


def test_goto_near_the_sun_is_refused() -> None:
    ra, dec = sun_at_noon()
    guard, mount = guarded(hour_angle_deg=0.0, dec_deg=80.0, time_utc=NOON, crosses_meridian=True)
    with pytest.raises(RefusedError, match=r"20 deg from the Sun, nearer than 30"):
        guard.goto(ra, dec + 20.0)
    assert mount.did == []


def test_goto_whose_way_passes_the_sun_is_refused() -> None:
    ra, dec = sun_at_noon()
    guard, mount = guarded(time_utc=NOON, crosses_meridian=True)
    mount.here = ((ra + 45.0) % 360.0, dec)
    with pytest.raises(RefusedError, match=r"path passes \d deg from the Sun"):
        guard.goto(ra - 45.0, dec)
    assert mount.did == []


def test_moves_towards_the_sun_are_refused() -> None:
    ra, dec = sun_at_noon()
    guard, mount = guarded(time_utc=NOON, crosses_meridian=True)
    mount.here = (ra, dec + 35.0)
    with pytest.raises(RefusedError, match="Sun"):
        guard.move(Direction.SOUTH, 1.0, 10.0)
    guard.move(Direction.NORTH, 1.0, 10.0)
    assert [d[1] for d in mount.did] == [Direction.NORTH]


def test_who_is_too_near_the_sun_already_may_leave_it() -> None:
    ra, dec = sun_at_noon()
    guard, mount = guarded(time_utc=NOON, crosses_meridian=True)
    mount.here = (ra, dec + 20.0)
    with pytest.raises(RefusedError, match="Sun"):
        guard.move(Direction.SOUTH, 1.0, 5.0)
    guard.move(Direction.NORTH, 1.0, 5.0)
    guard.goto(ra, dec + 60.0)
    assert [d[0] for d in mount.did] == ["move", "goto"]


def test_at_night_the_sun_is_no_matter() -> None:
    guard, mount = guarded(time_utc=NIGHT, lowest_altitude_deg=-90.0, longest_slew_deg=180.0, crosses_meridian=True)
    guard.goto(*at(-150.0, 30.0))
    assert mount.did


def test_without_a_site_the_sun_is_taken_to_be_up() -> None:
    ra, dec = sun_at_noon()
    guard, _ = guarded(time_utc=NOON, site=None, allow_without_site=True)
    assert any("Sun" in r for r in guard.preview_goto(ra, dec + 10.0).refusals)


# -- time, site and hemisphere ----------------------------------------------------------------


def test_clock_and_site_are_set_by_what_a_person_asks_for_alone() -> None:
    """See test_clock_and_site.py."""
    import kochab

    callers = {
        path.name
        for path in Path(kochab.__file__).parent.rglob("*.py")
        if re.search(r"\.set_(clock|site)\b", path.read_text("utf-8")) and "protocols" not in path.parts
    }
    drivers = {"lx200.py", "nexstar.py", "ioptron.py"}  # which call their protocols' functions
    assert callers - drivers == {"guard.py", "rest.py", "actions.py"}


# -- the record -------------------------------------------------------------------------------


def test_every_motion_is_in_the_log(caplog) -> None:
    caplog.set_level("INFO", "kochab")
    guard, mount = guarded()
    guard.goto(*at(-41.0, 40.0))
    with pytest.raises(RefusedError):
        guard.goto(*at(-40.0, -60.0))
    guard.stop()
    assert [(e.action, e.outcome) for e in guard.log.entries] == [
        ("goto", "sent"),
        ("goto", "refused"),
        ("stop", "sent"),
    ]
    assert guard.log.entries[0].detail["dec_deg"] == 40.0
    assert guard.log.entries[0].time_utc.endswith("+00:00")
    assert len(guard.log.sent()) == len(mount.did) == 2
    assert [m.split()[:2] for m in caplog.messages] == [["goto", "sent"], ["goto", "refused"], ["stop", "sent"]]


def test_a_journal_on_a_disk_that_hangs_never_holds_up_a_stop() -> None:
    class Hanging(logging.Handler):
        def emit(self, record):
            hanging.append(list(mount.did))

    hanging, handler = [], Hanging()
    guard, mount = guarded()
    logging.getLogger("kochab").addHandler(handler)
    logging.getLogger("kochab").setLevel("INFO")
    try:
        guard.stop()
    finally:
        logging.getLogger("kochab").removeHandler(handler)
    assert hanging == [[("stop",)]], "the bytes are on their way before anything is written"


@pytest.mark.parametrize(("own", "option"), [(Epoch.DATE, "J2000"), (Epoch.J2000, "date")])
def test_an_epoch_that_the_mount_contradicts_is_told_with_the_option_that_mends_it(monkeypatch, own, option) -> None:
    guard, _ = guarded()
    guard.epoch = own
    other = Epoch.J2000 if own is Epoch.DATE else Epoch.DATE
    for found, told in ((None, ""), (own, "")):
        monkeypatch.setattr(guarding, "reported_epoch", lambda _, found=found: found)
        assert guard.epoch_doubt() == told
    monkeypatch.setattr(guarding, "reported_epoch", lambda _: other)
    doubt = guard.epoch_doubt()
    assert doubt.startswith(f"The mount's altitude and azimuth are of {option}, not ")
    assert doubt.endswith(f" (--epoch {option}).")


def test_an_order_that_is_refused_after_a_silence_shows_whether_the_mount_was_switched_off_and_on() -> None:
    """It may be the last question of a command; the next one would take the false home for granted."""
    guard, mount = guarded()
    home = at(-90.0, 90.0)

    class WokeUp(Imaginary):
        def goto(self, ra_deg, dec_deg):
            mount.missed, mount.here = 1, home
            raise RefusedError("It now says that it is elsewhere.")

    mount.__class__ = WokeUp
    guard.position()
    with pytest.raises(RefusedError, match="elsewhere"):
        guard.goto(*at(-45.0, 45.0))
    assert "Sync first" in guard.policy.slew_block_reason


def test_a_mount_in_doubt_turns_no_axis_far_though_at_the_pole_the_sky_hardly_tells() -> None:
    """An evening's nudge took the tube to 28 deg from the Sun: its mount believed to be at its home."""
    guard, mount = guarded(-90.0, 90.0)
    guard.policy.slew_block_reason = "It was restarted."
    with pytest.raises(RefusedError, match="It was restarted"):
        guard.move(Direction.EAST, 2.0, 3.0)
    guard.move(Direction.EAST, 2.0, 0.4)  # without rates it may go four times as far, and two seconds on
    assert [name for name, *_ in mount.did] == ["move"]


class ToldInMinutes(Imaginary):
    """As INDI passes on a StarBook: tenths of a minute of right ascension, whole minutes of declination, cut off."""

    def position(self):
        here = super().position()
        return replace(here, ra_deg=floor(here.ra_deg * 40.0) / 40.0, dec_deg=floor(here.dec_deg * 60.0) / 60.0)

    def sync(self, ra_deg, dec_deg):
        ra, dec = floor(ra_deg * 40.0) / 40.0, floor(dec_deg * 60.0) / 60.0
        super().sync(ra - 0.5 / 40.0, dec - 0.5 / 60.0)  # and what INDI sends is cut off by the mount once more


@pytest.mark.parametrize("kind", [ToldInMinutes, Imaginary])
def test_a_sync_read_back_to_three_minutes_is_taken_by_a_mount_that_tells_minutes(kind) -> None:
    guard, mount = guarded()
    mount.__class__ = kind
    fine = mount.sync
    if kind is Imaginary:  # one that tells seconds, and stands as far off, did not take it as it was meant
        mount.sync = lambda ra_deg, dec_deg: fine(ra_deg - 0.04, dec_deg - 0.04)
    ra, dec = at(-41.0, 40.9)
    told = nullcontext() if kind is ToldInMinutes else pytest.raises(NoAnswerError, match="take a new frame")
    with told:
        guard.sync(ra + 0.0249, dec + 0.0166, by_hand=True, confirmed=True)


def test_a_mount_that_tells_minutes_and_ignores_a_sync_is_said_to() -> None:
    guard, mount = guarded()
    mount.__class__, mount.takes_syncs = ToldInMinutes, False
    here = guard.position()
    with pytest.raises(RefusedError, match="ignored the sync, still off by 6"):
        guard.sync(here.ra_deg, here.dec_deg + 0.1, by_hand=True, confirmed=True)
