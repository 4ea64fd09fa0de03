"""Every rule of motion at its limit, from both sides; on the meridian a declination 40 deg higher is the altitude."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.mount import Direction, MountState, PierSide
from kochab.gear.mounts import motion_policy as policy
from kochab.gear.mounts.motion_plan import Limits, Plan
from kochab.sky.horizon import hour_angle_deg, sun_vector

from .imaginary import NIGHT, NOON, SITE, at

AWAKE = MountState(slewing=False, parked=False)


def plan(start, target, action="goto", via=(), time_utc=NIGHT, site=SITE, **more):
    """From one place of date to another, through the places ``via``."""
    limits = Limits(**{k: more.pop(k) for k in list(more) if k in Limits.__dataclass_fields__})
    path = np.array([unit_vectors(*place) for place in (start, *via, target)])
    told = {"state": AWAKE, "site": site, "paths": (path,), "action": action} | more
    told.setdefault("has_sides", not limits.crosses_meridian or told["state"].pier_side is not None)
    return Plan(start, target, target, limits=limits, time_utc=time_utc, **told)


def high(altitude):
    return at(0.0, altitude - 40.0)


def said(rule, asked):
    return " ".join(finding.sentence for finding in rule(asked))


LEAVES = ("move", "pulse", "track", "park", "home")


@pytest.mark.parametrize(
    ("start", "target", "actions", "words"),
    [
        (50.0, 5.1, ("goto", *LEAVES), ""),
        (50.0, 4.9, ("goto", *LEAVES), "is 4.9° high, the limit is 5°"),
        (2.0, 4.0, ("goto",), "is 4.0° high, the limit is 5°"),
        (2.0, 4.0, LEAVES, ""),
        (4.0, 2.0, LEAVES, "is 2.0° high"),
        (50.0, 79.9, ("goto", *LEAVES), ""),
        (50.0, 80.1, ("goto", *LEAVES), "is 80.1° high, above the upper limit of 80°"),
        (85.0, 82.0, ("goto",), "is 82.0° high, above the upper limit of 80°"),
        (85.0, 82.0, LEAVES, ""),
        (82.0, 85.0, LEAVES, "is 85.0° high"),
        (85.0, 50.0, ("goto",), ""),
        (2.0, 50.0, ("goto",), ""),
    ],
)
def test_who_is_too_low_or_too_high_may_leave_but_not_go_on(start, target, actions, words) -> None:
    for action in actions:
        found = said(policy.horizon, plan(high(start), high(target), action, highest_altitude_deg=80.0))
        assert (words in found) if words else not found, action


@pytest.mark.parametrize(
    ("start", "between", "words"),
    [
        (50.0, 4.96, ""),
        (50.0, 4.94, "would dip to 4.9°, the limit is 5°"),
        (3.0, 2.96, ""),
        (3.0, 2.94, "would dip to 2.9°"),
        (50.0, 80.04, ""),
        (50.0, 80.06, "would rise to 80.1°, the limit is 80°"),
        (85.0, 85.04, ""),
        (85.0, 85.06, "would rise to 85.1°"),
    ],
)
def test_a_path_may_pass_the_altitudes_by_a_twentieth_of_a_degree(start, between, words) -> None:
    found = said(policy.horizon, plan(high(start), high(50.0), via=[high(between)], highest_altitude_deg=80.0))
    assert (words in found) if words else not found


@pytest.mark.parametrize(
    ("allowed", "start", "between", "words"),
    [
        ((-60.0, 45.0), 0.0, 45.04, ""),
        ((-60.0, 45.0), 0.0, 45.06, "reaches hour angle +3.0 h, the limits are -4.0 to +3.0 h"),
        ((-60.0, 45.0), 0.0, -60.04, ""),
        ((-60.0, 45.0), 0.0, -60.06, "reaches hour angle -4.0 h"),
        ((-60.0, 45.0), 75.0, 75.04, ""),
        ((-60.0, 45.0), 75.0, 75.06, "reaches hour angle +5.0 h"),
        ((-60.0, 45.0), -75.0, -75.04, ""),
        ((-60.0, 45.0), -75.0, -75.06, "reaches hour angle -5.0 h"),
        ((-180.0, 45.0), 0.0, 46.0, "limits are -12.0 to +3.0 h"),
        ((-60.0, 180.0), 0.0, -61.0, "limits are -4.0 to +12.0 h"),
        ((-180.0, 180.0), 0.0, 150.0, ""),
    ],
)
def test_a_path_may_pass_the_hour_angles_by_a_twentieth_of_a_degree(allowed, start, between, words) -> None:
    asked = plan(at(start, 60.0), at(0.0, 60.0), via=[at(between, 60.0)], hour_angle_deg=allowed)
    found = said(policy.horizon, asked)
    assert (words in found) if words else not found


@pytest.mark.parametrize(
    ("action", "allow", "severity"), [("goto", False, "refuse"), ("goto", True, "warn"), ("pulse", False, "warn")]
)
def test_without_a_site_only_a_pulse_needs_no_leave(action, allow, severity) -> None:
    (found,) = policy.horizon(plan((0.0, 0.0), (1.0, 0.0), action, site=None, allow_without_site=allow))
    assert found.severity == severity


SUN = radec_deg(sun_vector(NOON))


def below_sun(deg):
    """A place so far from the Sun."""
    return SUN[0], SUN[1] - deg


@pytest.mark.parametrize(
    ("start", "target", "between", "actions", "words"),
    [
        (60.0, 30.1, None, ("goto", "move", "pulse", "park", "home", "track"), ""),
        (
            60.0,
            29.8,
            None,
            ("goto", "move", "pulse", "park", "home", "track"),
            "is 30 deg from the Sun, nearer than 30",
        ),
        (20.0, 25.0, None, ("goto", "track"), "is 25 deg from the Sun"),
        (20.0, 25.0, None, ("move", "pulse", "park", "home"), ""),
        (25.0, 20.0, None, ("move", "pulse", "park", "home"), "is 20 deg from the Sun"),
        (60.0, 60.0, 29.96, ("goto",), ""),
        (60.0, 60.0, 29.94, ("goto",), "path passes 30 deg from the Sun"),
        (20.0, 60.0, 19.96, ("goto", "move"), ""),
        (20.0, 60.0, 19.94, ("goto", "move"), "path passes 20 deg from the Sun"),
    ],
)
def test_the_sun_has_a_cone_of_thirty_degrees_that_one_may_only_leave(start, target, between, actions, words) -> None:
    via = [] if between is None else [below_sun(between)]
    for action in actions:
        found = said(policy.sun, plan(below_sun(start), below_sun(target), action, via, NOON))
        assert (words in found) if words else not found, action


@pytest.mark.parametrize(
    ("side", "between", "dec", "words"),
    [
        (PierSide.WEST, 15.04, 60.0, ""),
        (PierSide.WEST, 15.06, 60.0, "15° past the meridian on the west side"),
        (PierSide.EAST, -15.04, 60.0, ""),
        (PierSide.EAST, -15.06, 60.0, "15° past the meridian on the east side"),
        (PierSide.WEST, 30.0, 60.04, "30° past"),
        (PierSide.WEST, 30.0, 60.06, ""),  # the other axis turns
    ],
)
def test_a_move_passes_the_meridian_by_fifteen_degrees(side, between, dec, words) -> None:
    state = replace(AWAKE, pier_side=side)
    found = said(policy.past_meridian, plan(at(0.0, 60.0), at(0.0, dec), "move", [at(between, 60.0)], state=state))
    assert (words in found) if words else not found


@pytest.mark.parametrize(
    ("step", "state", "allow_large_sync", "severity"),
    [
        (4.9, AWAKE, False, []),
        (5.1, AWAKE, False, ["confirm"]),
        (19.9, AWAKE, False, ["confirm"]),
        (20.1, AWAKE, False, ["refuse"]),
        (20.1, AWAKE, True, ["confirm"]),
        (20.1, replace(AWAKE, home_confirmed=False), False, ["confirm"]),
        (20.1, replace(AWAKE, home_confirmed=True), False, ["refuse"]),
    ],
)
def test_a_sync_of_five_degrees_is_asked_for_and_one_of_twenty_refused(step, state, allow_large_sync, severity) -> None:
    asked = plan((10.0, 20.0), (10.0, 20.0 + step), "sync", state=state, allow_large_sync=allow_large_sync)
    assert [found.severity for found in policy.sync_step(asked)] == severity


@pytest.mark.parametrize(
    ("distance", "from_home", "refused"),
    [(119.9, False, False), (120.1, False, True), (120.1, True, False), (np.nan, True, True)],
)
def test_a_slew_is_no_longer_than_its_cap_but_from_home(distance, from_home, refused) -> None:
    asked = plan((0.0, 0.0), (distance, 0.0), from_home=from_home)
    assert bool(said(policy.slew_length, asked)) is refused


@pytest.mark.parametrize(
    ("action", "distance", "refused"),
    [("goto", 0.1, True), ("sync", 0.1, True), ("move", 4.9, False), ("move", 5.1, True), ("pulse", 0.1, False)],
)
def test_while_clock_or_site_are_in_doubt_a_mount_is_moved_by_five_degrees_at_most(action, distance, refused) -> None:
    asked = plan((10.0, 20.0), (10.0, 20.0 + distance), action, block_reason="Its clock is wrong.")
    assert said(policy.agreement, asked) == ("Its clock is wrong." if refused else "")
    assert not said(policy.agreement, replace(asked, block_reason=""))


@pytest.mark.parametrize(
    ("turn", "beside", "refused"),
    [(5.1, 4.9, True), (-5.1, 4.9, True), (4.9, 4.9, False), (5.1, 5.1, False), (0.0, 0.29, True), (0.0, 0.31, False)],
)
@pytest.mark.parametrize("pole", [1.0, -1.0])
def test_beside_the_pole_a_sync_turns_right_ascension_by_five_degrees_at_most(turn, beside, refused, pole) -> None:
    """Five degrees from it; where three tenths are left, a right ascension is no direction at all."""
    dec = pole * (90.0 - beside)
    found = said(policy.sync_step, plan((10.0, dec), (10.0 + turn, dec), "sync"))
    assert ("So near the pole" in found) is refused


# -- A slew from home ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("hour", "dec", "home"),
    [
        (10.0, 89.75, True),  # noise, whatever the hour angle
        (10.0, 89.65, False),  # it tracks beside the pole
        (109.0, 89.65, True),
        (111.0, 89.65, False),
        (-71.0, 89.65, True),
        (-69.0, 89.65, False),
        (90.0, 88.1, True),
        (90.0, 87.9, False),
        (-90.0, -88.1, True),
    ],
)
def test_home_is_two_degrees_about_the_pole_with_the_counterweight_down(hour, dec, home) -> None:
    state = replace(AWAKE, pier_side=PierSide.WEST)
    for target, leaves_at in ((30.0, 90.0), (-30.0, -90.0)):
        asked = plan(at(hour, dec), at(target, 40.0), state=state)
        leaving = policy.leaving_home(asked)
        assert leaving.from_home is home
        assert (leaving.state.pier_side is None) is home
        if home:
            assert hour_angle_deg(leaving.start_deg[0], SITE, NIGHT) == pytest.approx(leaves_at)
            assert 0.0 <= leaving.start_deg[0] < 360.0
            assert leaving.start_deg[1] == dec
        else:
            assert leaving == asked


@pytest.mark.parametrize(
    ("direction", "east", "north"),
    [
        (Direction.EAST, 8.0, 0.0),
        (Direction.WEST, -8.0, 0.0),
        (Direction.NORTH, 0.0, 8.0),
        (Direction.SOUTH, 0.0, -8.0),
    ],
)
def test_a_move_turns_one_axis_by_its_angle(direction, east, north) -> None:
    moved = policy.with_move(plan((100.0, 40.0), (100.0, 40.0), "move"), direction, 8.0)
    assert moved.target_deg == pytest.approx((100.0 + east, 40.0 + north))
    np.testing.assert_allclose(moved.paths[0][0], unit_vectors(100.0, 40.0))
