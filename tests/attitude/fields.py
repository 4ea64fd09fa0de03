"""Simulated matches: a camera, a pointing, stars, and what a bad day does to their centroids."""

from dataclasses import dataclass

import numpy as np

from kochab.core.attitude import Attitude, attitude_from, small_rotation
from kochab.core.camera import Camera
from kochab.core.solution import Matches


@dataclass(frozen=True)
class Field:
    """Matches with their truth, and a first guess that is a little off."""

    matches: Matches
    camera: Camera
    attitude: Attitude
    first_camera: Camera
    first_attitude: Attitude


def simulate(
    seed: int,
    stars: int = 100,
    fov_deg: float = 10.0,
    sigma_px: float = 0.3,
    corner: float = 0.0,
    mirrored: bool = False,
    wrong: int = 0,
    off_centre_px: tuple[float, float] = (0.0, 0.0),
    guess_px: float = 2.0,
) -> Field:
    """A 3000 x 2000 frame; ``corner`` is the k1 distortion at the corner as a share of radius."""
    rng = np.random.default_rng(seed)
    w, h = 3000, 2000
    focal = w / 2 / np.tan(np.radians(fov_deg) / 2)
    k1 = corner / ((w / 2) ** 2 + (h / 2) ** 2) * focal**2
    cx, cy = (w - 1) / 2 + off_centre_px[0], (h - 1) / 2 + off_centre_px[1]
    camera = Camera(w, h, focal, cx, cy, k1=k1, mirrored=mirrored)
    ra, dec, roll = rng.uniform([0, -90, -180], [360, 90, 180])
    attitude = attitude_from(float(ra), float(dec), float(roll))
    xy = rng.uniform([0, 0], [w - 1, h - 1], (stars, 2))
    vectors = camera.unproject(xy) @ attitude.matrix
    xy = xy + rng.normal(0, sigma_px, xy.shape) if sigma_px else xy.copy()
    xy[:wrong] += rng.choice([-1, 1], (wrong, 2)) * rng.uniform(15, 60, (wrong, 2))
    index = np.arange(stars, dtype=np.int64)
    first_camera = Camera.centred(w, h, focal * (1 + guess_px / 2000), mirrored)
    nudge = small_rotation(rng.normal(0, guess_px / focal, 3))
    return Field(Matches(index, index, xy, vectors), camera, attitude, first_camera, Attitude(nudge @ attitude.matrix))


def centre_error_px(field: Field, camera: Camera, attitude: Attitude) -> np.ndarray:
    """Where a fit puts the direction that is truly in the middle of the frame, px (2,)."""
    middle = np.array([[(camera.width - 1) / 2, (camera.height - 1) / 2]])
    truth = field.camera.unproject(middle) @ field.attitude.matrix
    return np.asarray((camera.project(truth @ attitude.matrix.T) - middle)[0])
