"""The attitude that puts two stars where they are seen, in plain numbers: ten times as quick."""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vector = tuple[float, float, float] | list[float]


def two_stars(
    p: list[float], q: list[float], focal_px: float, mirrored: bool, star_p: Vector, star_q: Vector
) -> Floats:
    """Rotation (3, 3), ICRS to camera, for two detections and the stars that they are.

    ``p`` and ``q`` are px from the frame's middle, the stars ICRS unit vectors. What the two
    separations differ by is shared evenly: the middles agree, and the planes.
    """
    sign = -1.0 if mirrored else 1.0
    seen = _axes(_unit((sign * p[0], p[1], focal_px)), _unit((sign * q[0], q[1], focal_px)))
    sky = _axes(star_p, star_q)
    return np.array([
        [sum(seen[k][i] * sky[k][j] for k in (0, 1, 2)) for j in (0, 1, 2)] for i in (0, 1, 2)
    ])  # fmt: skip


def _axes(a: Vector, b: Vector) -> tuple[Vector, Vector, Vector]:
    """Right-handed axes from the middle of two unit vectors and the plane they lie in."""
    middle = _unit((a[0] + b[0], a[1] + b[1], a[2] + b[2]))
    normal = _unit(_cross(a, b))
    return middle, normal, _cross(middle, normal)


def _cross(a: Vector, b: Vector) -> tuple[float, float, float]:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _unit(v: tuple[float, float, float]) -> tuple[float, float, float]:
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) or 1.0
    return v[0] / length, v[1] / length, v[2] / length
