"""Where the tutor leads people whose mount and hands nobody of it knows (`tests.nights.hands`)."""

import pytest

from tests.nights.hands import KINDS, run

BY_NAME = {kind.name: kind for kind in KINDS}


@pytest.mark.parametrize("name", ["wrong bolt", "other axis in the test", "coupling", "backlash, coupling, slips"])
@pytest.mark.parametrize("seed", [3001, 3002, 3003])
def test_such_hands_end_below_a_minute_of_arc_and_accuse_no_clock(name, seed):
    one = run(BY_NAME[name], seed)
    assert one.ended_arcsec < 60.0, one
    assert not one.accused, one
    assert one.blind_turns <= 0.25


def test_hands_that_overshoot_end_below_a_minute_of_arc_in_thirty_instructions():
    """Chance may let one go too far in eleven turns of thirteen."""
    ended = [run(BY_NAME["overshoots 5 arcmin"], seed) for seed in range(3001, 3013)]
    assert sum(one.ended_arcsec < 60.0 for one in ended) >= 11, ended
    assert all(one.ended_arcsec < one.began_arcsec for one in ended), ended


@pytest.mark.parametrize("seed", [3001, 3002, 3003])
def test_a_clock_six_hours_wrong_ends_no_farther_than_it_began(seed):
    one = run(BY_NAME["clock 6 h wrong"], seed)
    assert one.ended_arcsec < one.began_arcsec
    assert one.instructions <= 12
    assert "Check the clock and time zone" in one.told[-1]
