"""The evenings see what goes wrong: each kind of violation, done to a board without any guard."""

import pytest

from kochab.core.errors import KochabError
from tests.boards import BOARDS, served, virtual_time
from tests.boards.evenings import Astronomer, Hangs, spend
from tests.boards.sky import sidereal_deg


@pytest.fixture(params=[kind for kind in BOARDS if kind != "skywatcher"])
def astronomer(request):
    """Somebody with no guard, whose tube is well up."""
    with virtual_time() as time, served(request.param, time=time, slew_deg_s=30.0, acceleration_deg_s2=60.0) as board:
        board.align(-40.0, 40.0)
        someone = Astronomer(request.param, 1, time=time)
        someone.board = board
        yield someone


def seen(astronomer):
    return {kind for kind, _ in astronomer.evening.violations}


def bare_goto(board, hour_angle_deg, dec_deg):
    """Straight to the motors."""
    with board.lock:
        board.target_deg = [sidereal_deg(board.clock.unix(), 8.0) - hour_angle_deg, dec_deg]
        board.goto()


def rests(board):
    while board.moving:
        board.timing.sleep(0.05)


def test_a_slew_below_the_horizon_from_a_false_home_is_seen_as_both(astronomer):
    board = astronomer.board
    board.boot_s = 0.0
    board.cut_power(0.0)

    def go():
        bare_goto(board, -60.0, 10.0)
        rests(board)

    assert astronomer._do("goto", go) is True
    assert {"false", "low"} <= seen(astronomer)


def test_a_home_that_lost_its_power_and_is_called_done_is_seen(astronomer):
    board = astronomer.board
    board.boot_s = 0.0
    board.tube.axes[0].top_deg_s = board.tube.axes[1].top_deg_s = 1.0

    def home():
        board.go_home()
        board.timing.sleep(0.5)
        board.cut_power(0.0)

    astronomer._mishap = lambda: None
    astronomer._slews("home", home, None)
    assert seen(astronomer) == {"done"}


def test_an_end_without_a_word_of_the_restart_is_seen(astronomer):
    board = astronomer.board
    board.boot_s = 0.0
    board.tube.axes[0].top_deg_s = board.tube.axes[1].top_deg_s = 1.0

    def slew(words):
        with board.lock:
            board.align(-40.0, 40.0)
        bare_goto(board, -10.0, 40.0)
        board.timing.sleep(0.3)
        board.cut_power(0.0)
        with board.lock:
            board.transcript.append((board.clock.unix(), "<", b"#"))
        raise KochabError(words)

    astronomer._mishap = lambda: None
    astronomer._slews("goto", lambda: slew("The mount was switched off and on."), None)
    assert seen(astronomer) == set()
    astronomer._slews("goto", lambda: slew("The mount stopped 58 deg from its target."), None)
    assert seen(astronomer) == {"word"}


def test_a_motion_that_outlives_its_session_is_seen(astronomer, monkeypatch):
    monkeypatch.setattr("tests.boards.evenings.RUNS_OUT_S", 0.5)
    board = astronomer.board
    board.tube.axes[0].top_deg_s = board.tube.axes[1].top_deg_s = 1.0

    class Careless:
        def see_stopped(self):
            """It says that it stands."""

        def close(self):
            """And leave it running."""

    astronomer.guard = Careless()
    bare_goto(board, 0.0, 40.0)
    astronomer._disconnect()
    assert seen(astronomer) == {"running"}


def test_the_sun_a_hang_and_a_traceback_are_seen(astronomer, monkeypatch):
    monkeypatch.setattr("tests.boards.evenings.IDLE_S", 0.3)
    monkeypatch.setattr("tests.boards.evenings.HANG_S", 1.0)
    monkeypatch.setattr("tests.boards.board.Board.nearest_sun_deg", lambda board, since: 20.0)
    astronomer._do("nothing", lambda: None)
    assert seen(astronomer) == {"sun"}
    astronomer._do("fault", lambda: 1 / 0)
    assert seen(astronomer) == {"sun", "fault"}
    with pytest.raises(Hangs):
        astronomer._do("hang", lambda: astronomer.time.sleep(5.0))
    assert seen(astronomer) == {"sun", "fault", "hang"}


RICH_SEEDS = (4, 5, 8)
"""Of the first eight evenings those that cut the power of each board five times and more."""


@pytest.mark.parametrize("kind", BOARDS)
def test_evenings_with_power_cuts_hold(kind, monkeypatch):
    """Five of the boards slewed from a false home before the guard watched for restarts."""
    monkeypatch.setenv("KOCHAB_CONFIG", "")  # whatever it sets itself is put back
    evenings = [spend(kind, seed) for seed in RICH_SEEDS]
    assert sum(evening.cuts for evening in evenings) >= 5
    assert not any(evening.violations for evening in evenings), "\n".join(
        line for evening in evenings if evening.violations for line in evening.diary
    )


def test_an_evening_by_the_computers_clock_on_a_line_of_the_system_holds(monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", "")
    evening = spend("onstep", 6, orders=5, where="real time")
    assert evening.cuts
    assert not evening.violations, "\n".join(evening.diary)


def test_a_seed_repeats_its_evening(monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", "")
    first, again = (spend("am5", 1) for _ in range(2))
    assert [line.split("board://")[0] for line in first.diary] == [line.split("board://")[0] for line in again.diary]


@pytest.mark.parametrize("seed", [21261, 90191])
def test_two_nexstar_evenings_that_ended_near_the_sun_and_below_the_limit_are_quiet(seed):
    """A goto whose braking was forgotten; and key 9, which on a board faster than any mount of Celestron's ran too far."""
    assert spend("nexstar", seed, 10, "").violations == []
