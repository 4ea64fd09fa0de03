"""The belief of a bolt against Bayes' rule by hand, and against threads and hands that are drawn."""

import numpy as np
import pytest

from kochab.polar.bolt_filter import CHANCES, PARTICLES, BoltFilter


def after(turns, believed=None):
    believed = believed or BoltFilter.unknown()
    for asked, change in turns:
        believed = believed.turned(asked, change, 2.0, abs(change) > 8.0)
    return believed


def test_of_one_turn_the_sense_is_as_sure_as_hands_are():
    """The first movement is by one that turned as told, too far or sprang back, or by one that turned the other way."""
    found = after([(0.5, 1000.0)])
    as_told, wrong = CHANCES[[0, 3, 4]].sum(), CHANCES[1]
    assert found.clockwise_adds == pytest.approx(as_told / (as_told + wrong), abs=0.03)
    assert np.median(found.likely.arcsec_a_turn) == pytest.approx(2000.0, rel=0.3)


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_a_thread_of_any_scale_is_found_from_both_senses(scale):
    """A motor's turn is a unit of its board: nothing is supposed of how far it goes."""
    for sense in (1.0, -1.0):
        found = BoltFilter.unknown()
        for _ in range(3):
            found = found.turned(0.25, sense * 500.0 * scale, 0.1 * scale, True)
        assert np.median(found.likely.arcsec_a_turn) == pytest.approx(sense * 2000.0 * scale, rel=0.1)


def test_before_anything_moved_there_is_no_thread_and_more_backlash_with_every_turn():
    found = BoltFilter.unknown()
    slack = [np.median(found.slack_turns(1))]
    for _ in range(2):
        found = after([(0.1, 0.0)], found)
        assert not found.has_thread
        slack.append(np.median(found.backlash_turns))
    assert slack == sorted(slack)


def test_the_true_thread_and_backlash_lie_where_the_particles_are():
    """Drawn threads, backlash and hands: the middle 68 % of the particles hold the true value about as often."""
    random, inside, within = np.random.default_rng(7), [], []
    for _ in range(60):
        thread, backlash = random.choice([-1, 1]) * random.uniform(1500.0, 6500.0), random.uniform(0.05, 0.4)
        engaged, found = backlash * random.random(), BoltFilter.unknown()
        for asked in (0.25, 0.25, 0.5, -0.5, -0.25, 0.5, 0.25):
            free = engaged + asked * (1.0 + random.normal(0.0, 0.1))
            engaged = min(max(free, 0.0), backlash)
            change = (free - engaged) * thread + random.normal(0.0, 2.0)
            found = found.turned(asked, change, 2.0, abs(change) > 8.0)
        low, high = np.quantile(found.likely.arcsec_a_turn, (0.16, 0.84))
        inside.append(low < thread < high)
        within.append(abs(np.median(found.likely.backlash_turns) - backlash) < 0.08)
    assert 0.5 < np.mean(inside) < 0.97
    assert np.mean(within) > 0.8


def test_a_hand_that_goes_too_far_is_found_out():
    """And its thread is not taken for a coarser one."""
    turns = [
        (0.25, 500.0),
        (0.25, 500.0),
        (-0.25, -1000.0),
        (0.25, 500.0),
        (-0.25, -1000.0),
        (0.25, 1000.0),
        (0.25, 500.0),
    ]
    found = after(turns)
    assert found.hands.sum() == pytest.approx(len(turns))
    assert found.hands[3] > 1.5
    assert np.median(found.likely.arcsec_a_turn) == pytest.approx(2000.0, rel=0.1)


def test_the_same_turns_give_the_same_belief_and_particles_enough():
    one, other = (after([(0.25, 500.0), (0.25, -480.0)]) for _ in range(2))
    assert np.array_equal(one.arcsec_a_turn, other.arcsec_a_turn)
    assert len(one.arcsec_a_turn) == PARTICLES
    assert np.all((one.engaged_turns >= 0.0) & (one.engaged_turns <= one.backlash_turns))
    assert len(np.unique(one.arcsec_a_turn)) > PARTICLES / 2
