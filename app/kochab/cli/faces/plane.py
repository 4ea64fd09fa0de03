"""The tangent plane at the middle of a frame, which other solvers' callers expect the scale and the turn of."""

import numpy as np

from kochab.core.attitude import east_north
from kochab.core.solution import Solution

Cd = tuple[tuple[float, float], tuple[float, float]]


def cd_at_centre(solution: Solution) -> Cd:
    """Degrees of (east, north) a pixel of (x, y), by a step of a pixel each way."""
    camera = solution.camera
    east, north = east_north(solution.centre_vector)
    middle = np.array([camera.width - 1.0, camera.height - 1.0]) / 2.0
    # Differences over two pixels: the lens' distortion at the centre is in them, which a formula for TAN leaves out.
    steps = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    rays = camera.unproject(middle + steps) @ solution.attitude.matrix
    ahead = rays @ np.cross(east, north)
    plane = np.degrees(np.stack([rays @ east, rays @ north]) / ahead)
    x, y = (plane[:, 1] - plane[:, 0]) / 2.0, (plane[:, 3] - plane[:, 2]) / 2.0
    return (float(x[0]), float(y[0])), (float(x[1]), float(y[1]))
