"""Every limit of the guard from both sides: a little within is allowed, a little beyond is not."""

import re
from dataclasses import replace
from datetime import timedelta
from time import monotonic

import numpy as np
import pytest

from kochab.core.attitude import apart_deg, attitude_from, radec_deg
from kochab.core.camera import Camera
from kochab.core.errors import RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, Epoch, MountState, PierSide, Pointing, TrackingRate
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.gear.mounts.coordinates import epoch_of, from_mount_epoch, to_mount_epoch, utc_of
from kochab.gear.mounts.motion_plan import Limits, SyncEvidence, great_circle, turned
from kochab.gear.mounts.motion_policy import MotionPolicy, leaving_home, with_paths
from kochab.gear.mounts.slew_supervisor import SupervisedMotion, allowed_region, may_flip, slew_limit_s
from kochab.sky.horizon import altitude_deg, from_altaz, sidereal_deg, sun_vector
from tests.gear.mounts.imaginary import NIGHT, NOON, SITE, at, guarded

READY = MountState(slewing=False, parked=False, aligned=True, tracking=True)
FORK = {"crosses_meridian": True}


def policy(time_utc=NIGHT, site=SITE, **limits):
    return MotionPolicy(site, Limits(**limits), lambda: time_utc)


def here(hour_deg, dec_deg):
    return Pointing(*at(hour_deg, dec_deg), Epoch.DATE)


def goto(start, target, state=READY, **limits):
    """What forbids a slew between hour angles and declinations."""
    _, preview = policy(**limits).goto(here(*start), state, at(*target))
    return preview.refusals


def from_horizon(azimuth, altitude):
    """Hour angle and declination of a place above the horizon."""
    ra, dec = from_altaz(altitude, azimuth, SITE, NIGHT)
    return float((at(0.0, 0.0)[0] - ra + 180.0) % 360.0 - 180.0), dec


def high(altitude):
    """Hour angle and declination so high, on the meridian in the south."""
    return -0.5, altitude - (90.0 - SITE.latitude_deg)


# -- Altitude, hour angle, length ---------------------------------------------------------------


def test_five_degrees_above_the_horizon_are_the_lowest() -> None:
    assert goto((-20.0, 40.0), high(5.1)) == ()
    (refusal,) = goto((-20.0, 40.0), high(4.9))
    assert refusal == "The target is 4.9° high, the limit is 5°. It never rises above the limit here."


@pytest.mark.parametrize(("hour", "dec"), [(-110.0, 0.0), (170.0, 20.0), (100.0, -10.0)])
def test_a_low_target_is_told_with_the_time_until_it_is_high_enough(hour, dec) -> None:
    """By the spherical triangle: cos H = (sin 5 - sin phi sin dec) / (cos phi cos dec), east of the meridian."""
    phi, d = np.radians([SITE.latitude_deg, dec])
    rises = -np.degrees(np.arccos((np.sin(np.radians(5.0)) - np.sin(phi) * np.sin(d)) / (np.cos(phi) * np.cos(d))))
    (refusal,) = goto((-20.0, 40.0), (hour, dec))
    assert "below the horizon" in refusal
    said = float(re.search(r"It rises above the limit in (\d+\.\d) h\.$", refusal)[1])
    assert said == pytest.approx((rises - hour) % 360.0 / 15.041, abs=0.14)


def test_the_highest_altitude_is_held_too() -> None:
    assert goto((-20.0, 10.0), high(79.9), highest_altitude_deg=80.0) == ()
    (refusal,) = goto((-20.0, 10.0), high(80.1), highest_altitude_deg=80.0)
    assert refusal == "The target is 80.1° high, above the upper limit of 80°."


def test_a_way_that_rises_too_high_between_two_low_ends_is_refused() -> None:
    """Both ends at hour angles of two hours stand at 60 deg; the way between them passes the zenith."""
    start, target = (-30.0, 50.0), (30.0, 50.0)
    assert goto(start, target, **FORK) == ()
    (refusal,) = goto(start, target, highest_altitude_deg=80.0, **FORK)
    assert "The path would rise to" in refusal


@pytest.mark.parametrize(("hour", "refused"), [(59.8, False), (60.2, True), (-44.8, False), (-45.2, True)])
def test_the_hour_angles_allowed_are_those_of_the_way(hour, refused) -> None:
    found = goto((0.5 * np.sign(hour), 20.0), (hour, 20.0), hour_angle_deg=(-45.0, 60.0))
    assert bool(found) is refused
    if refused:
        assert f"reaches hour angle {hour / 15.0:+.1f} h, the limits are -3.0 to +4.0 h" in found[0]


def test_the_longest_slew_is_a_third_of_the_circle() -> None:
    assert goto((-60.0, 0.0), (59.9, 0.0), **FORK) == ()
    (refusal,) = goto((-60.0, 0.0), (60.2, 0.0), **FORK)
    assert "slew of 120.2 deg is longer than the 120 allowed" in refusal


@pytest.mark.parametrize(
    ("state", "action", "allowed"),
    [
        (replace(READY, parked=True), "goto", False),
        (replace(READY, slewing=True), "goto", False),
        (replace(READY, slewing=True), "pulse", False),
        (replace(READY, aligned=False), "goto", False),
        (replace(READY, aligned=None, parked=None, slewing=None), "goto", True),
        (replace(READY, home_confirmed=False), "goto", False),
        (replace(READY, home_confirmed=False), "move", True),
        (replace(READY, home_confirmed=True), "goto", True),
    ],
)
def test_what_a_state_forbids(state, action, allowed) -> None:
    rules = policy()
    if action == "goto":
        preview = rules.goto(here(-20.0, 40.0), state, at(-25.0, 40.0))[1]
    else:
        preview = rules.move(action, here(-20.0, 40.0), state, Direction.NORTH, 1.0, 1.0, 1.5)[1]
    assert preview.allowed is allowed


def test_a_move_past_the_meridian_has_fifteen_degrees() -> None:
    west = replace(READY, pier_side=PierSide.WEST)
    for angle, allowed in ((24.9, True), (25.1, False)):
        _, preview, _ = policy().move("move", here(-10.0, 40.0), west, Direction.WEST, angle, angle, 1.0)
        assert preview.allowed is allowed


# -- The Sun --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("away", "refused"), [(30.2, False), (29.8, True)])
def test_thirty_degrees_from_the_sun_are_kept(away, refused) -> None:
    ra, dec = radec_deg(sun_vector(NOON))
    rules = policy(NOON, crosses_meridian=True)
    _, preview = rules.goto(Pointing(ra, dec + 50.0, Epoch.DATE), READY, (ra, dec + away))
    assert preview.allowed is not refused


@pytest.mark.parametrize(("margin", "refused"), [(0.1, True), (-0.1, False)])
def test_the_sun_is_no_matter_ten_degrees_below_the_horizon(margin, refused) -> None:
    """The limit is moved beside the Sun's own altitude of a summer noon."""
    ra, dec = radec_deg(sun_vector(NOON))
    height = float(altitude_deg(np.atleast_2d(sun_vector(NOON)), SITE, NOON)[0])
    rules = policy(NOON, sun_up_deg=height - margin, crosses_meridian=True)
    _, preview = rules.goto(Pointing(ra, dec + 50.0, Epoch.DATE), READY, (ra, dec + 10.0))
    assert preview.allowed is not refused
    assert Limits().sun_up_deg == -10.0


# -- A sync ----------------------------------------------------------------------------------------

TARGET = (-30.0, 40.0)


def sync(start, target, evidence=None, *, by_hand=True, allow_large_sync=False, state=READY, **limits):
    return policy(**limits).sync(here(*start), state, at(*target), evidence, by_hand, allow_large_sync)


@pytest.mark.parametrize(
    ("step", "confirmed", "refused"),
    [(4.9, False, False), (5.1, True, False), (19.9, True, False), (20.1, False, True)],
)
def test_a_sync_asks_from_five_degrees_and_refuses_from_twenty(step, confirmed, refused) -> None:
    found = sync((-30.0, 40.0 - step), TARGET)
    assert (bool(found.confirmations), bool(found.refusals)) == (confirmed, refused)
    allow_large_sync = sync((-30.0, 40.0 - step), TARGET, allow_large_sync=True)
    assert (allow_large_sync.allowed, bool(allow_large_sync.confirmations)) == (True, step > 5.0)
    guessed = sync((-30.0, 40.0 - step), TARGET, state=replace(READY, home_confirmed=False), by_hand=False)
    assert not any("would shift" in refusal for refusal in guessed.refusals)


@pytest.mark.parametrize(("dec", "warned"), [(84.9, False), (85.1, True), (-84.9, False), (-85.1, True)])
def test_near_the_pole_a_sync_hardly_corrects_right_ascension(dec, warned) -> None:
    found = sync((-30.0, dec - 1.0), (-30.0, dec))
    assert any("hardly corrects right ascension" in warning for warning in found.warnings) is warned


@pytest.mark.parametrize(("altitude", "refused"), [(0.1, False), (-0.1, True)])
def test_a_sync_is_above_the_horizon(altitude, refused) -> None:
    hour, dec = high(altitude)
    assert bool(sync((hour, dec + 1.0), (hour, dec)).refusals) is refused


def solves(apart_arcsec=0.0, away_arcsec=0.0, rms_px=0.5, alarm=-20.0, count=2):
    """Solves about the target, so far apart in declination and from it in right ascension."""
    ra, dec = from_mount_epoch(here(*TARGET), NIGHT)
    ra += away_arcsec / 3600.0 / np.cos(np.radians(dec))
    centres = [(ra, dec + (k / max(count - 1, 1) - 0.5) * apart_arcsec / 3600.0) for k in range(count)]
    return SyncEvidence(tuple(centres), (0.1,) * (count - 1) + (rms_px,), (-20.0,) * (count - 1) + (alarm,))


@pytest.mark.parametrize(
    ("evidence", "refusal"),
    [
        (solves(), ""),
        (None, "not 0"),
        (solves(count=1), "not 1"),
        (solves(apart_arcsec=118.0), ""),
        (solves(apart_arcsec=122.0), "differ by 122″"),
        (solves(apart_arcsec=122.0, count=3), "differ by 122″"),
        (solves(away_arcsec=118.0), ""),
        (solves(away_arcsec=122.0), "122″ from the solved position"),
        (solves(rms_px=1.95), ""),
        (solves(rms_px=2.05), "residual is 2.0 px"),
        (solves(rms_px=float("nan")), "residual"),
        (solves(alarm=float("nan")), "chance match"),
        (solves(away_arcsec=float("nan")), "differ by"),
        (replace(solves(count=3), centres_deg=((10.0, 0.0), (10.0, 0.0), (float("nan"), 0.0))), "differ by"),
        (solves(alarm=-5.1), ""),
        (solves(alarm=-4.9), "chance match"),
        (replace(solves(), rms_px=(0.1,)), "incomplete"),
        (replace(solves(), log10_false_alarm=(-20.0,)), "incomplete"),
    ],
)
def test_the_solves_that_a_sync_needs(evidence, refusal) -> None:
    found = sync((-30.0, 39.0), TARGET, evidence, by_hand=False)
    assert bool(found.refusals) is bool(refusal)
    assert refusal in "".join(found.refusals)


def test_a_preview_says_how_far_east_and_north_it_goes() -> None:
    """East is towards greater right ascension, shortened by the declination it goes to."""
    found = sync((-30.0, 38.0), (-31.0, 40.0))
    assert found.east_deg == pytest.approx(np.cos(np.radians(40.0)))
    assert found.north_deg == pytest.approx(2.0)
    assert found.offset_deg == pytest.approx(apart_deg(found.from_deg, found.to_deg))


# -- Ways, and what may be seen on them -----------------------------------------------------------


def test_a_great_circle_is_the_shortest_way_in_steps_of_a_degree() -> None:
    path = great_circle((10.0, 0.0), (10.0, 60.0))
    assert len(path) == 61
    ra, dec = zip(*(radec_deg(v) for v in path), strict=True)
    assert ra == pytest.approx([10.0] * 61)
    assert dec == pytest.approx(np.arange(61.0))
    assert len(great_circle((10.0, 0.0), (10.0, 0.0))) == 2
    assert len(great_circle((10.0, 0.0), (190.0, 0.0))) == 2  # there is no shortest way


def test_both_axes_turn_at_one_speed_until_each_arrives() -> None:
    path = [radec_deg(v) for v in turned((100.0, 10.0), -20.0, 40.0)]
    assert len(path) == 41
    assert path[10] == pytest.approx((90.0, 20.0))
    assert path[30] == pytest.approx((80.0, 40.0))
    assert path[-1] == pytest.approx((80.0, 50.0))


def plan_of(start, target, state=READY, **limits):
    return with_paths(policy(**limits).plan("goto", here(*start), state, at(*target)))


@pytest.mark.parametrize(("aside", "stray"), [(4.8, False), (5.3, True)])
def test_five_degrees_beside_its_region_a_telescope_has_strayed(aside, stray) -> None:
    """Beside a slew along the hour circle: its region is that line and the way by altitude and azimuth."""
    limits = {"allow_without_site": True, **FORK}
    plan = replace(plan_of((-60.0, 20.0), (-60.0, 30.0), **limits), site=None)
    seen = SupervisedMotion(plan, allowed_region(plan))
    off = aside / np.cos(np.radians(25.0))
    found = seen.finding(Pointing(*at(-60.0 + off, 25.0), Epoch.DATE), NIGHT + timedelta(seconds=10), monotonic())
    assert bool(found) is stray
    if stray:
        assert "wrong way, 5 deg off its path" in found


@pytest.mark.parametrize(("moved", "jumped"), [(44.5, False), (45.5, True)])
def test_twenty_degrees_a_second_and_five_beside_are_faster_than_any_motor(moved, jumped) -> None:
    plan = plan_of((-60.0, 0.0), (30.0, 0.0), **FORK)
    seen = SupervisedMotion(plan, allowed_region(plan))
    found = seen.finding(Pointing(*at(-60.0 + moved, 0.0), Epoch.DATE), NIGHT + timedelta(seconds=2), monotonic())
    assert (found is not None and "jumped by" in found) is jumped
    there = SupervisedMotion(plan, allowed_region(plan))
    assert (
        there.finding(Pointing(*at(29.7, 0.0), Epoch.DATE), NIGHT, monotonic()) is None
    )  # a late answer: it has arrived


def seen_on_its_way(start, target, places, action="goto"):
    """What is found at the last of the hour angles and declinations, seen half a second one after the other, at a minute."""
    plan = replace(plan_of(start, target, **FORK), action=action)
    motion, found = SupervisedMotion(plan, allowed_region(plan)), None
    for k, place in enumerate(places):
        now = NIGHT + timedelta(seconds=60.0 + 0.5 * k)
        found = motion.finding(Pointing(*at(*place, now), Epoch.DATE), now, monotonic())
    return found


def test_a_fast_slew_is_stopped_where_it_can_still_brake_above_the_limit() -> None:
    """Its Dec axis runs ahead of the other, down in the east: it stands at 6.4 deg, and a second later at 3 or 6."""
    start, target = (-60.0, 20.0), (0.0, -33.0)
    assert goto(start, target, **FORK) == ()
    fast, slow = ([(-60.0, -15.0 + step), (-60.0, -15.0)] for step in (2.0, 0.2))
    assert "the path would dip to 3." in seen_on_its_way(start, target, fast)
    assert seen_on_its_way(start, target, slow) is None
    assert seen_on_its_way(start, target, fast, action="home") is None, "whose target nobody knows"


def test_a_slew_whose_axes_end_at_its_target_is_not_stopped_before() -> None:
    """Straight on it would be at 3 deg; each axis ends where it has to, by its own kind of mount."""
    start, target = (-30.0, -11.0), (0.0, -33.0)
    assert goto(start, target, **FORK) == ()
    assert seen_on_its_way(start, target, [(-14.0, -27.0), (-10.0, -31.0)]) is None  # its Dec axis ends first
    fork = [from_horizon(140.0, 9.0), from_horizon(142.5, 6.5)]
    assert seen_on_its_way(from_horizon(130.0, 20.0), from_horizon(190.0, 5.5), fork) is None


def test_a_change_of_the_pier_side_is_found_unless_it_was_allowed() -> None:
    west = replace(READY, pier_side=PierSide.WEST)
    plan = plan_of((-60.0, 20.0), (-50.0, 30.0), west)
    seen = SupervisedMotion(plan, allowed_region(plan))
    assert seen.side_finding(PierSide.WEST) is None
    assert seen.side_finding(None) is None
    assert "from the west to the east side" in seen.side_finding(PierSide.EAST)
    for limits in ({"allow_flip": True}, FORK):
        free = SupervisedMotion(replace(plan, limits=Limits(**limits)), allowed_region(plan))
        assert free.side_finding(PierSide.EAST) is None


def test_a_slew_has_half_a_minute_and_the_time_of_its_longer_axis() -> None:
    assert slew_limit_s(plan_of((-60.0, 20.0), (-50.0, 45.0))) == pytest.approx(30.0 + 25.0 / 0.25)
    assert slew_limit_s(plan_of((-60.0, 20.0), (-20.0, 25.0))) == pytest.approx(30.0 + 40.0 / 0.25)
    assert slew_limit_s(plan_of((-80.0, 20.0), (-10.0, 25.0))) == 240.0


@pytest.mark.parametrize(("hour", "flips"), [(-0.5, False), (0.5, True), (29.5, True), (30.5, False)])
def test_a_mount_that_followed_past_the_meridian_may_still_flip_back(hour, flips) -> None:
    target = hour + 5.0 if hour > 0.0 else hour - 5.0
    assert may_flip(plan_of((hour, 20.0), (target, 20.0))) is flips
    known = replace(READY, pier_side=PierSide.WEST)
    assert not may_flip(plan_of((hour, 20.0), (target, 20.0), known))
    assert not may_flip(plan_of((hour, 20.0), (target, 20.0), **FORK))
    assert may_flip(plan_of((hour, 20.0), (target, 20.0), known, **FORK)) is flips, "a fork that names a side"


# -- The epoch that a mount's own altitude and azimuth show ---------------------------------------


@pytest.mark.parametrize("from_south", [False, True])
@pytest.mark.parametrize(("off_arcmin", "known"), [(0.0, True), (3.8, True), (4.3, False)])
def test_an_epoch_is_known_within_four_arcminutes(from_south, off_arcmin, known) -> None:
    """At a place where date and J2000 are 20 arcmin apart."""
    ra, dec = at(-40.0, 20.0)
    altitude = np.degrees(
        np.arcsin(
            np.sin(np.radians(50.0)) * np.sin(np.radians(dec))
            + np.cos(np.radians(50.0)) * np.cos(np.radians(dec)) * np.cos(np.radians(-40.0))
        )
    )
    azimuth = np.degrees(
        np.arctan2(
            -np.cos(np.radians(dec)) * np.sin(np.radians(-40.0)),
            np.cos(np.radians(50.0)) * np.sin(np.radians(dec))
            - np.sin(np.radians(50.0)) * np.cos(np.radians(dec)) * np.cos(np.radians(-40.0)),
        )
    )
    assert from_altaz(altitude, azimuth, SITE, NIGHT) == pytest.approx((ra, dec), abs=1e-9)
    shown = (altitude + off_arcmin / 60.0, (azimuth + 180.0 * from_south) % 360.0)
    assert epoch_of(Pointing(ra, dec, Epoch.DATE), shown, SITE, NIGHT) is (Epoch.DATE if known else None)
    j2000 = from_mount_epoch(Pointing(ra, dec, Epoch.DATE), NIGHT)
    assert epoch_of(Pointing(*j2000, Epoch.DATE), shown, SITE, NIGHT) is (Epoch.J2000 if known else None)


def test_local_time_east_of_greenwich_is_ahead() -> None:
    assert utc_of(2026, 1, 1, 1, 30, 15, 2.0).isoformat() == "2025-12-31T23:30:15+00:00"
    assert utc_of(2026, 1, 1, 1, 30, 15, -5.5).isoformat() == "2026-01-01T07:00:15+00:00"
    assert to_mount_epoch(365.0, 10.0, Epoch.J2000, NIGHT) == (5.0, 10.0)
    assert from_mount_epoch(Pointing(365.0, 10.0, Epoch.J2000), NIGHT) == (5.0, 10.0)
    later = sidereal_deg(Site(0.0, 10.0), NIGHT) - sidereal_deg(Site(0.0, 0.0), NIGHT)
    assert later % 360.0 == pytest.approx(10.0)


# -- What a mount cannot do, and how long and far a motion may be -----------------------------------

TARGET_DEG = at(-35.0, 40.0)


@pytest.mark.parametrize(
    ("ability", "do"),
    [
        (Ability.MOVE, lambda guard: guard.move(Direction.NORTH, 1.0, 1.0)),
        (Ability.PULSE, lambda guard: guard.pulse(Direction.NORTH, 500)),
        (Ability.SIDEREAL, lambda guard: guard.track(TrackingRate.SIDEREAL)),
        (Ability.GOTO, lambda guard: run(guard.slew(*TARGET_DEG))),
        (Ability.SYNC, lambda guard: guard.sync(*TARGET_DEG, by_hand=True, confirmed=True)),
    ],
    ids=("move", "pulse", "track", "goto", "sync"),
)
def test_what_a_mount_lacks_is_refused_with_its_reason_before_a_byte(ability, do) -> None:
    guard, mount = guarded()
    do(guard)
    assert mount.did
    guard, mount = guarded()
    mount.lacks = {ability: "Its hand control has no word for it."}
    with pytest.raises(RefusedError, match="has no word for it"):
        do(guard)
    assert mount.did == []


@pytest.mark.parametrize(("milliseconds", "allowed"), [(0, False), (1, True), (5000, True), (5001, False), (-1, False)])
def test_a_guide_pulse_lasts_five_seconds_at_most(milliseconds, allowed) -> None:
    guard, mount = guarded()
    if allowed:
        guard.pulse(Direction.EAST, milliseconds)
    else:
        with pytest.raises(RefusedError, match="1 to 5000 ms"):
            guard.pulse(Direction.EAST, milliseconds)
    assert bool(mount.did) is allowed


@pytest.mark.parametrize(
    ("rate", "seconds", "refusal"),
    [
        (0.1, 60.0, ""),
        (0.1, 60.1, "at most 60 s"),
        (0.1, 0.0, "out of range"),
        (1.6, 59.0, ""),
        (1.6, 59.6, "at most 95°"),
        (0.0, 5.0, "out of range"),
        (0.1, float("nan"), "out of range"),
    ],
)
def test_a_move_lasts_a_minute_and_a_quarter_circle_at_most(rate, seconds, refusal) -> None:
    guard, mount = guarded(-80.0, 60.0, past_meridian_deg=60.0)
    if refusal:
        with pytest.raises(RefusedError, match=refusal):
            guard.move(Direction.WEST, rate, seconds)
    else:
        guard.move(Direction.WEST, rate, seconds)
    assert bool(mount.did) is not bool(refusal)


@pytest.mark.parametrize("latitude", [50.0, -35.0])
def test_a_flip_that_is_allowed_may_go_over_the_pole_that_is_up(latitude) -> None:
    """Three ways across the meridian, too where a mount does not tell its side; two of a fork and of one that stays."""
    up = np.sign(latitude)
    ends = (-20.0, up * 40.0), (20.0, up * 30.0)
    site = Site(latitude, SITE.longitude_deg)

    def ways(side=PierSide.WEST, ends=ends, site=site, alt_azimuth=None, **limits):
        state = replace(READY, pier_side=side, alt_azimuth=alt_azimuth)
        plan = policy(site=site, **limits).plan("goto", here(*ends[0]), state, at(*ends[1]))
        return with_paths(leaving_home(plan)).paths

    *_, over = ways(allow_flip=True)
    assert np.max(over[:, 2] * up) > np.cos(np.radians(1.0))
    assert all(np.max(path[:, 2] * up) < np.cos(np.radians(20.0)) for path in ways(allow_flip=True)[:2])
    assert apart_deg(radec_deg(over[0]), at(*ends[0])) < 0.01
    assert apart_deg(radec_deg(over[-1]), at(*ends[1])) < 0.01
    assert len(ways(allow_flip=True)) == 3
    assert len(ways()) == 2
    assert len(ways(side=None, allow_flip=True)) == len(ways(side=None)) == 3
    assert len(ways(side=None, crosses_meridian=True)) == 2
    assert len(ways(crosses_meridian=True)) == 3, "said to be a fork, and names a side of its pier"
    assert len(ways(crosses_meridian=True, alt_azimuth=True)) == 2
    assert len(ways(side=None, ends=((-90.0, up * 90.0), ends[1]))) == 2
    assert len(ways(ends=(ends[0], (-25.0, up * 30.0)), allow_flip=True)) == 2
    assert len(ways(site=None, allow_flip=True)) == 2


def test_a_way_of_nothing_has_its_two_ends() -> None:
    for ra_turn, dec_turn, points in ((0.0, 0.0, 2), (0.9, 0.0, 2), (1.0, -0.5, 2), (1.1, 0.0, 3), (0.0, -10.0, 11)):
        path = turned((30.0, 20.0), ra_turn, dec_turn)
        assert len(path) == points
        np.testing.assert_allclose(radec_deg(path[-1]), (30.0 + ra_turn, 20.0 + dec_turn))


def test_the_evidence_of_a_sync_is_that_of_its_solutions() -> None:
    camera = Camera.centred(1600, 1000, 7600.0)
    one, two = (Solution(camera, attitude_from(84.0 + k, -2.0, 25.0), (), 0.3 + k, -40.0 - k, "x") for k in (0, 1))
    found = SyncEvidence.of(one, two)
    assert found.centres_deg == (pytest.approx((84.0, -2.0)), pytest.approx((85.0, -2.0)))
    assert (found.rms_px, found.log10_false_alarm) == ((0.3, 1.3), (-40.0, -41.0))


@pytest.mark.parametrize(
    ("beside", "turn", "refused"),
    [(0.2, 0.1, True), (1.0, 6.0, True), (1.0, 4.0, False), (4.9, 6.0, True), (5.1, 6.0, False)],
)
@pytest.mark.parametrize("allow_large_sync", [False, True])
def test_a_sync_beside_the_pole_does_not_turn_right_ascension(beside, turn, refused, allow_large_sync) -> None:
    """There it is a step of nothing; everywhere else the mount then points that far beside, below the horizon too."""
    preview = sync((30.0, 90.0 - beside), (30.0 - turn, 90.0 - beside), allow_large_sync=allow_large_sync)
    assert ("farther from the pole" in " ".join(preview.refusals)) is refused


@pytest.mark.parametrize("allow_large_sync", [False, True])
@pytest.mark.parametrize(
    ("beside", "step", "fork", "refused"),
    [(0.5, 30.0, False, True), (1.9, 6.0, False, True), (2.1, 10.0, False, False), (0.5, 30.0, True, False)],
)
def test_a_sync_does_not_take_a_mount_away_from_its_home(beside, step, fork, refused, allow_large_sync) -> None:
    """Switched on where it stood, it takes that for home; synced, it knows the place but not the side of its pier."""
    start = -30.0, 90.0 - beside
    found = sync(start, (-30.0, start[1] - step), allow_large_sync=allow_large_sync, crosses_meridian=fork)
    assert ("thinks it is at home" in " ".join(found.refusals)) is refused


def test_a_mount_that_tells_the_side_of_its_pier_is_no_fork() -> None:
    """A person who says so would sync a German mount to the wrong side: 23 deg off at the end of its next slew."""
    told = replace(READY, pier_side=PierSide.WEST)
    found = sync((-30.0, 89.5), (-30.0, 60.0), allow_large_sync=True, crosses_meridian=True, state=told)
    assert "thinks it is at home" in " ".join(found.refusals)
    before = policy(crosses_meridian=True)
    before.reports_side = True  # as it did before it woke at home, where it has none
    found = before.sync(here(-30.0, 89.5), READY, at(-30.0, 60.0), None, True, True)
    assert "thinks it is at home" in " ".join(found.refusals)
