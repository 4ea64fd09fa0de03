import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from app.identify.chance import log10_false_alarm, log10_tail


@given(st.integers(1, 60), st.integers(0, 60), st.floats(1e-6, 0.9))
def test_the_tail_is_the_binomial_one(m, extra, p):
    n = m + extra
    expected = stats.binom.logsf(m - 1, n, p) / math.log(10)
    if expected < -280:  # beyond scipy's range
        assert log10_tail(m, n, p) < -270
    else:
        assert log10_tail(m, n, p) == pytest.approx(min(0.0, expected), rel=1e-6, abs=1e-9)


def test_impossible_and_certain():
    assert log10_tail(0, 10, 0.1) == 0.0
    assert log10_tail(11, 10, 0.1) == -math.inf
    assert log10_tail(3, 10, 0.0) == -math.inf


def test_more_candidates_never_make_it_more_certain():
    a = log10_false_alarm(6, 30, 35, 3.0, 1e6, reach_px=10, radii=8, candidates=10)
    b = log10_false_alarm(6, 30, 35, 3.0, 1e6, reach_px=10, radii=8, candidates=1000)
    assert b == pytest.approx(a + 2.0)


def test_the_bound_holds_for_points_thrown_at_random():
    """Random detections against random stars: no rarer than the bound says, at any level."""
    rng = np.random.default_rng(8)
    trials, least = 20000, []
    for _ in range(trials):
        stars, seen = rng.uniform(0, 100, (30, 2)), rng.uniform(0, 100, (20, 2))
        d2 = ((seen[:, None] - stars[None]) ** 2).sum(axis=2).min(axis=1)
        best = 0.0
        for k in range(8):
            r = 10.0 / 2 ** (k / 2)
            m = int((d2 < r * r).sum())
            best = min(
                best,
                log10_false_alarm(m, 20, 30, r, 1e4, reach_px=10, radii=8, candidates=1, free=0),
            )
        least.append(best)
    least = np.array(least)
    for level in (-0.5, -1.0, -2.0, -3.0):
        share = (least < level).mean()
        assert share <= 10**level + 3 * math.sqrt(10**level / trials)
