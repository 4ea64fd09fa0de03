"""A nudge on boards that lose the bytes that end it."""

import pytest

from kochab.core.errors import DeviceError
from kochab.core.mount import SIDEREAL_DEG_S, Direction
from kochab.core.progress import run
from kochab.gear.session import Meridian, MountSelection, guarded, limits_at
from kochab.workflows.nudge import nudge
from tests.boards import SITE, served, virtual_time


@pytest.fixture(params=["onstep", "onstepx", "am5", "ioptron", "nexstar"])
def nudged(request):
    """A board, and its guard."""
    with virtual_time() as time, served(request.param, time=time) as board:
        board.align(-20.0, 40.0)
        selection = MountSelection(board.port, board.driver)
        with guarded(selection, SITE, clock=board.clock, limits=limits_at(Meridian.FLIPS)) as guard:
            yield board, guard


def south(guard):
    return run(nudge(guard, Direction.SOUTH, 1800.0, rate_deg_s=0.5))


def test_a_nudge_whose_end_is_lost_is_stopped(nudged):
    board, guard = nudged
    board.lose_stops(1)
    south(guard)
    assert not board.moving


@pytest.mark.parametrize("nudged", ["ioptron", "nexstar"], indirect=True)
def test_a_stop_without_its_answer_is_sent_again_before_the_tube_is_far(nudged):
    """An answer was waited for 4.5 s, in which a nudge at 6 deg/s ran on by 27 deg."""
    board, guard = nudged
    begun = board.radec_deg()[1]
    board.lose_stops(1)
    run(nudge(guard, Direction.SOUTH, 21600.0, rate_deg_s=4.0))
    assert not board.moving
    assert 5.0 < begun - board.radec_deg()[1] < 20.0


def test_a_nudge_in_ra_at_the_pole_whose_end_is_lost_is_stopped(nudged):
    """Where the sky does not move: the axis does, and so does the right ascension that it tells."""
    board, guard = nudged
    board.align(-60.0, 90.0)
    begun = board.tube.axes[0].at_deg
    board.lose_stops(1)
    run(nudge(guard, Direction.EAST, 1800.0, rate_deg_s=0.5))
    assert abs(board.tube.axes[0].at_deg - begun) > 0.2
    assert not board.moving


def test_a_slow_nudge_whose_end_is_lost_is_seen_to_run_on(nudged):
    """At eight times the sidereal rate an RA axis at 75 deg of Dec crosses the sky at twice that rate."""
    board, guard = nudged
    board.align(-20.0, 75.0)
    board.lose_stops(1)
    run(nudge(guard, Direction.WEST, 120.0, rate_deg_s=8.0 * SIDEREAL_DEG_S))
    assert not board.moving


@pytest.mark.parametrize("direction", [Direction.WEST, Direction.NORTH])
def test_a_session_ends_only_when_the_mount_is_seen_to_follow_the_sky(nudged, direction):
    """After a move that nobody saw the end of: the bytes that ended it were lost, and later it was called over."""
    board, guard = nudged
    board.align(-20.0, 59.987)
    guard.move(direction, 0.5, 0.2)
    board.timing.sleep(4.0)
    axis = 1 if direction is Direction.NORTH else 0
    board.move(axis, 8.0 * SIDEREAL_DEG_S)
    assert not guard.emergency.moving
    assert "ran on" in guard.see_stopped()
    assert not board.moving
    assert guard.see_stopped() == ""


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("multiple", [0.5, 2.0, 8.0])
def test_a_stop_tells_of_what_ran_on(nudged, axis, multiple):
    """Also at a guide rate: nobody has told this program how fast it moves, nor who moves it."""
    board, guard = nudged
    board.align(-20.0, 59.987)
    guard.stop()
    board.move(axis, multiple * SIDEREAL_DEG_S)
    assert "ran on" in guard.emergency.confirm()
    assert not board.moving
    guard.stop()
    assert guard.emergency.confirm() == ""


def test_a_nudge_that_cannot_be_ended_is_told(nudged):
    board, guard = nudged
    board.lose_stops(1000)
    with pytest.raises(DeviceError, match=r"CUT ITS POWER|cut its power"):
        south(guard)
    board.lose_stops(0)
    guard.stop()
