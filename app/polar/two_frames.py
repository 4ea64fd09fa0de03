"""The axis from two attitudes: the axis of the rotation between them."""

import numpy as np
from numpy.typing import NDArray

from app.polar.rotations import rotation_vector

Floats = NDArray[np.float64]


def axis_of_two(first: Floats, second: Floats) -> tuple[Floats, float]:
    """Axis (3,) in E, N, U and turn, radians in [0, pi], between two attitudes (3, 3).

    Both take camera axes to E, N, U. The turn is right-handed about the axis; which end of the
    line points to the pole is not decided here. NaN when nothing turned.
    """
    vector = rotation_vector(second @ first.T)
    turn = float(np.linalg.norm(vector))
    if turn < 1e-12:
        return np.full(3, np.nan), 0.0
    return vector / turn, turn
