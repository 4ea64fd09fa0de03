"""The Jacobian against differences, for every parameter."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.attitude.least_squares import PARAMETERS, moved, project_with_jacobian, sane
from kochab.core.camera import Camera, FisheyeCamera

CAMERA = Camera(3000, 2000, 2500.0, 1480.0, 1010.0, -0.11, 0.03, 0.004, -0.003)
FISHEYE = FisheyeCamera(3000, 2000, 1000.0, 1480.0, 1010.0, -0.02, 0.003, 0.004, -0.003)


@pytest.fixture(params=[CAMERA, FISHEYE], ids=["gnomonic", "fisheye"])
def lens(request: pytest.FixtureRequest) -> Camera:
    return request.param


@pytest.fixture
def vectors(lens: Camera) -> np.ndarray:
    pixels = np.random.default_rng(1).uniform([0, 0], [2999, 1999], (40, 2))
    return lens.unproject(pixels)


@pytest.mark.parametrize("mirrored", [False, True])
def test_pixels_are_the_cameras_own(lens: Camera, vectors: np.ndarray, mirrored: bool) -> None:
    camera = replace(lens, mirrored=mirrored)
    pixels, _ = project_with_jacobian(camera, vectors)
    np.testing.assert_allclose(pixels, camera.project(vectors), atol=1e-9)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("index", range(len(PARAMETERS)), ids=PARAMETERS)
def test_each_column_is_the_difference(lens: Camera, vectors: np.ndarray, index: int, mirrored: bool) -> None:
    camera = replace(lens, mirrored=mirrored)
    _, jacobian = project_with_jacobian(camera, vectors)
    size = 1e-6
    step = np.zeros(len(PARAMETERS))

    def shifted(amount: float) -> np.ndarray:
        step[index] = amount
        other, matrix = moved(camera, np.eye(3), step)
        return other.project(vectors @ matrix.T)

    difference = (shifted(size) - shifted(-size)) / (2 * size)
    np.testing.assert_allclose(jacobian[:, :, index], difference, atol=2e-3, rtol=1e-6)


def test_what_lies_beyond_the_circle_of_a_fisheye_lens_folds_nothing() -> None:
    """A stereographic lens: r is theta (1 + theta^2 / 12 + ...), far from it in a corner where there is no sky."""
    lens = FisheyeCamera.centred(1600, 1600, 400.0)
    assert sane(replace(lens, k1=1 / 12, k2=1 / 120))
    assert not sane(replace(lens, k1=-0.3))


def test_distortion_that_folds_the_frame_is_not_sane() -> None:
    plain = Camera.centred(3000, 2000, 2500.0)
    assert sane(plain)
    assert sane(replace(plain, k1=-0.1))
    assert not sane(replace(plain, k1=-0.8))
    assert not sane(replace(plain, k1=2.0))


# -- How much a lens may distort: at the corner, its radius the farthest from the principal point --

RADIUS = np.hypot(2999.0, 1999.0) / 2.0 / 2500.0


@pytest.mark.parametrize(
    ("term", "power", "limit"),
    [
        ("k1", 2, 0.4),
        ("k1", 2, -0.8 / 3.0),
        ("k2", 4, 0.4),
        ("k2", 4, -0.16),
        ("p1", 1, 0.4 / 3.0),
        ("p2", 1, -0.4 / 3.0),
    ],
)
def test_a_corner_may_move_by_two_fifths_and_the_radius_must_grow(term: str, power: int, limit: float) -> None:
    """Outwards until 0.4 of the radius; inwards until the recorded radius grows by a fifth of the true one."""
    plain = Camera.centred(3000, 2000, 2500.0)
    for share, kept in ((0.9998, True), (1.0002, False)):
        assert sane(replace(plain, **{term: share * limit / RADIUS**power})) is kept


def test_distortions_add_up_and_an_eccentric_centre_has_a_farther_corner() -> None:
    plain = Camera.centred(3000, 2000, 2500.0)
    both = replace(plain, k1=0.2 / RADIUS**2, p1=0.03 / RADIUS, p2=-0.03 / RADIUS)
    assert sane(both)
    assert not sane(replace(both, p2=-0.04 / RADIUS))
    bent = replace(plain, k1=0.3 / RADIUS**2)
    for dx, dy in ((300.0, 0.0), (-300.0, 0.0), (0.0, 300.0), (0.0, -300.0)):
        far = np.hypot(1499.5 + abs(dx), 999.5 + abs(dy)) / 2500.0
        moved_camera = replace(bent, cx=bent.cx + dx, cy=bent.cy + dy)
        assert sane(moved_camera) is bool(0.3 * (far / RADIUS) ** 2 < 0.4)
        assert sane(replace(moved_camera, k1=0.399 / far**2))
        assert not sane(replace(moved_camera, k1=0.401 / far**2))


def test_a_distortion_that_is_mild_at_the_corner_may_be_too_strong_on_the_way() -> None:
    """Inwards by 0.45 at four fifths of the radius, and by 0.3 at the corner."""
    folded = replace(Camera.centred(3000, 2000, 2500.0), k1=-1.4 / RADIUS**2, k2=1.1 / RADIUS**4)
    assert not sane(folded)
    assert sane(replace(folded, k1=-1.1 / RADIUS**2, k2=0.85 / RADIUS**4))
