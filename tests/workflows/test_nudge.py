"""Nudges and "bring this star here", on the rig: the right way, the right amount, within bounds."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import wrapped
from kochab.core.errors import RefusedError, StoppedError, StrayedError
from kochab.core.mount import Ability, Direction
from kochab.core.progress import run
from kochab.gear.mounts.motion_plan import Limits
from kochab.sky.apparent import of_date_matrix
from kochab.workflows.nudge import ENDS, RUNS_ON, bring_here, nudge, turn_to_bring
from tests.simulate.failing_axis import AxisFailure, fail
from tests.workflows.mount_nights import SOUTH, bench, good, worn


def moved_arcsec(b, do):
    """How far the telescope went on the sky, towards east (of the axis) and north."""
    before = b.rig.truth().of_date_deg
    result = run(do)
    after = b.rig.truth().of_date_deg
    return result, wrapped(after[0] - before[0]) * 3600.0, (after[1] - before[1]) * 3600.0


@pytest.mark.parametrize("direction", Direction)
@pytest.mark.parametrize(("amount", "by"), [(20.0, "guide pulses"), (80.0, "guide pulses"), (600.0, "moves")])
def test_a_nudge_goes_its_way_as_far_as_asked(direction, amount, by) -> None:
    b = bench(good(lost_deg=0.0))
    nudged, east, north = moved_arcsec(b, nudge(b.guard, direction, amount, b.wait))
    assert nudged.by == by
    along = {"north": north, "south": -north, "east": east, "west": -east}[direction.value]
    across = east if direction.in_dec else north
    assert along == pytest.approx(amount, rel=0.1, abs=2.0)
    assert abs(across) < 4.0


def test_a_mount_without_pulses_moves_instead() -> None:
    b = bench(good(lost_deg=0.0))
    b.mount.lacks = {Ability.PULSE: "It has none."}
    nudged, _, north = moved_arcsec(b, nudge(b.guard, Direction.NORTH, 30.0, b.wait))
    assert nudged.by == "moves"
    assert north == pytest.approx(30.0, abs=3.0)


def alone(b, ends_alone):
    b.mount.ends_alone = ends_alone
    return b


@pytest.mark.parametrize("direction", Direction)
def test_a_mount_that_does_not_end_a_move_itself_goes_there(direction) -> None:
    """A crash leaves a move running, never a goto."""
    b = alone(bench(good(lost_deg=0.0, start=(-60.0, 40.0))), False)
    task = nudge(b.guard, direction, 600.0, b.wait)
    assert next(task).detail == ENDS, "told before it moves"
    assert b.mount.did == []
    nudged, east, north = moved_arcsec(b, task)
    assert nudged.by == "a goto"
    assert {"north": north, "south": -north, "east": east, "west": -east}[direction.value] == pytest.approx(600, abs=5)
    assert [did[0] for did in b.mount.did] == ["goto"]


@pytest.mark.parametrize("amount", [60.0, 600.0])
def test_a_fork_in_alt_azimuth_goes_there_because_its_axes_are_not_those_of_the_sky(amount) -> None:
    """A pulse or a move of its upper axis would go up, not north."""
    b = alone(bench(good(lost_deg=0.0, start=(-60.0, 40.0))), True)
    state = b.mount.state
    b.mount.state = lambda: replace(state(), alt_azimuth=True)
    nudged, _, north = moved_arcsec(b, nudge(b.guard, Direction.NORTH, amount, b.wait))
    assert nudged.by == "a goto"
    assert north == pytest.approx(amount, abs=5)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda b: b.mount.lacks.update({Ability.GOTO: "It cannot."}),
        lambda b: setattr(b.guard.policy, "slew_block_reason", "Its clock was set."),
        lambda b: setattr(b.guard, "limits", Limits(crosses_meridian=False)),
        lambda b: setattr(b.rig.mount, "tracking", False),
    ],
    ids=["no goto", "clock in doubt", "followed past the meridian", "stands"],
)
def test_where_no_goto_may_go_it_moves_and_tells_that_it_would_run_on(spoil) -> None:
    b = alone(bench(good(lost_deg=0.0, start=(5.0, 40.0))), False)
    spoil(b)
    told = [p.detail for p in nudge(b.guard, Direction.NORTH, 600.0, b.wait)]
    assert all(RUNS_ON in detail for detail in told)
    assert [did[0] for did in b.mount.did] == ["move"]
    b = bench(good(lost_deg=0.0))
    assert not any(RUNS_ON in p.detail for p in nudge(b.guard, Direction.NORTH, 600.0, b.wait))


def test_pulses_and_moves_are_renewed_within_a_second() -> None:
    b = bench(good(lost_deg=0.0))
    run(nudge(b.guard, Direction.NORTH, 60.0, b.wait))
    run(nudge(b.guard, Direction.NORTH, 5.0 * 3600.0, b.wait))
    assert max(did[2] for did in b.mount.did if did[0] == "pulse") <= 1000
    moves = [did[2] * did[3] for did in b.mount.did if did[0] == "move"]
    assert max(moves) <= 2.0
    assert sum(moves) == pytest.approx(5.0, abs=0.01)


@pytest.mark.parametrize("amount", [20.0, 600.0])
def test_a_stop_before_the_first_word_lets_no_nudge_begin(amount) -> None:
    b = bench(good(lost_deg=0.0))
    task = nudge(b.guard, Direction.NORTH, amount, b.wait)
    next(task)
    b.guard.stop()
    with pytest.raises(StoppedError):
        next(task)
    assert [did for did in b.mount.did if did[0] in ("move", "pulse")] == []


@pytest.mark.parametrize("amount", [20.0, 600.0])
def test_after_a_slew_that_strayed_a_nudge_leads_away(amount) -> None:
    b = bench(good(lost_deg=0.0))
    fail(b.rig.mount, 1, AxisFailure.SWAPPED)
    with pytest.raises(StrayedError):
        run(b.guard.slew(*b.guard.to_mount(*b.place(-15.0, 25.0))))
    fail(b.rig.mount, 1, None)
    b.rig.clock.step(3.0)  # it brakes
    run(nudge(b.guard, Direction.NORTH, amount, b.wait))
    assert b.mount.did[-1][0] in ("pulse", "move")


def test_a_chosen_rate_is_one_move_that_the_guard_bounds() -> None:
    b = bench(good(lost_deg=0.0))
    nudged, _, north = moved_arcsec(b, nudge(b.guard, Direction.NORTH, 30.0, b.wait, rate_deg_s=0.1))
    assert nudged.by == "one move of 0.1 s"
    assert north == pytest.approx(30.0, abs=6.0)
    with pytest.raises(RefusedError):
        run(nudge(b.guard, Direction.NORTH, 3600.0, b.wait, rate_deg_s=0.001))
    assert len([did for did in b.mount.did if did[0] == "move"]) == 1


def test_too_little_is_nothing_and_too_much_is_refused() -> None:
    b = bench()
    assert run(nudge(b.guard, Direction.NORTH, 0.1, b.wait)).by == "nothing"
    with pytest.raises(RefusedError, match="Use goto instead"):
        run(nudge(b.guard, Direction.NORTH, 100.0 * 3600.0, b.wait))
    assert [did for did in b.mount.did if did[0] in ("move", "pulse")] == []


def test_long_pulses_are_cut_into_what_the_guard_allows() -> None:
    b = bench(good(lost_deg=0.0), longest_pulse_ms=600)
    run(nudge(b.guard, Direction.NORTH, 60.0, b.wait))
    pulses = [did[2] for did in b.mount.did if did[0] == "pulse"]
    assert max(pulses) <= 600
    assert sum(pulses) == pytest.approx(60.0 / 7.52 * 1000.0, rel=0.01)


def test_the_guard_bounds_a_nudge_towards_the_ground() -> None:
    b = bench(good(lost_deg=0.0, start=(-40.0, -28.0)))  # some 6 deg high
    with pytest.raises(RefusedError, match="the limit is 5°"):
        run(nudge(b.guard, Direction.SOUTH, 4.0 * 3600.0, b.wait))
    assert not [did for did in b.mount.did if did[0] == "move"]


def test_cancelled_it_stops() -> None:
    b = bench()
    task = nudge(b.guard, Direction.NORTH, 600.0, b.wait)
    for _ in range(4):
        next(task)
    task.close()
    assert b.mount.did[-1] == ("stop",)


def test_a_persons_stop_between_pulses_ends_it() -> None:
    b = bench()
    task = nudge(b.guard, Direction.NORTH, 80.0, b.wait)
    next(task)
    next(task)
    b.guard.stop()
    with pytest.raises(StoppedError):
        run(task)
    assert len([did for did in b.mount.did if did[0] == "pulse"]) == 1


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("site", [worn(0).site, SOUTH])
@pytest.mark.parametrize("star", [(800.0, 500.0), (200.0, 900.0), (1100.0, 60.0)])
def test_a_clicked_star_comes_to_the_middle(side, site, star) -> None:
    b = bench(worn(5, side, site))
    solved = run(b.solve_now())
    sky = solved.sky_at(np.array([star]))[0]
    run(bring_here(b.guard, solved, star, wait=b.wait))
    after = run(b.solve_now())
    x, y = after.pixels_of(sky[None])[0]
    off = np.hypot(x - 639.5, y - 479.5)
    far = np.hypot(star[0] - 639.5, star[1] - 479.5)
    assert off < 12.0 + 0.06 * far  # play, and an axis beside the pole


def test_a_star_comes_to_any_pixel() -> None:
    b = bench(good(lost_deg=0.0))
    solved = run(b.solve_now())
    sky = solved.sky_at(np.array([(300.0, 300.0)]))[0]
    run(bring_here(b.guard, solved, (300.0, 300.0), (900.0, 700.0), b.wait))
    x, y = run(b.solve_now()).pixels_of(sky[None])[0]
    assert np.hypot(x - 900.0, y - 700.0) < 4.0


def test_the_turn_is_exact_for_a_mount_without_fault() -> None:
    """Turned about the pole of date and the axis square to it, the star is seen where wanted."""
    b = bench(good(lost_deg=0.0))
    solved = run(b.solve_now())
    date = of_date_matrix(b.guard.clock())
    turn = turn_to_bring(date, solved, (100.0, 100.0), (1200.0, 900.0))
    star = date @ solved.sky_at(np.array([(100.0, 100.0)]))[0]
    look = solved.attitude.matrix @ date.T
    east, north = np.radians([turn.east_deg, turn.north_deg])
    z = np.array([[np.cos(east), -np.sin(east), 0], [np.sin(east), np.cos(east), 0], [0, 0, 1]])
    ra = np.arctan2(look[2][1], look[2][0])
    along = np.array([[np.cos(ra), -np.sin(ra), 0], [np.sin(ra), np.cos(ra), 0], [0, 0, 1]])
    c, s = np.cos(north), np.sin(north)
    up = along @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) @ along.T
    seen = solved.camera.project(((look @ (z @ up).T) @ star)[None])[0]
    np.testing.assert_allclose(seen, (1200.0, 900.0), atol=0.05)


def test_bringing_is_cancelled_by_a_stop() -> None:
    b = bench(good(lost_deg=0.0))
    solved = run(b.solve_now())
    task = bring_here(b.guard, solved, (100.0, 100.0), wait=b.wait)
    for _ in range(3):
        next(task)
    task.close()
    assert b.mount.did[-1] == ("stop",)
