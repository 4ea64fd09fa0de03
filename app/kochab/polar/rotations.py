"""Rotation matrices of vectors and back, as the polar algorithms need them."""

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import cross_matrix, small_rotation


def wrapped_rad(angle: float) -> float:
    """An angle in [-pi, pi)."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def about(axis: Floats, angle_rad: float) -> Floats:
    """Rotation matrix (3, 3) about a unit vector (3,), right-handed."""
    return small_rotation(np.asarray(axis) * angle_rad)  # Rodrigues' formula, exact for large angles too


def about_each(axis: Floats, angles_rad: Floats) -> Floats:
    """Rotation matrices (N, 3, 3) about one unit vector (3,) by angles (N,)."""
    k = cross_matrix(axis)
    # 1 - cos as 2 sin^2 of the half: the difference itself cancels at small turns
    sine, rest = np.sin(angles_rad), 2.0 * np.sin(np.asarray(angles_rad) / 2.0) ** 2
    return np.asarray(np.eye(3) + sine[:, None, None] * k + rest[:, None, None] * (k @ k))


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
