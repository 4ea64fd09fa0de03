"""The whole sky on an ellipse: Hammer's projection, equal in area, east to the left."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def hammer(vectors: Floats, middle_ra_deg: float) -> Floats:
    """Places (..., 2) of ICRS unit vectors (..., 3); x in -2..2 to the right, y in -1..1 up.

    ``middle_ra_deg`` is the right ascension in the middle of the map. E. Hammer, Petermanns
    Mitteilungen 38, 85 (1892), scaled to the axes 2 and 1.
    """
    v = np.asarray(vectors, dtype=np.float64)
    ra = np.arctan2(v[..., 1], v[..., 0])
    west = -(np.mod(ra - np.radians(middle_ra_deg) + np.pi, 2.0 * np.pi) - np.pi)
    sine = np.clip(v[..., 2] / np.linalg.norm(v, axis=-1), -1.0, 1.0)
    cosine = np.sqrt(1.0 - sine**2)
    shrink = np.sqrt(1.0 + cosine * np.cos(west / 2.0))
    return np.stack([2.0 * cosine * np.sin(west / 2.0) / shrink, sine / shrink], axis=-1)


def pieces(xy: Floats) -> list[Floats]:
    """A line (N, 2) of places, cut where it leaves the map on one side and returns on the other."""
    jumps = np.flatnonzero(np.abs(np.diff(xy[:, 0])) > 1.0) + 1
    return [part for part in np.split(xy, jumps) if len(part) > 1]
