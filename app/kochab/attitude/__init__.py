"""From matched stars to the camera's attitude: estimators by name, and Wahba's problem."""

from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.registry import Registry, number
from kochab.core.values import frozen


class Estimator(Protocol):
    """Anything that turns matched stars into an attitude without a first guess."""

    def estimate(self, xy_px: NDArray[np.float64], vectors: NDArray[np.float64], camera: Camera) -> Attitude:
        """The attitude of a ``camera`` that records stars at ``xy_px`` (M, 2).

        Their ICRS unit vectors are ``vectors`` (M, 3). The most trustworthy star, as a rule the
        brightest, comes first. ValueError when the stars are too few or lie too badly.
        """
        ...


ESTIMATORS: Registry[Estimator] = Registry("attitude", "kochab.estimators", {"quest": "kochab.attitude:Quest"})


# -- The optimal rotation between two sets of directions, with its covariance ------------------


def wahba(camera: Floats, icrs: Floats, sigma_rad: Floats | float = 1.0) -> Attitude:
    """The attitude that minimises the weighted squares of ``camera - matrix @ icrs``.

    Parameters
    ----------
    camera, icrs : (N, 3)
        Unit vectors of the same N >= 2 stars in camera axes and in ICRS, not all parallel.
    sigma_rad : (N,) or float
        One-sigma error of each measured direction, a direction across it, radians.

    Returns
    -------
    Attitude
        With the covariance of a small rotation about the camera axes, rad^2.

    Raises
    ------
    ValueError
        Fewer than two stars, or all in one direction: the roll is free.

    Notes
    -----
    Wahba's problem by singular values (Markley 1988, J. Astronaut. Sci. 36, 245); the covariance
    is the inverse of ``sum (1 - b b^T) / sigma^2`` (Shuster and Oh 1981, J. Guid. Control 4, 70,
    equation 97, with measured directions ``b``).

    """
    b, v = np.asarray(camera, dtype=np.float64), np.asarray(icrs, dtype=np.float64)
    if len(b) < 2:
        raise ValueError("An attitude needs two stars or more.")
    weight = np.broadcast_to(1.0 / np.square(sigma_rad), len(b))
    u, s, vt = np.linalg.svd((b * (weight / weight.sum())[:, None]).T @ v)
    if s[1] < 1e-14:
        raise ValueError("The stars lie in one direction: the roll is free.")
    # A proper rotation has determinant +1; without the sign, noise could give a mirror image.
    proper = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    matrix = (u * np.array([1.0, 1.0, proper])) @ vt
    information = weight.sum() * np.eye(3) - (b * weight[:, None]).T @ b
    return Attitude(np.asarray(matrix), np.linalg.inv(information))


# -- What the estimators share: directions of recorded stars, and how much they scatter --------

FLOOR_PX = 0.02
"""No set of centroids is believed to be better than this, whatever the residuals say."""


def directions(xy_px: Floats, vectors: Floats, camera: Camera, fewest: int) -> tuple[Floats, Floats]:
    """Unit vectors (M, 3) of M stars in camera axes and in ICRS.

    Raises ValueError when the lists differ in length, hold what is not finite, or hold fewer than ``fewest`` stars.

    Parameters
    ----------
    xy_px : Floats
        Where the stars are on the frame, (M, 2) px.
    vectors : Floats
        Their ICRS unit vectors (M, 3), in the same order.
    camera : Camera
        Turns pixels into directions.
    fewest : int
        How many stars the estimate needs.
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


def sigma_rad(seen: Floats, icrs: Floats, matrix: Floats, camera: Camera, given_px: float | None) -> float:
    """One-sigma error of a measured direction along one axis, radians.

    Without ``given_px`` the residuals say it: M stars are 2 M measurements, of which a rotation takes three.

    Parameters
    ----------
    seen : Floats
        Unit vectors (M, 3) of the stars as measured, camera axes.
    icrs : Floats
        The same stars' ICRS unit vectors (M, 3).
    matrix : Floats
        Rotation (3, 3) from ICRS to camera axes.
    camera : Camera
        Its focal length turns pixels into radians.
    given_px : float or None
        Centroid error of a coordinate, px; None to take it from the residuals.
    """
    if given_px is not None:
        return given_px / camera.focal_px
    residual = seen - icrs @ matrix.T
    freedom = max(2 * len(seen) - 3, 1)
    return max(float(np.sqrt(np.sum(residual**2) / freedom)), FLOOR_PX / camera.focal_px)


# -- The optimal attitude of all stars together: Wahba's problem -------------------------------


@frozen
class Quest:
    """Least squares over every star with equal weights.

    ``sigma_px`` is the one-sigma error of a centroid along one axis, px, above 0; None takes it
    from the residuals. It sets the covariance, not the attitude.

    QUEST (Shuster and Oh 1981, J. Guid. Control 4, 70) finds the largest eigenvalue of a 4 x 4
    matrix by iteration. The same minimum is found here by singular values (Markley 1988, see
    ``wahba``), which has no case in which it fails to converge; the covariance is Shuster and
    Oh's.
    """

    paper: ClassVar[str] = "Shuster and Oh 1981; named in Lost in space, 2018, section 10.1.3"

    sigma_px: float | None = number(None, "px", 1e-4, 100.0, "error of a centroid along an axis", "from the residuals")

    def estimate(self, xy_px: Floats, vectors: Floats, camera: Camera) -> Attitude:
        """The attitude from M >= 2 stars at ``xy_px`` (M, 2), ICRS unit ``vectors`` (M, 3)."""
        seen, icrs = directions(xy_px, vectors, camera, 2)
        # Equal weights give the same matrix whatever sigma is, which only then can be told from the residuals.
        matrix = wahba(seen, icrs).matrix
        return wahba(seen, icrs, sigma_rad(seen, icrs, matrix, camera, self.sigma_px))
