"""Pairs that choose each other, against trying all of them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kochab.solver.matches import mutual_nearest, without_companions


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
