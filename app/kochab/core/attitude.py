"""Where the camera points: a rotation from ICRS to camera axes, in every form people use."""

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.values import frozen

ARCSEC = math.pi / 648_000.0
"""One arcsecond, radians: ``x * ARCSEC`` is in radians, ``x / ARCSEC`` in arcseconds."""

Degrees = tuple[float, float]
"""Two coordinates of a place, degrees: right ascension or an axis, and declination."""

Angle = TypeVar("Angle", float, Floats)


@frozen(eq=False)
class Attitude:
    """``matrix`` (3, 3) takes ICRS unit vectors to camera axes (x right, y down, z boresight).

    ``covariance`` (3, 3), rad^2, is of a small rotation about the camera axes x, y, z.
    """

    matrix: Floats
    covariance: Floats | None = None

    @property
    def boresight(self) -> Floats:
        """ICRS unit vector (3,) of the camera's z axis."""
        return np.asarray(self.matrix[2])

    @property
    def ra_dec_deg(self) -> tuple[float, float]:
        """Boresight in ICRS degrees."""
        return radec_deg(self.matrix[2])

    @property
    def roll_deg(self) -> float:
        """Position angle of the camera's up (-y), degrees east of north, in (-180, 180]."""
        return roll_at(self.matrix, self.matrix[2])

    @property
    def sigma_arcsec(self) -> tuple[float, float, float]:
        """One-sigma errors along x, along y, and of roll.

        Turning about the y axis moves the boresight along x, and the reverse.
        """
        if self.covariance is None:
            return (float("nan"),) * 3
        s = np.degrees(np.sqrt(np.diag(self.covariance))) * 3600.0
        return float(s[1]), float(s[0]), float(s[2])

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """(w, x, y, z), scalar first and not negative, of the same rotation as ``matrix``.

        ``v_camera = matrix @ v_icrs = q v_icrs q*`` with Hamilton's product, so it is scipy's
        ``Rotation.from_matrix(matrix)`` with the scalar moved to the front.
        """
        (a, b, c), (d, e, f), (g, h, i) = self.matrix.tolist()
        products = np.array(  # 4 q q^T
            [
                [1.0 + a + e + i, h - f, c - g, d - b],
                [h - f, 1.0 + a - e - i, b + d, c + g],
                [c - g, b + d, 1.0 - a + e - i, f + h],
                [d - b, c + g, f + h, 1.0 - a - e + i],
            ]
        )
        # Of its rows, all parallel to q, the longest loses no digits (Shepperd 1978, J. Guid.
        # Control 1, 223). scipy's Rotation does the same, but takes 0.2 s to import.
        row = products[products.diagonal().argmax()]
        w, x, y, z = (math.copysign(1.0, row[0]) * row / np.linalg.norm(row)).tolist()
        return abs(w), x, y, z

    @property
    def euler_deg(self) -> tuple[float, float, float]:
        """(RA, Dec, roll), degrees: turns about z by RA, then y by -Dec, then x by -roll.

        They take the ICRS axes to (boresight, camera's left, camera's up).
        """
        return (*self.ra_dec_deg, self.roll_deg)


def wrapped(angle_deg: Angle) -> Angle:
    """Angles in [-180, 180)."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def unit_vectors(ra_deg: Floats | float, dec_deg: Floats | float) -> Floats:
    """Unit vectors (..., 3) of ICRS degrees."""
    ra, dec = np.radians(ra_deg), np.radians(dec_deg)
    return np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)


def unit(vectors: Floats) -> Floats:
    """The same vectors (..., 3) with length one."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def cross_product(a: Floats | Sequence[float], b: Floats | Sequence[float]) -> Floats:
    """The vectors (..., 3) at right angles to ``a`` and ``b`` (..., 3); ``np.cross`` takes three times as long."""
    a, b = np.asarray(a), np.asarray(b)
    made = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    (ax, ay, az), (bx, by, bz) = ((of[..., 0], of[..., 1], of[..., 2]) for of in (a, b))
    made[..., 0] = ay * bz - az * by
    made[..., 1] = az * bx - ax * bz
    made[..., 2] = ax * by - ay * bx
    return made


def cross_matrix(vector: Floats | Sequence[float]) -> Floats:
    """The matrix (3, 3) that takes ``v`` to ``vector x v``."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def east_north(direction: Floats) -> Floats:
    """Unit vectors (2, 3) to the east and to the north of a direction (3,); at a pole, those of RA 0."""
    ra = np.arctan2(direction[1], direction[0])
    # Not cross(pole, direction), whose length is zero at the pole.
    east = np.array([-np.sin(ra), np.cos(ra), 0.0])
    return np.stack([east, cross_product(direction, east)])


def radec_deg(vector: Floats | Sequence[float]) -> tuple[float, float]:
    """RA in [0, 360) and Dec, degrees, of one vector (3,); three numbers are the quickest."""
    x, y, z = vector.tolist() if isinstance(vector, np.ndarray) else vector
    ra = math.degrees(math.atan2(y, x)) % 360.0
    dec = math.degrees(math.atan2(z, math.hypot(x, y)))
    return (ra if ra < 360.0 else 0.0), dec  # -1e-20 % 360 rounds up to 360


def angle_between(a: Floats, b: Floats) -> float:
    """Angle between two vectors (3,), radians, exact for small ones too."""
    # The arc cosine of a @ b is zero or noise below about 1e-8 rad (2 mas). Numpy's cross takes ten times as long.
    ax, ay, az = np.asarray(a).tolist()
    bx, by, bz = np.asarray(b).tolist()
    across = math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    return math.atan2(across, ax * bx + ay * by + az * bz)


def separation_deg(a: Floats, b: Floats) -> float:
    """Angle between two vectors (3,), degrees."""
    return float(np.degrees(angle_between(a, b)))


def apart_deg(a_deg: tuple[float, float], b_deg: tuple[float, float]) -> float:
    """Angle between two places given as (RA, Dec), degrees."""
    return separation_deg(unit_vectors(*a_deg), unit_vectors(*b_deg))


def small_rotation(angles_rad: Floats) -> Floats:
    """The matrix (3, 3) that turns by ``angles_rad`` (3,): ``v + angles x v`` when small."""
    x, y, z = np.asarray(angles_rad, dtype=np.float64).tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    a, b = 1.0, 0.5
    if angle > 1e-6:  # below, the series is exact to 1e-13 and 0/0 is avoided
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    return np.array(
        [
            [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
        ]
    )


def small_rotations(angles_rad: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) for rotation vectors ``angles_rad`` (..., 3)."""
    return np.stack([small_rotation(each) for each in angles_rad.reshape(-1, 3)]).reshape(*angles_rad.shape, 3)


def rotation_vector(matrix: Floats) -> Floats:
    """Rotation vector (3,), radians, of length at most pi, of a rotation matrix (3, 3)."""
    return np.asarray(rotation_vectors(matrix[None])[0])


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


def roll_at(matrix: Floats, direction: Floats) -> float:
    """Position angle (deg east of north) of the camera's up, seen at an ICRS direction (3,)."""
    east, north = east_north(direction)
    up = -matrix[1]
    roll = float(np.degrees(np.arctan2(up @ east, up @ north)))
    return roll if roll > -180.0 else 180.0  # arctan2 gives -180 for a negative zero


def attitude_from(ra_deg: float, dec_deg: float, roll_deg: float) -> Attitude:
    """The attitude whose boresight and roll are given, ICRS degrees."""
    z, roll = unit_vectors(ra_deg, dec_deg), np.radians(roll_deg)
    east, north = east_north(z)
    y = -(np.cos(roll) * north + np.sin(roll) * east)
    return Attitude(np.stack([cross_product(y, z), y, z]))
