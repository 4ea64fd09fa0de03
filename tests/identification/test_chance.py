import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from kochab.identification.verification import crowding, log10_by_distance, log10_false_alarm, log10_tail


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


@pytest.mark.parametrize(
    ("change", "decades"),
    [
        ({"reach_px": 30.0}, 4.0),  # four free numbers, each with ten places to be in
        ({"reach_px": 30.0, "free": 2}, 2.0),
        ({"reach_px": 30.0, "free": 0}, 0.0),
        ({"reach_px": 1.0}, 0.0),  # there is never less than one
        ({"radii": 10}, 1.0),
        ({"radii": 10, "candidates": 100}, 3.0),
    ],
)
def test_every_way_to_be_lucky_is_paid_for(change, decades):
    plain = {"reach_px": 3.0, "radii": 1, "candidates": 1, "free": 4}
    once = log10_false_alarm(12, 30, 35, 3.0, 1e6, **plain)
    assert log10_false_alarm(12, 30, 35, 3.0, 1e6, **plain | change) == pytest.approx(once + decades)


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
            best = min(best, log10_false_alarm(m, 20, 30, r, 1e4, reach_px=10, radii=8, candidates=1, free=0))
        least.append(best)
    least = np.array(least)
    for level in (-0.5, -1.0, -2.0, -3.0):
        share = (least < level).mean()
        assert share <= 10**level + 3 * math.sqrt(10**level / trials)


def test_the_bound_by_distance_is_reached_no_oftener_than_it_says():
    rng, witnesses, density, tried = np.random.default_rng(2), 4, 1e-5, (20.0, 3.0)
    reached = []
    for _ in range(1500):
        # the nearest star of each witness, for each of the pointings that there are
        count = int(tried[0] + tried[1] * 200.0)
        square = rng.exponential(1.0 / (density * math.pi), (count, witnesses))
        agree = rng.uniform(-tried[0] / tried[1], 200.0, count)  # at which radius the ends agree
        worst = np.maximum(np.sort(square, axis=1), np.maximum(agree, 0.0)[:, None] ** 2)
        best = np.argsort(worst[:, 1])[:3]
        reached.append(
            min(log10_by_distance(row.tolist(), witnesses, density, tried)[0] for row in np.sqrt(worst[best]))
        )
    for k in (0.5, 1.0, 2.0):
        share = float((np.array(reached) < -k).mean())
        assert share <= 10.0**-k + 3.0 * math.sqrt(10.0**-k / len(reached))
    assert min(reached) < -1.0


def test_no_witness_is_no_evidence_and_a_nearer_one_is_more():
    assert log10_by_distance([], 3, 1e-5, (10.0, 1.0)) == (0.0, 0)
    far, near = (log10_by_distance([d] * 3, 3, 1e-5, (10.0, 1.0)) for d in (2.0, 1.0))
    assert near[0] < far[0] < -5.0
    assert near[1] == 3


HALF = np.array([512.0, 384.0])


def test_evenly_spread_stars_are_not_crowded() -> None:
    rng, found = np.random.default_rng(6), []
    for _ in range(200):
        stars, seen = (rng.uniform(-HALF, HALF, (n, 2)) for n in (60, 40))
        found.append(crowding(seen, stars, HALF, 60 / (4.0 * HALF.prod())))
    assert min(found) == 1.0
    assert np.median(found) < 1.1
    assert max(found) < 1.6


def test_crowding_is_the_density_where_the_detections_stand() -> None:
    """60 stars of a blob of 80 px on 40 detections of another, against an integral over both."""
    rng, sigma, found = np.random.default_rng(6), 80.0, []
    density = 60 / (4.0 * HALF.prod())
    for _ in range(50):
        stars, seen = (rng.normal(0.0, sigma, (n, 2)) for n in (60, 40))
        found.append(crowding(seen, stars, HALF, density))
    # two Gaussians meet as one of twice the variance, averaged over the nudges of 31 to 82 px
    nudge = np.array([3.0, 4.5, 6.0, 8.0]) * 10.24
    there = 60.0 * np.exp(-(nudge**2) / (4.0 * sigma**2)) / (4.0 * np.pi * sigma**2)
    expected = float(there.mean()) / density
    assert expected > 4.0
    assert np.mean(found) == pytest.approx(expected, rel=0.2)


def test_a_cluster_that_thins_out_within_the_nudges_counts_where_it_is() -> None:
    """Blobs of 25 px on one another: 31 px away three quarters of the density is gone, 82 px away all."""
    rng, sigma, found = np.random.default_rng(6), 25.0, []
    density = 60 / (4.0 * HALF.prod())
    for _ in range(50):
        stars, seen = (rng.normal(0.0, sigma, (n, 2)) for n in (30, 20))
        found.append(crowding(seen, stars, HALF, density))
    nudge = np.array([1.5, 2.0]) * 10.24
    there = 30.0 * np.exp(-(nudge**2) / (4.0 * sigma**2)) / (4.0 * np.pi * sigma**2)
    assert np.mean(found) == pytest.approx(float(there.mean()) / density, rel=0.15)


def test_stars_elsewhere_and_no_stars_do_not_crowd() -> None:
    seen = np.random.default_rng(1).normal(0.0, 30.0, (20, 2))
    assert crowding(seen, seen[:5] + 300.0, HALF, 1e-5) == 1.0
    assert crowding(seen, np.zeros((0, 2)), HALF, 0.0) == 1.0
    assert crowding(np.zeros((0, 2)), seen, HALF, 1e-5) == 1.0


def test_a_right_pointing_does_not_crowd_itself() -> None:
    """Detections on their own stars: the nudges are too far for these to count."""
    rng = np.random.default_rng(9)
    stars = rng.uniform(-HALF, HALF, (60, 2))
    apart = np.linalg.norm(stars[:, None] - stars, axis=2) + 1e3 * np.eye(60)
    stars = stars[apart.min(axis=1) > 30.0]
    seen = stars + rng.normal(0.0, 2.0, stars.shape)
    assert crowding(seen, stars, HALF, len(stars) / (4.0 * HALF.prod())) < 1.5
