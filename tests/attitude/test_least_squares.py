"""The least squares against numpy's own, its limits from both sides, and a whole fit with its covariance by hand."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from kochab.attitude import fit as fitting
from kochab.attitude import least_squares
from kochab.attitude.fit import FocalPrior, corrections, match_probability, refine
from kochab.attitude.least_squares import (
    PARAMETERS,
    FitState,
    Normal,
    chance,
    columns,
    distortion_supported,
    moved,
    project_with_jacobian,
    sane,
)
from kochab.core.attitude import Attitude, attitude_from, small_rotation
from kochab.core.camera import Camera
from kochab.core.solution import Matches

from .fields import simulate

W, H, FOCAL = 3000, 2000, 4000.0
CAMERA = Camera.centred(W, H, FOCAL)
TRUTH = attitude_from(50.0, 20.0, 33.0)


def rows_and_residual(seed=1, parameters=5, residuals=20):
    rng = np.random.default_rng(seed)
    lengths = np.geomspace(1e-3, 1e4, parameters)[:, None]  # as of radians and pixels
    return rng.normal(size=(parameters, residuals)) * lengths, rng.normal(size=residuals)


def test_a_step_is_that_of_least_squares_and_its_covariance_the_inverse_of_the_squares() -> None:
    rows, residual = rows_and_residual()
    normal = Normal.of(rows)
    expected, *_ = np.linalg.lstsq(rows.T, residual, rcond=None)
    np.testing.assert_allclose(normal.step(residual), expected, rtol=1e-9)
    np.testing.assert_allclose(normal.inverse(), np.linalg.inv(rows @ rows.T), rtol=1e-8)
    free = np.array([0, 3])
    fewer, *_ = np.linalg.lstsq(rows[free].T, residual, rcond=None)
    np.testing.assert_allclose(normal.only(free).step(residual), fewer, rtol=1e-9)


def test_a_damped_step_adds_its_share_of_each_parameters_own_square() -> None:
    """Levenberg-Marquardt with Marquardt's scaling, and the undamped step is the same afterwards."""
    rows, residual = rows_and_residual()
    normal = Normal.of(rows)
    plain = normal.step(residual)
    square = rows @ rows.T
    for damping in (0.1, 3.0):
        expected = np.linalg.solve(square + damping * np.diag(np.diag(square)), rows @ residual)
        np.testing.assert_allclose(normal.step(residual, damping), expected, rtol=1e-9)
    np.testing.assert_array_equal(normal.step(residual), plain)


def test_parameters_without_effect_stay_and_two_that_are_one_share_it() -> None:
    rows, residual = rows_and_residual(parameters=3)
    expected, *_ = np.linalg.lstsq(rows.T, residual, rcond=None)
    idle = Normal.of(np.concatenate([rows, np.zeros((1, 20))])).step(residual)
    np.testing.assert_allclose(idle, [*expected, 0.0], rtol=1e-6, atol=1e-12)
    twin = Normal.of(np.concatenate([rows, rows[:1]])).step(residual)
    assert twin[0] == pytest.approx(expected[0] / 2.0, rel=1e-2)
    assert twin[3] == pytest.approx(expected[0] / 2.0, rel=1e-2)


def test_a_residual_that_its_own_parameter_takes_away_counts_twenty_times_at_most() -> None:
    """Of leverage 1 nothing can be said; 1 - leverage is 0.05 at least."""
    rows = np.array([[1.0, 0.0, 0.0], [0.0, 3.0, 1.0]])
    residual = np.array([2.0, 1.0, 1.0])
    step = 4.0 / 10.0
    left = np.array([0.0, (1.0 - 3.0 * step) / (1.0 - 0.9), (1.0 - step) / (1.0 - 0.1)])
    assert Normal.of(rows).held_out(residual) == pytest.approx(np.sum(left**2), rel=1e-6)
    steep = np.array([[5.0, 1.0]])
    step = 6.0 / 26.0
    left = np.array([(1.0 - 5.0 * step) / 0.05, (1.0 - step) / (1.0 - 1.0 / 26.0)])
    assert Normal.of(steep).held_out(np.ones(2)) == pytest.approx(np.sum(left**2), rel=1e-6)


@pytest.mark.parametrize(
    ("before", "after", "freedom", "expected"),
    [
        (2.0, 1.0, 6, 0.125),
        (2.0, 1.0, 1, np.sqrt(0.5)),
        (2.0, 1.0, 0, 1.0),
        (2.0, 1.0, -3, 1.0),
        (0.0, 1.0, 6, 1.0),
        (1.0, 2.0, 6, 1.0),
        (1.0, 0.0, 2, 1e-30),
    ],
)
def test_the_chance_of_two_terms_is_the_tail_of_the_f_distribution(before, after, freedom, expected) -> None:
    """(R1 / R0)^(dof / 2); without freedom, or with nothing to gain, all is chance."""
    assert chance(before, after, freedom) == pytest.approx(expected)
    if freedom == 6 and before > after > 0.0:
        assert scipy.stats.f.sf((before - after) / 2.0 / (after / freedom), 2, freedom) == pytest.approx(expected)


# -- The camera's change, and which cameras there are -------------------------------------------------


def test_a_step_moves_every_parameter_by_itself_and_the_focal_length_by_its_logarithm() -> None:
    camera = Camera(W, H, FOCAL, 1500.0, 1010.0, 0.01, 0.02, 0.003, 0.004, True)
    step = np.array([1e-3, -2e-3, 3e-3, 0.5, 1.0, 2.0, 0.1, 0.2, 0.3, 0.4])
    after, matrix = moved(camera, TRUTH.matrix, step)
    expected = (W, H, FOCAL * np.exp(0.5), 1501.0, 1012.0, 0.11, 0.22, 0.303, 0.404)
    got = (after.width, after.height, after.focal_px, after.cx, after.cy, after.k1, after.k2, after.p1, after.p2)
    assert got == pytest.approx(expected)
    assert after.mirrored
    np.testing.assert_allclose(matrix, small_rotation(step[:3]) @ TRUTH.matrix)
    for large, factor in ((1.7, np.e), (-1.7, 1.0 / np.e)):  # no step takes it farther
        assert moved(camera, TRUTH.matrix, large * np.eye(10)[3])[0].focal_px == pytest.approx(factor * FOCAL)


R2 = ((W - 1.0) ** 2 + (H - 1.0) ** 2) / 4.0 / FOCAL**2


@pytest.mark.parametrize(
    ("terms", "whole"),
    [
        ({}, True),
        ({"k1": 0.39 / R2}, True),
        ({"k1": 0.41 / R2}, False),
        ({"k1": -0.26 / R2}, True),  # 1 + 3 k1 r^2 is 0.22
        ({"k1": -0.27 / R2}, False),
        ({"k2": 0.39 / R2**2}, True),
        ({"k2": 0.41 / R2**2}, False),
        ({"k2": -0.155 / R2**2}, True),  # 1 + 5 k2 r^4 is 0.225
        ({"k2": -0.165 / R2**2}, False),
        ({"k1": 0.6 / R2, "k2": -0.5 / R2**2}, True),  # both together: 0.1 at the corner, 0.18 on the way
        ({"k1": -0.6 / R2, "k2": 0.6 / R2**2}, True),  # 0 at the corner, but on the way 1 - 0.9 ... grows
        ({"p1": 0.39 / 3.0 / np.sqrt(R2)}, True),
        ({"p1": -0.41 / 3.0 / np.sqrt(R2)}, False),
        ({"p2": -0.39 / 3.0 / np.sqrt(R2)}, True),
        ({"p2": 0.41 / 3.0 / np.sqrt(R2)}, False),
        ({"p1": 0.2 / 3.0 / np.sqrt(R2), "p2": -0.21 / 3.0 / np.sqrt(R2)}, False),
        ({"k1": 0.2 / R2, "p1": 0.19 / 3.0 / np.sqrt(R2)}, True),
        ({"k1": -0.2 / R2, "p1": 0.21 / 3.0 / np.sqrt(R2)}, False),
    ],
)
def test_a_lens_keeps_its_frame_in_one_piece(terms, whole) -> None:
    """The radius grows by a fifth of what it would without distortion; nothing moves by two fifths of its radius."""
    camera = replace(CAMERA, **terms)
    r = np.linspace(0.0, 1.0, 400)[1:] * np.sqrt(R2)
    k1, k2 = camera.k1, camera.k2
    grows = np.all(1.0 + 3.0 * k1 * r**2 + 5.0 * k2 * r**4 > 0.2)
    tangential = 3.0 * (abs(camera.p1) + abs(camera.p2)) * r
    near = np.all(np.abs(k1 * r**2 + k2 * r**4) + tangential < 0.4)
    if len(terms) == 2 and "k2" in terms:
        whole = bool(grows and near)
    assert (grows and near) == whole
    assert sane(camera) is whole


@pytest.mark.parametrize(("cx", "cy"), [(0.0, 0.0), (2999.0, 0.0), (0.0, 1999.0), (2999.0, 1999.0)])
def test_the_corner_farthest_from_the_principal_point_decides(cx, cy) -> None:
    far2 = 4.0 * R2
    for share, whole in ((0.3999, True), (0.4001, False)):  # a pixel of the corner is 0.0003
        assert sane(replace(CAMERA, cx=cx, cy=cy, k1=share / far2)) is whole


# -- A whole fit by hand ------------------------------------------------------------------------------


def matches(camera, xy, noise):
    number = np.arange(len(xy))
    return Matches(number, number, xy + noise, camera.unproject(xy) @ TRUTH.matrix)


def by_hand(camera, found, names, weight):
    """Weighted least squares of five stars by numerical derivatives: parameters' covariance, and sum of squares."""

    def residual(step):
        after, matrix = moved(camera, TRUTH.matrix, step)
        return ((found.xy - after.project(found.vectors @ matrix.T)) * weight[:, None]).ravel()

    index = [PARAMETERS.index(name) for name in names]
    step = np.zeros(10)
    for _ in range(6):
        slopes = np.stack([(residual(step + h) - residual(step - h)) / 2e-6 for h in 1e-6 * np.eye(10)[index]])
        change, *_ = np.linalg.lstsq(slopes.T, -residual(step), rcond=None)
        step[index] += change
    square = float(np.sum(residual(step) ** 2))
    return step, square, np.linalg.inv(slopes @ slopes.T)


def student_variance(freedom):
    return float(scipy.stats.t.stats(freedom, moments="v"))


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("stars", [2, 3, 4, 5])
def test_a_few_stars_of_different_errors_give_the_textbooks_answer_and_covariance(stars, mirrored) -> None:
    """Weights by the errors' ratios; the level from the residuals, over the numbers less the parameters: Student's."""
    camera = replace(CAMERA, mirrored=mirrored)
    rng = np.random.default_rng(11)
    xy = rng.uniform(100.0, [2900.0, 1900.0], (stars, 2))
    sigma = np.array([0.3, 0.6, 1.2, 0.3, 0.9])[:stars]
    found = matches(camera, xy, rng.normal(0.0, 1.0, xy.shape) * sigma[:, None])
    names = ("rx", "ry", "rz", "log_focal")[: 3 + (stars > 3)]
    weight = np.median(sigma) / sigma
    step, square, inverse = by_hand(camera, found, names, weight)
    fit = refine(found, camera, TRUTH, sigma, distortion=False)
    assert fit.terms == names
    after, matrix = moved(camera, TRUTH.matrix, step)
    assert fit.camera.focal_px == pytest.approx(after.focal_px, rel=1e-7)
    np.testing.assert_allclose(fit.attitude.matrix, matrix, atol=1e-8)
    np.testing.assert_allclose(fit.residuals_px, found.xy - after.project(found.vectors @ matrix.T), atol=1e-4)
    assert fit.inliers.all()
    freedom = 2 * stars - len(names)
    variance = square / freedom * student_variance(max(freedom, 3))
    np.testing.assert_allclose(fit.attitude.covariance, variance * inverse[:3, :3], rtol=2e-3, atol=1e-12)
    assert fit.rms_px == pytest.approx(np.sqrt(np.mean(np.sum(fit.residuals_px**2, axis=1))))


@pytest.mark.parametrize("share", [0.3, 1.0, 3.0])
def test_a_prior_and_the_stars_meet_in_their_weighted_mean(share) -> None:
    """A focal length two of its sigmas off, as sure as so many times the stars' own error."""
    rng = np.random.default_rng(12)
    xy = rng.uniform(100.0, [2900.0, 1900.0], (5, 2))
    found = matches(CAMERA, xy, rng.normal(0.0, 0.3, xy.shape))
    step, square, inverse = by_hand(CAMERA, found, ("rx", "ry", "rz", "log_focal"), np.ones(5))
    own = np.sqrt(square / 6.0 * inverse[3, 3])
    sigma = share * own
    told = step[3] + 2.0 * sigma
    fit = refine(found, CAMERA, TRUTH, distortion=False, focal=FocalPrior(FOCAL * np.exp(told), sigma))
    mean = (step[3] / own**2 + told / sigma**2) / (1.0 / own**2 + 1.0 / sigma**2)
    assert np.log(fit.camera.focal_px / FOCAL) == pytest.approx(mean, rel=1e-4)


@pytest.mark.parametrize(("sigmas", "taken"), [(3.9, True), (4.1, False)])
def test_a_prior_is_wrong_from_four_sigmas_of_both_errors_on(sigmas, taken) -> None:
    rng = np.random.default_rng(12)
    xy = rng.uniform(100.0, [2900.0, 1900.0], (5, 2))
    found = matches(CAMERA, xy, rng.normal(0.0, 0.3, xy.shape))
    step, square, inverse = by_hand(CAMERA, found, ("rx", "ry", "rz", "log_focal"), np.ones(5))
    own = np.sqrt(square / 6.0 * inverse[3, 3])
    for sign in (1.0, -1.0):
        told = FocalPrior(FOCAL * np.exp(step[3] + sign * sigmas * np.hypot(own, 0.7 * own)), 0.7 * own)
        fit = refine(found, CAMERA, TRUTH, distortion=False, focal=told)
        assert bool(abs(np.log(fit.camera.focal_px / FOCAL) - step[3]) > 0.1 * own) is taken


@pytest.mark.parametrize(("times", "counts"), [(9.5, True), (10.5, False)])
def test_a_prior_more_than_ten_times_less_certain_than_the_stars_is_left_out(times, counts) -> None:
    rng = np.random.default_rng(12)
    xy = rng.uniform(100.0, [2900.0, 1900.0], (5, 2))
    found = matches(CAMERA, xy, rng.normal(0.0, 0.3, xy.shape))
    step, square, inverse = by_hand(CAMERA, found, ("rx", "ry", "rz", "log_focal"), np.ones(5))
    own = np.sqrt(square / 6.0 * inverse[3, 3])
    told = FocalPrior(FOCAL * np.exp(step[3] + 20.0 * own), times * own)
    alone = refine(found, CAMERA, TRUTH, distortion=False)
    fit = refine(found, CAMERA, TRUTH, distortion=False, focal=told)
    assert bool(fit.camera.focal_px != alone.camera.focal_px) is counts


# -- How many stars may speak for which term ------------------------------------------------------------


BASE_TERMS = ("rx", "ry", "rz", "log_focal")


def bent(stars, noise_px=0.01, seed=21, **terms):
    """Stars all over the frame, whatever the lens does to them; what is fitted of it."""
    camera = replace(CAMERA, **terms)
    rng = np.random.default_rng(seed)
    xy = rng.uniform([0.0, 0.0], [2999.0, 1999.0], (stars, 2))
    found = matches(camera, xy, rng.normal(0.0, noise_px, xy.shape))
    return refine(found, CAMERA, TRUTH)


LENSES = {
    "k1": {"k1": 0.03 / R2},
    "k2": {"k2": 0.03 / R2**2},
    "cx": {"cx": CAMERA.cx + 60.0, "cy": CAMERA.cy - 40.0},
    "p1": {"p1": 0.004, "p2": -0.003},
}


@pytest.mark.parametrize(
    ("term", "stars", "fitted"),
    [
        ("k1", 7, False),
        ("k1", 8, True),
        ("k2", 13, False),
        ("k2", 14, True),
        ("cx", 13, False),
        ("cx", 14, True),
        ("p1", 17, False),
        ("p1", 18, True),
    ],
)
def test_so_many_stars_may_speak_for_a_term(term, stars, fitted) -> None:
    fit = bent(stars, **LENSES[term])
    assert (term in fit.terms) is fitted
    if fitted:
        name, value = next(iter(LENSES[term].items()))
        assert getattr(fit.camera, name) == pytest.approx(value, rel=0.3, abs=0.0)


@pytest.mark.parametrize(("stars", "found"), [(13, False), (14, True)])
def test_two_terms_that_hide_each_other_are_found_together(stars, found) -> None:
    """A cubic that a quintic takes back at the corner; what is left of it a focal length alone does not explain."""
    truth = {"k1": 0.02 / R2, "k2": -0.0155 / R2**2}
    fit = bent(stars, noise_px=0.3, seed=6, **truth)
    assert ({"k1", "k2"} <= set(fit.terms)) is found
    if found:
        assert (fit.camera.k1, fit.camera.k2) == pytest.approx(tuple(truth.values()), rel=0.3)


@pytest.mark.parametrize(("stars", "terms"), [(17, BASE_TERMS), (18, (*BASE_TERMS, "k1"))])
def test_from_eighteen_stars_on_a_known_distortion_has_to_earn_its_place_anew(stars, terms) -> None:
    """Fewer keep what was given, and fit nothing of it when it is right."""
    camera = replace(CAMERA, k1=0.03 / R2)
    rng = np.random.default_rng(22)
    xy = rng.uniform([0.0, 0.0], [2999.0, 1999.0], (stars, 2))
    fit = refine(matches(camera, xy, rng.normal(0.0, 0.1, xy.shape)), camera, TRUTH)
    assert fit.terms == terms
    assert fit.camera.k1 == pytest.approx(camera.k1, rel=0.05 if "k1" in terms else 1e-12)


def test_a_distortion_that_was_given_stays_when_chance_would_help_as_much_once_in_ten_thousand() -> None:
    """Ten stars, 20 numbers, of which the turn, the focal length and the distortion take five."""
    rng = np.random.default_rng(23)
    xy = rng.uniform([0.0, 0.0], [2999.0, 1999.0], (10, 2))
    noise, free, verdicts = rng.normal(0.0, 0.3, xy.shape), columns(BASE_TERMS), []
    for share in np.linspace(0.0, 0.01, 81):
        camera = replace(CAMERA, k1=share / R2)
        found = matches(camera, xy, noise)

        def squares(lens, found=found):
            return by_hand(lens, found, BASE_TERMS, np.ones(10))[1]

        state = FitState(camera, TRUTH.matrix, found, np.ones(10), np.ones(10, bool), camera, np.ones(10)).descend(free)
        by_chance = (squares(camera) / squares(CAMERA)) ** ((20.0 - 4.0 - 1.0) / 2.0) if share else 1.0
        verdicts.append((distortion_supported(state, free), by_chance < 1e-4 or not share))
    assert [mine for mine, _ in verdicts] == [expected for _, expected in verdicts]
    assert 20 < sum(mine for mine, _ in verdicts) < 61


def test_a_lens_with_several_faults_has_each_of_them_found() -> None:
    terms = LENSES["k1"] | LENSES["cx"] | LENSES["p1"]
    fit = bent(200, **terms)
    assert set(fit.terms) == set(PARAMETERS) - {"k2"}
    for name, value in terms.items():
        assert getattr(fit.camera, name) == pytest.approx(value, rel=0.05), name
    assert fit.rms_px == pytest.approx(0.01 * np.sqrt(2.0), rel=0.1)


# -- Outliers -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("stars", "left_out"), [(5, False), (6, True), (12, True)])
def test_an_outlier_is_told_from_six_matches_on(stars, left_out) -> None:
    field = simulate(5, stars, 10.0, 0.1)
    xy = field.matches.xy.copy()
    xy[0] += [30.0, 20.0]
    fit = refine(replace(field.matches, xy=xy), field.first_camera, field.attitude, distortion=False)
    assert bool(fit.inliers[0]) is not left_out
    assert fit.inliers[1:].mean() > 0.7


def test_where_most_places_are_farther_off_than_may_be_all_of_them_count_alike() -> None:
    """Of errors of a pixel only a third are within what 0.3 pixels would explain: no majority to be trusted."""
    rng = np.random.default_rng(15)
    xy = rng.uniform(100.0, [2900.0, 1900.0], (40, 2))
    found = matches(CAMERA, xy, rng.normal(0.0, 1.0, xy.shape))
    step, *_ = by_hand(CAMERA, found, BASE_TERMS, np.ones(40))
    camera, matrix = moved(CAMERA, TRUTH.matrix, step)
    fit = refine(found, CAMERA, TRUTH, distortion=False, worst_px=3.0 * 0.29)
    near = np.hypot(*fit.residuals_px.T) < 3.2 * 0.29
    assert 0.27 < near.mean() < 0.47
    np.testing.assert_allclose(fit.attitude.matrix, matrix, atol=1e-9)
    assert fit.camera.focal_px == pytest.approx(camera.focal_px, rel=1e-8)
    assert fit.inliers.all()


@pytest.mark.parametrize("seed", [1, 2])
def test_the_fit_stands_where_its_own_weights_leave_it(seed) -> None:
    """Least squares, weights by the residuals, and so on by hand until nothing changes: some stars are neither right
    nor wrong."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(100.0, [2900.0, 1900.0], (40, 2))
    noise = rng.normal(0.0, 0.3, xy.shape)
    noise[:6] *= 3.5
    found = matches(CAMERA, xy, noise)
    right, outlier_fraction = np.ones(40), 1.0 / 11.0
    for _ in range(60):
        step, *_ = by_hand(CAMERA, found, BASE_TERMS, np.sqrt(right))
        camera, matrix = moved(CAMERA, TRUTH.matrix, step)
        length = np.hypot(*(found.xy - camera.project(found.vectors @ matrix.T)).T)
        level = np.sqrt(np.sum(right * length**2) / corrections(outlier_fraction)[0] / (2.0 * right.sum() - 4.0))
        right, outlier_fraction = match_probability(length / level, outlier_fraction)
    assert np.any((right > 0.05) & (right < 0.9))
    fit = refine(found, CAMERA, TRUTH, distortion=False)
    turn = fit.attitude.matrix @ matrix.T
    off = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2.0
    assert np.abs(off / np.sqrt(np.diag(fit.attitude.covariance))).max() < 0.008


def test_a_guess_turned_by_a_degree_is_led_home() -> None:
    """Far from the answer the derivatives are made anew, and the steps shortened, until it is exact."""
    for seed in range(6):
        field = simulate(seed, 12, 60.0, 0.0, guess_px=0.0)
        rng = np.random.default_rng(seed)
        away = Attitude(small_rotation(rng.normal(0.0, 0.02, 3)) @ field.attitude.matrix)
        camera = replace(field.camera, focal_px=1.1 * field.camera.focal_px)
        fit = refine(field.matches, camera, away, distortion=False)
        assert fit.rms_px < 1e-3


# -- Terms by those who had no part in them, and blocks of the frame --------------------------------------

BASE = [PARAMETERS.index(name) for name in ("rx", "ry", "rz", "log_focal")]


def chance_of_k1(residual, slopes):
    """That a useless k1 improves the fit of stars left out one coordinate at a time as much, and the fit itself."""

    def squares(columns):
        design = slopes[:, columns]
        every = residual - design @ np.linalg.lstsq(design, residual, rcond=None)[0]
        left = []
        for k in range(len(residual)):
            others = np.arange(len(residual)) != k
            step, *_ = np.linalg.lstsq(design[others], residual[others], rcond=None)
            left.append(residual[k] - design[k] @ step)
        return np.sum(every**2), np.sum(np.square(left))

    (fit, held_out), (fit_more, held_out_more) = squares(BASE), squares([*BASE, PARAMETERS.index("k1")])
    freedom = len(residual) - 5
    return (held_out_more / held_out) ** (freedom / 2.0), (fit_more / fit) ** (freedom / 2.0)


@pytest.mark.parametrize(("chance_held_out", "fitted"), [(0.85e-4, True), (1.15e-4, False)])
@pytest.mark.parametrize(("seed", "rounds"), [(1, 4), (5, 4), (1, 2)])
def test_a_term_stays_when_held_out_stars_would_want_it_by_chance_once_in_ten_thousand(
    chance_held_out, fitted, seed, rounds
):
    """Ten stars that only k1 may be tried with, bent just so much."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform([0.0, 0.0], [2999.0, 1999.0], (10, 2))
    noise = rng.normal(0.0, 0.2, xy.shape)
    vectors = CAMERA.unproject(xy)
    _, jacobian = project_with_jacobian(CAMERA, vectors)
    slopes = jacobian.reshape(-1, 10)
    low, high = 0.0, 0.05
    for _ in range(50):
        k1 = (low + high) / 2.0
        chance_now, _ = chance_of_k1(noise.ravel() + slopes[:, PARAMETERS.index("k1")] * k1, slopes)
        low, high = (k1, high) if chance_now > chance_held_out else (low, k1)
    assert chance_of_k1(noise.ravel() + slopes[:, PARAMETERS.index("k1")] * k1, slopes)[1] < 1e-4
    seen = replace(CAMERA, k1=k1).project(vectors) - xy
    fit = refine(matches(CAMERA, xy, noise + seen), CAMERA, TRUTH, rounds=rounds)
    assert ("k1" in fit.terms) is fitted


@pytest.mark.parametrize(("chance_of_fit", "fitted"), [(0.9e-4, True), (1.1e-4, False)])
@pytest.mark.parametrize("seed", [1, 5])
def test_on_the_way_a_term_needs_the_residuals_alone(chance_of_fit, fitted, seed) -> None:
    """In a single round nobody is held out: the fit's own chance decides, once in ten thousand too."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform([0.0, 0.0], [2999.0, 1999.0], (10, 2))
    noise = rng.normal(0.0, 0.2, xy.shape)
    vectors = CAMERA.unproject(xy)
    slopes = project_with_jacobian(CAMERA, vectors)[1].reshape(-1, 10)
    low, high = 0.0, 0.05
    for _ in range(50):
        k1 = (low + high) / 2.0
        _, chance_now = chance_of_k1(noise.ravel() + slopes[:, PARAMETERS.index("k1")] * k1, slopes)
        low, high = (k1, high) if chance_now > chance_of_fit else (low, k1)
    seen = replace(CAMERA, k1=k1).project(vectors) - xy
    fit = refine(matches(CAMERA, xy, noise + seen), CAMERA, TRUTH, rounds=1)
    assert ("k1" in fit.terms) is fitted


def waving(xy, noise_px=0.2, wave_px=1.0):
    rng = np.random.default_rng(14)
    return rng.normal(0.0, noise_px, xy.shape) + wave_px * np.sin(xy[:, ::-1] / 300.0)


def stated(xy, noise, inliers=None):
    """The covariance stated of a rotation and focal length fitted to all stars alike, and its plain part by hand."""
    found = matches(CAMERA, xy, noise)
    fit = refine(found, CAMERA, TRUTH, distortion=False, rounds=0)
    every = np.ones(len(xy), dtype=bool) if inliers is None else inliers
    state = FitState(fit.camera, fit.attitude.matrix, found, np.ones(len(xy)), every, fit.camera, np.ones(len(xy)))
    free = columns(("rx", "ry", "rz", "log_focal"))
    state = state.descend(free)
    residual, jacobian = state.slopes()
    kept = np.tile(every, 2)
    design, left = jacobian[free].reshape(4, -1).T[kept], residual.ravel()[kept]
    plain = left @ left / (len(left) - 4.0) * np.linalg.inv(design.T @ design)[:3, :3]
    plain *= student_variance(len(left) - 4.0)
    return fitting._covariance(state, free, 0.02), plain, design, left


@pytest.mark.parametrize("wave_px", [0.0, 1.0])
def test_blocks_of_the_frame_are_left_out_one_by_one(monkeypatch, wave_px) -> None:
    """The jackknife's variance by ninths of the frame counts as eight freedoms beside the residuals' six."""
    monkeypatch.setattr(fitting, "_misfit_px2", lambda *_: 0.0)
    xy = np.random.default_rng(13).uniform(0.0, [2999.0, 1999.0], (90, 2))
    covariance, plain, design, left = stated(xy, waving(xy, wave_px=wave_px))
    block = np.tile((xy[:, 0] * 3 // 3000) + 3 * (xy[:, 1] * 3 // 2000), 2)
    moves = np.array([np.linalg.lstsq(design[block != b], left[block != b], rcond=None)[0][:3] for b in range(9)])
    between = 8.0 / 9.0 * np.sum((moves - moves.mean(axis=0)) ** 2, axis=0)
    ratio = between / np.diag(plain)
    ratio[:2] = ratio[:2].mean()
    excess = np.maximum(1.0, (8.0 * ratio + 6.0) / 14.0)
    np.testing.assert_allclose(covariance, plain * np.sqrt(np.outer(excess, excess)), rtol=1e-4, atol=1e-16)
    assert bool(excess.max() > 2.0) is (wave_px > 0.0)


def in_blocks(blocks, stars):
    """Stars in so many ninths of the frame, evenly."""
    rng = np.random.default_rng(15)
    names = np.array([0, 8, 2, 6, 4, 1, 3])[:blocks][np.arange(stars) % blocks]
    corner = np.stack([names % 3 * 1000.0, names // 3 * 2000.0 / 3.0], axis=1)
    return corner + rng.uniform(10.0, [990.0, 650.0], (stars, 2))


@pytest.mark.parametrize(("blocks", "stars", "heard"), [(6, 15, False), (6, 16, True), (5, 40, False), (6, 40, True)])
def test_blocks_are_heard_from_six_of_them_and_sixteen_stars_on(monkeypatch, blocks, stars, heard) -> None:
    monkeypatch.setattr(fitting, "_misfit_px2", lambda *_: 0.0)
    xy = in_blocks(blocks, stars)
    push = np.random.default_rng(3).normal(0.0, 3.0, (9, 2))
    name = (xy[:, 0] * 3 // 3000 + 3 * (xy[:, 1] * 3 // 2000)).astype(int)
    covariance, plain, *_ = stated(xy, push[name])
    assert bool(np.diag(covariance / plain).max() > 1.0 + 1e-6) is heard


@pytest.mark.parametrize("stars", [15, 24, 90])
def test_what_blocks_are_off_together_is_in_the_middles_error(stars) -> None:
    """Blocks that are off by 1 px, each its own way, leave the middle open by about as much; noise alone does not."""
    variances = {0.0: [], 1.0: []}
    for seed in range(40):
        rng = np.random.default_rng([seed, stars])
        xy = rng.uniform(0.0, [2999.0, 1999.0], (stars, 2))
        push, noise = rng.normal(0.0, 1.0, (9, 2)), rng.normal(0.0, 0.2, (stars, 2))
        name = (xy[:, 0] * 3 // 3000 + 3 * (xy[:, 1] * 3 // 2000)).astype(int)
        for size, kept in variances.items():
            covariance, *_ = stated(xy, noise + size * push[name])
            kept.append(covariance[0, 0] * FOCAL**2)
    heard = stars >= fitting.FEWEST_FOR_BLOCKS
    assert np.median(variances[0.0]) < 4.0 * 0.2**2 / stars
    assert bool(np.median(variances[1.0]) > 0.4) is heard
    assert np.median(variances[1.0]) < 2.0


def test_stars_that_are_left_out_have_no_say_in_the_blocks() -> None:
    """Of 24 stars 15 count: too few for blocks, however far off the others are."""
    xy = in_blocks(6, 24)
    noise = waving(xy, 0.1)
    inliers = np.arange(24) < 15
    noise[~inliers] += 40.0
    covariance, plain, *_ = stated(xy, noise, inliers)
    np.testing.assert_allclose(covariance, plain, rtol=1e-6, atol=1e-18)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("off_x", "off_y", "plausible"),
    [(749.9, 0.0, True), (750.1, 0.0, False), (0.0, 499.9, True), (0.0, 500.1, False), (750.1, 500.1, False)],
)
def test_a_lens_is_centred_in_the_frames_middle_half(off_x, off_y, plausible, sign) -> None:
    lens = replace(CAMERA, cx=1499.5 + sign * off_x, cy=999.5 + sign * off_y)
    assert least_squares.centre_plausible(lens) is plausible
    assert least_squares.centre_plausible(lens, cropped=True)


@pytest.mark.parametrize(("off_x", "off_y", "plausible"), [(2999.9, 1999.9, True), (3000.1, 0.0, False)])
def test_the_lens_of_a_cropped_frame_is_centred_a_side_away_at_most(off_x, off_y, plausible) -> None:
    lens = replace(CAMERA, cx=1499.5 + off_x, cy=999.5 - off_y)
    assert least_squares.centre_plausible(lens, cropped=True) is plausible


def test_an_axis_is_begun_wherever_the_stars_put_it() -> None:
    """A third of the frame beside the middle, on stars without noise."""
    rng = np.random.default_rng(22)
    true = replace(CAMERA, cx=1499.5 + 2000.0, cy=999.5 - 300.0)
    xy = rng.uniform(0.0, [2999.0, 1999.0], (12, 2))
    rows = np.arange(12)
    matches = Matches(rows, rows, xy, true.unproject(xy))
    lens, _ = least_squares.off_axis(matches, CAMERA, np.eye(3))
    assert (lens.cx, lens.cy) == pytest.approx((true.cx, true.cy), abs=5.0)
    assert lens.focal_px == pytest.approx(true.focal_px, rel=1e-3)
