"""The supply of a mount fails while its port stays open: boards that share nothing with the drivers."""

import gc
import subprocess
import sys
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial

import pytest

from kochab.core.errors import DeviceError
from kochab.core.mount import Ability, Direction
from kochab.core.progress import run
from kochab.gear.mount_events import StandsStill, StopFailed
from kochab.gear.mount_line import MountLine
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.sync_needed import SyncNeeded
from kochab.workflows.nudge import nudge
from tests.boards import Night, served, virtual_time
from tests.boards.sky import sidereal_deg

FORGETS = ("onstep", "onstepx", "am5", "ioptron")


@pytest.fixture(params=FORGETS)
def board(request):
    """Aligned, tracking, well up in the east; its clock has a battery, so that it alone tells nothing."""
    with virtual_time() as time, served(request.param, time=time, slew_deg_s=4.0, keeps_clock=True) as one:
        one.align(-50.0, 40.0)
        yield one


@pytest.fixture
def guard(board):
    mount = open_mount(board.driver, board.port, site=board.site, clock=board.clock)
    with Guard(mount, board.site, Limits(crosses_meridian=True), clock=board.clock) as one:
        yield one


def place(board, hour_angle_deg, dec_deg):
    return (sidereal_deg(board.clock.unix(), board.site.longitude_deg) - hour_angle_deg) % 360.0, dec_deg


def said(order):
    """What an order that has to fail says."""
    with pytest.raises(DeviceError) as told:
        order()
    return str(told.value)


def cut_when_it_moves(board):
    """Cut its power half a second after its motors have begun."""

    def cut():
        while not board.moving:
            board.timing.sleep(0.05)
        board.timing.sleep(0.5)
        board.cut_power(0.5)

    return board.timing.start(cut)


def test_a_mount_that_lost_its_power_between_two_orders_is_not_slewed_from_its_false_home(board, guard) -> None:
    """One answer is missed, or none: then it is at home for all it says."""
    guard.preview_goto(*place(board, -30.0, 50.0))
    board.cut_power(0.5)
    for _ in range(3):
        with pytest.raises(DeviceError):
            run(guard.slew(*place(board, -30.0, 50.0)))
    assert "Sync first" in said(lambda: guard.goto(*place(board, -30.0, 50.0)))
    assert [order.kind for order in board.orders if order.kind == "goto"] == []


def test_home_is_not_done_by_a_mount_that_was_found_to_be_restarted_before(board, guard) -> None:
    """It takes itself to be there, and does not move."""
    guard.position()
    board.cut_power(0.5)
    board.timing.sleep(5.0)
    guard.position()
    ended = said(lambda: run(guard.rest("home")))
    assert "says that it is home" in ended
    assert "Sync first" in ended
    guard.clock_and_site.trust()
    run(guard.rest("home"))


def test_a_clock_that_could_not_be_asked_in_a_silence_is_asked_after_it(board, guard) -> None:
    """After two missed answers it counted as a mount without a clock, and slewed 25 deg wrong by a clock of the year 2000."""
    board.keeps_clock = False
    board.align(-90.0, 90.0)  # at its home, where a restart takes nothing but the clock
    board.cut_power(100.0)
    for _ in range(3):
        with pytest.raises(DeviceError):
            guard.goto(*place(board, -30.0, 50.0))
    board.timing.sleep(100.0)
    with suppress(DeviceError):
        guard.goto(*place(board, -30.0, 50.0))
    assert bool(guard.policy.clock_conflict) is (abs(board.clock_error_s) > 600.0)


def test_a_mount_that_wakes_parked_in_a_slew_is_said_to_have_been_restarted(board, guard) -> None:
    if board.driver != "onstep":
        pytest.skip("the others do not wake parked where they believe to be at home")
    board.saved["parked"] = True  # in its memory, from an evening before
    cutting = cut_when_it_moves(board)
    assert "switched off and on" in said(lambda: run(guard.slew(*place(board, -10.0, 40.0))))
    board.timing.join(cutting)


def test_a_restart_that_no_question_met_is_seen_before_its_clock_is_set(board, guard) -> None:
    """The comparison began anew with a clock that the mount then refused to take."""
    guard.preview_goto(*place(board, -30.0, 50.0))
    board.cut_power(0.5)
    board.timing.sleep(10.0)
    with suppress(DeviceError):
        guard.set_clock()
    assert "Sync first" in said(lambda: guard.goto(*place(board, -30.0, 50.0)))
    assert not board.false_slews()


def test_after_a_restart_clock_and_site_are_compared_again_though_nothing_was_missed(board, guard) -> None:
    guard.preview_goto(*place(board, -30.0, 50.0))
    board.keeps_clock = False
    board.cut_power(0.5)
    board.timing.sleep(10.0)
    guard.position()
    said(lambda: guard.goto(*place(board, -30.0, 50.0)))
    # An OnStepX wakes with the date that it was set to.
    assert bool(guard.policy.clock_conflict) is (abs(board.clock_error_s) > 600.0)


def test_a_slew_in_which_the_power_failed_ends_with_a_word_of_the_restart(board, guard) -> None:
    cutting = cut_when_it_moves(board)
    ended = said(lambda: run(guard.slew(*place(board, -10.0, 40.0))))
    board.timing.join(cutting)
    if "Sync first" not in ended:  # it was silent to the end: the next question tells
        ended = said(lambda: guard.goto(*place(board, -30.0, 50.0)))
    assert "switched off and on" in ended
    assert not board.false_slews()


@pytest.mark.parametrize(("off_s", "word"), [(8.0, "Sync first"), (60.0, "CUT ITS POWER")])
def test_a_slew_that_ends_in_silence_tells_of_the_power(off_s, word, board, guard) -> None:
    """Three answers are missed, and Stop is sent; one that is back by then says where it takes itself to be."""
    board.timing.Timer(2.0, lambda: board.cut_power(off_s)).start()
    ended = said(lambda: run(guard.slew(*place(board, -10.0, 40.0))))
    assert word in ended
    assert "power" in ended or "switched off and on" in ended
    board.timing.sleep(off_s)
    assert "Sync first" in said(lambda: guard.goto(*place(board, -30.0, 50.0)))
    assert not board.false_slews()


def test_a_mount_that_says_for_a_minute_that_it_parks_and_stands_is_not_waited_for(guard, board) -> None:
    if board.driver != "onstep":
        pytest.skip("the others say that they move only while they do")
    begun = board.timing.monotonic()
    stuck = board.timing.Timer(2.0, lambda: setattr(board, "going", "") or [axis.stop() for axis in board.tube.axes])
    stuck.start()
    assert "stood still for 60 s" in said(lambda: run(guard.rest("park")))
    assert board.timing.monotonic() - begun < 90.0


@pytest.mark.parametrize("action", ["home", "park"])
def test_rest_is_not_done_by_a_mount_whose_power_failed_on_the_way(action, board, guard) -> None:
    if Ability(action if action == "park" else "go home") in guard.lacks:
        pytest.skip("it has no such command that Kochab knows")
    cutting = cut_when_it_moves(board)
    ended = said(lambda: run(guard.rest(action)))
    board.timing.join(cutting)
    assert board.false_by_deg() > 5.0
    assert guard.policy.slew_block_reason or "did not answer" in ended
    assert "switched off and on" in said(lambda: guard.goto(*place(board, -30.0, 50.0)))
    assert not board.false_slews()


def test_a_restart_that_one_command_saw_forbids_the_slew_of_the_next(board, tmp_path) -> None:
    """Every `kochab mount` is a program of its own, and this mount's clock and site give nothing away."""

    def command():
        mount = open_mount(board.driver, board.port, site=board.site, clock=board.clock)
        needed = SyncNeeded.of_line(board.clock, tmp_path, f"{board.driver} {board.port}")
        return Guard(mount, board.site, Limits(crosses_meridian=True), clock=board.clock, needed=needed)

    with command() as first:
        first.preview_goto(*place(board, -30.0, 50.0))
        board.cut_power(0.5)
        for _ in range(3):
            with pytest.raises(DeviceError):
                run(first.slew(*place(board, -30.0, 50.0)))
    with command() as second:
        assert "Sync first" in said(lambda: second.goto(*place(board, -30.0, 50.0)))
        assert not board.false_slews()
        second.clock_and_site.trust()  # what --trust-mount does
    assert list(tmp_path.iterdir()) == []


def test_a_mount_that_woke_up_and_was_nudged_cannot_be_synced_either(board, guard) -> None:
    """Three degrees from its home it no longer says that it is there, and no sync tells the side of its pier."""
    guard.position()
    board.cut_power(0.5)
    board.timing.sleep(20.0)
    guard.position()
    assert "Sync first" in guard.policy.slew_block_reason
    guard.limits = Limits()
    for _ in range(40):
        if guard.position().dec_deg < 87.5:
            break
        run(nudge(guard, Direction.SOUTH, 3600.0, rate_deg_s=1.0))
    assert 80.0 < guard.position().dec_deg < 88.0
    guard.allow_large_sync = True
    told = said(lambda: guard.sync(*board.radec_deg(), by_hand=True, confirmed=True))
    assert "can't set the pier side" in told


# -- The end of a session ----------------------------------------------------------------------


def goes(board, guard):
    """A slew that nobody waits for, under way."""
    guard.goto(*place(board, -10.0, 40.0))
    while not board.moving:
        guard.state()


def stands(board):
    """It has been seen to stand: its motors do not run."""
    return not board.moving


def test_a_session_that_ends_in_a_slew_repeats_a_stop_that_was_lost(board, guard) -> None:
    goes(board, guard)
    board.lose_stops(1 if board.driver != "ioptron" else 3)  # its Stop is three commands
    guard.close()
    assert stands(board)


def test_a_block_that_ends_in_a_slew_repeats_a_stop_that_was_lost(board) -> None:
    """As every command ends."""
    mount = open_mount(board.driver, board.port, site=board.site, clock=board.clock)
    with Guard(mount, board.site, Limits(crosses_meridian=True), clock=board.clock) as one:
        goes(board, one)
        board.lose_stops(1)
    assert stands(board)


@pytest.mark.parametrize(("lost", "told"), [(1, ""), (1000, "CUT ITS POWER")])
def test_a_guard_that_is_dropped_in_a_slew_sees_its_stop_through(lost, told, board, capsys) -> None:
    gc.freeze()  # what thousands of tests have left takes half a second to look through
    mount = open_mount(board.driver, board.port, site=board.site, clock=board.clock)
    guard = Guard(mount, board.site, Limits(crosses_meridian=True), clock=board.clock)
    goes(board, guard)
    for axis in board.tube.axes:
        axis.top_deg_s = 0.5  # long under way
    board.lose_stops(lost)
    del guard
    gc.collect()  # of what is younger than the freeze
    assert stands(board) is not bool(told)
    assert told in capsys.readouterr().err


ENDS_IN_A_SLEW = """
import sys
from datetime import UTC, datetime
from kochab.core.frame import Site
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
port, ra, dec = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
guard = Guard(open_mount("onstep", port), None, Limits(allow_without_site=True, crosses_meridian=True))
guard.goto(ra, dec)
"""


def test_a_program_that_ends_in_a_slew_sees_its_stop_through() -> None:
    """By the computer's clock: the interpreter is on its way out."""
    with served("onstep", clock=Night(datetime.now(UTC)), slew_deg_s=1.0) as one:
        ra, dec = one.align(-40.0, 60.0)
        one.lose_stops(1)
        line = [sys.executable, "-c", ENDS_IN_A_SLEW, one.port, str(ra), str(dec - 30.0)]
        ended = subprocess.run(line, capture_output=True, text=True, timeout=120)
        assert ended.returncode == 0, ended.stderr
        assert [order.kind for order in one.orders] == ["goto"]
        assert stands(one)


def test_a_disconnection_tells_what_it_saw(board, guard) -> None:
    told = []
    line = MountLine(lambda: guard, told.append)
    task = line.run()
    while next(task).stage != "listening":
        pass
    goes(board, guard)
    board.lose_stops(1 if board.driver != "ioptron" else 3)
    line.stop()
    task.close()
    assert isinstance(told[-1], StandsStill)
    assert stands(board)


def test_a_disconnection_from_a_mount_that_ignores_every_stop_says_so_in_capitals(board, guard) -> None:
    told = []
    line = MountLine(lambda: guard, told.append)
    task = line.run()
    while next(task).stage != "listening":
        pass
    goes(board, guard)
    board.tube.axes[0].top_deg_s = 0.5  # long under way
    board.lose_stops(99)
    line.stop()
    task.close()
    assert isinstance(told[-1], StopFailed)
    assert "CUT ITS POWER" in told[-1].sentence


def test_a_line_that_broke_in_a_slew_is_opened_again_to_stop_it(board) -> None:
    reopen = partial(open_mount, board.driver, board.port, site=board.site, clock=board.clock, stop_first=True)
    with Guard(reopen(), board.site, Limits(crosses_meridian=True), clock=board.clock, reopen=reopen) as guard:
        goes(board, guard)
        guard.mount.talk.link.close()
        guard.stop_on_new_line()
        assert stands(board)
        assert guard.policy.slew_block_reason == ""
