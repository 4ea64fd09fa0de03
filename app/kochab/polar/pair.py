"""Whether two frames look like a turn of an equatorial mount's RA axis: then they show how it is aligned."""

import numpy as np

from kochab.core.attitude import Attitude

LEAST_TURN_DEG, MOST_OFF_DEG = 5.0, 10.0
"""A smaller turn is a dither or a field's drift; an axis farther from the pole is no mount that somebody aligns."""


def turned_about_a_pole(one: Attitude, other: Attitude) -> bool:
    """Whether the rotation between two attitudes, of frames of one camera, is about a celestial pole.

    Of two unrelated frames 1.5 % look so: two caps of :data:`MOST_OFF_DEG` cover that share of the sphere.
    """
    turn = other.matrix.T @ one.matrix  # of the sky against the camera, in ICRS
    angle = np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0))
    if not np.radians(LEAST_TURN_DEG) <= angle <= np.radians(180.0 - LEAST_TURN_DEG):
        return False  # near half a turn, as after a meridian flip, the antisymmetric part has no direction
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return bool(abs(axis[2]) >= np.cos(np.radians(MOST_OFF_DEG)) * np.linalg.norm(axis))
