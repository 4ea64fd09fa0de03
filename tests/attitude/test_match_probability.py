"""How far a match is trusted falls with its distance, and the weights' bias is known."""

import numpy as np
import pytest

from kochab.attitude.fit import PRIOR_COUNTS, REACH_SIGMA, corrections, match_probability


def test_near_stars_are_trusted_and_far_ones_are_not() -> None:
    right, _ = match_probability(np.array([0.0, 1.0, 2.0, 5.0, 7.0, 100.0]), 0.05)
    assert (np.diff(right) <= 0.0).all()
    assert right[1] > 0.98
    assert right[3] < 0.01
    assert right[-1] < 1e-12


def test_the_share_of_wrong_stars_is_learnt() -> None:
    rng = np.random.default_rng(5)
    good = np.hypot(*rng.normal(size=(2, 900)))
    bad = REACH_SIGMA * np.sqrt(rng.uniform(size=100))
    for scaled, low, high in ((good, 0.0, 0.01), (np.append(good, bad), 0.07, 0.13)):
        outlier_fraction = PRIOR_COUNTS[0] / sum(PRIOR_COUNTS)
        for _ in range(30):
            _, outlier_fraction = match_probability(scaled, outlier_fraction)
        assert low < outlier_fraction < high


def test_stars_beyond_reach_have_no_say_in_the_share() -> None:
    near = np.array([0.5, 1.0, 1.5])
    assert match_probability(near, 0.05)[1] == match_probability(np.append(near, 50.0), 0.05)[1]


@pytest.mark.parametrize("outlier_fraction", [0.02, 0.1, 0.3])
def test_corrections_are_those_of_normal_residuals(outlier_fraction: float) -> None:
    rng = np.random.default_rng(1)
    residual = rng.normal(size=(2, 200_000))
    weight, _ = match_probability(np.hypot(*residual), outlier_fraction)
    short, wider = corrections(outlier_fraction)
    square = (weight * np.square(residual).sum(axis=0)).sum() / (2.0 * weight.sum())
    assert square == pytest.approx(short, rel=0.01)
    groups = (weight * residual).reshape(2, -1, 100).sum(axis=2) / 100.0
    step = 1e-3  # by how much the weighted sum answers to a shift
    moved, _ = match_probability(np.hypot(residual[0] + step, residual[1]), outlier_fraction)
    slope = (moved * (residual[0] + step) - weight * residual[0]).mean() / step
    spread = groups.var() / slope**2 * 100.0
    assert spread * weight.mean() == pytest.approx(wider, rel=0.05)


def test_without_wrong_stars_nothing_is_corrected() -> None:
    assert corrections(1e-12) == pytest.approx((1.0, 1.0), abs=1e-3)


@pytest.mark.parametrize("outlier_fraction", [0.05, 0.4])
def test_right_stars_have_the_whole_normal_law_and_wrong_ones_the_whole_disc(outlier_fraction: float) -> None:
    """What the odds imply of the right ones' density sums to one star, and not to two."""
    radius = np.linspace(0.0, 8.0, 4001)
    right, _ = match_probability(radius, outlier_fraction)
    uniform = 1.0 / (np.pi * REACH_SIGMA**2)
    normal = right / (1.0 - right) * outlier_fraction / (1.0 - outlier_fraction) * uniform
    rings = normal * 2.0 * np.pi * radius
    assert rings.sum() * (radius[1] - radius[0]) == pytest.approx(1.0, abs=1e-3)
