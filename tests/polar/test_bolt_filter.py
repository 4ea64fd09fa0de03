"""The belief of a bolt against Bayes' rule by hand, and against threads and hands that are drawn."""

import numpy as np
import pytest

from kochab.polar.bolt_filter import CHANCES, PARTICLES, SAME_BOLT, SAME_SENSE, SAME_THREAD, BoltFilter


def after(turns, believed=None):
    believed = believed or BoltFilter.unknown()
    for asked, change in turns:
        believed = believed.turned(asked, change, 2.0, abs(change) > 8.0)
    return believed


def test_of_one_turn_the_sense_is_as_sure_as_hands_are():
    """The first movement is by one that turned as told, too far or sprang back, or by one that turned the other way."""
    found = after([(0.5, 1000.0)])
    as_told, wrong = CHANCES[:3].sum(), CHANCES[3:6].sum()
    assert found.clockwise_adds == pytest.approx(as_told / (as_told + wrong), abs=0.03)
    assert np.median(found.likely.arcsec_a_turn) == pytest.approx(2000.0, rel=0.3)


@pytest.mark.parametrize("scale", [0.1, 1.0, 100.0])
def test_a_thread_of_any_scale_is_found_from_both_senses(scale):
    """A motor's turn is a unit of its board: nothing is supposed of how far it goes."""
    for sense in (1.0, -1.0):
        found = BoltFilter.unknown()
        for _ in range(3):
            found = found.turned(0.25, sense * 500.0 * scale, 0.1 * scale, True)
        assert np.median(found.likely.arcsec_a_turn) == pytest.approx(sense * 2000.0 * scale, rel=0.1)


def test_another_nights_thread_is_believed_as_surely_as_it_is_the_same_bolts():
    """Eight in ten are that bolt, most of the same sense; the others lie evenly, up to e squared apart, of either sense."""
    found = BoltFilter.other_night(2000.0)
    apart = np.abs(np.log(np.abs(found.arcsec_a_turn) / 2000.0))
    another = 1.0 - SAME_BOLT
    assert np.mean(apart < SAME_THREAD) == pytest.approx(0.683 * SAME_BOLT + another * SAME_THREAD / 2.0, abs=0.03)
    for near, far in ((0.5, 1.0), (1.0, 1.5), (1.5, 2.0)):
        assert np.mean((apart > near) & (apart < far)) == pytest.approx(another * 0.25, abs=0.02)
    assert found.clockwise_adds == pytest.approx(SAME_BOLT * SAME_SENSE + another / 2.0, abs=0.03)


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
    for _ in range(30):
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
    assert found.hands.sum(axis=0) == pytest.approx(len(turns))
    assert found.hands[1].mean() > 1.5
    assert np.median(found.too_far_turns) == pytest.approx(0.25, rel=0.15)
    assert np.median(found.likely.arcsec_a_turn) == pytest.approx(2000.0, rel=0.1)


def test_a_turn_both_the_other_way_and_springing_back_does_not_turn_its_sense_over():
    """Seed 500230 of hands that do all of these: 3 turns of 8 went the other way, and four turns were asked of it."""
    turns = [(0.25, -922.0), (-0.25, -867.0), (-0.25, -737.0), (0.25, 461.0), (1.0, 3767.0), (1.0, -2744.0)]
    assert after(turns).clockwise_adds > 0.8
    assert after([*turns, (1.875, -1261.0)]).clockwise_adds > 0.1, "it was 0.00, and proved the wrong way"
    assert np.median(after(turns).likely.arcsec_a_turn) == pytest.approx(3274.0, rel=0.15)


def test_a_thread_that_the_first_turns_spoke_against_is_there_when_later_ones_speak_for_it():
    """Seed 500143: 1608 arcsec a turn, 0.11 turns of backlash; it sprang back twice and then was turned the other way."""
    turns = [(0.25, 207.0), (-0.25, -98.0), (-0.25, -256.0), (-1.0, 2020.0), (-0.25, -402.0), (-0.25, -402.0)]
    found = after(turns)
    assert found.clockwise_adds > 0.9
    assert np.median(found.likely.arcsec_a_turn) == pytest.approx(1608.0, rel=0.3)


def test_how_far_a_hand_goes_too_far_is_learned_with_the_thread():
    """2560 arcsec a turn and 0.05 turns too far in every second: small turns moved eight times what they should."""
    turns = [(0.25, 640.0), (0.055, 269.0), (-0.12, -436.0), (0.07, 179.0), (0.006, 143.0), (-0.03, -205.0)]
    turns += [(0.011, 28.0), (0.011, 28.0), (-0.03, -77.0), (0.04, 230.0)]
    found = after(turns)
    assert np.median(found.likely.arcsec_a_turn) == pytest.approx(2560.0, rel=0.15)
    assert np.median(found.too_far_turns) == pytest.approx(0.05, rel=0.2)


def test_the_same_turns_give_the_same_belief_and_particles_enough():
    one, other = (after([(0.25, 500.0), (0.25, -480.0)]) for _ in range(2))
    assert np.array_equal(one.arcsec_a_turn, other.arcsec_a_turn)
    assert len(one.arcsec_a_turn) == PARTICLES
    assert np.all((one.engaged_turns >= 0.0) & (one.engaged_turns <= one.backlash_turns))
    assert len(np.unique(one.arcsec_a_turn)) > PARTICLES / 2
