"""Terms that are hardly told apart must not carry the fit away: narrow fields low in the sky."""

import numpy as np
import pytest

from kochab.attitude.fit import refine
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.solution import Matches

FOV_DEG, STARS, UP_DEG = 4.0, 600, 139.0


def lift_arcmin(altitude_deg):
    """Saemundsson's refraction."""
    return 1.02 / np.tan(np.radians(altitude_deg + 10.3 / (altitude_deg + 5.11)))


def low_field(altitude_deg, noise_px, seed):
    """A field so high above the horizon: its stars as the air lifts them, and a first camera."""
    rng = np.random.default_rng(seed)
    focal = 640.0 / np.tan(np.radians(FOV_DEG / 2.0))
    camera = Camera(1280, 960, focal, 639.5, 479.5)
    vectors = camera.unproject(rng.uniform((0, 0), (1279, 959), (STARS, 2)))
    up = np.array([np.sin(np.radians(UP_DEG)), -np.cos(np.radians(UP_DEG))])
    height = altitude_deg + np.degrees(np.arctan2(vectors[:, :2] @ up, vectors[:, 2]))
    lifted = np.radians((lift_arcmin(height) - lift_arcmin(altitude_deg)) / 60.0)
    seen = vectors.copy()
    seen[:, :2] += lifted[:, None] * up
    xy = camera.project(seen) + rng.normal(0.0, noise_px, (STARS, 2))
    index = np.arange(STARS)
    return Matches(index, index, xy, vectors), camera, rng.uniform(0.5, 2.0, STARS)


@pytest.mark.parametrize(
    ("altitude", "noise", "seed"), [(9.0, 0.1, 23), (11.0, 0.3, 9), (12.0, 0.5, 14), (14.0, 0.1, 10), (10.0, 0.1, 14)]
)  # all of these ran away to rms from 6 to 10^79 px
def test_a_centre_and_a_distortion_that_are_hardly_told_apart_do_not_run_away(altitude, noise, seed):
    matches, camera, sigma = low_field(altitude, noise, seed)
    fit = refine(matches, camera, Attitude(np.eye(3)), sigma)
    assert fit.rms_px < 4.0
    assert fit.camera.focal_px == pytest.approx(camera.focal_px, rel=0.02)
    middle = camera.unproject(np.array([[639.5, 479.5]]))
    off = fit.camera.project(middle @ fit.attitude.matrix.T) - [639.5, 479.5]
    assert np.hypot(*off[0]) < 3.0
