"""How a mount is built: its geometry, its wedge with two bolts, its configuration.

Mount frame: z along the north end of the polar axis, y east, x the meridian at the mount's own
equator. Tube frame: x along the tube, z its up (north when the tube is on the meridian), y its
left. Camera axes: x right, y down, z out along the boresight. Local frame: east, north, up.
"""

from dataclasses import field
from math import cos, radians, sin

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.frame import Site
from kochab.core.values import frozen
from kochab.simulate.mechanics.axis import GearErrors

X, Y, Z = np.eye(3)
CAMERA_TO_TUBE = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@frozen
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


def about(axis: Floats, angle: float) -> Floats:
    """Rotation (3, 3) about a unit vector (3,) by radians, right-handed: Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + sin(angle) * cross + (1.0 - cos(angle)) * (cross @ cross))


def mount_to_enu(altitude_deg: float, azimuth_deg: float) -> Floats:
    """Rotation (3, 3) of a mount whose polar axis' north end is at this altitude and azimuth."""
    a = radians(altitude_deg)
    level = np.array([[0.0, 1.0, 0.0], [-sin(a), 0.0, cos(a)], [cos(a), 0.0, sin(a)]])
    return np.asarray(about(Z, -radians(azimuth_deg)) @ level)


def camera_to_enu(hour_deg: float, dec_deg: float, axis: Floats, build: Build) -> Floats:
    """Rotation (3, 3) from camera axes to east, north, up.

    A declination angle beyond 90 is a tube that has gone through the pole, as on the other side of the pier.

    Parameters
    ----------
    hour_deg, dec_deg : float
        The axes' true angles, degrees.
    axis : Floats
        Rotation (3, 3) from the mount's axes: :func:`mount_to_enu`.
    build : Build
        How square the mount is, and how the camera sits on it.
    """
    tube = (
        about(Z, -radians(hour_deg))
        @ about(X, radians(build.square_deg))
        @ about(Y, -radians(dec_deg))
        @ about(Z, radians(build.cone_deg))
    )
    turned = CAMERA_TO_TUBE @ about(Z, radians(build.camera_roll_deg))
    return _drooped(axis @ tube @ turned, build.flexure_arcsec)


def _drooped(camera: Floats, flexure_arcsec: float) -> Floats:
    """Bend the whole camera towards the ground, about the level line square to its boresight."""
    if not flexure_arcsec:
        return camera
    e, n, _ = camera[:, 2]
    level = float(np.hypot(e, n))
    # straight up: gravity pulls along the tube and bends it nowhere
    if level < 1e-9:
        return camera
    # level is the cosine of the altitude, the share of gravity that acts across the tube
    angle = radians(flexure_arcsec / 3600.0) * level
    # Right-handed about the direction to the right of the boresight this would raise it.
    return np.asarray(about(np.array([n, -e, 0.0]) / level, -angle) @ camera)


# -- The polar axis on its wedge, and the two bolts that move it -------------------------------


@frozen
class BoltErrors:
    """Backlash of the altitude and azimuth bolts, arcmin, and how far each drags the other axis.

    ``coupling`` is the part of an altitude turn that goes into azimuth, and the reverse.
    """

    backlash_arcmin: tuple[float, float] = (0.0, 0.0)
    coupling: tuple[float, float] = (0.0, 0.0)


class Wedge:
    """Where the polar axis points. Errors are those of POLAR alignment everywhere.

    Altitude error positive when the visible end is too high; azimuth error raw (as the knob turns), positive
    clockwise as seen from above. ``error_arcmin`` (2,) holds both, against the pole this wedge was made for.
    """

    def __init__(
        self, pole_altitude_deg: float, north: bool, error_arcmin: tuple[float, float], errors: BoltErrors | None = None
    ) -> None:
        self._pole_altitude_deg = pole_altitude_deg
        self._north = north
        self._bolts = errors or BoltErrors()
        self.error_arcmin = np.array(error_arcmin, dtype=np.float64)
        self._slack = np.zeros(2)  # how far each bolt has moved within its backlash, about the middle

    def turn(self, altitude_arcmin: float, azimuth_arcmin: float) -> None:
        """Turn both bolts by what they would move without backlash or coupling."""
        half = np.array(self._bolts.backlash_arcmin) / 2.0
        wanted = self._slack + np.array([altitude_arcmin, azimuth_arcmin])
        self._slack = np.clip(wanted, -half, half)
        # only what is left of a turn beyond the backlash moves the axis
        moved = wanted - self._slack
        first, second = self._bolts.coupling
        self.error_arcmin = self.error_arcmin + moved + np.array([second * moved[1], first * moved[0]])

    def to_enu(self) -> Floats:
        """Rotation (3, 3) from the mount frame to east, north, up."""
        altitude = self._pole_altitude_deg + self.error_arcmin[0] / 60.0
        north_end = altitude if self._north else -altitude
        return mount_to_enu(north_end, float(self.error_arcmin[1]) / 60.0)

    def axis_enu(self) -> Floats:
        """Direction (3,) of the visible end of the polar axis."""
        axis = self.to_enu()[:, 2]
        return np.asarray(axis if self._north else -axis)


# -- How a mount is built, how badly it stands and how it moves --------------------------------


@frozen
class MountConfig:
    """How a mount is built, how badly it stands and how it moves. Degrees unless named.

    ``misalignment_arcmin`` is the altitude and raw azimuth error of the axis against the refracted pole.
    ``past_meridian_deg`` is how far a German mount may follow beyond the meridian. ``approach_deg`` is how far a goto
    at least goes towards greater angles at its end, against the backlash of its gears, as many hand controllers do; 0
    for not at all. ``computer_clock_s`` and ``computer_site`` are what its own computer has wrong.
    """

    misalignment_arcmin: tuple[float, float] = (0.0, 0.0)
    build: Build = field(default_factory=Build)
    hour_gear: GearErrors = field(default_factory=GearErrors)
    dec_gear: GearErrors = field(default_factory=GearErrors)
    bolts: BoltErrors = field(default_factory=BoltErrors)
    slew_deg_s: float = 4.0
    acceleration_deg_s2: float = 2.0
    approach_deg: float = 0.0
    guide_rate: float = 0.5  # of sidereal
    german: bool = True
    past_meridian_deg: float = 15.0
    computer_clock_s: float = 0.0
    computer_site: Site | None = None
    aligned: bool = True
