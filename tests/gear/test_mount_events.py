"""What is known of a mount from its line's words: how long a slew will still take."""

import pytest

from kochab.core.mount import MountState
from kochab.gear.mount_events import MountSnapshot, PositionReport

SLEWS = MountState(slewing=True)


@pytest.fixture
def seen():
    """Readings of a slew down to Dec 0, each its time, s, and the distance left, deg; the times left, s."""

    def read(*looks):
        known, found = MountSnapshot(), []
        for time_s, left_deg in looks:
            known.hear(PositionReport((10.0, left_deg), SLEWS, target_deg=(10.0, 0.0), monotonic_s=time_s))
            found.append(known.left_s)
        return found

    return read


def test_at_a_constant_speed_the_time_left_is_the_distance_over_it(seen) -> None:
    """However the readings are spaced: the weights of the newest and of those before make one."""
    looks = [(5.0 + t, 40.0 - 2.0 * t) for t in (0.0, 1.0, 1.5, 4.0, 5.0)]
    assert seen(*looks) == [None, *(pytest.approx(left / 2.0) for _, left in looks[1:])]


def test_a_change_of_speed_is_taken_up_by_seven_tenths(seen) -> None:
    *_, left_s = seen((0.0, 40.0), (1.0, 38.0), (2.0, 34.0))
    assert left_s == pytest.approx(34.0 / (0.3 * 2.0 + 0.7 * 4.0))


def test_of_a_mount_that_stands_or_goes_the_other_way_no_time_is_told(seen) -> None:
    assert seen((0.0, 40.0), (1.0, 40.01), (2.0, 41.0)) == [None, None, None]
