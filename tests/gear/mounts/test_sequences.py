"""A few of the random evenings, and that what watches over them sees what it is there for."""

import pytest

from kochab.core.mount import Direction
from tests.gear.mounts import sequences
from tests.gear.mounts.sequences import MOUNTS, NIGHT_UNIX, Evening, Plan, planned, play, simulated_time

TELL_NO_SIDE = ("lx200", "synscan", "gemini", "rainbow")


@pytest.mark.parametrize("seed", range(14))
def test_a_random_evening_keeps_every_rule(seed) -> None:
    evening = play(planned(seed))
    assert evening.violations == []
    assert evening.counts["Connected"] > 0


def test_an_evening_comes_out_the_same_again() -> None:
    one, other = (play(planned(5)) for _ in range(2))
    assert one.counts == other.counts
    assert one.telescope.orders == other.telescope.orders


@pytest.fixture(params=MOUNTS)
def evening(request, tmp_path):
    evening = Evening(Plan(0, request.param, 50.0, False), tmp_path)
    with simulated_time(evening.world):
        yield evening
        evening.disconnect()


def test_a_motion_below_the_limit_is_seen(evening) -> None:
    evening.telescope.mover = "kochab"
    evening.telescope.orders.append((NIGHT_UNIX, "kochab", "turn", ()))
    evening.telescope.turn_by_hand(0.0, 0.0)
    with evening.acting("kochab"):
        evening.telescope.turn_axis_to(1, -60.0)
        evening.telescope.turn_axis_to(0, 0.0)
    evening.world.pass_time(15.0)
    (found,) = evening.violations
    assert "deg high" in found


def test_another_program_may_do_so(evening) -> None:
    with evening.acting("other"):
        evening.telescope.turn_axis_to(1, -60.0)
        evening.telescope.turn_axis_to(0, 0.0)
    evening.world.pass_time(15.0)
    assert evening.violations == []


def test_weights_above_the_tube_are_seen_where_the_mount_tells_its_side(evening) -> None:
    evening.connect()
    with evening.acting("kochab"):
        evening.telescope.turn_axis_to(1, 75.0)
        evening.telescope.turn_axis_to(0, -30.0)
    evening.world.pass_time(15.0)
    assert bool(evening.violations) is (evening.plan.driver not in TELL_NO_SIDE)
    assert all("the weights" in found for found in evening.violations)


def test_tracking_below_the_limit_is_seen(evening) -> None:
    evening._may_hold = lambda now: True
    evening.telescope.place(75.0, -10.0)
    evening.telescope.tracking = True
    evening.world.pass_time(60.0)
    assert "it tracks at" in evening.violations[0]


def test_a_move_longer_than_told_and_one_after_a_stop_are_seen(evening) -> None:
    with evening.acting("kochab"):
        evening.telescope.move(Direction.SOUTH, 0.5)
    evening.told_until = evening.world.now() + 1.0
    evening.stopped_at = None
    evening.world.pass_time(5.0)
    assert "longer than told" in evening.violations[0]
    with evening.acting("kochab"):
        evening.telescope.move(Direction.NORTH, 0.5)
    evening.stopped_at = evening.world.now()
    evening.world.pass_time(1.0)
    assert "after a Stop" in evening.violations[1]


def test_an_order_that_nobody_asked_for_is_seen(tmp_path) -> None:
    evening = Evening(Plan(0, "ioptron", 50.0, False), tmp_path)
    with simulated_time(evening.world):
        evening.connect()
        evening.wire.write(b":mn#")
        evening.disconnect()
    assert "nobody asked for" in evening.violations[0]


def test_the_time_of_an_evening_is_that_of_its_waits() -> None:
    world, seen = sequences.World(NIGHT_UNIX), []
    world.at(0.3, lambda: seen.append(world.now() - NIGHT_UNIX))
    timer = world.timer(0.6, seen.append, ("timer",))
    timer.start()
    late = world.timer(0.7, seen.append, ("late",))
    late.start()
    late.cancel()
    world.pass_time(1.0)
    assert seen == [pytest.approx(0.3), "timer"]
    assert world.now() == NIGHT_UNIX + 1.0
