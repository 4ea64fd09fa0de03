"""Syncs on a person's word alone: all of a night count together, and each is judged when the tube stands."""

from datetime import timedelta

import pytest

from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.mount import Direction, MountState
from kochab.core.progress import run
from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.night_syncs import NightSyncs
from kochab.workflows.sync_mount import accept_sync, offer_sync
from tests.boards import served, virtual_time
from tests.gear.mounts.imaginary import NIGHT, SITE, Imaginary, at, guarded
from tests.gear.mounts.test_guard import evidence
from tests.workflows.mount_nights import bench, good


def by_hand(guard, dec_deg, hour_angle_deg=-40.0):
    guard.sync(*at(hour_angle_deg, dec_deg), by_hand=True, confirmed=True)


# -- The limit of the night --------------------------------------------------------------------


def test_syncs_by_hand_count_together_against_the_limit_of_one() -> None:
    guard, mount = guarded(dec_deg=20.0)
    for dec in (26.0, 32.0, 38.0):
        by_hand(guard, dec)
    with pytest.raises(RefusedError, match=r"by hand the mount would be shifted by 24\.0°, more than 20°.*--arm"):
        by_hand(guard, 44.0)
    assert mount.here == at(-40.0, 38.0)
    by_hand(guard, 39.9)  # 19.9 in all


def test_small_syncs_by_hand_ask_for_a_yes_as_soon_as_they_add_up_to_five_degrees() -> None:
    guard, _ = guarded(dec_deg=20.0)
    by_hand(guard, 23.0)
    guard.goto(*at(-50.0, 40.0))
    with pytest.raises(RefusedError, match=r"by 6\.0°: confirm it"):
        guard.sync(*at(-50.0, 43.0), by_hand=True)


def test_a_wrong_sync_that_is_synced_back_or_undone_counts_no_more() -> None:
    guard, _ = guarded(dec_deg=20.0)
    for dec in (35.0, 20.0, 35.0):
        by_hand(guard, dec)
    guard.undo_sync()
    assert guard.syncs.shift_deg == pytest.approx((0.0, 0.0))
    by_hand(guard, 35.0)


def test_in_right_ascension_they_count_as_far_as_they_move_the_place() -> None:
    """Three times ten degrees are fifteen on the sky at 60 deg of declination, and twenty-nine beside the equator."""
    guard, _ = guarded(hour_angle_deg=-40.0, dec_deg=60.0)
    for hour_angle in (-50.0, -60.0, -70.0):
        by_hand(guard, 60.0, hour_angle)
    guard.goto(*at(-60.0, 10.0))
    with pytest.raises(RefusedError, match=r"by 30\.\d°, more than 20°"):
        by_hand(guard, 10.0, -61.0)


@pytest.mark.parametrize("how", ["solved", "armed"])
def test_solved_frames_and_a_word_for_this_one_begin_anew(how) -> None:
    guard, _ = guarded(dec_deg=20.0)
    by_hand(guard, 38.0)
    target = at(-40.0, 44.0)
    guard.allow_large_sync = how == "armed"
    guard.sync(*target, evidence(target) if how == "solved" else None, by_hand=how == "armed", confirmed=True)
    assert guard.syncs.shift_deg == (0.0, 0.0)
    by_hand(guard, 60.0)


def test_the_next_program_goes_on_counting_until_the_night_is_over(tmp_path) -> None:
    now = [NIGHT]
    mount = Imaginary(*at(-40.0, 20.0))

    def program():
        syncs = NightSyncs.of_line(lambda: now[0], tmp_path, "/dev/ttyUSB0")
        return Guard(mount, SITE, Limits(), clock=lambda: NIGHT, wait=lambda s: None, syncs=syncs)

    for dec in (29.0, 38.0):
        by_hand(program(), dec)
    now[0] += timedelta(hours=11.9)
    with pytest.raises(RefusedError, match=r"by 27\.0°"):
        by_hand(program(), 47.0)
    now[0] += timedelta(hours=0.2)
    by_hand(program(), 47.0)
    assert NightSyncs.of_line(lambda: now[0], tmp_path, "/dev/ttyUSB1").shift_deg == (0.0, 0.0)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"ra_deg": NaN, "dec_deg": 0, "unix_s": 0}', '{"ra_deg": "x"}', "[" * 9999]
)
def test_a_damaged_sum_is_none(tmp_path, text) -> None:
    (tmp_path / "-dev-a-syncs.json").write_text(text)
    syncs = NightSyncs.of_line(lambda: NIGHT, tmp_path, "/dev/a")
    assert syncs.shift_deg == (0.0, 0.0)
    syncs.add(1.0, 2.0)
    assert NightSyncs.of_line(lambda: NIGHT, tmp_path, "/dev/a").shift_deg == (1.0, 2.0)


def test_where_it_cannot_be_kept_it_holds_for_this_program(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    syncs = NightSyncs.of_line(lambda: NIGHT, tmp_path / "file", "COM3")
    syncs.add(1.0, 2.0)
    assert syncs.shift_deg == (1.0, 2.0)


# -- A tube that runs on -----------------------------------------------------------------------


class Coasting(Imaginary):
    """It goes on by ``step_deg`` of declination at each of the next ``looks``, and says that it does not slew."""

    looks, step_deg = 0, 0.2

    def position(self):
        if self.looks > 0:
            self.looks -= 1
            self.here = self.here[0], self.here[1] + self.step_deg
        return super().position()


def coasting(mount):
    return Guard(mount, SITE, Limits(), clock=lambda: NIGHT, wait=lambda s: None)


def test_a_sync_waits_for_a_tube_that_runs_out_of_a_nudge() -> None:
    mount = Coasting(*at(-40.0, 40.0))
    mount.looks = 4
    guard, target = coasting(mount), at(-40.0, 42.0)
    guard.sync(*target, evidence(target))
    assert mount.here == target
    guard.undo_sync()
    assert mount.here == pytest.approx(at(-40.0, 40.8))  # from where it stood


def test_a_tube_that_does_not_come_to_rest_is_not_synced() -> None:
    mount = Coasting(*at(-40.0, 40.0))
    mount.looks = 1000
    with pytest.raises(RefusedError, match="still moving: wait until it stands"):
        coasting(mount).sync(*at(-40.0, 41.0), by_hand=True)
    assert mount.did == []


@pytest.mark.parametrize("answers", ["nothing", "no"])
def test_a_sync_while_the_mount_begins_to_move_is_not_said_to_be_ignored(answers) -> None:
    """Nor is one that was taken, though the answer says no."""

    class Nudged(Coasting):
        def sync(self, ra_deg, dec_deg):
            super().sync(ra_deg, dec_deg)
            self.looks = 3
            if answers == "no":
                raise RefusedError("The mount refused the sync.")

    mount = Nudged(*at(-40.0, 40.0))
    target = at(-40.0, 42.0)
    with pytest.raises(NoAnswerError, match=r"whether it took the sync is not known.*Nothing slews"):
        coasting(mount).sync(*target, evidence(target))


@pytest.mark.parametrize("answer", [None, RefusedError("The mount refused the sync.")])
def test_no_offset_is_slewed_after_a_sync_that_was_taken(monkeypatch, answer) -> None:
    """The mount takes it and turns on by half a degree, or says that it did not take it."""
    b = bench(good(lost_deg=1.5))
    offer = run(offer_sync(b.guard, b.solve_now))
    take = b.mount.sync

    def sync(ra_deg, dec_deg):
        take(ra_deg, dec_deg)
        if answer is not None:
            raise answer
        b.rig.mount.turn_by_hand(0.5)
        ra, dec = b.rig.mount.believed_deg()
        b.rig.mount.sync(ra, dec + 0.5)

    monkeypatch.setattr(b.mount, "sync", sync)
    with pytest.raises(NoAnswerError, match="is not known"):
        run(accept_sync(b.guard, offer, fall_back=True, wait=b.wait))
    assert "goto" not in [did[0] for did in b.mount.did]


def test_a_board_whose_tube_coasts_takes_the_sync_of_the_place_where_it_stands() -> None:
    """OnStep slows down for 2.5 s after a nudge at 1 deg/s: a sync of then was called ignored."""
    with virtual_time() as time, served("onstep", time=time, acceleration_deg_s2=0.4) as board:
        board.align(-40.0, 30.0)
        mount = open_mount("onstep", board.port, site=board.site, clock=board.clock)
        with Guard(mount, board.site, Limits(), clock=board.clock) as guard:
            board.nudge_by_hand(1, 1.0)
            guard.emergency.wait(1.5)
            board.nudge_by_hand(1, 0.0)
            here = guard.position()
            guard.sync(here.ra_deg, here.dec_deg + 3.0, by_hand=True, confirmed=True)
            assert guard.position().dec_deg == pytest.approx(here.dec_deg + 3.0, abs=0.05)
            assert not board.moving


# -- A mount that does not say whether it moves ------------------------------------------------

UNKNOWN = MountState(slewing=None, parked=None, aligned=True, tracking=None)
NEEDS_REST = {
    "goto": lambda guard: guard.goto(*at(-50.0, 45.0)),
    "park": lambda guard: guard.park(),
    "home": lambda guard: guard.go_home(),
    "a long move": lambda guard: guard.move(Direction.NORTH, 1.0, 10.0),
}


@pytest.mark.parametrize("action", NEEDS_REST)
def test_unknown_motion_blocks_what_needs_a_standing_mount(action) -> None:
    mount = Coasting(*at(-40.0, 30.0))
    mount.now, mount.looks = UNKNOWN, 1000
    with pytest.raises(RefusedError, match="The mount is slewing"):
        NEEDS_REST[action](coasting(mount))
    assert mount.did == []


@pytest.mark.parametrize("action", NEEDS_REST)
def test_a_mount_that_never_says_whether_it_moves_is_seen_to_stand(action) -> None:
    mount = Coasting(*at(-40.0, 30.0))
    mount.now = UNKNOWN
    NEEDS_REST[action](coasting(mount))
    assert mount.did
