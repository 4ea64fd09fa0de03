"""One axis: profiles keep to speed and acceleration, gears have play, clutches slip."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.simulate.mechanics.axis import GearErrors, MotorAxis

degrees = st.floats(-170.0, 170.0)
rates = st.floats(-4.0, 4.0)


@given(start=degrees, first=rates, wait=st.floats(0.0, 5.0), target=degrees, carrier=st.sampled_from([0.0, 15 / 3600]))
def test_a_slew_arrives_keeps_its_limits_and_never_jumps(start, first, wait, target, carrier):
    axis = MotorAxis(start, 0.0)
    axis.run(0.0, first)
    before = axis.motor_deg(wait)
    end = axis.slew(wait, target, carrier)
    assert axis.motor_deg(wait) == pytest.approx(before, abs=1e-9)
    assert axis.motor_deg(end) == pytest.approx(target + carrier * (end - wait), abs=1e-6)
    assert axis.motor_deg(end + 100) == pytest.approx(target + carrier * (end + 100 - wait), abs=1e-6)
    t = np.linspace(wait, end, 400)
    angle = np.array([axis.motor_deg(x) for x in t])
    rate = np.array([axis.motor_rate_deg_s(x) for x in t])
    assert abs(rate).max() <= 4.0 + 0.02 + 1e-9
    if end > wait:
        step = (end - wait) / 399
        assert abs(np.diff(angle)).max() <= 4.1 * step + 1e-9
        assert abs(np.diff(rate)).max() <= 2.0 * step + 1e-6 + carrier


def test_a_long_slew_takes_as_long_as_speed_and_acceleration_say():
    axis = MotorAxis(0.0, 0.0)
    assert axis.slew(0.0, 60.0) == pytest.approx(60.0 / 4.0 + 4.0 / 2.0)
    short = MotorAxis(0.0, 0.0)
    assert short.slew(0.0, 2.0) == pytest.approx(2.0 * np.sqrt(2.0 / 2.0))


def test_the_past_can_be_asked_after_new_commands():
    axis = MotorAxis(10.0, 0.0)
    axis.run(0.0, 1.0, gently=False)
    at_three = axis.true_deg(3.0)
    axis.run(5.0, -2.0)
    axis.slew(6.0, 50.0)
    assert axis.true_deg(3.0) == at_three == pytest.approx(13.0)


@given(play=st.floats(0.001, 0.2), way=st.floats(0.5, 5.0))
def test_backlash_is_lost_at_every_reversal(play, way):
    axis = MotorAxis(0.0, 0.0, GearErrors(backlash_deg=play))
    end = axis.slew(0.0, way)
    assert axis.true_deg(end) == pytest.approx(way - play / 2.0)
    back = axis.slew(end, 0.0)
    assert axis.true_deg(back) == pytest.approx(play / 2.0)
    axis.slew(back, 0.2 * play)  # within the play nothing turns
    assert axis.true_deg(back + 10.0) == pytest.approx(play / 2.0)


@given(way=st.floats(-20.0, 20.0), play=st.floats(0.0, 0.05), carrier=st.sampled_from([0.0, 15 / 3600]))
def test_an_approach_ends_on_the_same_side_of_the_play(way, play, carrier):
    axis = MotorAxis(0.0, 0.0, GearErrors(backlash_deg=play))
    end = axis.slew(0.0, way, carrier, approach_deg=0.1)
    target = way + carrier * end
    assert axis.motor_deg(end) == pytest.approx(target, abs=1e-9)
    assert axis.true_deg(end + 1.0) == pytest.approx(target + carrier - play / 2.0, abs=1e-6)


def test_backlash_in_one_segment_that_turns_back():
    axis = MotorAxis(0.0, 0.0, GearErrors(backlash_deg=0.1))
    axis.run(0.0, 2.0)
    axis.run(3.0, -2.0)  # brakes through zero within one segment
    top = max(axis.motor_deg(t) for t in np.linspace(0.0, 5.0, 5001))
    assert axis.true_deg(4.001) == pytest.approx(top - 0.05, abs=1e-5)


def test_periodic_error_has_its_amplitude_and_its_period():
    axis = MotorAxis(0.0, 0.0, GearErrors(periodic_arcsec=12.0, worm_deg=2.0, worm_phase_deg=30.0))
    axis.run(0.0, 15.0 / 3600.0, gently=False)
    t = np.arange(0.0, 960.0, 1.0)
    error = np.array([axis.true_deg(x) - axis.motor_deg(x) for x in t]) * 3600.0
    assert error.max() == pytest.approx(12.0, abs=0.01)
    assert error.min() == pytest.approx(-12.0, abs=0.01)
    np.testing.assert_allclose(error[:480], error[480:960], atol=1e-6)
    assert error[0] == pytest.approx(6.0)


def test_a_slipping_clutch_loses_a_part_of_fast_turns_only():
    axis = MotorAxis(0.0, 0.0, GearErrors(slip=0.01))
    end = axis.slew(0.0, 30.0)
    assert axis.true_deg(end) == pytest.approx(30.3)
    end = axis.slew(end, 0.0)
    assert axis.true_deg(end) == pytest.approx(0.6)
    axis.run(end, 15.0 / 3600.0, gently=False)
    assert axis.true_deg(end + 240.0) == pytest.approx(1.6)


def test_a_wrong_rate_adds_up_while_it_tracks():
    axis = MotorAxis(0.0, 0.0, GearErrors(rate_error=0.001))
    axis.run(0.0, 15.0 / 3600.0, gently=False)
    assert (axis.true_deg(3600.0) - axis.motor_deg(3600.0)) * 3600 == pytest.approx(54.0)


def test_a_stop_rings_and_dies_away():
    axis = MotorAxis(0.0, 0.0, GearErrors(wobble_arcsec=30.0, wobble_hz=2.0, wobble_s=1.0))
    end = axis.slew(0.0, 10.0)
    swing = [abs(axis.true_deg(end + k * 0.25) - 10.0) * 3600.0 for k in range(0, 40)]
    assert swing[0] == pytest.approx(30.0)
    assert swing[4] == pytest.approx(30.0 * np.exp(-1.0))
    assert max(swing[32:]) < 0.02
    axis.nudge(end + 20.0, 7.5 / 3600.0, 1.0, 0.0)  # guiding does not ring
    assert axis.true_deg(end + 21.0) == pytest.approx(10.0 + 7.5 / 3600.0, abs=1e-6)


def test_guiding_adds_its_rate_for_its_time():
    axis = MotorAxis(0.0, 0.0)
    axis.run(0.0, 15.0 / 3600.0, gently=False)
    axis.nudge(10.0, -7.5 / 3600.0, 2.0, 15.0 / 3600.0)
    assert axis.motor_deg(20.0) * 3600.0 == pytest.approx(20 * 15.0 - 15.0)


def test_hands_turn_the_telescope_and_not_the_motor():
    axis = MotorAxis(5.0, 0.0)
    end = axis.slew(0.0, 45.0)
    axis.displace(2.0, 3.0)
    assert axis.motor_deg(end) == pytest.approx(45.0)
    assert axis.true_deg(end) == pytest.approx(48.0)
    assert axis.true_deg(1.9) == pytest.approx(axis.motor_deg(1.9))


def test_old_motion_is_forgotten_and_memory_does_not_grow():
    axis = MotorAxis(0.0, 0.0, GearErrors(backlash_deg=0.01, rate_error=0.01))
    for k in range(3000):
        axis.nudge(10.0 * k, 0.002 * (-1) ** k, 1.0, 0.0)
    assert len(axis._segments) < 500
    assert axis.motor_deg(30000.0) == pytest.approx(0.0, abs=1e-6)
