"""A spiral around a place: each place once, every step small, all through the guard, and stopped at any time."""

import numpy as np
import pytest

from kochab.core.attitude import apart_deg
from kochab.core.errors import RefusedError, StoppedError
from kochab.core.progress import run
from kochab.gear.mounts.guard import Guard
from kochab.workflows.spiral_search import spiral_search, square_spiral
from tests.gear.mounts.bench import LIMITS, SITE, START, place
from tests.gear.mounts.imaginary import Imaginary

STEP_DEG = 0.25


def night():
    return START


def search(dec_deg=40.0, hour_angle_deg=-20.0):
    mount = Imaginary(*place(hour_angle_deg, dec_deg, night), slew_deg_s=1e6)
    return mount, Guard(mount, SITE, LIMITS, clock=night, wait=lambda s: None)


@pytest.mark.parametrize("turns", [1, 2, 5])
def test_a_spiral_comes_to_every_place_once_in_steps_to_a_neighbour(turns) -> None:
    places = square_spiral(turns)
    wide = range(-turns, turns + 1)
    assert sorted(places) == sorted((e, n) for e in wide for n in wide if (e, n) != (0, 0))
    for one, after in zip([(0, 0), *places], places, strict=False):
        assert abs(one[0] - after[0]) + abs(one[1] - after[1]) == 1
    rings = [max(map(abs, p)) for p in places]
    assert rings == sorted(rings), "the nearer ring first"


@pytest.mark.parametrize("dec_deg", [0.0, 40.0, 75.0])
def test_the_steps_on_the_sky_are_as_long_as_asked_and_around_where_it_was(dec_deg) -> None:
    mount, guard = search(dec_deg)
    start = mount.here
    run(spiral_search(guard, STEP_DEG, 2, 0.0, wait=lambda s: None))
    went = [(e.detail["ra_deg"], e.detail["dec_deg"]) for e in guard.log.sent("goto")]
    assert len(went) == 24
    for one, after in zip([start, *went], went, strict=False):
        assert apart_deg(one, after) == pytest.approx(STEP_DEG, rel=0.06)
    assert max(apart_deg(start, one) for one in went) < 2.9 * STEP_DEG
    for (east, north), (ra, dec) in zip(square_spiral(2), went, strict=True):
        across = ((ra - start[0] + 180.0) % 360.0 - 180.0) * np.cos(np.radians(start[1])) / STEP_DEG
        assert (across, (dec - start[1]) / STEP_DEG) == pytest.approx((east, north), abs=0.05)


def test_a_stop_ends_it_where_it_is() -> None:
    _, guard = search()
    task = spiral_search(guard, STEP_DEG, 2, 1.0, wait=lambda s: None)
    while len(guard.log.sent("goto")) < 3:
        next(task)
    guard.stop()
    with pytest.raises(StoppedError):
        run(task)
    assert len(guard.log.sent("goto")) == 3


def test_the_guard_refuses_a_step_below_the_limit() -> None:
    _, guard = search(-34.8, -1.0)  # 5.2 deg high
    with pytest.raises(RefusedError, match="the limit is 5°"):
        run(spiral_search(guard, STEP_DEG, 2, 0.0, wait=lambda s: None))
    assert all(e.detail["dec_deg"] > -35.01 for e in guard.log.sent("goto"))


@pytest.mark.parametrize(("step_deg", "turns", "dec_deg"), [(2.0, 5, 40.0), (0.1, 1, 89.5)])
def test_a_wide_one_or_one_beside_the_pole_is_refused_before_it_begins(step_deg, turns, dec_deg) -> None:
    _, guard = search(dec_deg)
    with pytest.raises(RefusedError, match="not beside a pole"):
        run(spiral_search(guard, step_deg, turns, 0.0, wait=lambda s: None))
    assert not guard.log.sent("goto")
