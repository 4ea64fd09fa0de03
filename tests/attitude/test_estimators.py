"""Every estimator is exact on exact stars, honest about its errors, and refuses what it cannot."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kochab.attitude import ESTIMATORS, FLOOR_PX, directions, sigma_rad
from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.errors import UsageError

from .fields import Field, simulate

NAMES = list(ESTIMATORS)
CAMERA = Camera.centred(3000, 2000, 8000.0)


def estimate(name: str, field: Field, **options):  # type: ignore[no-untyped-def]
    m = field.matches
    return ESTIMATORS.make(name, **options).estimate(m.xy, m.vectors, field.camera)


def turn(found, truth) -> np.ndarray:
    """Rotation vector (3,) in camera axes, rad."""
    return Rotation.from_matrix(found.matrix @ truth.matrix.T).as_rotvec()


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25)
@given(st.integers(0, 10_000), st.integers(4, 30), st.sampled_from([0.8, 10.0, 40.0]), st.booleans())
def test_exact_stars_give_the_exact_attitude(name, seed, stars, fov_deg, mirrored) -> None:
    field = simulate(seed, stars, fov_deg, sigma_px=0.0, corner=0.01, mirrored=mirrored)
    options = {"tolerance_arcsec": 1e-5} if name == "plate_constants" else {}
    found = estimate(name, field, **options)
    assert np.linalg.norm(turn(found, field.attitude)) < 2e-7
    np.testing.assert_allclose(found.matrix @ found.matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(found.matrix) == pytest.approx(1.0)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "where", [(0.0, 90.0, 0.0), (180.0, -90.0, 33.0), (359.9, 89.0, -170.0), (0.0, 0.0, 180.0), (360.0, -20.0, 90.0)]
)
def test_poles_and_the_first_hour_are_no_edges(name, where) -> None:
    truth = attitude_from(*where)
    xy = np.random.default_rng(4).uniform(0, 1999, (12, 2))
    found = ESTIMATORS.make(name).estimate(xy, CAMERA.unproject(xy) @ truth.matrix, CAMERA)
    assert np.linalg.norm(turn(found, truth)) < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_claimed_errors_are_the_scatter_of_many_trials(name) -> None:
    field = simulate(11, 12, sigma_px=0.0)
    rng, turns, claimed = np.random.default_rng(0), [], []
    for _ in range(500):
        noisy = replace(field.matches, xy=field.matches.xy + rng.normal(0, 0.5, (12, 2)))
        options = {} if name == "plate_constants" else {"sigma_px": 0.5}
        found = estimate(name, replace(field, matches=noisy), **options)
        turns.append(turn(found, field.attitude))
        claimed.append(found.covariance)
    measured, told = np.cov(np.array(turns).T), np.mean(claimed, axis=0)
    scale = np.sqrt(np.outer(np.diag(measured), np.diag(measured)))
    np.testing.assert_allclose(told / scale, measured / scale, atol=0.25)


@pytest.mark.parametrize("name", ["quest", "triad"])
def test_errors_come_from_the_residuals_when_not_told(name) -> None:
    field = simulate(5, 200, sigma_px=0.5)
    told = estimate(name, field, sigma_px=0.5).sigma_arcsec
    assert estimate(name, field).sigma_arcsec == pytest.approx(told, rel=0.9)


def test_two_stars_are_worse_than_all_and_six_constants_than_three_angles() -> None:
    errors = {name: [] for name in NAMES}
    for seed in range(150):
        field = simulate(seed, 20, sigma_px=0.5)
        for name in NAMES:
            errors[name].append(turn(estimate(name, field), field.attitude))
    rms = {name: np.sqrt(np.mean(np.square(e), axis=0)) for name, e in errors.items()}
    assert (rms["triad"] > 2.0 * rms["quest"]).all()
    assert (rms["plate_constants"] >= 0.98 * rms["quest"]).all()
    assert (rms["plate_constants"] < rms["triad"]).all()


def test_a_wrong_focal_length_spoils_the_constants_least() -> None:
    field = simulate(3, 6, sigma_px=0.0)
    wrong = replace(field, camera=replace(field.camera, focal_px=1.05 * field.camera.focal_px))
    angle = {name: np.linalg.norm(turn(estimate(name, wrong), field.attitude)) for name in NAMES}
    assert angle["plate_constants"] < 1e-6 < 0.1 * angle["quest"]
    assert angle["quest"] < angle["triad"]


def test_triad_believes_the_first_star_and_leans_on_the_second_for_roll_alone() -> None:
    field = simulate(3, 10, sigma_px=2.0)
    found = estimate("triad", field)
    first = field.camera.unproject(field.matches.xy)[0]
    np.testing.assert_allclose(found.matrix @ field.matches.vectors[0], first, atol=1e-12)
    other = estimate("triad", field, partner="next")
    np.testing.assert_allclose(other.matrix @ field.matches.vectors[0], first, atol=1e-12)
    assert not np.allclose(other.matrix, found.matrix, atol=1e-9)


@pytest.mark.parametrize(("name", "fewest"), [("quest", 2), ("triad", 2), ("plate_constants", 3)])
def test_what_cannot_be_estimated_is_refused(name, fewest) -> None:
    field = simulate(1, 5, sigma_px=0.0)
    estimator, xy, vectors = ESTIMATORS.make(name), field.matches.xy, field.matches.vectors
    estimator.estimate(xy[:fewest], vectors[:fewest], field.camera)
    with pytest.raises(ValueError, match="stars or more"):
        estimator.estimate(xy[: fewest - 1], vectors[: fewest - 1], field.camera)
    with pytest.raises(ValueError, match="do not match"):
        estimator.estimate(xy, vectors[1:], field.camera)
    with pytest.raises(ValueError, match="not a number"):
        estimator.estimate(np.where(np.eye(5, 2) > 0, np.nan, xy), vectors, field.camera)
    same = np.zeros(5, dtype=int)
    with pytest.raises(ValueError, match=r"one (direction|line)"):
        estimator.estimate(xy[same], vectors[same], field.camera)


def test_a_second_star_nearer_than_was_asked_for_is_told_so() -> None:
    field = simulate(1, 5, 10.0, sigma_px=0.0)
    with pytest.raises(ValueError, match="less than 60 degrees"):
        ESTIMATORS.make("triad", least_angle_deg=60.0).estimate(field.matches.xy, field.matches.vectors, field.camera)


def test_a_mirrored_picture_has_no_constants_for_a_plain_camera() -> None:
    field = simulate(1, 5, sigma_px=0.0, mirrored=True)
    with pytest.raises(ValueError, match=r"mirrored|settle"):
        estimate("plate_constants", replace(field, camera=replace(field.camera, mirrored=False)))


def test_three_stars_leave_no_residual_to_judge_the_constants_by() -> None:
    assert estimate("plate_constants", simulate(1, 3, sigma_px=0.0)).covariance is None
    assert estimate("plate_constants", simulate(1, 4)).covariance is not None


def test_an_unknown_name_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(UsageError, match="quest, plate_constants, triad"):
        ESTIMATORS.make("x")


def test_of_m_stars_a_rotation_takes_three_of_two_m_measurements() -> None:
    """The scatter of residuals over what freedom is left, never below the floor; a given error as it is."""
    icrs = CAMERA.unproject(np.random.default_rng(2).uniform(0, 1999, (8, 2)))
    residual = np.full((8, 3), 1e-3)
    assert sigma_rad(icrs + residual, icrs, np.eye(3), CAMERA, None) == pytest.approx(1e-3 * np.sqrt(24.0 / 13.0))
    assert sigma_rad(icrs[:2] + residual[:2], icrs[:2], np.eye(3), CAMERA, None) == pytest.approx(1e-3 * np.sqrt(6.0))
    assert sigma_rad(icrs[:1] + residual[:1], icrs[:1], np.eye(3), CAMERA, None) == pytest.approx(1e-3 * np.sqrt(3.0))
    assert sigma_rad(icrs, icrs, np.eye(3), CAMERA, None) == FLOOR_PX / 8000.0
    assert sigma_rad(icrs, icrs, np.eye(3), CAMERA, 0.4) == 0.4 / 8000.0


def test_lists_that_do_not_match_or_hold_no_numbers_are_refused() -> None:
    xy = np.random.default_rng(2).uniform(0, 1999, (4, 2))
    vectors = CAMERA.unproject(xy)
    seen, icrs = directions(xy, vectors, CAMERA, 4)
    np.testing.assert_allclose(seen, icrs)
    for places, stars, fewest, sentence in (
        (xy, vectors[:3], 2, "4 places do not match 3"),
        (xy, vectors, 5, "needs 5 stars"),
        (np.where(xy == xy[0, 0], np.nan, xy), vectors, 2, "not a number"),
        (xy, np.where(vectors == vectors[0, 0], np.inf, vectors), 2, "not a number"),
    ):
        with pytest.raises(ValueError, match=sentence):
            directions(places, stars, CAMERA, fewest)
