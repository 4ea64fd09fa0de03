"""The axis from boresights alone: the normal of the plane their tips lie in."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def axis_of_plane(boresights: Floats) -> Floats:
    """Unit vector (3,) normal to the plane through three or more directions (N, 3).

    The smallest singular vector of the centred directions. It ignores roll, so it needs larger
    turns than attitudes do, but it also works where roll is unknown. Its sign is not decided.
    """
    if len(boresights) < 3:
        raise ValueError("A plane needs three directions or more.")
    centred = boresights - boresights.mean(axis=0)
    return np.asarray(np.linalg.svd(centred)[2][2])
