"""The match set grows to the whole field, through distortion, and takes no false star."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.attitude.fit import refine
from kochab.core.attitude import Attitude, attitude_from, unit
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Matches, Solution
from kochab.lab.bench.identify_sigma import in_sigmas
from kochab.simulate.random_fields import random_attitude
from kochab.sky import open_catalogue
from kochab.solver import UNKNOWN_YEAR, UNKNOWN_YEAR_SIGMA, SolveOptions
from kochab.solver.matches import catalogue_sigma_rad, extend, with_catalogue_error, with_unknown_date, zonal_covariance
from kochab.solver.pipeline import solve_detections

from .fields import YEAR, orion, photograph, told


def grown(field, found):
    matches, fit = extend(field.detections, found, open_catalogue(), YEAR)
    right = field.rows[matches.detection] == matches.star
    return matches, fit, right


def test_a_few_central_stars_lead_to_all() -> None:
    field = orion()
    matches, fit, right = grown(field, told(field, 6, 0.4))
    assert right.mean() > 0.97
    assert len(matches) > 0.95 * len(field.detections)
    assert fit.rms_px < 0.35
    assert len(fit.residuals_px) == len(matches) == fit.inliers.sum()


@pytest.mark.parametrize("corner", [0.03, -0.03, 0.06])
@pytest.mark.parametrize("mirrored", [False, True])
def test_strong_distortion_is_learnt_from_the_centre_outward(corner: float, mirrored: bool) -> None:
    focal = 1600 / 2 / np.tan(np.radians(20))
    k1 = corner / (800**2 + 500**2) * focal**2
    camera = replace(Camera.centred(1600, 1000, focal, mirrored), k1=k1)
    field = photograph(camera, attitude_from(84.0, -2.0, 25.0), stars=150)
    matches, fit, right = grown(field, told(field, 12, 0.5))
    assert len(matches) > 0.93 * len(field.detections)
    assert right.mean() > 0.97
    assert fit.camera.k1 == pytest.approx(k1, rel=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_a_fisheye_lens_is_followed_to_its_edge(seed: int) -> None:
    """Its outer term shows nowhere but where stars are pixels off their places, and not beside an axis off the middle."""
    camera = replace(FisheyeCamera.centred(2800, 2800, 960.0, False), k1=-0.03, k2=-0.006, cx=1410.0, cy=1430.0)
    field = photograph(camera, attitude_from(60.0 * seed, 80.0 - 25.0 * seed, 10.0), 700, seed=seed, spurious=60)
    stars = open_catalogue().vectors(np.maximum(field.rows, 0), YEAR) @ field.attitude.boresight
    ahead = np.flatnonzero((stars > np.cos(np.radians(86.0))) | (field.rows < 0))  # others are mirrored into the frame
    field = replace(field, detections=field.detections.take(ahead), rows=field.rows[ahead])
    found = replace(told(field, 40, 0.35), camera=FisheyeCamera.centred(2800, 2800, 960.0, False))
    matches, fit = extend(field.detections, found, open_catalogue(), YEAR)
    assert np.isin(np.flatnonzero(field.rows >= 0), matches.detection).mean() > 0.97
    assert (field.rows[matches.detection] == matches.star).mean() > 0.98
    assert fit.rms_px < 0.35


def test_false_detections_stay_without_a_name() -> None:
    camera = Camera.centred(1600, 1000, 7600.0)
    field = photograph(camera, attitude_from(84.0, -2.0, 25.0), spurious=80, missing=0.3)
    matches, fit, right = grown(field, told(field))
    assert right.mean() > 0.95
    assert (field.rows[matches.detection] >= 0).mean() > 0.95
    assert fit.rms_px < 0.4


@pytest.mark.parametrize(("ra", "dec"), [(0.001, 0.0), (180.0, 89.9), (40.0, -89.9)])
def test_it_works_at_the_seams_of_the_sky(ra: float, dec: float) -> None:
    field = photograph(Camera.centred(1600, 1000, 7600.0), attitude_from(ra, dec, 100.0), 60)
    matches, _, right = grown(field, told(field))
    assert len(matches) > 0.95 * len(field.detections)
    assert right.mean() > 0.97


def test_few_matches_are_kept_when_nothing_can_be_added() -> None:
    field = photograph(Camera.centred(1600, 1000, 7600.0), attitude_from(84.0, -2.0, 25.0), 5)
    matches, _, right = grown(field, told(field, 5))
    assert len(matches) == 5
    assert right.all()


def test_without_distortion_the_camera_has_none_whatever_the_method_found() -> None:
    field = orion()
    found = told(field, 6, 0.4)
    bent = replace(found, camera=replace(found.camera, k1=0.01))
    _, fit = extend(field.detections, bent, open_catalogue(), YEAR, distortion=False)
    assert not fit.camera.distorted


def test_a_last_fit_that_ran_away_is_made_again_without_what_carried_it(monkeypatch) -> None:
    field, made = orion(), []

    def runaway(*args, distortion, rounds=4, **options):
        fit = refine(*args, distortion=distortion, rounds=rounds, **options)
        made.append((rounds, distortion))
        away = distortion and rounds > 1
        return replace(fit, rms_px=np.inf, camera=replace(fit.camera, k1=1e9)) if away else fit

    monkeypatch.setattr("kochab.solver.matches.refine", runaway)
    _, fit, right = grown(field, told(field, 6, 0.4))
    assert made[-2:] == [(4, True), (4, False)]
    assert fit.rms_px < 0.35
    assert right.mean() > 0.97


def test_a_catalogue_place_is_less_certain_with_every_year() -> None:
    """Exact places of Tycho-2 stars: its motions alone, to 1 mas a year in common, make 35 mas by 2026."""
    bright, faint = np.array([6.0]), np.array([11.5])
    arcsec = [np.degrees(catalogue_sigma_rad(faint, year)[0]) * 3600.0 for year in (1991.25, 2026.25)]
    assert arcsec == pytest.approx([0.042, np.hypot(0.042, 0.0875)], rel=0.05)
    assert catalogue_sigma_rad(bright, 2026.25) < 0.5 * catalogue_sigma_rad(faint, 2026.25)
    exact = Attitude(np.eye(3), np.zeros((3, 3)))
    assert with_catalogue_error(exact, 2026.25).sigma_arcsec == pytest.approx((0.035, 0.035, 0.0))
    assert with_catalogue_error(Attitude(np.eye(3)), 2026.25).covariance is None


def test_an_undated_frame_counts_what_its_stars_may_have_moved() -> None:
    """What 25 stars of 1.5 deg share of their motions is 1.4 sigma too much, were the date taken for known."""
    rng, errors = np.random.default_rng(4), {"dated": [], "undated": []}
    camera = Camera.centred(1000, 800, 1000 / 2 / np.tan(np.radians(0.75)))
    size = np.array([camera.width - 1.0, camera.height - 1.0])
    for _ in range(40):
        attitude, year = random_attitude(rng), UNKNOWN_YEAR + UNKNOWN_YEAR_SIGMA * rng.normal()
        rows = open_catalogue().brightest(attitude.boresight, np.radians(1.0), 60)
        shared_rad = np.sqrt(zonal_covariance(year)[0, 0]) * rng.normal(size=2)
        vectors = open_catalogue().vectors(rows, year) + shared_rad @ attitude.matrix[:2]
        xy = camera.project(vectors @ attitude.matrix.T)
        inside = ((xy > 0) & (xy < size)).all(axis=1)
        xy = xy[inside][:25] + rng.normal(0.0, 0.01, xy[inside][:25].shape)
        seen = Detections.from_list(xy, camera.width, camera.height)
        truth = Solution(camera, attitude, (), 0.0, 0.0, "truth")
        moment = datetime(2000, 1, 1, 12, tzinfo=UTC) + timedelta(days=365.25 * (year - 2000.0))
        for name, hint in (("dated", Hint(time_utc=moment)), ("undated", None)):
            found = run(solve_detections(seen, SolveOptions(hint=hint)))
            if isinstance(found, Solution):
                errors[name].append(in_sigmas(found, truth, size / 2.0)[:2])
    for name, scaled in errors.items():
        assert len(scaled) >= 36
        assert np.sqrt(np.mean(np.square(scaled))) == pytest.approx(1.0, abs=0.25), name


def test_the_motion_of_an_undated_frame_is_a_turn_of_all_its_stars_and_nothing_without_a_covariance() -> None:
    rng, turn = np.random.default_rng(1), np.radians([0.3 / 3600, -0.2 / 3600, 9.0 / 3600])
    vectors = unit(np.array([0.0, 0.0, 1.0]) + 0.02 * rng.normal(size=(50, 3)))
    matches = Matches(np.arange(50), np.arange(50), np.zeros((50, 2)), vectors)
    later = vectors + np.cross(turn, vectors)
    known = with_unknown_date(Attitude(np.eye(3), np.zeros((3, 3))), matches, later)
    np.testing.assert_allclose(known.covariance, np.outer(turn, turn), rtol=1e-6)
    assert with_unknown_date(Attitude(np.eye(3)), matches, later).covariance is None


@pytest.mark.parametrize("off", [(0.55, 0.0), (0.4, 0.1)])
def test_a_part_of_a_larger_frame_is_known_by_its_optical_axis(off: tuple[float, float]) -> None:
    """Blind, 46 deg wide, its axis so much of a side beside the middle: a lens in the middle fitted a third of its stars,
    or all poorly and with an aspect ratio, and was 2 to 60 px off."""
    focal = 800 / np.tan(np.radians(23.0))
    lens = Camera.centred(1600, 1100, focal)
    lens = replace(lens, cx=lens.cx + off[0] * 1600, cy=lens.cy + off[1] * 1100, k1=-0.02)
    field = photograph(lens, attitude_from(84.0, 20.0, 25.0), stars=220, spurious=15)
    found = run(solve_detections(field.detections))
    assert isinstance(found, Solution)
    assert len(found.stars) > 200
    assert found.camera.aspect == 1.0
    assert (found.camera.cx, found.camera.cy) == pytest.approx((lens.cx, lens.cy), abs=8.0)
    middle = np.array([[799.5, 549.5]])
    true = (lens.unproject(middle) @ field.attitude.matrix)[0]
    assert np.hypot(*(found.centre_attitude.matrix @ true)[:2]) * focal < 0.2
