"""Mutual nearest points, against scipy's tree."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from kochab.core.pairing import mutual_nearest, mutual_nearest_of_few


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("radius_px", [2.0, 15.0, 200.0])
def test_each_is_the_nearest_of_the_other_within_the_radius(seed: int, radius_px: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.0, 100.0, (rng.integers(1, 40), 2)), rng.uniform(0.0, 100.0, (rng.integers(1, 60), 2))
    to_b, to_a = cKDTree(b).query(a), cKDTree(a).query(b)
    want = [(i, j) for i, (gap, j) in enumerate(zip(*to_b, strict=True)) if gap < radius_px and to_a[1][j] == i]
    i, j = mutual_nearest(a, b, radius_px)
    assert list(zip(i, j, strict=True)) == want
    i, j, distance2 = mutual_nearest_of_few(a, b, radius_px)
    assert list(zip(i, j, strict=True)) == want
    assert distance2 == pytest.approx([to_b[0][k] ** 2 for k, _ in want])
