"""The optimal rotation between two sets of directions, with its covariance."""

import math

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude

Floats = NDArray[np.float64]


def wahba(camera: Floats, icrs: Floats, sigma_rad: Floats | float = 1.0) -> Attitude:
    """The attitude that minimises the weighted squares of ``camera - matrix @ icrs``.

    Parameters
    ----------
    camera, icrs : (N, 3)
        Unit vectors of the same N >= 2 stars in camera axes and in ICRS, not all parallel.
    sigma_rad : (N,) or float
        One-sigma error of each measured direction, a direction across it, radians.

    Returns
    -------
    Attitude
        With the covariance of a small rotation about the camera axes, rad^2.

    Raises
    ------
    ValueError
        Fewer than two stars, or all in one direction: the roll is free.

    Notes
    -----
    Wahba's problem by singular values (Markley 1988, J. Astronaut. Sci. 36, 245); the covariance
    is the inverse of ``sum (1 - b b^T) / sigma^2`` (Shuster and Oh 1981, J. Guid. Control 4, 70,
    equation 97, with measured directions ``b``).

    """
    b, v = np.asarray(camera, dtype=np.float64), np.asarray(icrs, dtype=np.float64)
    if len(b) < 2:
        raise ValueError("An attitude needs two stars or more.")
    weight = np.broadcast_to(1.0 / np.square(sigma_rad), len(b))
    u, s, vt = np.linalg.svd((b * (weight / weight.sum())[:, None]).T @ v)
    if s[1] < 1e-14:
        raise ValueError("The stars lie in one direction: the roll is free.")
    proper = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    matrix = (u * np.array([1.0, 1.0, proper])) @ vt
    information = weight.sum() * np.eye(3) - (b * weight[:, None]).T @ b
    return Attitude(np.asarray(matrix), np.linalg.inv(information))


def small_rotation(angles_rad: Floats) -> Floats:
    """The matrix (3, 3) that turns by ``angles_rad`` (3,): ``v + angles x v`` when small."""
    x, y, z = np.asarray(angles_rad, dtype=np.float64).tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    a, b = 1.0, 0.5
    if angle > 1e-6:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    return np.array([
        [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
        [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
        [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
    ])  # fmt: skip
