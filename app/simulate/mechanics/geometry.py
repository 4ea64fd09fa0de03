"""From axis angles to where the camera looks: rotations only.

Mount frame: z along the north end of the polar axis, y east, x the meridian at the mount's own
equator. Tube frame: x along the tube, z its up (north when the tube is on the meridian), y its
left. Camera axes: x right, y down, z out along the boresight. Local frame: east, north, up.
"""

from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CAMERA_TO_TUBE = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True)
class Build:
    """How a mount was put together; all zero is perfect.

    ``cone_deg``: the tube leans towards its left off the square with the declination axis.
    ``square_deg``: the declination axis leans off the square with the polar axis.
    ``flexure_arcsec``: how far the tube droops when it lies level; at altitude a, cos(a) of it.
    ``camera_roll_deg``: the camera in its holder, turned clockwise as seen from behind it.
    """

    cone_deg: float = 0.0
    square_deg: float = 0.0
    flexure_arcsec: float = 0.0
    camera_roll_deg: float = 0.0


def about_x(angle: float) -> Floats:
    """Rotation (3, 3) about x by radians, right-handed."""
    c, s = cos(angle), sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_y(angle: float) -> Floats:
    """Rotation (3, 3) about y by radians, right-handed."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def about_z(angle: float) -> Floats:
    """Rotation (3, 3) about z by radians, right-handed."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def mount_to_enu(altitude_deg: float, azimuth_deg: float) -> Floats:
    """Rotation (3, 3) of a mount whose polar axis' north end is at this altitude and azimuth."""
    a = radians(altitude_deg)
    level = np.array([[0.0, 1.0, 0.0], [-sin(a), 0.0, cos(a)], [cos(a), 0.0, sin(a)]])
    return np.asarray(about_z(-radians(azimuth_deg)) @ level)


def axis_direction(hour_deg: float, dec_deg: float) -> Floats:
    """Unit vector (3,) in the mount frame of a perfect tube at these axis angles."""
    h, d = radians(hour_deg), radians(dec_deg)
    return np.array([cos(d) * cos(h), -cos(d) * sin(h), sin(d)])


def camera_to_enu(hour_deg: float, dec_deg: float, axis: Floats, build: Build) -> Floats:
    """Rotation (3, 3) from camera axes to east, north, up.

    ``hour_deg`` and ``dec_deg`` are the axes' true angles; a declination angle beyond 90 is a
    tube that has gone through the pole, as on the other side of the pier. ``axis`` is
    :func:`mount_to_enu`.
    """
    tube = (
        about_z(-radians(hour_deg))
        @ about_x(radians(build.square_deg))
        @ about_y(-radians(dec_deg))
        @ about_z(radians(build.cone_deg))
    )
    turned = CAMERA_TO_TUBE @ about_z(radians(build.camera_roll_deg))
    return _drooped(axis @ tube @ turned, build.flexure_arcsec)


def _drooped(camera: Floats, flexure_arcsec: float) -> Floats:
    """Bend the whole camera towards the ground, about the level line square to its boresight."""
    if not flexure_arcsec:
        return camera
    e, n, _ = camera[:, 2]
    level = float(np.hypot(e, n))
    if level < 1e-9:
        return camera
    angle = radians(flexure_arcsec / 3600.0) * level
    # Right-handed about the direction to the right of the boresight this would raise it.
    k = np.array([n, -e, 0.0]) / level
    cross = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    bend = np.eye(3) - sin(angle) * cross + (1.0 - cos(angle)) * (cross @ cross)
    return np.asarray(bend @ camera)
