"""What a frame that was solved blind tells of the motion, and the filter in another camera's axes."""

import numpy as np
import pytest

from kochab.attitude.filter import begin, predicted
from kochab.core.attitude import ARCSEC, Attitude, attitude_from, rotation_vector, small_rotation
from kochab.core.camera import Camera
from kochab.solver.tracker import SAME_MOTION_S, filter_after_blind_solve, in_axes_of

FIRST = attitude_from(80.0, 40.0, 10.0).matrix
SIGMAS = np.array([10.0, 20.0, 90.0]) * ARCSEC
LONG_S = 2.0 * SAME_MOTION_S


def sure(matrix):
    return Attitude(matrix, np.diag(SIGMAS) ** 2)


def test_after_a_long_gap_the_velocity_is_guessed_from_both_ends() -> None:
    rate = np.array([30.0, -50.0, 20.0]) * ARCSEC  # a second, about the camera's axes
    before = begin(sure(FIRST), 0.0)
    second = small_rotation(-rate * LONG_S) @ FIRST
    after = filter_after_blind_solve(before, sure(second), LONG_S, was_lost=False)
    assert after.rates_rad_s == pytest.approx(rate, rel=1e-6)
    ahead = predicted(after, 2.0 * LONG_S)
    assert np.allclose(ahead.matrix, small_rotation(-rate * 2.0 * LONG_S) @ FIRST, atol=1e-9)
    fresh = begin(sure(second), LONG_S)
    assert np.array_equal(after.covariance, fresh.covariance), "a guess is no knowledge"


def test_a_jump_tells_nothing_of_the_velocity() -> None:
    before = begin(sure(FIRST), 0.0)
    far = attitude_from(200.0, -20.0, 10.0)
    after = filter_after_blind_solve(before, sure(far.matrix), LONG_S, was_lost=False)
    assert not after.rates_rad_s.any()
    assert not filter_after_blind_solve(None, sure(FIRST), 0.0, was_lost=True).rates_rad_s.any()


def test_errors_are_as_large_in_another_cameras_axes() -> None:
    """The same error of the pointing is as likely, whichever model of the camera it is told in."""
    one = Camera(1000, 800, 1200.0, 499.5, 399.5)
    other = Camera(1000, 800, 1200.0, 899.5, 99.5)
    state = begin(sure(FIRST), 0.0)
    turned = in_axes_of(state, one, other)
    turn = turned.matrix @ FIRST.T
    assert np.degrees(np.linalg.norm(rotation_vector(turn))) > 10.0
    for error in np.diag(SIGMAS):
        moved = turn @ small_rotation(error) @ FIRST
        told = rotation_vector(moved @ turned.matrix.T)
        assert told @ np.linalg.solve(turned.covariance[:3, :3], told) == pytest.approx(1.0)
    assert in_axes_of(state, one, one) is state
    assert in_axes_of(state, None, one) is state
