from dataclasses import replace

import numpy as np
import pytest

from kochab.attitude import filter as filtering
from kochab.attitude.filter import begin, predicted, updated
from kochab.core.attitude import ARCSEC, Attitude, attitude_from, rotation_vector, small_rotation

SIGMA = 15.0 * ARCSEC


def measured(matrix, rng, sigma=SIGMA):
    noisy = small_rotation(rng.normal(0.0, sigma, 3)) @ matrix
    return Attitude(noisy, np.eye(3) * sigma**2)


def follow(path, rng, dt=0.1, sigma=SIGMA):
    """States after each frame, and the truth, of ``path(t) -> rate (3,) rad/s``."""
    matrix = attitude_from(80.0, 40.0, 10.0).matrix
    state = begin(measured(matrix, rng, sigma), 0.0)
    out = []
    for k in range(1, 400):
        for j in range(4):
            matrix = small_rotation(-path((k - 1 + (j + 0.5) / 4) * dt) * dt / 4) @ matrix
        state = updated(predicted(state, k * dt), measured(matrix, rng, sigma))
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
    earlier = predicted(state, state.time_s - 5.0)
    assert np.allclose(earlier.matrix, state.matrix)
    assert np.allclose(state.matrix @ state.matrix.T, np.eye(3), atol=1e-10)
    assert np.linalg.eigvalsh(state.covariance).min() > 0


def test_an_attitude_without_covariance_is_refused() -> None:
    with pytest.raises(ValueError, match="covariance"):
        begin(attitude_from(1.0, 2.0, 3.0), 0.0)


def test_two_short_predictions_are_one_long_one() -> None:
    """White acceleration knows no frames: how often it is looked at changes nothing."""
    begun = begin(measured(np.eye(3), np.random.default_rng(5)), 0.0)
    once = predicted(begun, 0.7).covariance
    twice = predicted(predicted(begun, 0.2), 0.7).covariance
    assert np.allclose(once, twice, rtol=1e-12, atol=0.0)
    assert np.array_equal(once, once.T)


def quiet_state(rate_sigma_arcsec_s=1.0, sigma=SIGMA):
    """A mount that stands, known to ``sigma`` and to ``rate_sigma_arcsec_s`` on each axis."""
    state = begin(Attitude(attitude_from(80.0, 40.0, 10.0).matrix, np.eye(3) * sigma**2), 100.0)
    state.covariance[3:, 3:] = np.eye(3) * (rate_sigma_arcsec_s * ARCSEC) ** 2
    return state


def seen_off(state, arcsec, sigma=SIGMA):
    """A frame that shows the camera turned by ``arcsec`` (3,) from where the filter has it."""
    return Attitude(small_rotation(np.array(arcsec) * ARCSEC) @ state.matrix, np.eye(3) * sigma**2)


def test_at_first_the_velocity_is_zero_within_what_the_model_says() -> None:
    state = begin(measured(np.eye(3), np.random.default_rng(6)), 12.5)
    assert state.rates_deg_s == (0.0, 0.0, 0.0)
    assert state.rates_sigma_deg_s == pytest.approx((1.0 / 30.0,) * 3)
    assert np.allclose(state.attitude.covariance, np.eye(3) * SIGMA**2)
    assert (state.time_s, state.agility, state.contradicted) == (12.5, 1.0, False)
    assert (state.chi2, state.step_s) == (0.0, 0.0)


def test_a_second_of_wander_is_what_the_model_says(monkeypatch) -> None:
    """White acceleration: the velocity's sigma grows with the root of time, the angle's with its 3/2 power."""
    monkeypatch.setattr(filtering, "WANDER_RAD_S", 30.0 * ARCSEC)
    known = quiet_state(1e-6, 1e-12)
    for seconds in (1.0, 4.0):
        later = predicted(known, known.time_s + seconds)
        assert later.rates_sigma_deg_s == pytest.approx((30.0 * seconds**0.5 / 3600.0,) * 3)
        angle = np.sqrt(np.diag(later.attitude.covariance)) / ARCSEC
        assert angle == pytest.approx(30.0 * seconds**1.5 / np.sqrt(3.0))
        assert (later.time_s, later.step_s) == (known.time_s + seconds, seconds)


def test_a_frame_is_taken_in_as_bayes_has_it() -> None:
    """The gain's form against the other one: informations add, the mean is weighted by them."""
    state = predicted(quiet_state(100.0), 100.7)
    seen = seen_off(state, (9.0, -14.0, 6.0), 2.0 * SIGMA)
    after = updated(state, seen)
    prior = np.linalg.inv(state.covariance)
    told = np.zeros((6, 6))
    told[:3, :3] = np.eye(3) / (2.0 * SIGMA) ** 2
    covariance = np.linalg.inv(prior + told)
    np.testing.assert_allclose(after.covariance, covariance, rtol=1e-9, atol=1e-9 * covariance[0, 0])
    step = covariance @ told @ np.append(rotation_vector(seen.matrix @ state.matrix.T), np.zeros(3))
    np.testing.assert_allclose(error(state, after.matrix), step[:3], rtol=1e-6)
    np.testing.assert_allclose(after.rates_rad_s, step[3:], rtol=1e-6)
    gap = np.array([9.0, -14.0, 6.0]) * ARCSEC
    spread = state.covariance[:3, :3] + np.eye(3) * (2.0 * SIGMA) ** 2
    assert after.chi2 == pytest.approx(gap @ np.linalg.inv(spread) @ gap, rel=1e-6)
    assert not after.contradicted


def test_a_frame_that_contradicts_makes_the_velocity_uncertain_and_sets_it() -> None:
    """A mount that stood and is half a degree off a second later has turned by that much in it."""
    state = predicted(quiet_state(), 101.0)
    ordinary = updated(state, seen_off(state, (5.0, 0.0, 0.0)))
    after = updated(state, seen_off(state, (1800.0, 0.0, 0.0)))
    assert after.contradicted
    assert after.rates_deg_s == pytest.approx((-0.5, 0.0, 0.0), abs=0.002)
    assert np.linalg.norm(error(after, seen_off(state, (1800.0, 0.0, 0.0)).matrix)) < 0.1 * SIGMA
    assert min(after.rates_sigma_deg_s) > 3.0 * max(ordinary.rates_sigma_deg_s)
    assert np.linalg.eigvalsh(after.covariance).min() > 0.0


def test_a_jump_is_believed_however_far_beyond_the_model_it_is() -> None:
    """Ten degrees in a tenth of a second is no slew, yet the next prediction starts from there."""
    state = predicted(quiet_state(), 100.1)
    after = updated(state, seen_off(state, (0.0, 36000.0, 0.0)))
    assert after.rates_deg_s == pytest.approx((0.0, -100.0, 0.0), rel=1e-3, abs=1e-3)


def test_a_frame_at_the_gate_is_believed_and_one_beyond_it_contradicts() -> None:
    state = quiet_state()
    sigma = np.sqrt(2.0) * SIGMA / ARCSEC  # of the filter and of the frame
    for chi2, contradicts in ((0.98 * filtering.GATE, False), (1.02 * filtering.GATE, True)):
        after = updated(state, seen_off(state, (np.sqrt(chi2) * sigma, 0.0, 0.0)))
        assert (after.chi2, after.contradicted) == (pytest.approx(chi2, rel=1e-6), contradicts)


@pytest.mark.parametrize(
    ("chi2", "factor"),
    [(3.0, 0.914), (3.9, 1.0), (0.0, 0.677), (30.0, 13.6), (3000.0, 13.6)],
    ids=["as believed", "a little more", "quieter", "far off", "however far"],
)
def test_the_agility_falls_by_nine_percent_a_quiet_frame_and_jumps_after_a_surprise(chi2, factor) -> None:
    state = replace(quiet_state(), agility=100.0)
    sigma = np.sqrt(2.0) * SIGMA / ARCSEC
    after = updated(state, seen_off(state, (0.0, 0.0, np.sqrt(chi2) * sigma)))
    assert after.agility / state.agility == pytest.approx(factor, rel=2e-3)


def test_the_agility_stays_between_a_tracking_and_the_wildest_mount() -> None:
    calm, wild = replace(quiet_state(), agility=1.0), replace(quiet_state(), agility=1e10)
    assert updated(calm, seen_off(calm, (0.0, 0.0, 0.0))).agility == 1.0
    assert updated(wild, seen_off(wild, (0.0, 7200.0, 0.0))).agility == 1e10
    later = predicted(replace(quiet_state(1e-6, 1e-12), agility=1e10), 101.0)
    assert later.rates_sigma_deg_s == pytest.approx((55.6,) * 3, rel=1e-3)


def test_a_mount_turns_by_two_arcminutes_a_second_and_wanders_by_two_arcseconds() -> None:
    state = begin(Attitude(np.eye(3), np.eye(3) * SIGMA**2), 0.0)
    assert state.rates_sigma_deg_s == pytest.approx((1.0 / 30.0,) * 3)
    later = predicted(quiet_state(1e-6, 1e-12), 101.0)
    assert later.rates_sigma_deg_s == pytest.approx((2.0 / 3600.0,) * 3)


def test_a_frame_contradicts_by_chance_once_in_ten_thousand() -> None:
    from scipy.stats import chi2

    assert chi2.sf(filtering.GATE, 3) == pytest.approx(1e-4, rel=0.02)


@pytest.mark.parametrize(("step_s", "counted_s"), [(0.0, 1e-3), (0.0005, 1e-3), (0.0015, 0.0015), (2.0, 2.0)])
def test_a_manoeuvre_adds_a_jump_of_the_velocity_since_the_frame_before(step_s, counted_s) -> None:
    """At least a millisecond ago, and of three times what the frame shows, or of a degree a second when that is more."""
    state = replace(quiet_state(), step_s=step_s)
    frame = seen_off(state, (0.0, 110.0, 0.0))
    after = updated(state, frame)
    assert after.contradicted
    jump = max(3600.0, 3.0 * 110.0 / counted_s) * ARCSEC
    added = jump**2 * np.kron([[counted_s**2, -counted_s], [-counted_s, 1.0]], np.eye(3))
    seen = np.eye(6)[:3]  # of rotation and velocity a frame shows the first
    told = np.linalg.inv(state.covariance + added) + seen.T @ np.linalg.inv(frame.covariance) @ seen
    sigma = np.sqrt(np.diag(np.linalg.inv(told)))
    np.testing.assert_allclose(np.sqrt(np.diag(after.covariance)), sigma, rtol=1e-5)
