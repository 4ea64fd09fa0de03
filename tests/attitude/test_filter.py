import numpy as np
import pytest

from kochab.attitude import small_rotation
from kochab.attitude.filter import ARCSEC, MotionModel, begin, predicted, rotation_vector, updated
from kochab.core.attitude import Attitude, attitude_from

SIGMA = 15.0 * ARCSEC


def measured(matrix, rng, sigma=SIGMA):
    noisy = small_rotation(rng.normal(0.0, sigma, 3)) @ matrix
    return Attitude(noisy, np.eye(3) * sigma**2)


def follow(path, rng, motion=None, dt=0.1, sigma=SIGMA):
    """States after each frame, and the truth, of ``path(t) -> rate (3,) rad/s``."""
    motion = motion or MotionModel()
    matrix = attitude_from(80.0, 40.0, 10.0).matrix
    state = begin(measured(matrix, rng, sigma), 0.0, motion)
    out = []
    for k in range(1, 400):
        for j in range(4):
            matrix = small_rotation(-path((k - 1 + (j + 0.5) / 4) * dt) * dt / 4) @ matrix
        state = updated(predicted(state, k * dt, motion), measured(matrix, rng, sigma), motion)
        out.append((state, matrix))
    return out


def error(state, matrix):
    return rotation_vector(matrix @ state.matrix.T)


@pytest.mark.parametrize("vector", [[0, 0, 0], [1e-9, 0, 2e-9], [0.3, -0.2, 0.1], [0, 3.0, 0]])
def test_rotation_vector_undoes_small_rotation(vector) -> None:
    assert np.allclose(rotation_vector(small_rotation(np.array(vector, float))), vector, atol=1e-12)


def test_a_steady_turn_is_averaged_and_its_rate_found() -> None:
    rng = np.random.default_rng(1)
    rate = np.radians([0.002, -0.004, 0.01])
    late = follow(lambda t: rate, rng)[100:]
    off = np.array([error(*pair) for pair in late]) / ARCSEC
    assert off.std() < 7.0  # from 15
    rates = np.array([s.rates_rad_s for s, _ in late]) / ARCSEC
    assert np.abs(rates.mean(axis=0) - rate / ARCSEC).max() < 1.5


def test_the_covariance_is_honest() -> None:
    rng = np.random.default_rng(2)
    late = follow(lambda t: np.radians([0.01, 0.0, 0.0]), rng)[50::10]
    chi2 = [e @ np.linalg.solve(s.covariance[:3, :3], e) for s, m in late for e in [error(s, m)]]
    assert 0.8 < np.mean(chi2) < 4.5  # 3 when all motion is as modelled; here it is quieter
    rates = [(s.rates_rad_s - np.radians([0.01, 0, 0])) / np.sqrt(np.diag(s.covariance)[3:]) for s, _ in late]
    assert np.sqrt(np.mean(np.square(rates))) < 1.6


def test_a_slew_that_begins_is_followed_and_forgotten() -> None:
    rng = np.random.default_rng(3)

    def path(t):
        return np.radians([0.0, 1.0, 0.0]) if 10.0 < t < 20.0 else np.zeros(3)

    run = follow(path, rng)
    assert any(s.contradicted for s, _ in run[98:104])
    during = [np.linalg.norm(error(s, m)) / ARCSEC for s, m in run[110:195]]
    assert np.median(during) < 40.0
    rate = np.array([s.rates_deg_s for s, _ in run[120:195]])
    assert np.abs(np.median(rate, axis=0) - [0, 1, 0]).max() < 0.01
    after = [np.linalg.norm(error(s, m)) / ARCSEC for s, m in run[350:]]
    assert np.median(after) < 20.0
    assert run[-1][0].agility < 100.0


def test_time_does_not_run_backwards_and_the_matrix_stays_a_rotation() -> None:
    rng = np.random.default_rng(4)
    state = follow(lambda t: np.radians([0.1, 0.2, -0.3]), rng)[-1][0]
    earlier = predicted(state, state.time_s - 5.0, MotionModel())
    assert np.allclose(earlier.matrix, state.matrix)
    assert np.allclose(state.matrix @ state.matrix.T, np.eye(3), atol=1e-10)
    assert np.linalg.eigvalsh(state.covariance).min() > 0


def test_an_attitude_without_covariance_is_refused() -> None:
    with pytest.raises(ValueError, match="covariance"):
        begin(attitude_from(1.0, 2.0, 3.0), 0.0, MotionModel())


def test_two_short_predictions_are_one_long_one() -> None:
    """White acceleration knows no frames: how often it is looked at changes nothing."""
    motion = MotionModel(wander_arcsec_s=30.0)
    begun = begin(measured(np.eye(3), np.random.default_rng(5)), 0.0, motion)
    once = predicted(begun, 0.7, motion).covariance
    twice = predicted(predicted(begun, 0.2, motion), 0.7, motion).covariance
    assert np.allclose(once, twice, rtol=1e-12, atol=0.0)
    assert np.array_equal(once, once.T)
