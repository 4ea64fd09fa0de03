"""Pairs that choose each other, against trying all of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import angle_between, attitude_from
from kochab.core.camera import Camera
from kochab.core.frame import Detections
from kochab.core.pairing import mutual_nearest
from kochab.solver.matches import centroid_sigma, field_centre, without_companions


def by_hand(a: np.ndarray, b: np.ndarray, tolerance: float) -> set[tuple[int, int]]:
    if len(a) == 0 or len(b) == 0:
        return set()
    d = np.linalg.norm(a[:, None] - b[None], axis=2)
    return {
        (i, int(np.argmin(d[i])))
        for i in range(len(a))
        if d[i].min() <= tolerance and np.argmin(d[:, np.argmin(d[i])]) == i
    }


@given(st.integers(0, 9999), st.integers(0, 40), st.integers(0, 40), st.floats(0.5, 40))
def test_same_as_trying_all(seed: int, n: int, m: int, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0, 100, (n, 2)), rng.uniform(0, 100, (m, 2))
    i, j = mutual_nearest(a, b, tolerance)
    pairs = set(zip(i.tolist(), j.tolist(), strict=True))
    assert pairs == by_hand(a, b, tolerance)
    assert len(pairs) == len(i)


def test_what_is_not_finite_pairs_with_nothing() -> None:
    a = np.array([[1.0, 1.0], [np.nan, 2.0]])
    b = np.array([[np.nan, np.nan], [1.1, 1.0], [np.inf, 2.0]])
    i, j = mutual_nearest(a, b, 5.0)
    assert (i.tolist(), j.tolist()) == ([0], [1])


def test_two_detections_of_one_star_leave_the_nearer() -> None:
    i, j = mutual_nearest(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.8, 0.0]]), 3.0)
    assert (i.tolist(), j.tolist()) == ([1], [0])


def test_a_faint_companion_is_part_of_the_brighter_star() -> None:
    places = np.array([[10.0, 10.0], [50.0, 50.0], [11.0, 10.0], [50.0, 55.0], [np.nan, 0.0]])
    assert without_companions(places, 2.0).tolist() == [True, True, False, True, True]


def test_a_centroid_is_as_sure_as_its_light_and_twice_as_unsure_when_clipped_or_blended() -> None:
    """Half the width over the signal to noise, with 0.15 px that no light takes away."""
    plain = Detections.from_list(np.zeros((5, 2)), 640, 480)
    found = replace(
        plain,
        fwhm_px=np.array([3.0, 3.0, np.nan, 3.0, 3.0]),
        snr=np.array([5.0, 0.5, 10.0, 5.0, 5.0]),
        saturated=np.array([False, False, False, True, False]),
        blended=np.array([False, False, False, False, True]),
    )
    usual = np.hypot(0.15, 0.3)
    assert centroid_sigma(found) == pytest.approx([usual, np.hypot(0.15, 1.5), 0.15, 2.0 * usual, 2.0 * usual])


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("principal", [(250.0, 150.0), (350.0, 200.0), (300.0, 300.0), (390.0, 320.0)])
def test_the_field_is_held_by_the_circle_through_its_farthest_corner(mirrored: bool, principal) -> None:
    """That is the one nearest to the principal point."""
    camera = Camera(640, 480, 900.0, *principal, mirrored=mirrored)
    attitude = attitude_from(120.0, 40.0, 30.0)
    centre, radius = field_centre(camera, attitude)
    middle, *corners = camera.unproject(np.array([[319.5, 239.5], [0, 0], [639, 0], [0, 479], [639, 479]]))
    np.testing.assert_allclose(centre, middle @ attitude.matrix, atol=1e-12)
    assert radius == pytest.approx(max(angle_between(middle, corner) for corner in corners), rel=1e-9)
