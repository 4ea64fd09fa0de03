"""The fit recovers what was put in, knows how well, and adds no term without need."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.attitude.fit import FocalPrior, refine
from kochab.core.solution import Matches

from .fields import Field, centre_error_px, simulate

LENS_TERMS = {"cx", "cy", "k1", "k2", "p1", "p2"}


def fitted(field: Field, **kwargs):  # type: ignore[no-untyped-def]
    return refine(field.matches, field.first_camera, field.first_attitude, **kwargs)


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.integers(5, 60), st.sampled_from([0.8, 5.0, 30.0, 60.0]), st.booleans())
def test_exact_stars_give_the_exact_camera(seed: int, stars: int, fov_deg: float, mirrored: bool) -> None:
    field = simulate(seed, stars, fov_deg, sigma_px=0.0, mirrored=mirrored)
    fit = fitted(field, distortion=False)
    assert fit.rms_px < 1e-5
    assert fit.camera.mirrored is mirrored
    assert fit.camera.focal_px == pytest.approx(field.camera.focal_px, rel=1e-6)
    np.testing.assert_allclose(fit.attitude.matrix, field.attitude.matrix, atol=1e-7)


@pytest.mark.parametrize(
    ("stars", "fov_deg", "corner"),
    [(8, 10.0, 0.0), (60, 1.0, 0.0), (60, 60.0, 0.0), (80, 40.0, 0.03), (80, 40.0, -0.03)],
)
def test_covariance_is_calibrated(stars: int, fov_deg: float, corner: float) -> None:
    """The squared error over the claimed covariance averages to its three dimensions."""
    chi2 = []
    for seed in range(100):
        field = simulate(seed, stars, fov_deg, 0.3, corner)
        fit = fitted(field)
        dx, dy = centre_error_px(field, fit.camera, fit.attitude) / fit.camera.focal_px
        turn = fit.attitude.matrix @ field.attitude.matrix.T
        error = np.array([-dy, dx, (turn[1, 0] - turn[0, 1]) / 2])
        chi2.append(error @ np.linalg.solve(fit.attitude.covariance, error))
    # The mean of 100 draws of chi-square(3) has a deviation of 0.24.
    assert 2.4 < np.mean(chi2) < 3.7


def test_sigma_scales_with_the_noise() -> None:
    quiet, loud = (fitted(simulate(4, 100, sigma_px=s)).attitude for s in (0.1, 1.0))
    np.testing.assert_allclose(loud.sigma_arcsec, 10 * np.array(quiet.sigma_arcsec), rtol=0.01)


def test_perfect_agreement_is_not_believed_beyond_the_floor() -> None:
    fit = fitted(simulate(4, 5, sigma_px=0.0))
    assert min(fit.attitude.sigma_arcsec) > 1e-3 * fit.camera.scale_arcsec_px


@pytest.mark.parametrize("corner", [0.03, -0.03])
@pytest.mark.parametrize("fov_deg", [2.0, 20.0, 60.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_real_distortion_is_found(corner: float, fov_deg: float, mirrored: bool) -> None:
    field = simulate(11, 80, fov_deg, 0.3, corner, mirrored)
    fit = fitted(field)
    assert "k1" in fit.terms
    assert fit.camera.k1 == pytest.approx(field.camera.k1, rel=0.05)
    assert fit.rms_px < 0.6
    corners = np.array([[0.0, 0.0], [2999.0, 1999.0]])
    seen = field.camera.unproject(corners) @ field.attitude.matrix
    again = fit.camera.project(seen @ fit.attitude.matrix.T)
    np.testing.assert_allclose(again, corners, atol=3.0)  # 54 px were bent there


@pytest.mark.parametrize("fov_deg", [1.0, 10.0, 60.0])
@pytest.mark.parametrize("stars", [9, 20, 200])
def test_absent_distortion_is_refused(fov_deg: float, stars: int) -> None:
    accepted = sum(bool(LENS_TERMS & set(fitted(simulate(seed, stars, fov_deg)).terms)) for seed in range(60))
    assert accepted <= 1  # four tests a fit at 1e-4 each


def test_too_few_stars_may_not_speak_for_distortion() -> None:
    fit = fitted(simulate(3, 7, 40.0, 0.1, 0.03))
    assert not LENS_TERMS & set(fit.terms)


def test_a_shifted_principal_point_is_found_in_a_wide_field_and_not_in_a_narrow_one() -> None:
    wide = fitted(simulate(5, 150, 60.0, 0.2, off_centre_px=(40.0, -25.0)))
    assert {"cx", "cy"} <= set(wide.terms)
    assert wide.camera.cx == pytest.approx(1499.5 + 40.0, abs=4.0)
    assert wide.camera.cy == pytest.approx(999.5 - 25.0, abs=4.0)
    narrow = fitted(simulate(5, 150, 1.0, 0.2, off_centre_px=(40.0, -25.0)))
    assert "cx" not in narrow.terms
    assert (
        np.hypot(
            *centre_error_px(simulate(5, 150, 1.0, 0.2, off_centre_px=(40.0, -25.0)), narrow.camera, narrow.attitude)
        )
        < 0.3
    )


@pytest.mark.parametrize("corner", [0.0, 0.02])
def test_an_axis_that_few_stars_gave_is_fitted_anew_and_its_error_is_told(corner: float) -> None:
    """Kept as it was, its error is in the centre, 1.3 times as large, and in no sigma."""
    scaled = []
    for seed in range(60):
        field = simulate(seed, 400, 14.0, 0.15, corner, off_centre_px=(40.0, -25.0))
        few = refine(field.matches.take(slice(None, None, 4)), field.first_camera, field.first_attitude, rounds=1)
        fit = refine(field.matches, few.camera, few.attitude)
        assert ("cx" in fit.terms) == (fit.camera.cx != 1499.5)
        sigma_px = fit.camera.focal_px * np.radians(np.array(fit.attitude.sigma_arcsec[1::-1]) / 3600.0)
        scaled.append(centre_error_px(field, fit.camera, fit.attitude) / sigma_px)
    assert np.sqrt(np.mean(np.square(scaled))) == pytest.approx(1.0, abs=0.2)


def test_an_axis_beside_the_middle_is_not_taken_for_a_lens_out_of_line() -> None:
    """Terms are tested to first order: where k1 is not yet fitted, the axis looks like p1 and p2."""
    terms = [set(fitted(simulate(seed, 400, 14.0, 0.1, 0.02, off_centre_px=(40.0, -25.0))).terms) for seed in range(20)]
    assert sum(found >= {"k1", "cx", "cy"} for found in terms) >= 19
    assert sum("p1" in found for found in terms) <= 1


@pytest.mark.parametrize("wrong", [5, 20])
@pytest.mark.parametrize("corner", [0.0, 0.03])
def test_wrong_matches_are_left_out(wrong: int, corner: float) -> None:
    field = simulate(17, 80, 30.0, 0.3, corner, wrong=wrong)
    fit = fitted(field)
    assert not fit.inliers[:wrong].any()
    assert fit.inliers[wrong:].mean() > 0.97
    assert np.hypot(*centre_error_px(field, fit.camera, fit.attitude)) < 0.3


def test_noisy_stars_weigh_less() -> None:
    errors = {True: [], False: []}  # type: ignore[var-annotated]
    for seed in range(40):
        field = simulate(seed, 40, sigma_px=0.1)
        noise = np.random.default_rng(seed + 1).normal(0, 2.0, (20, 2))
        xy = field.matches.xy.copy()
        xy[:20] += noise
        field = replace(field, matches=replace(field.matches, xy=xy))
        sigma = np.where(np.arange(40) < 20, 2.0, 0.1)
        for weighted in (True, False):
            fit = fitted(field, sigma_px=sigma if weighted else None)
            errors[weighted].append(np.hypot(*centre_error_px(field, fit.camera, fit.attitude)))
    assert np.median(errors[True]) < 0.5 * np.median(errors[False])


def test_two_stars_fix_the_rotation_alone_and_one_does_not() -> None:
    field = simulate(1, 2, sigma_px=0.0, guess_px=0.0)
    fit = fitted(field)
    assert fit.terms == ("rx", "ry", "rz")
    np.testing.assert_allclose(fit.attitude.matrix, field.attitude.matrix, atol=1e-8)
    one = Matches(*(getattr(field.matches, n)[:1] for n in ("detection", "star", "xy", "vectors")))
    with pytest.raises(ValueError, match="two matches"):
        refine(one, field.first_camera, field.first_attitude)


@pytest.mark.parametrize(("stars", "told"), [(3, False), (4, True)])
def test_four_stars_may_speak_for_the_focal_length(stars: int, told: bool) -> None:
    field = simulate(3, stars, 10.0, 0.0)
    fit = fitted(field)
    true, guessed = field.camera.focal_px, field.first_camera.focal_px
    assert ("log_focal" in fit.terms) is told
    assert fit.camera.focal_px == pytest.approx(true if told else guessed, rel=1e-9)


def test_where_the_middle_points_is_as_sure_when_the_principal_point_is_elsewhere() -> None:
    """A roll about that point carries the middle along, and the fit knows that it does."""
    chi2 = []
    for seed in range(150):
        field = simulate(seed, 12, 10.0, 0.5, off_centre_px=(1300.0, -900.0))
        fit = fitted(replace(field, first_camera=field.camera), distortion=False)
        dx, dy = centre_error_px(field, fit.camera, fit.attitude) / fit.camera.focal_px
        turn = fit.attitude.matrix @ field.attitude.matrix.T
        error = np.array([-dy, dx, (turn[1, 0] - turn[0, 1]) / 2])
        chi2.append(error @ np.linalg.solve(fit.attitude.covariance, error))
    assert 2.4 < np.mean(chi2) < 4.2


def test_a_star_behind_the_camera_is_an_outlier_and_not_a_crash() -> None:
    field = simulate(1, 30, 30.0)
    vectors = field.matches.vectors.copy()
    vectors[0] *= -1.0
    fit = fitted(replace(field, matches=replace(field.matches, vectors=vectors)))
    assert not fit.inliers[0]
    assert np.isfinite(fit.residuals_px).all()
    assert np.hypot(*centre_error_px(field, fit.camera, fit.attitude)) < 0.5


def believed(field: Field, off: float = 0.0, sigma: float = 1e-4) -> FocalPrior:
    return FocalPrior(field.camera.focal_px * (1.0 + off), sigma)


def test_a_known_focal_length_stays_put_and_the_covariance_with_it_is_calibrated() -> None:
    chi2, off, free = [], [], []
    for seed in range(150):
        field = simulate(seed, 12, 10.0, 0.5)
        told = field.camera.focal_px * np.exp(np.random.default_rng(seed).normal(0, 1e-5))
        fit = fitted(field, focal=FocalPrior(told, 1e-5))
        off.append(np.log(fit.camera.focal_px / field.camera.focal_px))
        free.append(np.log(fitted(field).camera.focal_px / field.camera.focal_px))
        dx, dy = centre_error_px(field, fit.camera, fit.attitude) / fit.camera.focal_px
        turn = fit.attitude.matrix @ field.attitude.matrix.T
        error = np.array([-dy, dx, (turn[1, 0] - turn[0, 1]) / 2])
        chi2.append(error @ np.linalg.solve(fit.attitude.covariance, error))
    assert np.std(off) < 1.5e-5
    assert np.std(free) > 5.0 * np.std(off)
    assert 2.4 < np.mean(chi2) < 4.2


def test_a_belief_far_looser_than_the_stars_changes_nothing() -> None:
    field = simulate(8, 60, 10.0, 0.3)
    loose = fitted(field, focal=believed(field, off=0.08, sigma=0.1))
    assert loose.camera == fitted(field).camera


@pytest.mark.parametrize("off", [0.01, -0.3])
def test_a_belief_that_the_stars_contradict_is_left_out(off: float) -> None:
    field = simulate(8, 60, 10.0, 0.3)
    wrong = fitted(field, focal=believed(field, off=off))
    assert wrong.camera.focal_px == pytest.approx(field.camera.focal_px, rel=1e-4)


def test_good_stars_contradict_sooner_than_poor_ones() -> None:
    """Their own error counts in their own noise: eight sigmas of it are a contradiction."""
    for noise_px, taken in ((0.05, False), (2.0, True)):
        alone = [fitted(simulate(seed, 60, 10.0, 0.05)).camera.focal_px for seed in range(20)]
        true = simulate(0).camera.focal_px
        off = 8.0 * float(np.std(alone)) / true
        field = simulate(8, 60, 10.0, noise_px)
        fit = fitted(field, focal=believed(field, off=off, sigma=1e-6))
        away = abs(fit.camera.focal_px / true - 1.0 - off)
        assert (away < off / 4) == taken


def test_a_range_of_focal_lengths_is_a_belief() -> None:
    focal = FocalPrior.of_range(990.0, 1010.0)
    assert focal.focal_px == pytest.approx(1000.0, rel=1e-3)
    assert focal.sigma == pytest.approx(0.01, rel=0.01)


@pytest.mark.parametrize("far", [4.2, 5.0])
def test_a_star_a_little_too_far_off_weighs_little(far: float) -> None:
    """It is too near to be thrown out for certain, and too far to weigh as the others do."""
    errors = {"soft": [], "all": []}  # type: ignore[var-annotated]
    for seed in range(80):
        field = simulate(seed, 14, 10.0, 0.3)
        xy = field.matches.xy.copy()
        xy[0] = field.camera.project((field.matches.vectors @ field.attitude.matrix.T)[:1])[0]
        xy[0] += 0.3 * far * np.array([0.6, 0.8])
        field = replace(field, matches=replace(field.matches, xy=xy))
        for name, rounds in (("soft", 4), ("all", 0)):
            fit = fitted(field, distortion=False, rounds=rounds)
            errors[name].append(centre_error_px(field, fit.camera, fit.attitude))
    soft, kept = (np.sqrt(np.mean(np.square(errors[name]))) for name in ("soft", "all"))
    assert soft < 0.97 * kept


def test_a_given_distortion_that_the_stars_do_not_ask_for_is_dropped() -> None:
    kept = 0
    for seed in range(40):
        field = simulate(seed, 12, 20.0, 0.3)
        bent = replace(field.first_camera, k1=0.02)
        kept += fitted(replace(field, first_camera=bent)).camera.distorted
    assert kept <= 1


def test_a_given_distortion_that_few_stars_do_ask_for_is_kept() -> None:
    field = simulate(2, 12, 40.0, 0.3, 0.03)
    fit = fitted(replace(field, first_camera=field.camera))
    assert fit.camera.k1 == pytest.approx(field.camera.k1, rel=0.2)


def shifted(field: Field, by_px: float) -> Field:
    """The same with its first two stars off their places."""
    xy = field.matches.xy.copy()
    xy[0] += [by_px, 0.0]
    xy[1] += [0.0, -by_px]
    return replace(field, matches=replace(field.matches, xy=xy))


def test_who_knows_how_far_stars_are_off_at_worst_is_misled_less_by_two_that_are_farther() -> None:
    off = []
    for seed in range(60):
        field = shifted(simulate(seed, 10, 10.0, 0.5), 2.5)
        fits = (fitted(field, distortion=False, worst_px=w) for w in (None, 1.5))
        off.append([np.hypot(*centre_error_px(field, f.camera, f.attitude)) for f in fits])
    learnt, told = np.mean(off, axis=0)
    assert told < 0.8 * learnt


@pytest.mark.parametrize(("worst_px", "within"), [(100.0, 1e-12), (0.01, 1e-4)])
def test_a_worst_place_that_none_reaches_is_no_news_and_one_that_most_exceed_no_harm(
    worst_px: float, within: float
) -> None:
    field = shifted(simulate(4, 10, 10.0, 0.5), 2.5)
    alone = fitted(field, distortion=False)
    fit = fitted(field, distortion=False, worst_px=worst_px)
    assert fit.camera.focal_px == pytest.approx(alone.camera.focal_px, rel=within)


def test_a_prior_is_one_measurement_more() -> None:
    """A focal length that the stars say anyway changes no residual; the roll's variance has one more freedom."""
    field = simulate(6, 5, 10.0, 0.5)
    alone = fitted(field, distortion=False)
    own = FocalPrior(alone.camera.focal_px, 2e-4)
    told = fitted(field, distortion=False, focal=own)
    np.testing.assert_allclose(told.residuals_px, alone.residuals_px, atol=1e-3)
    ratio = told.attitude.covariance[2, 2] / alone.attitude.covariance[2, 2]
    assert ratio == pytest.approx(6.0 / 7.0 * (7.0 / 5.0) / (6.0 / 4.0), rel=0.05)  # and Student's variances


def test_a_star_beyond_the_clip_is_no_inlier_though_it_weighs_a_little() -> None:
    """Of the right ones a thousandth lies beyond 3.7 sigma; the rms is that of the inliers alone."""
    field = simulate(9, 80, 10.0, 0.3)
    ideal = field.camera.project(field.matches.vectors @ field.attitude.matrix.T)
    for sigmas, kept in ((3.0, True), (4.6, False)):
        xy = field.matches.xy.copy()
        xy[0] = ideal[0] + 0.3 * sigmas * np.array([0.6, 0.8])
        fit = fitted(replace(field, matches=replace(field.matches, xy=xy)), distortion=False)
        assert bool(fit.inliers[0]) is kept
        assert fit.inliers.mean() > 0.95
        assert fit.rms_px == pytest.approx(np.sqrt(np.mean(np.sum(fit.residuals_px[fit.inliers] ** 2, axis=1))))


@pytest.mark.parametrize(("off_px", "fitted_centre"), [(950.0, True), (1050.0, False)])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_principal_point_stays_in_the_middle_two_thirds_of_a_wide_frame(
    off_px: float, fitted_centre: bool, axis: int
) -> None:
    off = (off_px, 0.0) if axis == 0 else (0.0, off_px * 2.0 / 3.0)
    fit = fitted(simulate(5, 200, 60.0, 0.1, off_centre_px=off, guess_px=1.0))
    assert ("cx" in fit.terms) is fitted_centre


def test_one_round_gives_no_covariance_and_more_do() -> None:
    field = simulate(4, 60)
    assert fitted(field, rounds=1).attitude.covariance is None
    assert fitted(field, rounds=2).attitude.covariance is not None


def test_the_sigma_is_that_of_the_noise_over_the_stars() -> None:
    """Two thirds of a pixel over a hundred stars: along x and y a root of a hundred of it."""
    field = simulate(12, 100, 10.0, 0.6)
    sigma = np.array(fitted(field, distortion=False).attitude.sigma_arcsec)
    alone = 0.6 / 10.0 * field.camera.scale_arcsec_px
    assert sigma[:2] == pytest.approx([alone, alone], rel=0.25)
    radius2 = np.sum((field.matches.xy - [1499.5, 999.5]) ** 2)
    assert sigma[2] == pytest.approx(np.degrees(0.6 / np.sqrt(radius2)) * 3600.0, rel=0.25)


@pytest.mark.parametrize(("sigmas", "taken"), [(3.0, True), (5.0, False)])
def test_a_focal_length_four_sigmas_from_the_stars_is_left_out(sigmas: float, taken: bool) -> None:
    """Of both errors together, the stars' and its own."""
    field = simulate(8, 60, 10.0, 0.3)
    alone = fitted(field, distortion=False)
    own = np.std([np.log(fitted(simulate(s, 60, 10.0, 0.3), distortion=False).camera.focal_px) for s in range(30)])
    prior = FocalPrior(alone.camera.focal_px * np.exp(sigmas * np.hypot(own, own)), own)
    moved = np.log(fitted(field, distortion=False, focal=prior).camera.focal_px / alone.camera.focal_px)
    assert moved / own == pytest.approx(sigmas / np.sqrt(2.0) if taken else 0.0, abs=0.7 if taken else 1e-9)


@pytest.mark.parametrize(("times", "counts"), [(5.0, True), (20.0, False)])
def test_a_prior_ten_times_less_certain_than_the_stars_is_no_news(times: float, counts: bool) -> None:
    field = simulate(8, 60, 10.0, 0.3)
    alone = fitted(field, distortion=False).camera.focal_px
    own = np.std([np.log(fitted(simulate(s, 60, 10.0, 0.3), distortion=False).camera.focal_px) for s in range(30)])
    told = fitted(field, distortion=False, focal=FocalPrior(alone * np.exp(times * own), times * own)).camera.focal_px
    assert bool(told != alone) is counts


@pytest.mark.parametrize(("stars", "heard"), [(3, False), (4, True)])
def test_a_prior_is_heard_from_four_stars_on(stars: int, heard: bool) -> None:
    """Three stars leave the focal length as it was given; the fourth lets it be fitted, prior and all."""
    field = simulate(3, stars, 10.0, 0.5)
    true = field.camera.focal_px
    fit = fitted(field, distortion=False, focal=FocalPrior(true, 1e-7))
    assert bool(abs(fit.camera.focal_px / true - 1.0) < 1e-6) is heard


def test_two_rounds_weigh_the_matches_as_four_do_when_there_is_nothing_to_leave_out() -> None:
    field = simulate(4, 40, 10.0, 0.3)
    two, four, one = (fitted(field, distortion=False, rounds=r) for r in (2, 4, 1))
    np.testing.assert_allclose(two.residuals_px, four.residuals_px, atol=1e-6)
    np.testing.assert_allclose(two.attitude.covariance, four.attitude.covariance, rtol=1e-6)
    assert np.abs(one.residuals_px - four.residuals_px).max() > 1e-4  # a least-squares fit, unweighted


@pytest.mark.parametrize("off_px", [(450.0, 300.0), (450.0, 450.0), (600.0, 300.0)])
def test_a_fit_of_many_stars_is_no_worse_than_the_camera_it_is_given(off_px: tuple[float, float]) -> None:
    """Of a crop, whose axis is far off the middle, stars in the middle half found the axis; from the middle out of
    reach, it left one in twelve with residuals of 2 to 30 px."""
    for seed in range(20):
        field = simulate(seed, 124, 62.0, 0.15, 0.004, off_centre_px=off_px)
        middle = np.flatnonzero((np.abs(field.matches.xy - (1499.5, 999.5)) < (750.0, 500.0)).all(axis=1))
        fit = refine(field.matches.take(middle), field.camera, field.attitude, rounds=1)
        assert np.median(np.hypot(*fit.residuals_px.T)) < 0.5
