"""What a pointing owes to the stars that proposed it, and what a search owes to its hint and its ways."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy

from kochab.core.attitude import attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.pairing import mutual_nearest_of_few
from kochab.identification.patterns import COMPLETE, Search, known_camera
from kochab.identification.quads import FieldStars
from kochab.identification.verification import CandidatePointing, chance_of, verify
from tests.identification.conftest import of_shipped

SIDE, LEVEL, REACH_PX = 1024, 1, 10.0
HALF = np.array([SIDE / 2.0, SIDE / 2.0])
FOCAL_PX = SIDE / 2.0 / float(np.tan(np.radians(10.0)))


def proposed(volume, rng, count, beside, real=0):
    """What is verified where four detections are stars, ``real`` more too, and the others are anywhere.

    With ``beside``, another detection is nearer to each of the four stars than the one that proposes it.
    """
    attitude = attitude_from(*rng.uniform((0.0, -60.0, -180.0), (360.0, 60.0, 180.0)))
    pointing = CandidatePointing(attitude.matrix, FOCAL_PX, False)
    number = volume.near(LEVEL, attitude.matrix[2], 0.3)
    xy = pointing.project(volume.stars[number].astype(np.float64))[0]
    inside = np.nonzero((np.abs(xy) < HALF - 20.0).all(axis=1))[0]
    chosen = rng.choice(inside, 4 + real, replace=False)
    seen = [xy[chosen] + rng.normal(0.0, 0.3, (len(chosen), 2)), rng.uniform(-HALF, HALF, (count, 2))]
    if beside:
        seen.insert(1, xy[chosen[:4]])
        seen[0][:4] += 1.0
    view = FieldStars(np.concatenate(seen), HALF, (0.9 * FOCAL_PX, 1.1 * FOCAL_PX))
    stars = number[chosen[:4]]
    return view, stars, verify(volume, LEVEL, view, pointing, np.arange(4), stars, REACH_PX, len(view.xy), -11.0)


@pytest.mark.parametrize("beside", [False, True])
def test_the_four_that_propose_a_pointing_and_what_is_beside_them_prove_nothing(toy_volume, beside) -> None:
    """The claim is no rarer than that so many of the others have a star so near by chance, as the binomial law has it."""
    rng, tried = np.random.default_rng(5), 0
    for _ in range(20):
        view, proposing, verdict = proposed(toy_volume, rng, 10, beside, real=3)
        if verdict is None:
            continue
        expected, _ = verdict.pointing.project(toy_volume.stars[verdict.stars].astype(np.float64))
        apart = np.hypot(*(view.xy[verdict.detections] - expected).T)
        agree = apart[(verdict.detections >= 4) & ~np.isin(verdict.stars, proposing)]
        stars = len(toy_volume.near(LEVEL, verdict.pointing.matrix[2], 0.17)) / (np.pi * (0.17 * FOCAL_PX) ** 2)
        by_chance = scipy.stats.binom.sf(len(agree) - 1, len(view.xy) - 4, 0.5 * stars * np.pi * agree.max() ** 2)
        assert verdict.log10_chance > np.log10(by_chance)
        tried += 1
    assert tried > 15


def test_the_better_of_two_ways_to_judge_costs_a_factor_of_two(toy_volume) -> None:
    view, _, verdict = proposed(toy_volume, np.random.default_rng(6), 4, beside=False, real=9)
    number = toy_volume.near(LEVEL, verdict.pointing.matrix[2], 0.3)
    expected, _ = verdict.pointing.project(toy_volume.stars[number].astype(np.float64))
    near = (np.abs(expected) < HALF + 3.0 * REACH_PX).all(axis=1)
    expected, number = expected[near], number[near]
    i, _, square = mutual_nearest_of_few(view.xy, expected, REACH_PX)
    witness = i >= 4
    free = 5 if verdict.pointing.k1 else 4
    one_way, _ = chance_of(square[witness], view.xy[4:], expected, HALF, REACH_PX, free)
    assert one_way < -11.0
    assert verdict.log10_chance == pytest.approx(one_way + np.log10(2.0), abs=1e-4)


@pytest.mark.parametrize("stars", [COMPLETE, COMPLETE + 1])
def test_where_the_quads_are_asked_as_well_every_answer_pays_for_one_more_way(stars) -> None:
    xy = np.random.default_rng(1).uniform(0.0, SIDE, (stars, 2))
    scale = Camera.centred(SIDE, SIDE, FOCAL_PX).scale_arcsec_px
    search = Search(Detections.from_list(xy, SIDE, SIDE), Hint(scale_arcsec_px=(scale / 1.01, scale * 1.01)))
    searches = known_camera(search, of_shipped)
    assert searches
    assert {known.n_searches for known in searches} == {search.n_searches} == {len(searches) + (stars > COMPLETE)}
    search.tried = 1000
    assert search.alarm(SimpleNamespace(log10_chance=-9.0)) == pytest.approx(-6.0 + np.log10(search.n_searches))


@pytest.mark.parametrize(("away", "allowed"), [(0.0, True), (0.99, True), (1.01, False), (3.0, False)])
@pytest.mark.parametrize("radius_deg", [0.5, 5.0, 40.0])
def test_a_hint_reaches_as_far_as_a_frame_whose_corner_holds_its_circle_s_edge(radius_deg, away, allowed) -> None:
    """``away`` from its place to the boresight, in radii of the circle and half diagonals of the frame together."""
    search = Search(Detections.from_list(np.ones((9, 2)), 1200, 900), Hint(centre_deg=(40.0, 0.0, radius_deg)))
    half_diagonal_deg = np.degrees(np.arctan(750.0 / FOCAL_PX))
    boresight = unit_vectors(40.0, away * (radius_deg + half_diagonal_deg))
    assert bool(search.allows(boresight, FOCAL_PX)) is allowed
    assert not Hint().centre_deg


def test_a_hint_of_the_whole_sky_allows_the_other_side_of_it() -> None:
    search = Search(Detections.from_list(np.ones((9, 2)), 1200, 900), Hint(centre_deg=(40.0, 0.0, 180.0)))
    assert search.allows(unit_vectors(220.5, 0.0), FOCAL_PX)
