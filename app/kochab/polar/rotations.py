"""Rotation matrices of vectors and back, as the polar algorithms need them."""

import numpy as np

from kochab.attitude import small_rotation
from kochab.core.arrays import Floats


def wrapped_rad(angle: float) -> float:
    """An angle in [-pi, pi)."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def cross_matrix(vector: Floats) -> Floats:
    """The matrix (3, 3) that takes ``v`` to ``vector x v``."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_vector(matrix: Floats) -> Floats:
    """Rotation vector (3,), radians, of length at most pi, of a rotation matrix (3, 3)."""
    return np.asarray(rotation_vectors(matrix[None])[0])


def about(axis: Floats, angle_rad: float) -> Floats:
    """Rotation matrix (3, 3) about a unit vector (3,), right-handed."""
    return small_rotation(np.asarray(axis) * angle_rad)  # Rodrigues' formula, exact for large angles too


def about_each(axis: Floats, angles_rad: Floats) -> Floats:
    """Rotation matrices (N, 3, 3) about one unit vector (3,) by angles (N,)."""
    k = cross_matrix(axis)
    # 1 - cos as 2 sin^2 of the half: the difference itself cancels at small turns
    sine, rest = np.sin(angles_rad), 2.0 * np.sin(np.asarray(angles_rad) / 2.0) ** 2
    return np.asarray(np.eye(3) + sine[:, None, None] * k + rest[:, None, None] * (k @ k))


def rotation_vectors(matrices: Floats) -> Floats:
    """Rotation vectors (N, 3), radians, of length at most pi, of matrices (N, 3, 3)."""
    m = matrices
    skew = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], axis=-1)
    twice_sine = np.sqrt(np.einsum("ij,ij->i", skew, skew))
    # trace - 1 is twice the cosine; arctan2 of both keeps arcseconds that arccos loses near zero
    angle = np.arctan2(twice_sine, np.einsum("ijj->i", m) - 1.0)
    if angle.max() >= 3.0:  # near half a turn the skew part vanishes
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_matrix(m).as_rotvec())
    safe = np.where(twice_sine > 1e-12, twice_sine, 1.0)
    # angle / (2 sin) tends to 1/2
    return np.asarray(np.where(twice_sine > 1e-12, angle / safe, 0.5)[:, None] * skew)


def best_rotation(before: Floats, after: Floats) -> Floats:
    """The rotation (3, 3) that takes unit vectors (N, 3) ``before`` nearest to ``after``.

    Least squares by singular values (Kabsch 1976, Acta Cryst. A32, 922).
    """
    u, _, vt = np.linalg.svd(after.T @ before)
    # without it noisy or coplanar vectors may give a reflection
    flip = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ vt)))])
    return np.asarray(u @ flip @ vt)


def tangents(axis: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (3,) at a direction in E, N, U: towards greater altitude, greater azimuth."""
    east, north, up = axis
    level = float(np.hypot(east, north))
    if level < 1e-9:  # straight up: any pair will do
        return np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    clockwise = np.array([north, -east, 0.0]) / level
    return np.array([-up * east / level, -up * north / level, level]), clockwise


def alt_az(direction: Floats) -> tuple[float, float]:
    """Altitude and azimuth (from north through east), radians, of a direction in E, N, U."""
    east, north, up = (float(c) for c in direction)
    return float(np.arctan2(up, np.hypot(east, north))), float(np.arctan2(east, north))


def direction(altitude_rad: float, azimuth_rad: float) -> Floats:
    """Unit vector (3,) in E, N, U."""
    level = np.cos(altitude_rad)
    return np.array([level * np.sin(azimuth_rad), level * np.cos(azimuth_rad), np.sin(altitude_rad)])
