import math

import numpy as np
import pytest
import scipy

from kochab.core.pairing import mutual_nearest_of_few
from kochab.identification.verification import crowding, least_likely, log10_agreement, log10_ball, log10_by_distance


@pytest.mark.parametrize(
    ("dimensions", "volume"),
    [(0, 1.0), (1, 6.0), (2, 9.0 * math.pi), (3, 36.0 * math.pi), (4, 40.5 * math.pi**2), (5, 1279.1)],
)
def test_the_volumes_are_those_of_balls_of_radius_three(dimensions, volume) -> None:
    assert log10_ball(dimensions, 3.0) == pytest.approx(math.log10(volume), abs=1e-4)


PLAIN = {"matched": 12, "square_px": 20.0, "n_evidence": 30, "density": 3.5e-5, "reach_px": 10.0, "free": 4}


@pytest.mark.parametrize(
    ("change", "decades"),
    [
        ({"reach_px": 100.0}, 4.0),  # each of four numbers has ten times the room
        ({"reach_px": 100.0, "free": 0}, None),  # no room is needed
        ({"square_px": 2000.0}, 20.0),  # 2 * 12 - 4 dimensions, each ten times as wide
        ({"density": 3.5e-4}, 12.0),  # twelve stars, each ten times as likely
    ],
)
def test_every_way_to_be_lucky_is_paid_for(change, decades) -> None:
    plain = PLAIN | {key: value for key, value in change.items() if key == "free"}
    more = log10_agreement(**plain | change) - log10_agreement(**plain)
    assert more == pytest.approx(decades or 0.0, abs=1e-5)


def test_numbers_fitted_to_as_many_distances_prove_nothing() -> None:
    assert log10_agreement(**PLAIN | {"matched": 2, "square_px": 0.0}) == 0.0
    assert log10_agreement(**PLAIN | {"matched": 3, "square_px": 0.0}) < -5.0
    assert least_likely(np.zeros(0), 10, 30.0, 1e6, 10.0, 0) == (0.0, 0.0)
    once, often = (least_likely(np.full(9, 4.0), 10, 30.0, 1e6, 10.0, 4, candidates=n)[0] for n in (1, 100))
    assert often == pytest.approx(once + 2.0)


def test_matches_that_fill_their_radius_claim_less_than_as_many_near_their_stars() -> None:
    """Both have all within 2 px; of one the squares lie evenly, as chance has them."""
    even, near = np.linspace(0.05, 3.95, 14), np.linspace(0.05, 1.0, 14)
    assert least_likely(near, 55, 211.0, 307200.0, 6.4, 4)[0] < least_likely(even, 55, 211.0, 307200.0, 6.4, 4)[0] - 4.0


def test_the_bound_holds_for_points_thrown_at_random() -> None:
    """Random detections against random stars: no rarer than the bound says, at any level."""
    rng = np.random.default_rng(8)
    trials, least = 5000, []
    for _ in range(trials):
        stars, seen = rng.uniform(0, 100, (30, 2)), rng.uniform(0, 100, (20, 2))
        least.append(least_likely(mutual_nearest_of_few(seen, stars, 10.0)[2], 20, 30, 1e4, 10.0, 0)[0])
    _holds(least)


def test_the_bound_holds_for_the_best_of_all_fits_to_points_thrown_at_random() -> None:
    """Turn, scale and shift sought from every two pairs near by: steps of a radius each were 3 in 100 below 10^-2."""
    rng, side, reach_px, least = np.random.default_rng(3), 100.0, 6.0, []
    for _ in range(300):
        seen, stars = rng.uniform(-50, 50, (20, 2)), rng.uniform(-65, 65, (30, 2))
        density = 30 * side**2 / (side + 30) ** 2
        fits = _fits(rng, seen @ [1, 1j], stars @ [1, 1j], reach_px)
        least.append(min([least_likely(d2, 20, density, side**2, reach_px, 4)[0] for d2 in fits], default=0.0))
    _holds(least)
    assert min(least) < -0.5


def _fits(rng, seen, stars, reach_px):
    """Squared distances after least-squares similarities from up to 400 pairs of near pairs; places are complex."""
    i, j = np.nonzero(np.abs(seen[:, None] - stars) < reach_px)
    two = np.stack(np.triu_indices(len(i), 1), axis=1)
    two = two[(np.abs(seen[i[two[:, 0]]] - seen[i[two[:, 1]]]) > 30.0) & (j[two[:, 0]] != j[two[:, 1]])]
    for a, b in rng.permutation(two)[:400]:
        turn = (seen[i[a]] - seen[i[b]]) / (stars[j[a]] - stars[j[b]])
        shift = seen[i[a]] - turn * stars[j[a]]
        for radius in (reach_px, reach_px / 2, reach_px / 2.8, reach_px / 2.8):
            k, m, _ = mutual_nearest_of_few(_plane(seen), _plane(turn * stars + shift), radius)
            if len(k) < 4:
                break
            turn, shift = np.linalg.lstsq(np.stack([stars[m], np.ones(len(m))], axis=1), seen[k], rcond=None)[0]
        places = turn * stars + shift
        if np.sqrt(np.mean(np.abs(places - stars) ** 2)) <= reach_px:
            yield mutual_nearest_of_few(_plane(seen), _plane(places), reach_px)[2]


def _plane(places):
    return np.stack([places.real, places.imag], axis=1)


def _holds(claims):
    claims = np.array(claims)
    for level in (-0.5, -1.0, -1.5, -2.0, -2.5, -3.0):
        count = int((claims < level).sum())
        assert scipy.stats.poisson.sf(count - 1, len(claims) * 10.0**level) > 0.01, (level, count)


def test_the_bound_by_distance_is_reached_no_oftener_than_it_says():
    rng, n_evidence, density, tried = np.random.default_rng(2), 4, 1e-5, (20.0, 3.0)
    reached = []
    for _ in range(1500):
        # the nearest star of each detection, for each of the pointings that there are
        count = int(tried[0] + tried[1] * 200.0)
        square = rng.exponential(1.0 / (density * math.pi), (count, n_evidence))
        agree = rng.uniform(-tried[0] / tried[1], 200.0, count)  # at which radius the ends agree
        worst = np.maximum(np.sort(square, axis=1), np.maximum(agree, 0.0)[:, None] ** 2)
        best = np.argsort(worst[:, 1])[:3]
        reached.append(
            min(log10_by_distance(row.tolist(), n_evidence, density, tried)[0] for row in np.sqrt(worst[best]))
        )
    for k in (0.5, 1.0, 2.0):
        share = float((np.array(reached) < -k).mean())
        assert share <= 10.0**-k + 3.0 * math.sqrt(10.0**-k / len(reached))
    assert min(reached) < -1.0


def test_no_match_is_no_evidence_and_a_nearer_match_is_more():
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
