"""The bolt tutor learns what bolts do, says it in words, and ends at the pole."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.attitude import ARCSEC
from kochab.core.frame import Site
from kochab.polar.bolts import ALTITUDE_BOLT, AZIMUTH_BOLT, Base, Bolt, bolts_of
from kochab.polar.error import (
    Knob,
    PolarError,
    altitude_in_words,
    angle_in_words,
    azimuth_in_words,
    rotation_in_words,
    sayable,
    turns_in_words,
)
from kochab.polar.pole import pole_direction
from kochab.polar.rotations import alt_az, direction
from kochab.polar.tutor import ROUGH, STUBBORN, WIDEST, BoltTutor, TutorStep


def error_at(d_alt, d_az, latitude=45.0, sigma=2.0):
    pole = pole_direction(Site(latitude, 0.0))
    alt, az = alt_az(pole)
    axis = direction(alt + d_alt * ARCSEC, az + d_az * ARCSEC)
    return PolarError(axis, pole, np.eye(2) * (sigma * ARCSEC) ** 2)


class Hands:
    """Bolts with a thread, a sense and backlash, turned by hands that are not exact."""

    def __init__(self, d_alt, d_az, a_turn, play_arcsec=(0.0, 0.0), seed=0, latitude=45.0):
        self.at = np.array([d_alt, d_az], float)
        self.a_turn = np.array(a_turn, float)
        self.half = np.array(play_arcsec) / 2.0
        self.slack = np.zeros(2)
        self.rng = np.random.default_rng(seed)
        self.latitude = latitude

    def follow(self, told):
        k = int(told.knob is Knob.AZIMUTH)
        turns = told.turns * (1.0 + 0.05 * self.rng.normal()) + self.rng.normal() / 360.0
        wanted = self.slack[k] + turns * self.a_turn[k]
        self.slack[k] = np.clip(wanted, -self.half[k], self.half[k])
        self.at[k] += wanted - self.slack[k]

    def error(self):
        return error_at(*(self.at + self.rng.normal(0, 2.0, 2)), self.latitude)


def align(hands, most=60):
    tutor = BoltTutor()
    for _ in range(most):
        hands.read = hands.error()
        told = tutor.advise(hands.read, noise_arcsec=(2.0, 2.0))
        if told.step is TutorStep.STOP:
            break
        hands.follow(told)
    return tutor, told


@settings(max_examples=60)
@given(
    size=st.floats(4.1, 9.8),
    angle=st.floats(0, 6.3),
    seed=st.integers(0, 10**6),
    a_turn=st.tuples(*[st.floats(900, 4200).flatmap(lambda v: st.sampled_from([v, -v]))] * 2),
    backlash=st.tuples(st.floats(0, 150), st.floats(0, 150)),
    latitude=st.sampled_from([-60, -20, 5, 45, 65]),
)
def test_whatever_the_bolts_the_end_is_the_pole(size, angle, seed, a_turn, backlash, latitude):
    """From 1 arcmin to 5 degrees, threads of any pitch and sense, with backlash, both hemispheres."""
    off = np.exp(size) * np.array([np.sin(angle), np.cos(angle) / np.cos(np.radians(latitude))])
    hands = Hands(*off, a_turn, backlash, seed, latitude)
    tutor, told = align(hands)
    assert told.step is TutorStep.STOP
    # It stops by what it reads: each bolt within 1.7 tolerances, or all within 2.5 goals of a hand that goes too far.
    limit = tutor.goal_arcsec * (ROUGH if tutor.rough else WIDEST)
    assert hands.read.total_arcsec < limit
    assert error_at(*hands.at, latitude).total_arcsec < limit + 6.0 * 2.0  # sigmas of that reading
    assert tutor.moves <= 7


def test_most_alignments_take_four_moves():
    moves = []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        hands = Hands(
            *rng.normal(0, 3000, 2), rng.uniform(900, 4200, 2) * rng.choice([-1, 1], 2), rng.uniform(0, 150, 2), seed
        )
        moves.append(align(hands)[0].moves)
    assert np.median(moves) <= 4
    assert np.mean(np.array(moves) <= 5) > 0.99


def test_one_bolt_at_a_time_the_larger_error_first():
    tutor = BoltTutor()
    first = tutor.advise(error_at(300.0, -4000.0))
    assert first.step is TutorStep.TEST
    assert first.knob is Knob.AZIMUTH
    assert first.words == "Left azimuth bolt: a quarter turn clockwise, then wait."
    second = tutor.advise(error_at(300.0, -3500.0))  # a quarter turn gave 500 arcsec
    assert (second.step, second.knob) == (TutorStep.TURN, Knob.AZIMUTH)
    assert second.turns == 0.25, "one turn may be mostly backlash"
    third = tutor.advise(error_at(300.0, -3000.0))
    assert third.turns == 1.0, "of 1.5 turns no more than four times what was seen to work"
    assert third.words == "Left azimuth bolt: one turn clockwise, then wait."
    assert tutor.moves == 1
    fourth = tutor.advise(error_at(300.0, -6.0))
    assert fourth.words.startswith("Azimuth is good (6″). Now altitude. Altitude bolt: an eighth of a turn")


def test_a_wrong_way_is_turned_back():
    tutor = BoltTutor()
    tutor.advise(error_at(2000.0, 0.0))
    told = tutor.advise(error_at(2500.0, 0.0))
    assert told.turns < 0
    assert "anticlockwise" in told.words
    assert "The number grew" in told.why
    assert tutor.moves == 2
    assert tutor.advise(error_at(2000.0, 0.0)).why == ""


def test_a_test_that_went_the_right_way_needs_no_word():
    tutor = BoltTutor()
    assert tutor.advise(error_at(2000.0, 0.0)).why == ""
    assert tutor.advise(error_at(1500.0, 0.0)).why == ""


def knowing_both(**changed):
    """A tutor that knows both bolts; the azimuth bolt was turned clockwise last."""
    usual = {"arcsec_a_turn": 2000.0, "proved": True, "direction": 1} | changed
    tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), replace(AZIMUTH_BOLT, **usual)))
    tutor.advise(error_at(-300.0, -900.0))
    return tutor


def test_a_bolt_that_went_a_little_too_far_waits_for_the_other():
    tutor = knowing_both()
    told = tutor.advise(error_at(-300.0, 32.0))  # 23 arcsec on the sky, the wrong way
    assert (told.knob, tutor.moves) == (Knob.ALTITUDE, 2)
    assert tutor.advise(error_at(1.0, 25.0)).step is TutorStep.STOP  # the total is good as it is
    far = knowing_both().advise(error_at(-300.0, 320.0))
    assert (far.knob, far.turns < 0) == (Knob.AZIMUTH, True)


def test_a_bolt_on_its_way_through_its_play_is_not_left_for_the_other():
    tutor = knowing_both()
    assert tutor.advise(error_at(-8.0, 60.0)).knob is Knob.AZIMUTH
    for altitude in (-16.0, -24.0):  # no azimuth was seen to move; the other opens by noise
        told = tutor.advise(error_at(altitude, 60.0))
        assert (told.knob, told.turns < 0) == (Knob.AZIMUTH, True)
    assert tutor.moves == 2


def test_no_test_nudge_when_the_total_is_good_without():
    assert BoltTutor().advise(error_at(20.0, 0.0)).step is TutorStep.STOP
    assert BoltTutor().advise(error_at(24.0, 0.0)).step is TutorStep.TEST


def test_stop_at_the_goal_and_below_the_uncertainty():
    assert BoltTutor().advise(error_at(5.0, 3.0)).step is TutorStep.STOP
    poor = BoltTutor().advise(error_at(40.0, 10.0, sigma=60.0))
    assert poor.step is TutorStep.STOP
    assert poor.words == "Finer than one sweep can tell (±60″). Tighten, then check."


def turned_well(bolt=ALTITUDE_BOLT, arcsec_a_turn=2000.0, direction=1, times=4):
    """A bolt that a steady hand turned by quarters in one direction."""
    for _ in range(times):
        bolt = bolt.learned(0.25 * direction, 0.25 * direction * arcsec_a_turn, 1.0)
    assert bolt.proved
    return bolt


def with_backlash():
    """A bolt with 0.2 turns of backlash, turned back and forth through it; clockwise last."""
    return turned_well().learned(-0.5, -600.0, 2.0).learned(-0.25, -500.0, 2.0).learned(0.5, 600.0, 2.0)


def test_play_is_learned_at_a_reversal_and_taken_into_account():
    bolt = with_backlash()
    assert bolt.backlash_turns == pytest.approx(0.2, abs=0.03)
    assert bolt.direction == 1
    assert bolt.needed(400.0) == pytest.approx(-0.2 - 0.2, abs=0.06)
    assert bolt.needed(-400.0) == pytest.approx(0.2, abs=0.01), "going on needs none"


def test_a_turn_swallowed_by_play_is_no_change_of_mind():
    bolt = turned_well()
    still = bolt.learned(-0.05, 0.5, 2.0)
    assert (still.direction, still.proved) == (1, True)
    assert still.arcsec_a_turn == pytest.approx(2000.0, rel=0.05)
    swallowed = still.learned(-0.1, 0.5, 2.0).learned(-0.1, 0.5, 2.0)
    assert swallowed.needed(100.0) < 1.5 * bolt.needed(100.0) < 0.0, "what may be left of its backlash is turned too"
    moved = swallowed.learned(-0.2, -200.0, 2.0)  # 0.1 turns moved of 0.45
    assert moved.backlash_turns == pytest.approx(0.35, abs=0.12)


def test_a_very_small_turn_does_not_change_the_thread():
    """A hand told two degrees may turn four, or back: 3400 arcsec a turn looked like 8000."""
    bolt = turned_well(arcsec_a_turn=3400.0)
    for again in range(1, 9):
        bolt = bolt.learned(2 / 360, 44.0, 1.0)
        assert bolt.arcsec_a_turn == pytest.approx(3400.0, rel=0.04 * again), again
        assert bolt.proved
    assert bolt.learned(2 / 360, -15.0, 1.0).arcsec_a_turn > 0.0


def test_an_untested_bolt_promises_nothing():
    with pytest.raises(ValueError, match="not been tested"):
        ALTITUDE_BOLT.needed(100.0)


@pytest.mark.parametrize(
    ("turns", "words"),
    [
        (0.25, "a quarter turn"),
        (-1.0, "one turn"),
        (1.5, "one and a half turns"),
        (2.0, "two turns"),
        (0.375, "three eighths of a turn"),
        (1 / 24, "15°"),
        (12.25, "12 and a quarter turns"),
    ],
)
def test_turns_have_words(turns, words):
    assert turns_in_words(turns) == words


@given(st.floats(-8, 8))
def test_what_is_said_is_never_more_than_what_is_wanted(turns):
    said = sayable(turns)
    assert abs(said) <= abs(turns) + 1e-9
    assert abs(turns) - abs(said) < 0.125
    assert said == 0.0 or (said > 0) == (turns > 0)
    assert rotation_in_words(1.0) != rotation_in_words(-1.0)


def test_a_hand_that_goes_too_far_again_and_again_is_asked_for_the_whole_way_to_the_degree():
    """Every extra turn is a chance to overshoot; other hands are asked in steps of 5 degrees from 15 degrees on."""
    tutor = BoltTutor(bolts=(replace(turned_well(arcsec_a_turn=4000.0), proved=True), AZIMUTH_BOLT))
    tutor._last = (Knob.ALTITUDE, 1.0)
    wanted = tutor.bolts[Knob.ALTITUDE].needed(-255.0) * 360.0
    usual = tutor._instruction(Knob.ALTITUDE, 255.0, error_at(-255.0, 0.0)).turns * 360.0
    assert usual == pytest.approx(wanted // 5.0 * 5.0), "rounded down, as it is better to go on than to come back"
    tutor._too_far = 2
    asked = tutor._instruction(Knob.ALTITUDE, 255.0, error_at(-255.0, 0.0)).turns * 360.0
    assert abs(asked - wanted) <= 1.0
    assert asked > usual


def test_errors_have_words_that_hold_from_every_side():
    high_east = error_at(320.0, 65.0)
    assert altitude_in_words(high_east) == "5.3′ ± 2″ too high: lower the axis"
    assert "too far east: rotate the mount anticlockwise" in azimuth_in_words(high_east)
    south = error_at(-20.0, 65.0, latitude=-45.0)
    assert "too low: raise the axis" in altitude_in_words(south)
    assert "too far west: rotate the mount anticlockwise" in azimuth_in_words(south)
    assert angle_in_words(7200.0) == "2.00°"


@pytest.mark.parametrize(("sigmas", "seen"), [(3.9, False), (4.1, True)])
def test_a_change_is_seen_from_four_sigmas_of_two_readings_on(sigmas, seen):
    """The azimuth knob's own arcseconds are longer than the sky's, and its noise with them."""
    for knob, before in ((Knob.ALTITUDE, (4000.0, 10.0)), (Knob.AZIMUTH, (10.0, 4000.0))):
        tutor = BoltTutor()
        told = tutor.advise(error_at(*before), noise_arcsec=(5.0, 5.0))
        assert told.knob is knob
        knob_share = 1.0 if knob is Knob.ALTITUDE else np.cos(alt_az(error_at(*before).axis)[0])
        change = sigmas * np.sqrt(2.0) * 5.0 / knob_share
        after = (4000.0 - change, 10.0) if knob is Knob.ALTITUDE else (10.0, 4000.0 - change)
        tutor.advise(error_at(*after), noise_arcsec=(5.0, 5.0))
        bolt = tutor.bolts[knob]
        assert (bolt.arcsec_a_turn is not None) is seen
        if seen:
            assert bolt.arcsec_a_turn == pytest.approx(-change / told.turns, rel=0.25), "its backlash is unknown"


def test_how_far_the_hand_really_turned_counts_when_it_is_known():
    tutor = BoltTutor()
    tutor.advise(error_at(2000.0, 0.0))
    tutor.advise(error_at(1600.0, 0.0), turned=0.5)
    assert tutor.bolts[Knob.ALTITUDE].arcsec_a_turn == pytest.approx(-800.0, rel=0.25)


@pytest.mark.parametrize(
    ("base", "off", "words"),
    [
        (Base.HEAD, (2820.0, 0.0), "Tilt the head down and watch the number: 47.0′ to go. Then lock it."),
        (Base.HEAD, (-2820.0, 0.0), "Tilt the head up and watch the number: 47.0′ to go. Then lock it."),
        (Base.HEAD, (0.0, 2820.0), "Pan the head anticlockwise, seen from above, and watch the number: 47.0′ to go."),
        (Base.PLATFORM, (0.0, -2820.0), "Swing the platform clockwise, seen from above, and watch the number: 47.0′"),
        (Base.PLATFORM, (2820.0, 0.0), "Foot on the pole’s side: a quarter turn clockwise, then wait."),
        (Base.WEDGE, (2820.0, 0.0), "Wedge’s altitude screw: a quarter turn clockwise, then wait."),
        (Base.WEDGE, (0.0, 2820.0), "Wedge’s azimuth screw: a quarter turn clockwise, then wait."),
    ],
)
def test_each_base_is_asked_for_in_its_own_words(base, off, words):
    told = BoltTutor(bolts=bolts_of(base)).advise(error_at(*off))
    assert told.words.startswith(words)
    assert told.by_hand is not words.endswith("then wait.")


def test_what_a_hand_moves_needs_no_test_and_is_no_witness():
    tutor = BoltTutor(120.0, bolts_of(Base.HEAD, (1000.0, None)))  # what bolts did there once is of no use
    told = tutor.advise(error_at(2820.0, -1500.0))
    assert told.turns * 1_296_000.0 == pytest.approx(-2820.0)
    told = tutor.advise(error_at(250.0, -4500.0))  # the head went sideways too
    assert not tutor.witness
    assert "Tilt the head down" in told.words
    told = tutor.advise(error_at(60.0, -4500.0))
    assert told.words.startswith("Altitude is good (60″). Now azimuth. Pan the head clockwise")
    assert tutor.advise(error_at(60.0, -70.0)).step is TutorStep.STOP


def test_a_bolt_known_from_another_night_is_proved_by_one_turn_that_agrees_or_learned_anew():
    known = replace(ALTITUDE_BOLT, arcsec_a_turn=1000.0)
    for moved, thread, proved in ((240.0, 980.0, True), (-500.0, -2000.0, False), (700.0, 2800.0, False)):
        tutor = BoltTutor(bolts=(known, AZIMUTH_BOLT))
        told = tutor.advise(error_at(-2800.0, 0.0))
        assert (told.step, told.turns) == (TutorStep.TURN, 0.25)  # not further before it is seen to move
        tutor.bolts[Knob.ALTITUDE] = replace(tutor.bolts[Knob.ALTITUDE], direction=1)  # without backlash
        told = tutor.advise(error_at(-2800.0 + moved, 0.0))
        assert tutor.bolts[Knob.ALTITUDE].arcsec_a_turn == pytest.approx(thread, rel=0.2)
        assert (abs(told.turns) > 0.25) is proved


def test_a_new_measurement_teaches_nothing_of_the_bolt():
    tutor = BoltTutor()
    tutor.advise(error_at(2000.0, 0.0))
    tutor.measured_again()
    tutor.advise(error_at(1600.0, 0.0))
    assert tutor.bolts[Knob.ALTITUDE].arcsec_a_turn is None


@pytest.mark.parametrize("sigma", [1.0, 10.0])
def test_a_thread_is_mended_by_turns_that_agree_and_less_by_noisy_ones(sigma):
    bolt = turned_well()
    once = bolt.learned(1.0, 2400.0, sigma)
    for _ in range(4):
        bolt = bolt.learned(1.0, 2400.0, sigma)
    assert 2000.0 < once.arcsec_a_turn < bolt.arcsec_a_turn < 2450.0
    assert bolt.learned(1.0, 2000.0, 400.0).arcsec_a_turn == pytest.approx(bolt.arcsec_a_turn, rel=0.05)


def test_one_turn_proves_nothing_and_backlash_makes_it_look_smaller():
    first = ALTITUDE_BOLT.learned(0.25, 300.0, 1.0)  # a part may have gone into its backlash
    assert (first.proved, first.direction) == (False, 1)
    assert 1200.0 < first.arcsec_a_turn < 2000.0
    assert first.learned(0.25, 500.0, 1.0).arcsec_a_turn == pytest.approx(2000.0, rel=0.1)


def test_of_readings_that_disagree_those_count_that_agree_best():
    """A hand that goes 5 arcmin too far in two turns of seven, and slips in one."""
    bolt = ALTITUDE_BOLT
    for change in (500.0, 800.0, 510.0, 495.0, 800.0, 150.0, 505.0):
        bolt = bolt.learned(0.25, change, 1.0)
    assert bolt.arcsec_a_turn == pytest.approx(2000.0, rel=0.05)
    assert bolt.proved


def test_a_turn_the_wrong_way_takes_the_proof_away_and_another_settles_it():
    wrong = turned_well(times=2).learned(0.25, -500.0, 1.0)
    assert (wrong.proved, wrong.arcsec_a_turn > 0.0) == (False, True)
    assert wrong.learned(0.25, 480.0, 1.0).proved
    assert not wrong.learned(-0.25, 490.0, 1.0).proved, "two of four"
    assert turned_well(times=6).learned(0.25, -500.0, 1.0).arcsec_a_turn > 0.0


def test_a_sense_that_three_mistakes_in_a_row_spoke_against_is_found_again():
    """An altitude bolt asked three times, and turned the other way each time: 4 arcmin became 13 degrees."""
    bolt = ALTITUDE_BOLT
    for _ in range(3):
        bolt = bolt.learned(0.25, 500.0, 1.0)
    assert bolt.arcsec_a_turn > 0.0
    for _ in range(5):
        bolt = bolt.learned(0.25, -500.0, 1.0)
    assert (bolt.arcsec_a_turn < 0.0, bolt.proved) == (True, True)


def test_an_unproved_bolt_is_given_no_more_than_a_test_a_proved_one_nine_tenths_and_near_the_pole_all():
    def asked(error_arcsec, sure):
        usual = {"arcsec_a_turn": 2000.0, "proved": sure, "direction": -1, "seen_turns": 2.0}
        tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), AZIMUTH_BOLT))
        return tutor.advise(error_at(error_arcsec, 0.0, sigma=0.1)).turns

    for error_arcsec in (950.0, 5000.0, 40000.0):
        assert asked(error_arcsec, False) == -0.25
    assert asked(890.0, False) == -0.125
    assert asked(5000.0, True) == pytest.approx(-2.25)
    near = 10.0 * 15.0 / np.sqrt(2.0)  # ten tolerances
    usual = {"arcsec_a_turn": near / 0.52, "proved": True, "direction": -1, "seen_turns": 0.5}
    for off, turns in ((0.98 * near, -0.5), (1.02 * near, -0.375)):  # 0.51 turns, and 0.9 of 0.53
        tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), AZIMUTH_BOLT))
        assert tutor.advise(error_at(off, 0.0, sigma=0.1)).turns == turns
    assert asked(40000.0, True) == -6.0  # then measure again
    small = replace(ALTITUDE_BOLT, arcsec_a_turn=2000.0, proved=True, direction=-1, seen_turns=0.25)
    told = BoltTutor(bolts=(small, AZIMUTH_BOLT)).advise(error_at(40000.0, 0.0))
    assert told.turns == -1.0, "four times what was seen to work"


def test_the_test_nudge_is_a_quarter_turn_and_half_of_it_for_a_small_error():
    assert BoltTutor().advise(error_at(910.0, 0.0)).turns == 0.25
    assert BoltTutor().advise(error_at(890.0, 0.0)).turns == 0.125


def test_the_tolerance_is_a_share_of_the_goal_or_one_sigma():
    tutor = BoltTutor(goal_arcsec=30.0)
    assert tutor.tolerance_arcsec(error_at(100.0, 0.0), Knob.ALTITUDE) == pytest.approx(30.0 / np.sqrt(2.0))
    pole = pole_direction(Site(45.0, 0.0))
    unsure = PolarError(pole, pole, np.diag([40.0, 70.0]) ** 2 * ARCSEC**2)
    assert tutor.tolerance_arcsec(unsure, Knob.ALTITUDE) == pytest.approx(40.0)
    assert tutor.tolerance_arcsec(unsure, Knob.AZIMUTH) == pytest.approx(70.0)


TOLERANCE = 40.0  # one sigma, where that is more than the goal's share


def knob_off(knob, on_sky_arcsec, sigma=TOLERANCE):
    """An error of one knob alone, and the knob's arcseconds for one on the sky."""
    share = 1.0 if knob is Knob.ALTITUDE else np.cos(alt_az(pole_direction(Site(45.0, 0.0)))[0])
    off = (on_sky_arcsec, 0.0) if knob is Knob.ALTITUDE else (0.0, on_sky_arcsec / share)
    return error_at(*off, sigma=sigma), share


@pytest.mark.parametrize("knob", list(Knob))
@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(
    ("hand_arcsec", "direction", "limit"),
    [
        (1.0, 0, 40.0),
        (1.0, 1, 40.0),  # it goes on
        (1.0, -1, 64.0),  # it would have to come back: 1.6 tolerances
        (50.0, 0, 40.0),
        (50.0, 1, 50.0),
        (50.0, -1, 64.0),
        (200.0, 1, 68.0),  # 1.7 tolerances, however coarse
        (200.0, -1, 68.0),
    ],
)
def test_a_bolt_is_left_within_its_tolerance_or_where_a_hand_can_do_no_better(
    knob, sense, hand_arcsec, direction, limit
):
    """A hand turns by two degrees at least, and 0.7 of what they move are left alone."""
    _, share = knob_off(knob, 0.0)
    a_turn = sense * hand_arcsec / share / (0.7 * 2.0 / 360.0)
    own, other = (ALTITUDE_BOLT, AZIMUTH_BOLT) if knob is Knob.ALTITUDE else (AZIMUTH_BOLT, ALTITUDE_BOLT)
    for off, told in ((0.97 * limit, None), (1.03 * limit, knob)):
        bolt = replace(own, arcsec_a_turn=a_turn, proved=True, direction=int(sense) * direction)
        tutor = BoltTutor(goal_arcsec=15.0, bolts=(bolt, other))
        assert tutor.advise(knob_off(knob, -off)[0]).knob is told


def test_a_bolt_that_was_told_to_come_back_is_on_its_way_until_it_is_seen_to_move():
    """Inside 1.6 tolerances, but not inside one: it goes on through its backlash."""
    bolt = replace(ALTITUDE_BOLT, arcsec_a_turn=2000.0, proved=True, direction=-1)
    tutor = BoltTutor(goal_arcsec=15.0, bolts=(bolt, AZIMUTH_BOLT))
    noise = (TOLERANCE, TOLERANCE)
    assert tutor.advise(knob_off(Knob.ALTITUDE, -100.0)[0], noise_arcsec=noise).turns > 0.0
    assert tutor.advise(knob_off(Knob.ALTITUDE, -50.0)[0], noise_arcsec=noise).turns > 0.0
    assert tutor.moves == 1
    assert tutor.advise(knob_off(Knob.ALTITUDE, -39.0)[0], noise_arcsec=noise).step is TutorStep.STOP


def test_the_noise_of_the_azimuth_knob_is_longer_than_the_skys_where_its_error_is_none_too():
    """A change of 400 of the knob, four sigmas of which are 480; 340 they would be of the altitude's."""
    tutor = BoltTutor()
    assert tutor.advise(error_at(10.0, 400.0), noise_arcsec=(60.0, 60.0)).knob is Knob.AZIMUTH
    tutor.advise(error_at(10.0, 0.0), noise_arcsec=(60.0, 60.0))
    assert tutor.bolts[Knob.AZIMUTH].arcsec_a_turn is None


@pytest.mark.parametrize(
    ("direction", "backlash_turns", "said"),
    [(1, 0.1, True), (1, 2.0 / 360.0, True), (1, 1.9 / 360.0, False), (-1, 0.1, False), (0, 0.1, False)],
)
def test_backlash_is_named_when_the_bolt_comes_back_through_as_much_as_a_hand_can_turn(direction, backlash_turns, said):
    bolt = Bolt(Knob.ALTITUDE, "altitude bolt", 2000.0, True, backlash_turns, direction)
    told = BoltTutor(bolts=(bolt, AZIMUTH_BOLT)).advise(error_at(4000.0, 0.0))
    assert told.turns < 0.0
    assert ("(backlash included)" in told.words) is said
    assert told.words.endswith("anticlockwise (backlash included), then wait." if said else "clockwise, then wait.")


@pytest.mark.parametrize(("goals", "told"), [(1.43, None), (1.47, Knob.ALTITUDE)])
def test_another_move_is_not_worth_less_than_half_a_goal(goals, told):
    """Nearly: up to 1.45 goals it is good as it is, unless the bolt is on its way."""
    usual = {"arcsec_a_turn": 200.0, "proved": True, "direction": 1}
    error = error_at(-15.0 * goals, 0.0, sigma=0.1)
    assert BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), AZIMUTH_BOLT)).advise(error).knob is told
    on_its_way = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), AZIMUTH_BOLT))
    on_its_way.advise(error_at(-60.0, 0.0, sigma=0.1))
    assert on_its_way.advise(error).knob is Knob.ALTITUDE
    assert on_its_way.moves == 1


def test_a_test_that_moved_the_other_axis_is_none_and_is_said():
    tutor = BoltTutor()
    tutor.advise(error_at(100.0, 4000.0))
    told = tutor.advise(error_at(1000.0, 4001.0))
    assert told.words == (
        "That moved altitude, not azimuth (+15.0′). Turn it back, or take it from here."
        " Left azimuth bolt: a quarter turn anticlockwise, then wait."
    )
    assert tutor.bolts[Knob.AZIMUTH].arcsec_a_turn is None
    assert tutor.bolts[Knob.ALTITUDE].arcsec_a_turn is None, "whoever turned what: that was no test of it either"
    back = tutor.advise(error_at(110.0, 4001.0))  # it was turned back
    assert back.words.startswith("Left azimuth bolt")
    assert tutor.advise(error_at(110.0, 3500.0)).step is TutorStep.TURN
    altitude = BoltTutor()
    altitude.advise(error_at(4000.0, 100.0))
    assert altitude.advise(error_at(4000.0, -800.0)).words.startswith("That moved azimuth, not altitude (−15.0′).")


def test_a_wrong_bolt_turned_by_somebody_leaves_a_proved_one_proved_and_its_play_known():
    usual = {"arcsec_a_turn": 2000.0, "proved": True, "direction": 1, "backlash_turns": 0.1}
    tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), replace(AZIMUTH_BOLT, **usual)))
    tutor.advise(error_at(-100.0, -3000.0))
    tutor.advise(error_at(-2100.0, -3000.0))  # altitude went down: anticlockwise
    assert tutor.bolts[Knob.AZIMUTH] == replace(AZIMUTH_BOLT, **usual)
    assert tutor.bolts[Knob.ALTITUDE] == replace(ALTITUDE_BOLT, **usual | {"direction": -1})


def test_a_bolt_moved_by_mistake_stands_at_the_other_end_of_its_backlash():
    bolt = with_backlash()
    there = bolt.moved_by_mistake(-300.0)
    assert bolt.needed(1000.0) == pytest.approx(-0.5 - 0.2, abs=0.07)
    assert there.needed(1000.0) == pytest.approx(-0.5, abs=0.03)
    assert there.needed(-1000.0) == pytest.approx(0.5 + 0.2, abs=0.07)
    assert ALTITUDE_BOLT.moved_by_mistake(300.0) == ALTITUDE_BOLT


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_bolts_that_move_each_others_axis_are_tested_towards_the_pole_and_then_no_more(sense):
    """A clock six hours wrong does that: 14 arcmin became 3 degrees."""
    at, tutor, farthest = np.array([3000.0, -5000.0]), BoltTutor(), 0.0
    for _ in range(12):
        told = tutor.advise(error_at(*at), noise_arcsec=(2.0, 2.0))
        if told.step is TutorStep.STOP:
            break
        assert abs(told.turns) <= 0.25
        at[int(told.knob is Knob.ALTITUDE)] += sense * 2400.0 * told.turns * (1.0 if told.knob is Knob.ALTITUDE else -1)
        farthest = max(farthest, *np.abs(at) - [3000.0, 5000.0])
    assert told.words == "Each bolt moves the other axis. Check the clock and time zone, and which bolt is which."
    assert all(tutor.crosses(knob) for knob in Knob), "by bolts that are proved to"
    assert told.stray
    assert farthest <= 600.0, "one test at most goes the wrong way"
    assert not tutor.witness


def test_turns_of_the_other_bolt_that_do_not_agree_accuse_no_clock():
    """Somebody takes hold of any bolt: what its turns moved the other axis by proves nothing unless four agree."""
    at, tutor = np.array([3000.0, -5000.0]), BoltTutor()
    for moved in (300.0, 900.0, 300.0, 900.0, 300.0, 900.0, 300.0, 900.0, 300.0, 900.0):
        told = tutor.advise(error_at(*at), noise_arcsec=(2.0, 2.0))
        assert told.step is not TutorStep.STOP
        assert "time zone" not in told.words
        at[int(told.knob is Knob.ALTITUDE)] += moved * np.sign(told.turns)
    assert not any(bolt.proved for bolt in tutor.bolts.values())


def test_the_clock_is_not_accused_before_both_bolts_are_proved_to_move_the_other_axis():
    """Turns of each agree within a factor of two: no proof yet of how far a turn of the bolt goes."""
    at, tutor, doubted = np.array([3000.0, -5000.0]), BoltTutor(), False
    for number in range(20):
        told = tutor.advise(error_at(*at), noise_arcsec=(2.0, 2.0))
        if told.step is TutorStep.STOP:
            break
        proved = all(tutor._across[knob].proved for knob in Knob)
        doubted = doubted or (min(len(tutor._strays[knob]) for knob in Knob) >= STUBBORN and not proved)
        size = (900.0, 500.0)[number // 2 % 2] * abs(told.turns) / 0.25
        at[int(told.knob is Knob.ALTITUDE)] += size * np.sign(told.turns)
    assert doubted, "they agreed, and the clock was not accused"
    assert told.words.startswith("Each bolt moves the other axis.")
    assert all(tutor._across[knob].proved for knob in Knob)


def turned_sky(hours, coupling=0.0):
    """A tutor that has proved both bolts under a clock so far wrong, or with bolts that drag the other axis along."""
    tutor, angle = BoltTutor(), np.radians(15.0 * hours)
    at = np.array([6000.0, 5000.0])  # altitude, azimuth on the sky
    for _ in range(12):
        told = tutor.advise(error_at(at[0], at[1] / np.cos(np.radians(45.0))), noise_arcsec=(2.0, 2.0))
        if told.knob is None:
            break
        size = 2500.0 * told.turns
        way = np.array([1.0, coupling]) if told.knob is Knob.ALTITUDE else np.array([coupling, 1.0])
        # from azimuth to altitude, as the sky is turned
        at = at + size * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]) @ way
        yield tutor, told


def test_the_clock_is_accused_by_proved_bolts_alone():
    accused = [(t.witness, all(bolt.proved for bolt in t.bolts.values())) for t, _ in turned_sky(2.0)]
    first = next(number for number, (witness, _) in enumerate(accused) if witness)
    assert accused[first][1], "either was seen to move its own axis, and proved"
    assert float(accused[first][0].split("off by ")[1].split(" h")[0]) == pytest.approx(2.0, abs=0.15)
    assert first >= 3, "both bolts, and each seen to move twice"
    assert not any(tutor.witness for tutor, _ in turned_sky(0.0))
    assert not any(tutor.witness for tutor, _ in turned_sky(0.0, coupling=0.3)), "dragging is not a turn of the sky"


def test_one_proved_bolt_does_not_accuse_the_clock_beside_one_that_was_turned_once():
    """Two hours wrong: altitude is good after its test, and azimuth is proved."""
    at, tutor, angle, seen = np.array([700.0, -650.0]), BoltTutor(), np.radians(30.0), []
    for _ in range(8):
        told = tutor.advise(error_at(at[0], at[1] / np.cos(np.radians(45.0))), noise_arcsec=(2.0, 2.0))
        proved = [tutor.bolts[knob].proved for knob in Knob]
        seen.append((proved, bool(tutor.witness)))
        if told.knob is None:
            break
        across = np.array([-np.sin(angle), np.cos(angle)])
        along = np.array([np.cos(angle), np.sin(angle)])
        at = at + (-6466.0 * along if told.knob is Knob.ALTITUDE else 2500.0 * across) * told.turns
    assert [False, True] in [proved for proved, _ in seen] or [True, False] in [proved for proved, _ in seen]
    assert not any(accused for proved, accused in seen if not all(proved))


def test_four_turns_one_way_are_outweighed_by_five_the_other():
    """A hand that always goes the other way is a bolt of the other sense: whatever its first turns said, more count."""
    bolt = ALTITUDE_BOLT
    for change in (500.0,) * 4 + (-500.0,) * 3:
        bolt = bolt.learned(0.25, change, 1.0)
        assert bolt.arcsec_a_turn > 0.0
    for _ in range(3):
        bolt = bolt.learned(0.25, -500.0, 1.0)
    assert bolt.arcsec_a_turn < 0.0, "six against four"
    assert bolt.proved


def test_a_careless_hand_is_given_no_turn_that_made_the_other_way_would_end_worse_than_it_began():
    usual = {"arcsec_a_turn": 4000.0, "proved": True, "direction": -1, "backlash_turns": 0.3, "seen_turns": 1.0}
    tutor = BoltTutor(bolts=(ALTITUDE_BOLT, replace(AZIMUTH_BOLT, **usual)))
    assert tutor.advise(error_at(0.0, 2000.0)).knob is Knob.AZIMUTH
    tutor.bolts[Knob.AZIMUTH] = replace(AZIMUTH_BOLT, **usual)
    for _ in range(2):  # twice the other bolt
        tutor.advise(error_at(900.0, 1999.0))
        tutor.advise(error_at(0.0, 1999.0))
    assert tutor.careless
    asked = tutor.advise(error_at(0.0, 1000.0))
    assert asked.knob is Knob.AZIMUTH
    on_sky = 4000.0 * abs(asked.turns) * np.cos(np.radians(45.0))
    assert on_sky + 1000.0 * np.cos(np.radians(45.0)) <= 2000.0 * np.cos(np.radians(45.0))


def test_a_careless_hand_turns_the_larger_error_first():
    usual = {"arcsec_a_turn": 2000.0, "proved": True, "direction": 1, "seen_turns": 1.0}
    for strayed, knob in ((0, Knob.ALTITUDE), (2, Knob.AZIMUTH)):
        tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), replace(AZIMUTH_BOLT, **usual)))
        assert tutor.advise(error_at(-900.0, 100.0)).knob is Knob.ALTITUDE
        tutor.measured_again()
        tutor._strayed = strayed
        assert tutor.advise(error_at(-300.0, 1300.0)).knob is knob


def test_the_amounts_in_the_sentence_are_those_on_the_screen():
    told = BoltTutor(bolts=bolts_of(Base.HEAD)).advise(error_at(2820.0, 0.0))
    assert "47.0′ to go" in told.words
    assert "12.0′ to go" in told.with_amounts(error_at(720.0, 300.0))
    stop = BoltTutor().advise(error_at(5.0, 3.0))
    assert stop.with_amounts(error_at(9.0, 0.0)) == "9″ ± 2″ from the pole. Tighten, then check."


def test_a_bolt_whose_sense_turned_over_starts_again_with_a_test():
    """Three turns the other way, the last of a whole turn; then six as told: none of those vouches for four turns."""
    bolt = ALTITUDE_BOLT
    for turns, change in ((0.25, -500.0), (0.25, -500.0), (1.0, -2000.0)):
        bolt = bolt.learned(turns, change, 1.0)
    assert (bolt.proved, bolt.seen_turns) == (True, 1.0)
    for _ in range(6):
        bolt = bolt.learned(0.25, 500.0, 1.0)
    assert bolt.arcsec_a_turn > 0.0
    assert bolt.seen_turns <= 0.25
    told = BoltTutor(bolts=(bolt, AZIMUTH_BOLT)).advise(error_at(40000.0, 0.0))
    assert -1.0 <= told.turns < 0.0


def test_a_bolt_whose_turns_contradict_each_other_is_tested_by_less():
    """It may go either way: as far as shows which."""
    once = ALTITUDE_BOLT.learned(0.25, 1500.0, 1.0)
    twice = once.learned(0.25, -1500.0, 1.0)
    for bolt, turns in ((once, 0.25), (twice, 0.0625)):
        told = BoltTutor(bolts=(bolt, AZIMUTH_BOLT)).advise(error_at(5000.0, 0.0))
        assert abs(told.turns) == pytest.approx(turns, abs=0.02)


def test_a_small_error_waits_while_the_other_is_large_but_for_a_bolt_that_obeys():
    """Seed 81061: twelve turns went into 1 arcmin of azimuth while altitude stood 3 deg off."""
    usual = {"arcsec_a_turn": 2000.0, "proved": True, "direction": 1, "seen_turns": 1.0}
    for unseen, knob in ((0, Knob.AZIMUTH), (1, Knob.ALTITUDE)):
        tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), replace(AZIMUTH_BOLT, **usual)))
        assert tutor.advise(error_at(300.0, 3000.0)).knob is Knob.AZIMUTH
        tutor.measured_again()
        tutor.bolts[Knob.AZIMUTH] = replace(tutor.bolts[Knob.AZIMUTH], unseen=unseen)
        assert tutor.advise(error_at(9000.0, 300.0)).knob is knob


def test_after_four_reversals_the_other_bolt_has_its_turn():
    usual = {"arcsec_a_turn": 2000.0, "proved": True, "direction": 1}
    tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), replace(AZIMUTH_BOLT, **usual)))
    asked = [tutor.advise(error_at(900.0 * (-1) ** n, 800.0)).knob for n in range(6)]
    assert asked == [Knob.ALTITUDE] * 5 + [Knob.AZIMUTH]


def test_a_hand_that_goes_too_far_again_and_again_is_asked_for_two_goals_and_a_half():
    usual = {"arcsec_a_turn": 2000.0, "proved": True, "direction": 1}
    tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), AZIMUTH_BOLT))
    for off in (600.0, -300.0, 40.0):
        assert tutor.advise(error_at(off, 0.0)).knob is Knob.ALTITUDE
    assert not tutor.rough
    tutor.advise(error_at(-300.0, 0.0))
    assert tutor.rough
    assert tutor.advise(error_at(39.0, 0.0)).knob is Knob.ALTITUDE
    assert tutor.advise(error_at(36.0, 0.0)).step is TutorStep.STOP


@pytest.mark.parametrize(
    ("error_arcsec", "words"),
    [
        (-50.0, "Altitude: a touch clockwise."),
        (70.0, "Altitude bolt: 12° anticlockwise, then wait."),
        (-70.0, "Altitude bolt: 12° clockwise, then wait."),
    ],
)
def test_what_is_less_than_ten_degrees_is_a_touch(error_arcsec, words):
    usual = {"arcsec_a_turn": 2000.0, "proved": True}
    tutor = BoltTutor(bolts=(replace(ALTITUDE_BOLT, **usual), AZIMUTH_BOLT))
    assert tutor.advise(error_at(error_arcsec, 0.0)).words == words
