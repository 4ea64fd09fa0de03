"""How pixels move when the attitude or the camera changes a little."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.attitude.wahba import small_rotation
from app.core.camera import Camera

Floats = NDArray[np.float64]

PARAMETERS = ("rx", "ry", "rz", "log_focal", "cx", "cy", "k1", "k2", "p1", "p2")
"""Columns of the Jacobian: a rotation about the camera axes (rad), ln focal length, the rest."""


def project_with_jacobian(camera: Camera, vectors: Floats) -> tuple[Floats, Floats]:
    """Pixels (N, 2) of camera-axes vectors (N, 3), z > 0, and their derivatives (N, 2, 10).

    The derivatives are by :data:`PARAMETERS`, at no change. The model is that of
    ``app.core.camera`` (Brown 1966, Photogramm. Eng. 32, 444).
    """
    u = vectors[:, 0] / vectors[:, 2]
    v = vectors[:, 1] / vectors[:, 2]
    uu, vv, uv = u * u, v * v, u * v
    r2 = uu + vv
    k1, k2, p1, p2 = camera.k1, camera.k2, camera.p1, camera.p2
    radial = 1.0 + r2 * (k1 + k2 * r2)
    slope = 2.0 * (k1 + 2.0 * k2 * r2)
    ud = u * radial + 2.0 * p1 * uv + p2 * (r2 + 2.0 * uu)
    vd = v * radial + p1 * (r2 + 2.0 * vv) + 2.0 * p2 * uv
    cross = slope * uv + 2.0 * (p1 * u + p2 * v)
    by_u = (radial + slope * uu + 2.0 * p1 * v + 6.0 * p2 * u, cross)
    by_v = (cross, radial + slope * vv + 6.0 * p1 * v + 2.0 * p2 * u)

    jacobian = np.empty((len(u), 2, len(PARAMETERS)))
    for axis in (0, 1):  # the picture's x, then y, in units of the focal length
        du, dv, row = by_u[axis], by_v[axis], jacobian[:, axis]
        row[:, 0] = -du * uv - dv * (1.0 + vv)
        row[:, 1] = du * (1.0 + uu) + dv * uv
        row[:, 2] = dv * u - du * v
        row[:, 3] = (ud, vd)[axis]
        row[:, 4:6] = 0.0
        row[:, 6] = (u, v)[axis] * r2
        row[:, 7] = row[:, 6] * r2
        row[:, 8] = (2.0 * uv, r2 + 2.0 * vv)[axis]
        row[:, 9] = (r2 + 2.0 * uu, 2.0 * uv)[axis]
    sign = -1.0 if camera.mirrored else 1.0
    f = camera.focal_px
    jacobian[:, 0] *= sign * f
    jacobian[:, 1] *= f
    jacobian[:, 0, 4] = 1.0
    jacobian[:, 1, 5] = 1.0
    pixels = np.stack([camera.cx + sign * f * ud, camera.cy + f * vd], axis=1)
    return pixels, jacobian


def moved(camera: Camera, matrix: Floats, step: Floats) -> tuple[Camera, Floats]:
    """The camera and the attitude matrix (3, 3) after a ``step`` (10,) of the parameters."""
    change = dict(zip(PARAMETERS[4:], (float(s) for s in step[4:]), strict=True))
    terms = {name: getattr(camera, name) + d for name, d in change.items()}
    focal = camera.focal_px * float(np.exp(np.clip(step[3], -1.0, 1.0)))
    return replace(camera, focal_px=focal, **terms), small_rotation(step[:3]) @ matrix


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
