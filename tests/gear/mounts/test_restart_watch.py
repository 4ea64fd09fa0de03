"""What a place that jumped tells of a restart: of a mount whose home is not the pole, and of one that was stopped."""

from datetime import UTC, datetime, timedelta

import pytest

from kochab.core.mount import Epoch, MountState, Pointing
from kochab.gear.journal import MotionLog
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.motion_policy import MotionPolicy
from kochab.gear.mounts.restart_watch import RestartWatch
from kochab.gear.mounts.slew_supervisor import reach_deg
from tests.gear.mounts.bench import SITE

BEGUN = datetime(2026, 1, 15, 22, 0, tzinfo=UTC)


class Told:
    """What of a mount the watch asks."""

    missed = 0

    def state(self):
        return MountState(slewing=False)


@pytest.fixture
def watched():
    """A watch, its mount, and a way to look at it after so many seconds at a place."""
    now = [100.0]

    def clock():
        return BEGUN + timedelta(seconds=now[0])

    mount, policy = Told(), MotionPolicy(SITE, Limits(), clock)
    watch = RestartWatch(mount, policy, MotionLog(clock=clock), reach_deg)

    def look(after_s, ra, dec, ordered=False, **how):
        now[0] += after_s
        ended = how.pop("ended_s", None)
        if ended is not None:
            how["ended"] = ended, BEGUN + timedelta(seconds=ended)
        watch.see(mount, Pointing(ra, dec, Epoch.DATE), now[0], ordered, **how)
        return policy.slew_block_reason

    return mount, look, now


def test_a_mount_that_is_elsewhere_after_a_silence_may_have_been_restarted(watched) -> None:
    """As a StarBook, which wakes up looking at the western horizon."""
    mount, look, _ = watched
    assert look(0.0, 100.0, 40.0) == ""
    mount.missed += 1
    assert look(5.0, 101.0, 40.0) == ""  # nudged a little, or standing while the sky turned
    mount.missed += 1
    assert "101° from where it was. Was it switched off" in look(5.0, 205.0, 0.0)


def test_without_a_silence_somebody_else_moved_it(watched) -> None:
    _, look, _ = watched
    look(0.0, 100.0, 40.0)
    assert look(5.0, 205.0, 0.0) == ""


def test_after_a_silence_in_a_slew_a_place_off_its_way_tells_of_a_restart(watched) -> None:
    mount, look, _ = watched
    look(0.0, 100.0, 40.0, ordered=True)
    mount.missed += 1
    assert look(6.0, 110.0, 45.0, ordered=True) == ""  # as far as it may have come
    mount.missed += 1
    assert "Was it switched off" in look(6.0, 205.0, 0.0, off_its_way=True)


def test_a_slew_that_was_stopped_does_not_explain_a_pole_that_is_read_much_later(watched) -> None:
    """INDI's EXOS-2 driver tells of no silence: it repeats its last place until the mount reports again."""
    _, look, now = watched
    look(0.0, 100.0, 60.0, ordered=True)
    ended = now[0] + 0.5
    assert "jumped 30° to its home" in look(20.0, 280.0, 89.9, ended_s=ended)


def test_a_slew_that_goes_to_the_pole_is_no_restart(watched) -> None:
    _, look, now = watched
    look(0.0, 100.0, 60.0, ordered=True)
    assert look(5.0, 280.0, 89.9, ordered=True) == ""
    look(1.0, 100.0, 60.0, ordered=True)
    assert look(9.0, 280.0, 89.9, ended_s=now[0] + 3.0) == ""  # it went on for three seconds after the look


def test_a_mount_that_nobody_ordered_to_move_has_not_gone_to_the_pole_as_fast_as_one_that_was(watched) -> None:
    """Twenty degrees in five seconds are a slew; unordered they are a restart, with no answer missed."""
    _, look, _ = watched
    assert look(0.0, 100.0, 70.0) == ""
    assert look(5.0, 100.0, 89.9, ordered=True) == ""
    assert look(5.0, 100.0, 70.0, ordered=True) == ""
    assert look(30.0, 100.0, 70.0) == ""
    assert "Mount was restarted" in look(5.0, 100.0, 89.9)
