"""What tests of the rig share."""

from functools import cache

import numpy as np

from kochab.sky import open_catalogue


@cache
def catalogue():
    return open_catalogue()


def turn_arcsec(a, b):
    """The small turn from one attitude matrix to another about the camera's x, y, z, arcsec."""
    m = a @ b.T
    return np.degrees([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]]) * 1800.0
