"""How pixels move when the attitude or the camera changes a little."""

import math

import numpy as np
from numpy.typing import NDArray

from app.attitude.wahba import small_rotation
from app.core.camera import Camera

Floats = NDArray[np.float64]

PARAMETERS = ("rx", "ry", "rz", "log_focal", "cx", "cy", "k1", "k2", "p1", "p2")
"""Columns of the Jacobian: a rotation about the camera axes (rad), ln focal length, the rest."""


def project_with_jacobian(camera: Camera, vectors: Floats) -> tuple[Floats, Floats]:
    """Pixels (N, 2) of camera-axes vectors (N, 3), z > 0, and their derivatives (N, 2, 10).

    The derivatives are by :data:`PARAMETERS`, at no change; in memory a parameter's lie together.
    The model is that of ``app.core.camera`` (Brown 1966, Photogramm. Eng. 32, 444).
    """
    flat = vectors[:, :2].T / vectors[:, 2]
    u, v = flat
    square = flat * flat
    uu, vv = square
    uv, r2 = u * v, uu + vv
    jacobian = np.empty((len(PARAMETERS), 2, len(u)))
    turn = jacobian[:3]
    turn[0, 0], turn[0, 1] = -uv, -1.0 - vv
    turn[1, 0], turn[1, 1] = 1.0 + uu, uv
    turn[2, 0], turn[2, 1] = -v, u
    bent = flat
    if camera.distorted:
        k1, k2, p1, p2 = camera.k1, camera.k2, camera.p1, camera.p2
        radial, slope = 1.0 + r2 * (k1 + k2 * r2), 2.0 * (k1 + 2.0 * k2 * r2)
        bent = np.stack([
            u * radial + 2.0 * p1 * uv + p2 * (r2 + 2.0 * uu),
            v * radial + p1 * (r2 + 2.0 * vv) + 2.0 * p2 * uv,
        ])  # fmt: skip
        cross = slope * uv + 2.0 * (p1 * u + p2 * v)
        by_u = radial + slope * uu + 2.0 * p1 * v + 6.0 * p2 * u
        by_v = radial + slope * vv + 6.0 * p1 * v + 2.0 * p2 * u
        across, down = by_u * turn[:, 0] + cross * turn[:, 1], by_v * turn[:, 1]
        turn[:, 1] = down + cross * turn[:, 0]
        turn[:, 0] = across
    jacobian[3], jacobian[4:6] = bent, 0.0
    np.multiply(flat, r2, out=jacobian[6])
    np.multiply(jacobian[6], r2, out=jacobian[7])
    jacobian[8, 0] = jacobian[9, 1] = 2.0 * uv
    jacobian[8, 1], jacobian[9, 0] = r2 + 2.0 * square[::-1]
    f = camera.focal_px
    shape = np.array([[-f if camera.mirrored else f], [f]])
    jacobian *= shape
    jacobian[4, 0] = jacobian[5, 1] = 1.0
    pixels = shape * bent + np.array([[camera.cx], [camera.cy]])
    return pixels.T, jacobian.T


def moved(camera: Camera, matrix: Floats, step: Floats) -> tuple[Camera, Floats]:
    """The camera and the attitude matrix (3, 3) after a ``step`` (10,) of the parameters."""
    x, y, z, focal, cx, cy, k1, k2, p1, p2 = step.tolist()
    c = camera
    after = Camera(
        c.width, c.height, c.focal_px * math.exp(min(max(focal, -1.0), 1.0)), c.cx + cx, c.cy + cy,
        c.k1 + k1, c.k2 + k2, c.p1 + p1, c.p2 + p2, c.mirrored,
    )  # fmt: skip
    return after, small_rotation(np.array([x, y, z])) @ matrix


def sane(camera: Camera) -> bool:
    """Whether the distortion keeps the frame in one piece.

    Along each ray from the principal point to the frame's border the recorded radius must grow,
    and no border point may be moved by more than two fifths of its radius.
    """
    if not camera.distorted:
        return True
    w, h = camera.width - 1.0, camera.height - 1.0
    border = np.array(
        [[0, 0], [w / 2, 0], [w, 0], [w, h / 2], [w, h], [w / 2, h], [0, h], [0, h / 2]]
    )
    ray = (border - [camera.cx, camera.cy]) / camera.focal_px
    ray = ray * np.linspace(0.05, 1.0, 12)[:, None, None]
    u, v = ray[..., 0], ray[..., 1]
    r2 = u * u + v * v
    shift = r2 * (camera.k1 + camera.k2 * r2)
    tangential = 3.0 * (abs(camera.p1) + abs(camera.p2)) * np.sqrt(r2)
    grows = 1.0 + r2 * (3.0 * camera.k1 + 5.0 * camera.k2 * r2) > 0.2
    return bool(np.all(grows) and np.all(np.abs(shift) + tangential < 0.4))
