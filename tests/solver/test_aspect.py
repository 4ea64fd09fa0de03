"""Resized images: the aspect ratio is fitted to the stars, reported, and kept in everything made from the solution."""

import io
from contextlib import redirect_stdout
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from astropy.io.fits import Header
from astropy.wcs import WCS

from kochab.attitude.fit import refine
from kochab.attitude.least_squares import project_with_jacobian
from kochab.core.attitude import Attitude, apart_deg, radec_deg
from kochab.core.camera import PROJECTIONS, Camera
from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.core.solution import Identification, Matches, Reason, Solution
from kochab.core.wcs import wcs_cards
from kochab.detection.auto import AutoDetector
from kochab.frames import read_frame
from kochab.simulate.random_fields import FieldPlan, random_attitude, random_field
from kochab.sky import open_catalogue
from kochab.solver import aspect
from kochab.solver.aspect import ASPECTS, Stretch, fitted, resized, stretch
from kochab.solver.pipeline import solve_detections
from kochab.workflows.polar.solutions import _camera
from kochab.workflows.solution_json import _solved
from kochab.workflows.solution_text import camera_text
from tests.solver.fields import photograph
from tests.solver.test_growth import ATTITUDE, CAMERA, DIAGONAL_PX, Places, scattered


def field(fov_deg, seed, share):
    """A random field whose image was made ``share`` longer along its rows; its truth."""
    truth = random_field(open_catalogue(), np.random.default_rng([3, seed]), FieldPlan(fov_deg, spurious=0.1))
    return resized(truth.detections, 1.0 + share), truth


def off_deg(solution, truth, share):
    """How far the middle and the corners are from where they truly are, degrees."""
    side = truth.camera.width - 1.0
    places = np.array([[side / 2, side / 2], [0.0, 0.0], [side, 0.0], [0.0, side], [side, side]])
    sky = truth.camera.unproject(places) @ truth.attitude.matrix
    places[:, 0] = (places[:, 0] + 0.5) * (1.0 + share) - 0.5
    return [apart_deg(radec_deg(a), radec_deg(b)) for a, b in zip(solution.sky_at(places), sky, strict=True)]


# Before, all of these were refused.
@pytest.mark.parametrize(("fov_deg", "share"), [(8.0, 0.012), (30.0, -0.03), (8.0, 0.06), (30.0, 0.2), (8.0, -0.12)])
def test_a_resized_image_solves_with_its_aspect_ratio(fov_deg, share):
    for seed in range(2):
        detections, truth = field(fov_deg, seed, share)
        answer = run(solve_detections(detections))
        assert isinstance(answer, Solution)
        assert answer.camera.aspect == pytest.approx(1.0 + share, rel=2e-3)
        assert max(off_deg(answer, truth, share)) < 0.004 * fov_deg
        assert any(f"stretched by {100 * (max(1 + share, 1 / (1 + share)) - 1):.1f}"[:16] in w for w in answer.warnings)


def test_a_ratio_beside_those_that_are_tried_is_found_and_a_poor_fit_of_one_refused(monkeypatch):
    """From 6 % it settled at 5.8 % with 16 stars, where 11 % hold 51: the middle was off by 0.43 deg."""
    rng = np.random.default_rng(20261128)
    for _ in range(48):
        truth = random_field(open_catalogue(), rng, FieldPlan(24.0, missing=0.1, spurious=0.1))
        longer = float(np.exp(np.log(1.15) * rng.uniform(-1.0, 1.0)))
    detections = resized(truth.detections, longer)
    answer = run(solve_detections(detections))
    assert answer.camera.aspect == pytest.approx(longer, rel=2e-3)
    assert max(off_deg(answer, truth, longer - 1.0)) < 0.1
    monkeypatch.setattr(aspect, "BESIDE", 1.0)
    assert run(solve_detections(detections)).reason is Reason.DISTORTION_TOO_STRONG


@pytest.mark.parametrize("fov_deg", [8.0, 30.0])
def test_square_pixels_stay_square(fov_deg):
    for seed in range(4):
        answer = run(solve_detections(field(fov_deg, seed, 0.0)[0]))
        assert answer.camera.aspect == 1.0
        assert answer.warnings == ()


def test_a_stretched_solution_reads_back_from_its_wcs_json_and_profile():
    detections, _ = field(8.0, 1, 0.06)
    solution = run(solve_detections(detections))
    assert isinstance(solution, Solution)
    with redirect_stdout(io.StringIO()):
        wcs = WCS(Header(wcs_cards(solution.camera, solution.attitude)))
    places = np.array([[0.0, 0.0], [800.0, 20.0], [400.0, 900.0]])
    for place, (ra, dec) in zip(places, wcs.all_pix2world(places, 0), strict=True):
        assert apart_deg((ra, dec), radec_deg(solution.sky_at(place[None])[0])) * 3600.0 < 0.1
    row = _solved("a.png", solution)
    camera = _camera(row)
    assert camera.aspect == solution.camera.aspect
    assert (camera.width, camera.height) == (solution.camera.width, solution.camera.height)
    assert "times as tall as wide" in camera_text(solution)


@pytest.mark.parametrize("lens", PROJECTIONS.values())
def test_the_derivatives_of_a_stretched_camera(lens):
    camera = lens(1600, 1000, 900.0, 810.0, 490.0, 0.05, -0.01, 1e-3, -2e-3, True, 1.13)
    rays = camera.unproject(np.array([[100.0, 120.0], [900.0, 400.0], [1500.0, 900.0]]))
    seen, slope = project_with_jacobian(camera, rays)
    np.testing.assert_allclose(seen, camera.project(rays), atol=1e-9)
    longer = replace(camera, focal_px=camera.focal_px * (1.0 + 1e-6)).project(rays)
    np.testing.assert_allclose(slope[:, :, 3], (longer - seen) / 1e-6, rtol=1e-4, atol=1e-3)


# -- What the map of places tells ---------------------------------------------------------------------


def stretched(share, count=120, noise_px=0.0, false=0):
    """A frame whose x is longer by a share, fitted as if its pixels were square."""
    side = CAMERA.width
    xy = scattered(count)
    middle = np.array([799.5, 499.5])
    seen = middle + (xy - middle) * [1.0 + share, 1.0]
    seen += np.random.default_rng(2).normal(0.0, noise_px, seen.shape)
    column = np.flatnonzero(np.abs(xy[:, 0] - 800.0) < 150.0)  # what a fit of square pixels holds on to
    catalogue = Places(xy)
    matches = Matches(column, column, seen[column], catalogue.places[column])
    fit = refine(matches, CAMERA, ATTITUDE, rounds=1, distortion=False)
    fit = replace(fit, camera=CAMERA, attitude=Attitude(ATTITUDE.matrix), rms_px=0.002 * side)
    extra = np.random.default_rng(4).uniform(0.0, [1600.0, 1000.0], (false, 2))
    detections = Detections.from_list(np.concatenate([seen, extra]), 1600, 1000)
    return detections, matches, fit, catalogue


@pytest.mark.parametrize("share", [0.03, 0.06])
def test_a_stretched_frame_tells_by_how_much(share) -> None:
    assert stretch(*stretched(share), 2024.0).share == pytest.approx(share, rel=1e-3)


def test_a_frame_that_fits_or_is_square_is_not_called_stretched() -> None:
    """A residual of 0.05 % of the larger side is a good fit."""
    detections, matches, fit, catalogue = stretched(0.05)
    for rms_px, told in ((0.00049 * 1600, False), (0.00051 * 1600, True)):
        answer = stretch(detections, matches, replace(fit, rms_px=rms_px), catalogue, 2024.0)
        assert (answer is not None) is told
    assert stretch(*stretched(0.0), 2024.0).aspect is None


def test_a_stretch_needs_ten_stars() -> None:
    detections, matches, fit, catalogue = stretched(0.05)
    for count, told in ((10, True), (9, False)):
        few = Matches(*(part[:count] for part in (matches.detection, matches.star, matches.xy, matches.vectors)))
        assert (stretch(detections, few, fit, catalogue, 2024.0) is not None) is told


def test_a_stretch_looks_at_twice_the_detections_in_the_field_and_at_no_more_than_half_the_sky() -> None:
    detections, matches, fit, catalogue = stretched(0.05)
    stretch(detections, matches, fit, catalogue, 2024.0)
    ((_, radius, count, year),) = catalogue.asked
    assert (radius, count, year) == (pytest.approx(np.arctan(DIAGONAL_PX / 7600.0)), 240, 2024.0)


@pytest.mark.parametrize(("share", "told"), [(0.012, True), (0.0065, False)])
def test_a_stretch_is_sure_when_twice_as_many_stars_agree_with_it(share, told) -> None:
    """A third of the stars agree without it, or six tenths, those near the middle; all of them with it."""
    detections, matches, fit, catalogue = stretched(share)
    near = np.count_nonzero(share * np.abs(scattered(120)[:, 0] - 799.5) < 3.2) / 120.0
    assert bool(near < 0.45) is told
    answer = stretch(detections, matches, fit, catalogue, 2024.0)
    assert answer.share == pytest.approx(share, rel=1e-2)
    assert answer.sure is told


@pytest.mark.parametrize(
    ("linear", "aspect"),
    [
        ([[1.05, 0.0], [0.0, 1.0]], 1.05),
        ([[1.0, 0.0], [0.0, 1.05]], 1.0 / 1.05),
        ([[1.0032, 0.0], [0.0, 1.0]], 1.0032),  # 0.3 % is the least
        ([[1.0028, 0.0], [0.0, 1.0]], None),
        ([[1.05, 0.011], [0.0, 1.0]], 1.05),  # a quarter of 4.9 % along another direction is 1.2 %
        ([[1.05, 0.014], [0.0, 1.0]], None),
    ],
)
def test_a_stretch_along_rows_or_columns_is_a_ratio(linear, aspect) -> None:
    told = Stretch(np.array(linear), Matches(*(np.zeros(0),) * 4), True).aspect
    assert told == (None if aspect is None else pytest.approx(aspect, rel=1e-3))


@pytest.mark.parametrize(
    ("share_fitted", "rms_share", "tried"),
    [(0.4, 0.00151, True), (0.4, 0.00149, False), (0.24, 0.0004, True), (0.26, 0.0004, False), (0.51, 0.1, False)],
)
def test_ratios_are_tried_where_a_fit_has_few_of_the_stars_and_is_poor_or_very_few(
    share_fitted, rms_share, tried
) -> None:
    """Fewer than a quarter of the stars, or than half of them and off by 0.15 % of the larger side."""
    detections, matches, fit, catalogue = stretched(0.0)
    inliers = np.arange(len(detections)) < round(share_fitted * len(detections))
    poor = replace(fit, rms_px=rms_share * 1600, inliers=inliers)
    looked_at = []

    def grow(seen, found):
        looked_at.append(seen.width)
        return matches, poor

    found = Identification(matches, CAMERA, fit.attitude, -30.0, "patterns")
    fitted(grow, detections, found, catalogue, 2024.0)
    widths = {max(2, round(1600 / aspect)) for aspect in ASPECTS}
    assert (len(looked_at) > 1) is tried
    assert not tried or widths <= set(looked_at)


@pytest.mark.parametrize(("rms_share", "tried"), [(0.0004, False), (0.0015, True)])
def test_no_ratio_is_tried_where_stars_all_over_the_frame_agree_too_well_for_one(rms_share, tried) -> None:
    """A narrow frame whose faint stars no catalogue names took 0.5 s of processor for them, ten times its rest."""
    detections, _, fit, catalogue = stretched(0.0)
    every = np.arange(len(detections))
    matches = Matches(every, every, detections.xy, catalogue.places)
    good = replace(fit, rms_px=rms_share * 1600, inliers=every < 24)
    looked_at = []

    def grow(seen, found):
        looked_at.append(seen.width)
        return matches, good

    fitted(grow, detections, Identification(matches, CAMERA, fit.attitude, -30.0, "patterns"), catalogue, 2024.0)
    assert (len(looked_at) > 1) is tried


@pytest.mark.parametrize(
    ("kept", "count", "near_before", "taken"),
    [
        (20, 20, 3, True),
        (20, 20, 4, False),
        (20, 11, 0, True),
        (20, 10, 1, False),
        (24, 12, 0, True),
        (24, 11, 0, False),
    ],
)
def test_a_ratio_is_taken_that_brings_twice_as_many_and_eight_stars_close_and_keeps_half(
    kept, count, near_before, taken
) -> None:
    """Of the new fit's stars three in four are closer than its RMS; of those before so many."""
    detections, matches, fit, catalogue = stretched(0.0)

    def first(k, near, near_px, far_px):
        stars = Matches(*(part[:k] for part in (matches.detection, matches.star, matches.xy, matches.vectors)))
        lengths = np.where(np.arange(k) < near, near_px, far_px)
        rms = float(np.sqrt(np.mean(lengths**2)))
        return stars, replace(fit, residuals_px=np.column_stack([lengths, 0.0 * lengths]), rms_px=rms)

    square, other = first(kept, near_before, 0.5, 4.0), first(count, round(0.75 * count), 0.5, 1.4)

    def grow(seen, found):
        return square if seen.width == 1600 else other

    found = Identification(matches, CAMERA, fit.attitude, -30.0, "patterns")
    answer, chosen, _ = fitted(grow, detections, found, catalogue, 2024.0)
    assert (chosen.camera.aspect != 1.0) is taken
    assert len(answer) == (count if taken else kept)


@cache
def recorded(path):
    """The detections of a picture and what is solved of them."""
    detections = AutoDetector().detect(read_frame(path))
    return detections, run(solve_detections(detections))


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("anet__apod2.jpg", 1.0 / 1.03),  # square pixels fitted it behind a lens tilted by 13 deg
        ("anet__apod2.jpg", 1.01),
        ("ores__oresat_star_tracker_data_mock_img.png", 1.0 / 1.03),
        ("ores__downsample_samples_5.bmp", 1.02),  # this and the next were refused as stretched
        ("ost__feb16_calibration_data_2.png", 1.03),
    ],
)
def test_a_real_frame_made_longer_one_way_says_by_how_much_and_as_recorded_nothing(shared_frames, name, share):
    detections, as_recorded = recorded(shared_frames / name)
    assert as_recorded.camera.aspect == 1.0
    answer = run(solve_detections(resized(detections, share)))
    assert isinstance(answer, Solution)
    assert answer.camera.aspect == pytest.approx(share, rel=5e-3)
    assert any("is stretched by" in w for w in answer.warnings)
    assert apart_deg(answer.ra_dec_deg, as_recorded.ra_dec_deg) < 0.003 * max(answer.camera.fov_deg)


def bent_lens(seed, rng):
    """A tilted lens of 8 to 58 degrees, up to 5 % off at the corners, its axis a little beside the middle."""
    focal = 511.5 / np.tan(np.radians((8.0, 12.0, 25.0, 58.0)[seed % 4]) / 2.0)
    corner = 511.5 * 2.0**0.5 / focal
    cx, cy = (511.5 + rng.normal(0.0, 15.0, 2)).tolist()
    p1, p2 = rng.normal(0.0, 0.004 / corner, 2).tolist()
    return Camera(1024, 1024, focal, cx, cy, float(rng.uniform(-0.05, 0.05) / corner**2), 0.0, p1, p2)


def test_no_lens_is_taken_for_a_resized_image():
    found = 0
    for seed in range(24):
        rng = np.random.default_rng([9, seed])
        lens, stars = bent_lens(seed, rng), 300 if seed % 2 else 40
        photo = photograph(lens, random_attitude(rng), stars, 0.15, spurious=5, missing=0.1, seed=seed)
        answer = run(solve_detections(photo.detections))
        if isinstance(answer, Solution):
            assert answer.camera.aspect == 1.0
            found += 1
    assert found >= 22
