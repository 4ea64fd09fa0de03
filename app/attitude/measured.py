"""What the estimators share: directions of recorded stars, and how much they scatter."""

import numpy as np
from numpy.typing import NDArray

from app.core.camera import Camera

Floats = NDArray[np.float64]
FLOOR_PX = 0.02
"""No set of centroids is believed to be better than this, whatever the residuals say."""


def directions(
    xy_px: Floats, vectors: Floats, camera: Camera, fewest: int
) -> tuple[Floats, Floats]:
    """Unit vectors (M, 3) of M stars in camera axes and in ICRS.

    Raises ValueError when the lists differ in length, hold what is not finite, or hold fewer than
    ``fewest`` stars.
    """
    xy = np.asarray(xy_px, dtype=np.float64).reshape(-1, 2)
    icrs = np.asarray(vectors, dtype=np.float64).reshape(-1, 3)
    if len(xy) != len(icrs):
        raise ValueError(f"{len(xy)} places do not match {len(icrs)} directions.")
    if len(xy) < fewest:
        raise ValueError(f"This estimate needs {fewest} stars or more.")
    if not (np.isfinite(xy).all() and np.isfinite(icrs).all()):
        raise ValueError("A place or a direction is not a number.")
    return camera.unproject(xy), icrs


def sigma_rad(
    seen: Floats, icrs: Floats, matrix: Floats, camera: Camera, told_px: float | None
) -> float:
    """One-sigma error of a measured direction along one axis, radians.

    It is ``told_px`` when given, else what the residuals of ``seen`` (M, 3) against ``matrix`` (3,
    3) say: M stars are 2 M measurements, of which a rotation takes three.
    """
    if told_px is not None:
        return told_px / camera.focal_px
    residual = seen - icrs @ matrix.T
    freedom = max(2 * len(seen) - 3, 1)
    return max(float(np.sqrt(np.sum(residual**2) / freedom)), FLOOR_PX / camera.focal_px)
