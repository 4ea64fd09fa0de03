"""Moves of the axis near the meridian: a German mount on its side of the pier, and others."""

from dataclasses import replace

import pytest

from kochab.core.errors import RefusedError
from kochab.core.mount import Direction, PierSide
from kochab.gear.mounts.motion_plan import Limits
from tests.gear.mounts.imaginary import guarded

EAST, WEST, NORTH = Direction.EAST, Direction.WEST, Direction.NORTH


def on_pier(side, hour_angle_deg, dec_deg=60.0, **limits):
    guard, mount = guarded(hour_angle_deg=hour_angle_deg, dec_deg=dec_deg, **limits)
    mount.now = replace(mount.now, pier_side=side)
    mount.rates_deg_s = (2.0,)
    return guard, mount


@pytest.mark.parametrize(
    ("side", "start", "way", "degrees"),
    [
        (PierSide.WEST, -10.0, WEST, 20.0),  # to 10 deg past the meridian
        (PierSide.WEST, -80.0, WEST, 60.0),
        (PierSide.WEST, -20.0, EAST, 60.0),
        (PierSide.EAST, 10.0, EAST, 20.0),
        (PierSide.EAST, 20.0, WEST, 60.0),
        (PierSide.WEST, 40.0, EAST, 60.0),  # too far already: it may come back
        (PierSide.EAST, -30.0, WEST, 45.0),
        (PierSide.WEST, -175.0, EAST, 15.0),  # under the pole
        (PierSide.WEST, 140.0, WEST, 20.0),  # too far under it: it may come back
        (PierSide.EAST, -140.0, EAST, 20.0),
        (None, -10.0, WEST, 60.0),  # perhaps a fork
    ],
)
def test_moves_that_stay_clear_of_the_pier(side, start, way, degrees):
    guard, mount = on_pier(side, start, dec_deg=80.0)
    guard.move(way, 2.0, degrees / 2.0)
    assert [did[0] for did in mount.did] == ["move"]


@pytest.mark.parametrize(
    ("side", "start", "way", "degrees", "past"),
    [
        (PierSide.WEST, -10.0, WEST, 60.0, "50° past"),
        (PierSide.EAST, 10.0, EAST, 60.0, "50° past"),
        (PierSide.WEST, 40.0, WEST, 20.0, "60° past"),
        (PierSide.WEST, -175.0, EAST, 60.0, "55° past"),
        (PierSide.EAST, 175.0, WEST, 60.0, "55° past"),
    ],
)
def test_moves_into_the_pier_are_refused(side, start, way, degrees, past):
    guard, mount = on_pier(side, start, dec_deg=80.0)
    with pytest.raises(RefusedError, match=past) as refused:
        guard.move(way, 2.0, degrees / 2.0)
    assert "--fork" in str(refused.value), "it may be a fork: where to say so"
    assert mount.did == []


def test_a_fork_and_the_declination_axis_go_on():
    fork, mount = on_pier(PierSide.WEST, -10.0, crosses_meridian=True)
    fork.move(WEST, 2.0, 20.0)
    german, other = on_pier(PierSide.WEST, -10.0, dec_deg=80.0)
    german.move(NORTH, 2.0, 8.0)  # over the pole: right ascension jumps, its axis does not turn
    assert mount.did
    assert other.did
    wide, third = on_pier(PierSide.WEST, -10.0, past_meridian_deg=60.0)
    wide.move(WEST, 2.0, 30.0)
    assert third.did
    assert Limits().past_meridian_deg == 15.0
