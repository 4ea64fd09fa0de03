"""What the guard does about a mount that is under way: it sees where it goes, and stops it."""

from dataclasses import replace
from time import monotonic

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.errors import NoAnswerError, RefusedError, StoppedError, StrayedError
from kochab.core.frame import Site
from kochab.core.mount import Direction, Epoch, PierSide, Pointing
from kochab.core.progress import run
from kochab.gear.mounts import DRIVERS, slew_supervisor
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.motion_policy import MotionPolicy, with_paths
from kochab.gear.mounts.slew_supervisor import ASIDE_DEG, SupervisedMotion, allowed_region, may_flip, slew_limit_s
from kochab.gear.servers.alpaca_link import ANSWER_S
from kochab.gear.servers.indi_link import CALL_S
from kochab.workflows.centre_target import centre_target
from tests.gear.mounts.imaginary import NIGHT, NOON, SITE, Imaginary, at, guarded
from tests.simulate.failing_axis import AxisFailure, fail
from tests.workflows.mount_nights import bench, good, target_of, worn


class Scripted(Imaginary):
    """It says the places it is given, one a question, and then that it stands at the last."""

    def follow(self, *places):
        self.places = list(places)

    def goto(self, ra_deg, dec_deg):
        self._do("goto", ra_deg, dec_deg)
        self.now = replace(self.now, slewing=True)

    def position(self):
        if len(getattr(self, "places", ())) and self.now.slewing:
            self.here = self.places.pop(0)
            if not self.places:
                self.now = replace(self.now, slewing=False)
        return super().position()


@pytest.fixture
def patient(monkeypatch):
    """No place is too far: between two looks no time passes here."""
    monkeypatch.setattr(slew_supervisor, "reach_deg", lambda _: 360.0)


def way(*hours_and_decs):
    return [at(hour, dec) for hour, dec in hours_and_decs]


def under_way(start, target, *places, **limits):
    """A slew from hour angle and declination to others, that really goes by these places."""
    guard, _ = guarded(*start)
    guard.limits = Limits(**limits)
    mount = Scripted(*at(*start))
    guard.emergency.mount = mount
    slew = guard.slew(*at(*target))
    next(slew)
    mount.follow(*way(*places))
    return guard, mount, slew


def stopped_with(mount, guard, slew, sentence):
    with pytest.raises(StrayedError, match=sentence):
        run(slew)
    assert [order for order, *_ in mount.did if order != "stop"] == ["goto"]
    assert mount.did[-1] == ("stop",)
    assert guard.supervisor.strayed
    actions = [entry.action for entry in guard.log.entries]
    assert actions.index("stop") < actions.index("stray"), "the journal is written after the Stop"


# -- the simulated mechanics breaks -----------------------------------------------------------


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("failure", AxisFailure)
def test_a_broken_axis_is_stopped_at_once(failure, axis) -> None:
    b = bench(good(lost_deg=0.0, start=(40.0, 60.0)))
    slew = b.guard.slew(*b.guard.to_mount(*b.place(15.0, 25.0)))
    if failure is not AxisFailure.JUMP:
        fail(b.rig.mount, axis, failure)
    for _ in range(6):  # begun: a second and a half
        next(slew)
    if failure is AxisFailure.JUMP:
        fail(b.rig.mount, axis, failure, misread_deg=-40.0)
    with pytest.raises(StrayedError, match="jumped by" if failure == "jump" else "wrong way"):
        run(slew)
    assert len(b.guard.log.sent("goto")) == 1
    b.rig.clock.step(3.0)  # it brakes
    assert not b.rig.mount.slewing
    hour, dec = b.rig.mount.true_axes_deg(b.rig.clock.now_unix())
    assert -15.0 < hour < 65.0
    assert -15.0 < dec < 85.0


def test_what_broke_during_a_centring_is_not_tried_again() -> None:
    b = bench(good(lost_deg=0.0))
    fail(b.rig.mount, 1, AxisFailure.SWAPPED)
    with pytest.raises(StrayedError, match="Kochab stopped the slew"):
        run(centre_target(b.guard, b.solve_now, target_of(b), wait=b.wait))
    assert len(b.guard.log.sent("goto")) == 1


@pytest.mark.parametrize("seed", range(6))
def test_a_worn_mount_that_does_what_it_is_told_is_let_alone(seed) -> None:
    rng = np.random.default_rng(seed)
    side = 1.0 if seed % 2 else -1.0
    b = bench(worn(seed, side), allow_flip=seed % 3 == 0)
    other = -side if seed % 3 == 0 else side
    target = b.place(other * rng.uniform(5.0, 60.0), rng.uniform(5.0, 80.0))
    run(b.guard.slew(*b.guard.to_mount(*target)))
    assert not b.guard.supervisor.strayed
    assert b.guard.log.entries[-1].outcome == "done"


# -- places that are read back ----------------------------------------------------------------


def test_a_way_within_its_room_is_gone_to_its_end(patient) -> None:
    places = ((-38.0, 30.0), (-30.0, 22.0), (-12.0, 20.0), (-10.0, 20.0), (-10.0, 20.0))
    guard, mount, slew = under_way((-40.0, 40.0), (-10.0, 20.0), *places)
    assert run(slew) == Pointing(*at(-10.0, 20.0), Epoch.DATE)
    assert mount.did == [("goto", *at(-10.0, 20.0))]
    assert not guard.supervisor.strayed


@pytest.mark.parametrize(
    ("places", "sentence"),
    [
        (((-44.0, 40.0), (-48.0, 40.0), (-49.0, 40.0)), r"wrong way, \d deg off its path"),
        (((-40.0, 47.0), (-40.0, 47.8)), "wrong way, 8 deg off its path"),
        (((-30.0, 18.0), (-5.0, 12.0), (0.0, 12.0)), "wrong way"),
    ],
)
def test_a_place_beside_the_room_stops_it(patient, places, sentence) -> None:
    guard, mount, slew = under_way((-40.0, 40.0), (-10.0, 20.0), *places)
    stopped_with(mount, guard, slew, sentence)


def test_a_single_wrong_answer_is_asked_again_and_forgotten() -> None:
    places = ((-39.9, 39.9), (60.0, 10.0), (-39.8, 39.8), (-39.7, 39.7), (-39.7, 39.7))
    guard, mount, slew = under_way((-40.0, 40.0), (-39.7, 39.7), *places)
    run(slew)
    assert mount.did == [("goto", *at(-39.7, 39.7))]
    assert not guard.supervisor.strayed


def test_a_jump_that_is_said_twice_stops_it() -> None:
    places = ((-39.0, 40.0), (-15.0, 40.0), (-15.0, 40.0))
    guard, mount, slew = under_way((-40.0, 40.0), (20.0, 40.0), *places, crosses_meridian=True)
    stopped_with(mount, guard, slew, r"jumped by 18 deg, faster than any motor")


def test_the_limits_are_those_of_the_places_it_really_passes(patient) -> None:
    start, target, low = (-110.0, 50.0), (-100.0, 60.0), 26.0
    places = ((-112.0, 49.0), (-112.0, 49.0))
    guard, mount, slew = under_way(start, target, *places, lowest_altitude_deg=low)
    stopped_with(mount, guard, slew, r"dip to 2[45]\.\d°, the limit is 26°\.$")
    limits = {"hour_angle_deg": (-45.0, 0.0)}
    guard, mount, slew = under_way((-40.0, 40.0), (-20.0, 20.0), (-46.0, 40.0), (-46.0, 40.0), **limits)
    stopped_with(mount, guard, slew, r"reaches hour angle -3\.1 h, the limits are -3\.0 to \+0\.0")


def test_the_sun_is_kept_away_from_while_it_moves(patient) -> None:
    guard, _ = guarded(time_utc=NOON, crosses_meridian=True)
    mount = Scripted(90.0, 23.4 + 33.0)  # the Sun is at 6 h, 23.4 deg
    guard.emergency.mount = mount
    slew = guard.slew(90.0, 23.4 + 50.0)
    next(slew)
    mount.follow((90.0, 23.4 + 29.0), (90.0, 23.4 + 28.5))
    stopped_with(mount, guard, slew, "passes 28 deg from the Sun, nearer than 30")


def test_a_flip_that_was_not_allowed_is_stopped() -> None:
    guard, _ = guarded(-30.0, 40.0)
    mount = Scripted(*at(-30.0, 40.0))
    mount.now = replace(mount.now, pier_side=PierSide.WEST)
    guard.emergency.mount = mount
    slew = guard.slew(*at(-10.0, 40.0))
    next(slew)
    mount.now = replace(mount.now, pier_side=PierSide.EAST)
    stopped_with(mount, guard, slew, "from the west to the east side of its pier: allow the flip")


def test_a_slew_has_the_time_of_its_angle() -> None:
    quick = {"slew_start_s": 0.0, "slowest_slew_deg_s": 1e9}
    _, mount, slew = under_way((-40.0, 40.0), (-10.0, 20.0), **quick)
    with pytest.raises(NoAnswerError, match="did not end within 0 s and was stopped"):
        run(slew)
    assert mount.did[-1] == ("stop",)


# -- moves and pulses -------------------------------------------------------------------------


def test_a_move_the_wrong_way_is_seen_by_whoever_asks_how_the_mount_is(patient, monkeypatch) -> None:
    monkeypatch.setattr(slew_supervisor, "LOOK_S", 0.0)
    guard, mount = guarded()
    guard.move(Direction.NORTH, 1.0, 20.0)
    mount.here = at(-40.0, 44.0)
    guard.state()
    stops = guard.stops
    mount.here = at(-40.0, 34.0)
    with pytest.raises(StrayedError, match="wrong way, 6 deg off its path"):
        guard.state()
    assert [order for order, *_ in mount.did] == ["move", "stop"]
    with pytest.raises(StrayedError):
        guard.check_not_stopped(stops, "motion")
    guard.state()  # it stands: nothing is watched any more
    guard.move(Direction.SOUTH, 1.0, 2.0)
    stops = guard.stops
    guard.check_not_stopped(stops, "motion")
    guard.stop()
    with pytest.raises(StoppedError, match="motion was stopped"):
        guard.check_not_stopped(stops, "motion")


def test_a_sync_just_after_a_pulse_is_no_jump() -> None:
    guard, mount = guarded()
    guard.pulse(Direction.EAST, 500)
    guard.sync(*at(-30.0, 30.0), by_hand=True, confirmed=True)
    assert mount.here == at(-30.0, 30.0)
    assert not guard.supervisor.strayed


# -- the room ---------------------------------------------------------------------------------


def plan_of(start, target, **limits):
    guard, mount = guarded(*start, **limits)
    here = Pointing(*mount.here, Epoch.DATE)
    return with_paths(MotionPolicy(SITE, guard.limits, lambda: NIGHT).plan("goto", here, mount.now, at(*target)))


def aside_deg(room, hour, dec):
    here = unit_vectors(*at(hour, dec))
    return np.degrees(np.arccos(np.clip((room @ here).max(), -1.0, 1.0)))


@pytest.mark.parametrize(
    ("start", "target"), [((-70.0, 10.0), (-5.0, 80.0)), ((40.0, 85.0), (80.0, -20.0)), ((-170.0, 75.0), (-60.0, 40.0))]
)
def test_axes_may_arrive_one_after_the_other(start, target) -> None:
    room = allowed_region(plan_of(start, target))
    for hour in np.linspace(start[0], target[0], 9):
        for dec in np.linspace(start[1], target[1], 9):
            assert aside_deg(room, hour, dec) < 2.0
    beyond = target[0] + 20.0 * np.sign(target[0] - start[0]), target[1]
    if abs(target[1]) < 60.0:
        assert aside_deg(room, *beyond) > ASIDE_DEG


def test_the_pole_belongs_to_the_room_only_of_a_mount_that_may_flip() -> None:
    start, target = (-60.0, 20.0), (-50.0, 30.0)
    apart = plan_of(start, target)
    assert not may_flip(apart)
    assert slew_limit_s(apart) == pytest.approx(30.0 + 10.0 / 0.25)
    assert aside_deg(allowed_region(apart), 0.0, 88.0) > 40.0
    for flipping in (plan_of(start, target, allow_flip=True), plan_of((-10.0, 20.0), (10.0, 20.0))):
        assert may_flip(flipping)
        assert slew_limit_s(flipping) == 240.0  # the longest allowed, for half a turn
        assert aside_deg(allowed_region(flipping), 77.0, 88.0) < 2.0
    assert not may_flip(plan_of((-10.0, 20.0), (10.0, 20.0), crosses_meridian=True))


def test_in_the_south_a_flip_goes_over_the_other_pole() -> None:
    """From it up to the higher end, whatever the hour angle."""
    target_deg = at(10.0, -10.0)
    plan = replace(
        plan_of((-10.0, -5.0), (10.0, -10.0)),
        site=Site(-33.0, SITE.longitude_deg),
        start_deg=at(-10.0, -60.0),
        target_deg=target_deg,
    )
    assert may_flip(plan)
    room = allowed_region(plan)
    for dec, inside in ((-88.0, True), (-15.0, True), (5.0, False)):
        assert bool(aside_deg(room, 120.0, dec) < 2.0) is inside, dec


def test_a_fork_may_go_either_way_round_in_azimuth() -> None:
    start, target = (-90.0, 40.0), (-60.0, 30.0)
    fork = allowed_region(plan_of(start, target, crosses_meridian=True))
    level = allowed_region(plan_of(start, target))
    assert aside_deg(fork, 70.0, 35.0) < 5.0
    assert aside_deg(level, 70.0, 35.0) > 40.0


def test_nothing_is_found_at_either_end() -> None:
    plan = plan_of((-60.0, 20.0), (-50.0, 30.0))
    seen = SupervisedMotion(plan, allowed_region(plan))
    for place in (plan.start_deg, plan.target_deg):
        assert seen.finding(Pointing(*place, Epoch.DATE), NIGHT, monotonic()) is None


def test_a_mount_that_falls_silent_in_a_slew_is_told_at_the_first_question_it_leaves_unanswered() -> None:
    guard, mount = guarded()
    slew = guard.slew(*at(-20.0, 40.0))
    next(slew)
    mount.state = lambda: (_ for _ in ()).throw(NoAnswerError("silent"))
    told = [next(slew).detail, next(slew).detail]
    assert "CUT ITS POWER" in told[0]
    with pytest.raises(NoAnswerError):
        run(slew)
    assert mount.did[-1] == ("stop",)
    waits = {name: getattr(driver, "timeout_s", None) for name, driver in DRIVERS.loaded().items()}
    waits |= {"indi": CALL_S, "alpaca": ANSWER_S}  # a server has its limit for all devices
    assert max(waits.values()) < 5.0


def woken(hour, dec, lost, moving=False):
    """What a guard says of a goto after its mount has jumped there, with or without a line that was lost."""
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=40.0)
    guard.position()
    if moving:
        guard.move(Direction.NORTH, 0.5, 2.0)
    mount.here = at(hour, dec)
    if lost:
        guard._reopen = lambda: Imaginary(*mount.here)
        guard.reconnect()
    guard.position()
    return guard, " ".join(guard.preview_goto(*at(-30.0, 50.0)).refusals)


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize(("dec", "refused"), [(90.0, True), (88.5, True), (86.0, False)])
def test_a_mount_that_jumps_to_the_pole_was_switched_off_and_on(dec, refused, lost) -> None:
    """OnStep and iOptron wake up at home wherever the tube is; nothing else that they say tells of it."""
    guard, refusals = woken(-40.0, dec, lost)
    assert ("switched off and on" in refusals) is (refused or lost)  # a silent mount that is 46 deg away woke up there
    if refused:
        with pytest.raises(RefusedError, match="thinks it is at home"):
            guard.sync(*at(-40.0, dec - 10.0), by_hand=True, confirmed=True)
        guard._reopen = lambda: Imaginary(*at(-40.0, dec))
        guard.reconnect()
        assert guard.preview_goto(*at(-30.0, 50.0)).refusals, "it is still at the pole for all it says"
        guard.clock_and_site.trust()
        assert guard.preview_goto(*at(-30.0, 50.0)).allowed


@pytest.mark.parametrize("moving", [False, True])
def test_a_mount_that_is_at_the_pole_when_its_line_is_back_is_synced_first_whether_or_not_it_moved(moving) -> None:
    _, refusals = woken(-40.0, 90.0, lost=True, moving=moving)
    assert "switched off and on" in refusals
    assert "Sync first" in refusals


@pytest.mark.parametrize("passed_s", [0.0, 5.0, 3600.0])
def test_a_mount_that_nobody_ordered_to_move_has_not_gone_to_the_pole_however_long_nobody_looked(
    passed_s, monkeypatch
) -> None:
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=40.0)
    guard.position()
    then = slew_supervisor.monotonic()
    monkeypatch.setattr(slew_supervisor, "monotonic", lambda: then + passed_s)
    mount.here = at(-40.0, 90.0)
    guard.position()
    (refusal,) = guard.preview_goto(*at(-30.0, 50.0)).refusals
    assert refusal.startswith("Mount was restarted (switched off and on)")


def test_a_mount_that_was_ordered_to_the_pole_is_believed_there() -> None:
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=40.0)
    mount.slew_deg_s = 15.0  # a guard that is kept waiting must not see it jump faster than any motor does
    run(guard.rest("home"))
    assert guard.position().dec_deg == 90.0
    assert guard.policy.slew_block_reason == ""


@pytest.mark.parametrize("tracks_s", [0.0, 1800.0])
def test_tracking_beside_the_pole_is_no_restart(tracks_s, monkeypatch) -> None:
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=88.5)
    guard.position()
    then = slew_supervisor.monotonic()
    monkeypatch.setattr(slew_supervisor, "monotonic", lambda: then + tracks_s)
    mount.missed += 1
    guard.position()
    assert guard.policy.slew_block_reason == ""


def test_an_axis_that_jumped_beside_the_pole_was_restarted() -> None:
    """The tube is where it was, within a degree, but the mount has lost how far its RA axis is turned."""
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=89.5)
    guard.position()
    mount.missed += 1
    mount.here = at(-90.0, 90.0)
    guard.position()
    assert "did not answer for a while" in guard.policy.slew_block_reason


@pytest.mark.parametrize("says", [{"at_home": True}, {"parked": True}])
def test_after_a_missed_answer_a_mount_that_says_home_or_park_needs_a_sync(says) -> None:
    """Far from the pole, too: where it parks is set in the mount."""
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=40.0)
    guard.position()
    mount.missed += 1
    mount.now = replace(mount.now, **says)
    guard.position()
    assert "did not answer for a while" in guard.policy.slew_block_reason


def test_after_a_missed_answer_a_mount_that_goes_on_is_believed() -> None:
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=40.0)
    guard.position()
    mount.missed += 1
    guard.position()
    mount.now = replace(mount.now, at_home=True)
    guard.position()
    assert guard.policy.slew_block_reason == ""


@pytest.mark.parametrize("missed", [0, 1])
def test_home_is_not_done_when_an_answer_was_missed_on_the_way(missed) -> None:
    """It may have been without power: then it says at once that it is at home, wherever the tube is."""
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=88.5)
    mount.slew_deg_s = 1.0
    home = guard.rest("home")
    next(home)
    mount.missed += missed
    mount.here, mount._way = (mount.here[0], 90.0), None
    if missed:
        with pytest.raises(RefusedError, match="switched off and on"):
            run(home)
        assert mount.did[-1] == ("stop",)
        assert guard.policy.slew_block_reason
    else:
        run(home)


def test_a_mount_that_says_it_is_parked_while_it_runs_is_not_parked_yet() -> None:
    """INDI's OnStep shows PARK=Ok at once."""
    guard, mount = guarded(hour_angle_deg=-40.0, dec_deg=40.0)
    places = [at(-40.0, 40.0)] + [at(-40.0, 40.0 + step) for step in range(5)] + [at(-40.0, 44.0)] * 9
    mount.position = lambda: Pointing(*places.pop(0), mount.epoch)
    mount.park = lambda: setattr(mount, "now", replace(mount.now, parked=True, slewing=None))
    looks = len(list(guard.rest("park")))
    assert looks >= 5, "until the first place that is given twice"
