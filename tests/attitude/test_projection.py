"""The Jacobian against differences, for every parameter."""

from dataclasses import replace

import numpy as np
import pytest

from kochab.attitude.least_squares import PARAMETERS, moved, project_with_jacobian, sane
from kochab.core.camera import Camera

CAMERA = Camera(3000, 2000, 2500.0, 1480.0, 1010.0, -0.11, 0.03, 0.004, -0.003)


@pytest.fixture
def vectors() -> np.ndarray:
    pixels = np.random.default_rng(1).uniform([0, 0], [2999, 1999], (40, 2))
    return CAMERA.unproject(pixels)


@pytest.mark.parametrize("mirrored", [False, True])
def test_pixels_are_the_cameras_own(vectors: np.ndarray, mirrored: bool) -> None:
    camera = replace(CAMERA, mirrored=mirrored)
    pixels, _ = project_with_jacobian(camera, vectors)
    np.testing.assert_allclose(pixels, camera.project(vectors), atol=1e-9)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("index", range(len(PARAMETERS)), ids=PARAMETERS)
def test_each_column_is_the_difference(vectors: np.ndarray, index: int, mirrored: bool) -> None:
    camera = replace(CAMERA, mirrored=mirrored)
    _, jacobian = project_with_jacobian(camera, vectors)
    size = 1e-6
    step = np.zeros(len(PARAMETERS))

    def shifted(amount: float) -> np.ndarray:
        step[index] = amount
        other, matrix = moved(camera, np.eye(3), step)
        return other.project(vectors @ matrix.T)

    difference = (shifted(size) - shifted(-size)) / (2 * size)
    np.testing.assert_allclose(jacobian[:, :, index], difference, atol=2e-3, rtol=1e-6)


def test_distortion_that_folds_the_frame_is_not_sane() -> None:
    plain = Camera.centred(3000, 2000, 2500.0)
    assert sane(plain)
    assert sane(replace(plain, k1=-0.1))
    assert not sane(replace(plain, k1=-0.8))
    assert not sane(replace(plain, k1=2.0))
