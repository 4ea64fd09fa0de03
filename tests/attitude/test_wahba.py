"""The optimal rotation: exact, proper, weighted, and with an honest covariance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kochab.attitude import wahba
from kochab.core.attitude import small_rotation


def directions(seed: int, count: int, spread: float = 0.2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    v = np.concatenate([rng.uniform(-spread, spread, (count, 2)), np.ones((count, 1))], axis=1)
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@given(st.integers(0, 10_000), st.integers(2, 30))
def test_exact_directions_give_the_exact_rotation(seed: int, count: int) -> None:
    truth = Rotation.random(random_state=seed).as_matrix()
    camera = directions(seed, count)
    found = wahba(camera, camera @ truth)
    np.testing.assert_allclose(found.matrix, truth, atol=1e-9)
    assert np.linalg.det(found.matrix) == pytest.approx(1.0)


def test_it_is_the_minimum_that_scipy_finds() -> None:
    rng = np.random.default_rng(3)
    camera, icrs = directions(1, 12), directions(2, 12)
    sigma = rng.uniform(0.5, 2.0, 12)
    reference, _ = Rotation.align_vectors(camera, icrs, weights=1 / sigma**2)
    np.testing.assert_allclose(wahba(camera, icrs, sigma).matrix, reference.as_matrix(), atol=1e-9)


def test_order_does_not_matter() -> None:
    camera, icrs = directions(1, 12), directions(2, 12)
    order = np.random.default_rng(0).permutation(12)
    a, b = wahba(camera, icrs), wahba(camera[order], icrs[order])
    np.testing.assert_allclose(a.matrix, b.matrix, atol=1e-12)


def test_covariance_is_the_scatter_of_many_trials() -> None:
    rng = np.random.default_rng(5)
    icrs, sigma = directions(7, 20), 1e-4
    turns = []
    for _ in range(600):
        seen = icrs + rng.normal(0, sigma, icrs.shape)
        seen /= np.linalg.norm(seen, axis=1, keepdims=True)
        found = wahba(seen, icrs, sigma)
        turns.append(Rotation.from_matrix(found.matrix).as_rotvec())
    measured, claimed = np.cov(np.array(turns).T), found.covariance
    assert claimed is not None
    np.testing.assert_allclose(np.diag(measured), np.diag(claimed), rtol=0.25)
    assert claimed[2, 2] > 10 * claimed[0, 0]  # roll is the weak axis of a narrow field


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_stars_is_refused(count: int) -> None:
    with pytest.raises(ValueError, match="two stars"):
        wahba(directions(0, count), directions(0, count))


def test_one_direction_twice_leaves_the_roll_free() -> None:
    star = np.repeat(directions(0, 1), 2, axis=0)
    with pytest.raises(ValueError, match="roll is free"):
        wahba(star, star)


@given(st.tuples(*[st.floats(-3, 3)] * 3))
def test_small_rotation_is_the_rotation_vector(angles: tuple[float, float, float]) -> None:
    expected = Rotation.from_rotvec(angles).as_matrix()
    np.testing.assert_allclose(small_rotation(np.array(angles)), expected, atol=1e-9)
