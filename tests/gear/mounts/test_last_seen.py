"""A mount that lost its power between two sessions, with a clock and a site that are right, needs a sync first."""

import subprocess
import sys
from datetime import UTC, datetime, timedelta

import pytest

from kochab.core.errors import DeviceError, LineLostError
from kochab.core.mount import Home
from kochab.core.progress import run
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.last_seen import LastSeen, Place
from kochab.gear.mounts.restart_watch import turned_aside_deg
from kochab.gear.session import Meridian as Pier
from kochab.gear.session import MountSelection, guarded, limits_at
from tests.boards import BOARDS, SITE, Night, served, virtual_time
from tests.boards.mechanics import HOME_DEG
from tests.boards.sky import sidereal_deg
from tests.gear.mounts.imaginary import NIGHT, Imaginary

FORGET = [kind for kind in BOARDS if kind != "skywatcher"]
"""Whose power fails without a word; a motor board's home is confirmed by a person each time."""
NOON = datetime(2026, 11, 24, 12, tzinfo=UTC)


@pytest.fixture(params=FORGET)
def board(request, monkeypatch, tmp_path):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    with virtual_time() as time, served(request.param, time=time, slew_deg_s=6.0, keeps_clock=True) as one:
        one.align(-50.0, 40.0)
        yield one


def session(board, **selected):
    """As the window and each command open one."""
    selection = MountSelection(board.port, board.driver, **selected)
    return guarded(selection, SITE, clock=board.clock, limits=limits_at(Pier.FLIPS), keep=True)


def place(board, hour_angle_deg, dec_deg):
    return (sidereal_deg(board.clock.unix(), board.site.longitude_deg) - hour_angle_deg) % 360.0, dec_deg


def said(order):
    with pytest.raises(DeviceError) as told:
        order()
    return str(told.value)


def seen(guard):
    guard.state()
    return guard.position()


def cut_between_two_sessions(board):
    with session(board) as guard:
        seen(guard)
        run(guard.slew(*place(board, -30.0, 45.0)))
    board.cut_power(0.5)
    board.timing.sleep(20.0)


def test_a_mount_that_wakes_at_its_home_between_two_sessions_is_not_slewed_from_there(board) -> None:
    cut_between_two_sessions(board)
    with session(board) as guard:
        told = said(lambda: guard.goto(*place(board, -60.0, 45.0)))
    assert "Was it switched off and on? Sync first" in told
    assert not board.false_slews()
    with session(board) as guard:  # nor by the third, which saw it at home already
        assert "Sync first" in said(lambda: guard.goto(*place(board, -60.0, 45.0)))
        guard.clock_and_site.trust()
        guard.goto(*place(board, -60.0, 45.0))


@pytest.mark.parametrize("killed", [False, True])
def test_a_session_that_ended_in_a_slew_from_home_has_seen_where_it_was(killed, board) -> None:
    """Interrupted, it tells where the tube was last; killed, where it was ten degrees before."""
    with board.lock:
        for axis, home in zip(board.tube.axes, HOME_DEG, strict=True):
            axis.at_deg = home
        board.set_counters(HOME_DEG)
    guard = session(board)
    seen(guard)
    slew = guard.slew(*place(board, -30.0, 45.0))
    for _ in range(25):
        next(slew)
    if not killed:
        slew.close()
        guard.close()
    board.cut_power(0.5)
    board.timing.sleep(20.0)
    with session(board) as guard:
        assert "Sync first" in said(lambda: guard.goto(*place(board, -60.0, 45.0)))
    assert not board.false_slews()


def test_a_person_who_says_that_the_mount_is_right_is_believed_before_it_is_looked_at(board) -> None:
    cut_between_two_sessions(board)
    with session(board) as guard:
        guard.clock_and_site.trust()  # as --trust-mount, at once
        seen(guard)
        assert guard.policy.slew_block_reason == ""
    with session(board) as guard:
        seen(guard)
        assert guard.policy.slew_block_reason == ""


def test_a_mount_whose_home_is_confirmed_now_is_believed(board) -> None:
    cut_between_two_sessions(board)
    with session(board, home=Home.NOW) as guard:
        seen(guard)
        assert guard.policy.slew_block_reason == ""


def test_a_mount_that_kochab_has_sent_to_rest_or_that_stayed_is_believed(board) -> None:
    with session(board) as guard:
        seen(guard)
        ways = [action for action in ("park", "home") if not rest_refused(guard, action)]
    board.timing.sleep(3600.0)
    with session(board) as guard:
        seen(guard)
        assert guard.policy.slew_block_reason == "", ways
    assert board.cuts == []


def rest_refused(guard, action):
    try:
        run(guard.rest(action))
    except DeviceError:
        return True
    return False


def test_a_mount_that_was_switched_off_and_on_at_its_home_is_believed(board) -> None:
    board.cut_power(0.5)
    board.timing.sleep(20.0)
    with board.lock:  # put there by hand while it was off
        home = board.believed_axes_deg()
        for axis, believed in zip(board.tube.axes, home, strict=True):
            axis.at_deg = believed
        board.set_counters(home)
    for _ in range(2):
        with session(board) as guard:
            seen(guard)
            assert guard.policy.slew_block_reason == ""
        board.cut_power(0.5)
        board.timing.sleep(600.0)


def test_the_next_command_says_it(monkeypatch, tmp_path) -> None:
    """Two programs by the computer's own clock."""
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    with served("onstep", clock=Night(datetime.now(UTC)), keeps_clock=True) as board:
        board.align(-50.0, 40.0)
        position = [sys.executable, "-m", "kochab", "mount", "position", f"--port={board.port}", "--driver=onstep"]
        for _ in range(2):
            assert "switched off and on" not in subprocess.run(position, capture_output=True, text=True).stdout
        board.cut_power(0.0)
        board.timing.sleep(board.boot_s + 0.5)
        told = subprocess.run(position, capture_output=True, text=True)
    assert "Was it switched off and on? Sync first" in told.stdout, told.stderr


@pytest.fixture(params=[89.3, 90.0])
def left_at_the_pole(request, board):
    """Where the evening's polar alignment was looked at: beside the pole, the RA axis turned, the mount aligned."""
    board.align(-20.0, request.param)
    with session(board) as guard:
        seen(guard)
    return board


@pytest.mark.parametrize("hours", [0.01, 2.0])
def test_a_mount_left_beside_the_pole_that_woke_up_there_has_lost_its_ra_axis(hours, left_at_the_pole) -> None:
    """On the sky it is where it was; a slew from there would be wrong by all that the axis is turned."""
    board = left_at_the_pole
    if board.driver == "nexstar" and board.believed_deg()[1] > 89.9:
        pytest.skip("it tells neither its axes nor its home: this cannot be told")
    board.timing.sleep(3600.0 * hours)
    board.cut_power(0.5)
    board.timing.sleep(20.0)
    assert board.lost_by_deg() > 20.0
    with session(board) as guard:
        assert "its RA axis is" in said(lambda: guard.goto(*place(board, -60.0, 45.0)))
        assert "Sync first" in guard.policy.slew_block_reason
    assert not board.false_slews()


@pytest.mark.parametrize("tracking", [False, True])
@pytest.mark.parametrize("hours", [0.01, 2.0, 9.0])
def test_one_that_kept_its_power_there_is_believed(hours, tracking, left_at_the_pole) -> None:
    board = left_at_the_pole
    board.track(tracking)
    board.timing.sleep(3600.0 * hours)
    with session(board) as guard:
        seen(guard)
        assert guard.policy.slew_block_reason == ""


def test_an_evening_that_begins_at_the_home_with_a_clock_to_be_set_is_believed(board) -> None:
    """Another clock is another right ascension of the same axis."""
    with board.lock:
        for axis, home in zip(board.tube.axes, HOME_DEG, strict=True):
            axis.at_deg = home
        board.set_counters(HOME_DEG)
        board.track(False)
        board.clock_error_s = -5000.0
    with session(board) as guard:
        seen(guard)
    board.clock_error_s = 0.0
    with session(board) as guard:
        seen(guard)
        assert guard.policy.slew_block_reason == ""


@pytest.mark.parametrize("how", ["a missed answer", "a broken line", "neither"])
def test_a_mount_that_is_elsewhere_after_a_session_that_ended_in_silence(how, tmp_path) -> None:
    """As a StarBook, which wakes up in the west; without a silence somebody has moved it by its hand control."""
    lost = LineLostError("The line broke.")
    for ra in (100.0, 205.0):
        mount, kept = Imaginary(ra, 40.0), LastSeen(lambda: NIGHT, tmp_path / "it.json")
        guard = Guard(mount, SITE, clock=lambda: NIGHT, wait=lambda _: None, last_seen=kept)
        guard.position()
        assert ("Sync first" in guard.policy.slew_block_reason) is (ra == 205.0 and how != "neither")
        if how == "a missed answer":
            mount.missed += 1
        elif how == "a broken line":
            mount.position = lambda: (_ for _ in ()).throw(lost)
            with pytest.raises(LineLostError):
                guard.position()
        guard.close()


@pytest.mark.parametrize(
    ("before", "now", "passed_s", "aside"),
    [
        (None, 90.0, 0.0, 0.0),
        (90.0, None, 0.0, 0.0),
        (340.0, 90.0, 0.0, 110.0),
        (340.0, 90.0, 3600.0, 94.96),  # tracked for an hour, and turned by the rest
        (90.0, 340.0, 3600.0, 110.0),
        (90.0, 80.0, 3600.0, 10.0),
        (90.0, 100.0, 3600.0, 0.0),
        (359.0, 1.0, 0.0, 2.0),
    ],
)
def test_how_far_an_ra_axis_is_from_where_standing_or_tracking_left_it(before, now, passed_s, aside) -> None:
    assert turned_aside_deg(before, now, passed_s) == pytest.approx(aside, abs=0.01)


# -- The file ----------------------------------------------------------------------------------


def test_what_is_half_a_day_old_or_damaged_tells_nothing(tmp_path) -> None:
    place, file = Place(10.0, 40.0, NOON.timestamp(), False), tmp_path / "mounts" / "com3-syncs.json"
    LastSeen(lambda: NOON, file).keep(place)
    assert LastSeen(lambda: NOON + timedelta(hours=11), file).read() == place
    assert LastSeen(lambda: NOON + timedelta(hours=13), file).read() is None
    for text in ("", "[]", "{}", '{"ra_deg": NaN, "dec_deg": 0, "unix_s": 0, "at_rest": false}', '{"ra_deg": "x"}'):
        file.write_text(text)
        assert LastSeen(lambda: NOON, file).read() is None


def test_a_place_that_hardly_changed_is_not_written_twice_a_second(tmp_path) -> None:
    file = tmp_path / "com3-syncs.json"
    seen_last = LastSeen(lambda: NOON, file)
    written = []
    for after_s, ra in ((0.0, 10.0), (0.5, 10.1), (1.0, 12.0), (2.0, 12.1), (700.0, 12.2)):
        seen_last.keep(Place(ra, 40.0, NOON.timestamp() + after_s, False))
        written.append(file.read_text())
    assert [written.index(text) for text in written] == [0, 0, 2, 2, 4]
    seen_last.keep(Place(12.3, 40.0, NOON.timestamp() + 701.0, False), last=True)
    assert "12.3" in file.read_text()
