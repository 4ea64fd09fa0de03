"""Solutions whose camera was fitted otherwise, while the map from pixels to sky stays the same."""

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.solution import Solution

ARCSEC = np.pi / 648000.0
NOISE = np.diag(np.square([1.0, 1.0, 10.0])) * ARCSEC**2


def solution(camera, matrix, covariance=NOISE):
    """An answer with this camera and attitude (3, 3)."""
    return Solution(camera, Attitude(matrix, covariance), (), 0.1, -50.0, "patterns")


def displaced(found, dx, dy):
    """The same frame with its optical centre elsewhere: all other terms are fitted to its map.

    Also gives how far the two maps are apart at worst, radians.
    """
    camera = found.camera
    x, y = np.meshgrid(np.linspace(0, camera.width - 1, 15), np.linspace(0, camera.height - 1, 11))
    pixels = np.stack([x.ravel(), y.ravel()], axis=-1)
    sky = found.sky_at(pixels)
    tilt = np.array([-dy, dx, 0.0]) / camera.focal_px * [1.0, -1.0 if camera.mirrored else 1.0, 1.0]
    start = np.array([*tilt, 0.0, camera.k1, camera.k2, camera.p1, camera.p2])

    def other(values):
        k1, k2, p1, p2 = values[4:]
        fitted = Camera(
            camera.width,
            camera.height,
            camera.focal_px * np.exp(values[3]),
            camera.cx + dx,
            camera.cy + dy,
            k1,
            k2,
            p1,
            p2,
            camera.mirrored,
        )
        matrix = Rotation.from_rotvec(values[:3]).as_matrix() @ found.attitude.matrix
        return replace(found, camera=fitted, attitude=Attitude(matrix, found.attitude.covariance))

    def gaps(values):
        return ((other(values).sky_at(pixels) - sky) / ARCSEC).ravel()

    best = other(least_squares(gaps, start, x_scale="jac", method="lm").x)
    return best, float(np.linalg.norm(best.sky_at(pixels) - sky, axis=1).max())
