from dataclasses import replace

import numpy as np
import pytest

from kochab.core.attitude import attitude_from, radec_deg, small_rotation
from kochab.core.camera import Camera
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.solution import Identification, NoSolution, Reason
from kochab.identification import IDENTIFIERS
from kochab.identification.predictional_estimate import differential, predictional_estimate
from kochab.identification.verification import least_likely
from kochab.lab.methods.predict import Predict
from kochab.simulate.random_fields import FieldPlan, random_field, random_points
from kochab.sky import open_catalogue


def hint_near(field, off_deg: float, radius_deg: float, rng) -> Hint:
    axis = rng.normal(size=3)
    across = np.cross(field.attitude.boresight, axis)
    across /= np.linalg.norm(across)
    off = np.radians(off_deg)
    place = np.cos(off) * field.attitude.boresight + np.sin(off) * across
    s = field.camera.scale_arcsec_px
    return Hint(scale_arcsec_px=(s / 1.1, s * 1.08), centre_deg=(*radec_deg(place), radius_deg))


def grid_of_stars(camera, attitude, n=60, seed=2):
    rng = np.random.default_rng(seed)
    xy = rng.uniform(20, [camera.width - 20, camera.height - 20], (n, 2))
    return xy, camera.unproject(xy) @ attitude.matrix


@pytest.mark.parametrize(("fov", "radius"), [(5.0, 1.0), (25.0, 3.0)])
def test_a_place_and_a_scale_are_enough(fov, radius) -> None:
    catalogue, rng = open_catalogue(), np.random.default_rng(5)
    field = random_field(catalogue, rng, FieldPlan(fov))
    hint = hint_near(field, 0.6 * radius, radius, rng)
    found = run(Predict().identify(field.detections, hint))
    assert isinstance(found, Identification)
    assert found.attitude.boresight @ field.attitude.boresight > np.cos(np.radians(fov / 200))
    assert found.camera.mirrored == field.camera.mirrored
    assert found.log10_false_alarm < -5


@pytest.mark.parametrize("scales", [(0.82, 0.99), (1.01, 1.19)])
def test_a_scale_just_outside_its_range_is_found(scales) -> None:
    field = random_field(open_catalogue(), np.random.default_rng(5), FieldPlan(25.0))
    hint = hint_near(field, 1.8, 3.0, np.random.default_rng(6))
    scale = field.camera.scale_arcsec_px
    asked = replace(hint, scale_arcsec_px=(scales[0] * scale, scales[1] * scale))
    found = run(Predict().identify(field.detections, asked))
    assert isinstance(found, Identification)
    assert found.camera.focal_px == pytest.approx(field.camera.focal_px, rel=0.01)


def test_points_and_other_places_are_refused() -> None:
    rng, catalogue = np.random.default_rng(7), open_catalogue()
    field = random_field(catalogue, rng, FieldPlan(8.0))
    hint = hint_near(field, 30.0, 1.5, rng)
    assert isinstance(run(Predict().identify(field.detections, hint)), NoSolution)
    points = random_points(rng, 40)
    assert isinstance(run(Predict().identify(points, hint)), NoSolution)


def test_what_it_needs_is_said() -> None:
    stars = Detections.from_list(np.random.default_rng(1).uniform(0, 900, (20, 2)), 900, 900)
    for hint in (None, Hint(scale_arcsec_px=(30.0, 32.0)), Hint(centre_deg=(10.0, 20.0, 1.0))):
        found = run(IDENTIFIERS.make("predict").identify(stars, hint))
        assert isinstance(found, NoSolution)
        assert "Give coordinates" in found.advice
    wide = Hint(scale_arcsec_px=(4.0, 4.4), centre_deg=(10.0, 20.0, 30.0))
    found = run(Predict().identify(stars, wide))
    assert isinstance(found, NoSolution)
    assert "smaller radius" in found.advice
    few = run(Predict().identify(stars.take(slice(0, 4)), wide))
    assert isinstance(few, NoSolution)
    assert few.reason == Reason.TOO_FEW_STARS


def test_differential_refinement_finds_a_small_turn_exactly() -> None:
    camera = Camera(1200, 900, 2000.0, 610.0, 440.0, k1=-0.1, p1=0.001, mirrored=True)
    truth = attitude_from(40.0, -20.0, 77.0)
    xy, vectors = grid_of_stars(camera, truth)
    start = small_rotation(np.radians([0.2, -0.1, 0.5])) @ truth.matrix
    matrix, _ = differential(camera, start, xy, vectors, np.ones(len(xy)), steps=4)
    assert np.allclose(matrix, truth.matrix, atol=1e-9)


def test_false_and_missing_stars_have_no_say() -> None:
    camera, truth = Camera.centred(1000, 1000, 2000.0), attitude_from(10.0, 50.0, 0.0)
    xy, vectors = grid_of_stars(camera, truth, 40)
    rng = np.random.default_rng(3)
    seen = np.concatenate([xy[4:] + rng.normal(0, 0.1, (36, 2)), rng.uniform(0, 999, (10, 2))])
    start = small_rotation(np.array([0.003, 0.002, 0.001])) @ truth.matrix
    found = predictional_estimate(camera, start, seen, vectors, 25.0)
    assert found is not None
    assert set(range(36)) >= set(found.seen.tolist())
    assert (found.star - 4 == found.seen).all()
    assert len(found.seen) >= 32
    off = np.degrees(np.arccos(found.attitude.matrix[2] @ truth.matrix[2])) * 3600.0
    assert off < 4 * found.attitude.sigma_arcsec[0] + 1
    assert found.sigma_px == pytest.approx(0.1, rel=0.4)


def test_nothing_near_the_expected_places_is_none() -> None:
    camera, truth = Camera.centred(1000, 1000, 2000.0), attitude_from(10.0, 50.0, 0.0)
    xy, vectors = grid_of_stars(camera, truth, 10)
    assert predictional_estimate(camera, truth.matrix, xy[:1], vectors, 5.0) is None
    assert predictional_estimate(camera, np.diag([1.0, -1, -1]), xy, vectors, 5.0) is None


def test_the_bound_is_reached_by_chance_no_oftener_than_it_says() -> None:
    rng, low = np.random.default_rng(9), 0
    camera, truth = Camera.centred(1000, 1000, 2000.0), attitude_from(10.0, 50.0, 0.0)
    for _ in range(300):
        _, vectors = grid_of_stars(camera, truth, 30, seed=int(rng.integers(1e9)))
        seen = rng.uniform(0, 999, (30, 2))
        found = predictional_estimate(camera, truth.matrix, seen, vectors, 40.0, closest_px=10.0)
        d2 = np.zeros(0) if found is None else np.sum(found.residuals_px**2, axis=1)
        low += least_likely(d2, 30, 30, 1e6, 40.0, 3)[0] < -1.0
    assert low <= 30
