"""Tracking is stopped at the horizon, the hour angles and past the meridian, with no motion asked for."""

import itertools
import math
import re
from dataclasses import replace

import pytest

from kochab.core.errors import RefusedError
from kochab.core.mount import Ability, Home, MountState, PierSide, TrackingRate
from kochab.gear.mount_events import LimitReached, OrderDone
from kochab.gear.mount_line import MountLine
from kochab.gear.mounts import motion_policy
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from tests.gear.mounts.bench import SITE, place
from tests.gear.mounts.imaginary import at, guarded
from tests.gear.mounts.test_conformance import wait_for
from tests.gear.mounts.test_skywatcher_home import board

WEST_OF_PIER = MountState(slewing=False, parked=False, tracking=True, pier_side=PierSide.WEST)


def tracking(hour, dec, state=WEST_OF_PIER, **limits):
    """A guard whose mount tracks there."""
    guard, mount = guarded(hour, dec)
    guard.limits, mount.now = Limits(**limits), state
    return guard, mount


@pytest.mark.parametrize(
    ("hour", "dec", "limits", "why"),
    [
        (14.9, 20.0, {}, "15° past the meridian on the west side of the pier"),
        (100.0, 0.2, {"lowest_altitude_deg": 5.0, "crosses_meridian": True}, "the limit is 5°"),
        (44.9, 20.0, {"hour_angle_deg": (-60.0, 45.0), "crosses_meridian": True}, r"hour angle \+3.0 h"),
        (14.9, 20.0, {"highest_altitude_deg": 55.0, "crosses_meridian": True}, None),
        (-15.0, 40.0, {"highest_altitude_deg": 70.0, "crosses_meridian": True}, "upper limit of 70"),
    ],
)
def test_tracking_that_comes_to_a_limit_is_stopped(hour, dec, limits, why) -> None:
    guard, mount = tracking(hour, dec, **limits)
    reason = guard.hold_limits()
    if why is None:
        assert (reason, mount.did) == ("", [])
        return
    assert reason.startswith("Kochab stopped the tracking. ")
    assert re.search(why, reason), reason
    assert mount.did == [("track", TrackingRate.OFF)]
    assert guard.hold_limits() == "", "it does not track any more"
    with pytest.raises(RefusedError):
        guard.track(TrackingRate.SIDEREAL)
    assert mount.did == [("track", TrackingRate.OFF)]


@pytest.mark.parametrize(
    ("hour", "dec", "state"),
    [
        (14.0, 20.0, WEST_OF_PIER),
        (20.0, 20.0, replace(WEST_OF_PIER, tracking=False)),
        (20.0, 20.0, replace(WEST_OF_PIER, slewing=True)),
        (20.0, 20.0, replace(WEST_OF_PIER, parked=True)),
        (20.0, 20.0, replace(WEST_OF_PIER, home_confirmed=False)),
        (20.0, 20.0, replace(WEST_OF_PIER, pier_side=None)),
        (20.0, 20.0, replace(WEST_OF_PIER, pier_side=PierSide.EAST)),
        (-100.0, 1.0, replace(WEST_OF_PIER, pier_side=None)),  # low, but it rises
    ],
)
def test_tracking_within_its_limits_is_let_alone(hour, dec, state) -> None:
    guard, mount = tracking(hour, dec, state)
    assert guard.hold_limits() == ""
    assert mount.did == []


def test_without_a_site_nothing_is_known_and_nothing_stopped() -> None:
    guard, mount = tracking(20.0, 20.0)
    guard.site = None
    assert guard.hold_limits() == ""
    assert mount.did == []


def test_a_mount_whose_tracking_cannot_be_stopped_is_told_in_capitals() -> None:
    guard, mount = tracking(20.0, 20.0)
    mount.lacks[Ability.TRACKING] = "It cannot."
    assert guard.hold_limits().startswith("KOCHAB CAN'T STOP THIS MOUNT'S TRACKING")
    assert mount.did == []
    assert guard.log.entries[-1].outcome == "failed"
    mount.lacks.clear()
    mount.fails["track"] = RefusedError("Not now.")
    assert guard.hold_limits().startswith("KOCHAB CAN'T STOP THIS MOUNT'S TRACKING")
    assert mount.now.tracking is True


def test_a_motor_board_that_is_only_watched_stops_at_its_limit(monkeypatch) -> None:
    """The line polls, nobody orders anything: the simulated telescope stands afterwards."""
    monkeypatch.setattr("kochab.gear.mount_line.WATCH_S", 0.0)
    monkeypatch.setattr("kochab.gear.mount_line.POLL_S", 0.05)
    with board() as b:
        mount = b.connect(home=Home.NOW)
        mount.goto(*place(-0.5, 30.0, b.clock))
        wait_for(lambda: mount.state().slewing is False)
        wait_for(lambda: mount.state().tracking and b.telescope._rates[0] > 0.0)
        guard = Guard(mount, SITE, Limits(past_meridian_deg=-0.4), clock=b.clock)
        told = []
        line = MountLine(lambda: guard, told.append)
        steps = line.run()
        next(steps)
        wait_for(lambda: next(steps) and any(isinstance(word, LimitReached) for word in told))
        assert next(word.sentence for word in told if isinstance(word, LimitReached)).startswith("Kochab stopped")
        assert b.telescope._rates[0] == 0.0
        for _ in range(5):
            next(steps)
        assert b.telescope._rates[0] == 0.0, "it stays stopped"
        assert len([word for word in told if isinstance(word, LimitReached)]) == 1
        assert not any(isinstance(word, OrderDone) for word in told)
        steps.close()


def test_it_looks_a_minute_ahead() -> None:
    assert motion_policy.AHEAD_S == 60.0
    guard, mount = tracking(14.70, 20.0)
    assert guard.hold_limits() == ""
    mount.here = guarded(14.85, 20.0)[1].here
    assert guard.hold_limits()


# -- the horizon of the place -------------------------------------------------------------------

TREES = ((0.0, 20.0), (90.0, 20.0), (100.0, 60.0), (180.0, 60.0), (190.0, 10.0), (270.0, 35.0))


def altitude_and_azimuth(hour, dec):
    """By the formulas of any textbook, degrees; azimuth from north over east."""
    h, d, p = (math.radians(angle) for angle in (hour, dec, 50.0))
    up = math.sin(p) * math.sin(d) + math.cos(p) * math.cos(d) * math.cos(h)
    north = math.cos(p) * math.sin(d) - math.sin(p) * math.cos(d) * math.cos(h)
    return math.degrees(math.asin(up)), math.degrees(math.atan2(-math.cos(d) * math.sin(h), north)) % 360.0


@pytest.mark.parametrize(("hour", "dec"), [(hour, dec) for hour in range(-150, 151, 30) for dec in (-10, 10, 30, 50)])
def test_a_target_behind_a_tree_is_refused_and_one_above_it_is_not(hour, dec) -> None:
    guard, _ = guarded(hour, dec)
    guard.limits = Limits(horizon_deg=TREES, crosses_meridian=True)
    altitude, azimuth = altitude_and_azimuth(hour, dec)
    points = [*TREES, (360.0, 20.0)]
    below = max((one, other) for one, other in itertools.pairwise(points) if one[0] <= azimuth)
    share = (azimuth - below[0][0]) / (below[1][0] - below[0][0])
    tree = max(5.0, below[0][1] + share * (below[1][1] - below[0][1]))
    refusals = guard.preview_goto(*at(hour, dec)).refusals
    assert bool(refusals) is (altitude < tree), (altitude, azimuth, tree, refusals)
    if refusals:
        assert f"the limit is {tree:.3g}°" in refusals[0]


def test_a_path_behind_a_tree_is_refused_and_tracking_stops_at_it() -> None:
    wall = ((150.0, 0.0), (160.0, 70.0), (170.0, 0.0))
    limits = {"horizon_deg": wall, "crosses_meridian": True}
    guard, _ = tracking(-50.0, 20.0, **limits)
    assert "path would dip" in guard.preview_goto(*at(20.0, 20.0)).refusals[0]
    free, _ = tracking(-50.0, 20.0, crosses_meridian=True)
    assert free.preview_goto(*at(20.0, 20.0)).allowed
    hours = [hour / 4.0 for hour in range(-200, 0)]
    stopped = next(hour for hour in hours if tracking(hour, 20.0, **limits)[0].hold_limits())
    altitude, azimuth = altitude_and_azimuth(stopped, 20.0)
    assert altitude == pytest.approx(7.0 * (azimuth - 150.0), abs=4.0)


def test_how_long_it_may_track_on_is_told() -> None:
    assert tracking(0.0, 20.0)[0].tracking_left_s() == 4500.0
    assert tracking(-15.0, 20.0)[0].tracking_left_s() == 2 * 3600.0
    assert tracking(0.0, 20.0, replace(WEST_OF_PIER, tracking=False))[0].tracking_left_s() is None
    assert tracking(0.0, 85.0, crosses_meridian=True)[0].tracking_left_s() is None


# -- clock and site of the mount ----------------------------------------------------------------


@pytest.mark.parametrize("side", [PierSide.EAST, PierSide.WEST])
@pytest.mark.parametrize("hour", [90.0, -90.0])
def test_a_mount_at_home_may_begin_to_track_whatever_side_it_reports_there(hour, side) -> None:
    guard, mount = tracking(hour, 89.99, replace(WEST_OF_PIER, pier_side=side, tracking=False))
    guard.track(TrackingRate.SIDEREAL)
    assert mount.did == [("track", TrackingRate.SIDEREAL)]
