"""The Predictional Estimate: from where the stars should be to where the camera points.

Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34), section "Predictional Estimate": the
attitude believed so far gives the expected constellation; each expected star is matched to the
recorded one at the least distance; differential changes of direction and rotation then make the
distances small. Matching and changing are repeated here with a reach that follows the distances,
and stars count only when each is the other's nearest, so that a false star has no say.
"""

import numpy as np

from kochab.attitude.least_squares import project_with_jacobian
from kochab.core.arrays import Floats, Ints
from kochab.core.attitude import Attitude, small_rotation
from kochab.core.camera import Camera
from kochab.core.pairing import mutual_nearest_of_few
from kochab.core.values import frozen

FEWEST = 2  # stars: one leaves the roll open
ROUNDS = 6
CLIP_SIGMA = 3.7  # times the median distance: 4.4 sigma of a coordinate, 1 right match in 13,000 lies beyond
FLOOR_PX = 0.02  # no place is believed to be better, however small the residuals are
BELIEF = 10.0  # residuals that the stated errors count for


@frozen(eq=False)
class Estimate:
    """An attitude with covariance; ``seen`` and ``star`` (M,) number what was matched.

    ``residuals_px`` (M, 2) are recorded minus expected places; ``sigma_px`` their RMS a coordinate
    over the degrees of freedom.
    """

    attitude: Attitude
    seen: Ints
    star: Ints
    residuals_px: Floats
    sigma_px: float


def predictional_estimate(
    camera: Camera,
    matrix: Floats,
    xy: Floats,
    vectors: Floats,
    reach_px: float,
    *,
    closest_px: float = 0.5,
    worst_px: float | None = None,
) -> Estimate | None:
    """Match recorded stars to a catalogue's and refine a rotation; None when fewer than two find each other.

    Parameters
    ----------
    camera : Camera
        The camera, whose model is kept.
    matrix : Floats
        First rotation (3, 3), ICRS to camera axes.
    xy : Floats
        Recorded places (N, 2), px.
    vectors : Floats
        The catalogue's stars (S, 3), ICRS unit vectors.
    reach_px : float
        How far off the expected places may be at first.
    closest_px : float
        The smallest reach it comes down to.
    worst_px : float or None
        The largest error a star's place can have, beyond which none counts in the end; None where it is not known.
    """
    last = np.zeros((2, 0), dtype=np.int64)
    for _ in range(ROUNDS):
        i, j, distance2 = mutual_nearest_of_few(xy, expected_px(camera, matrix, vectors), reach_px)
        if len(i) < FEWEST:
            return None
        matrix, _ = differential(camera, matrix, xy[i], vectors[j], np.ones(len(i)))
        middle = float(np.sqrt(np.median(distance2)))
        # from the median: wrong matches, while they are the minority, do not hold the reach open
        closer = max(closest_px, min(reach_px, CLIP_SIGMA * max(middle, FLOOR_PX)))
        if worst_px is not None and middle < worst_px:
            closer = min(closer, worst_px)
        if closer > 0.99 * reach_px and np.array_equal([i, j], last):
            break
        reach_px, last = closer, np.array([i, j])
    return concluded(camera, matrix, xy, vectors, i, j)


def concluded(
    camera: Camera, matrix: Floats, xy: Floats, vectors: Floats, i: Ints, j: Ints, sigma_px: Floats | None = None
) -> Estimate:
    """The final estimate from matches.

    Without ``sigma_px`` the residuals alone tell the errors' level.

    Parameters
    ----------
    camera : Camera
        The camera, whose model is kept.
    matrix : Floats
        First rotation (3, 3), ICRS to camera axes.
    xy : Floats
        Recorded places (N, 2), px.
    vectors : Floats
        The catalogue's stars (S, 3), ICRS unit vectors.
    i, j : Ints
        The matches (M,): numbers of recorded places and of stars.
    sigma_px : Floats or None
        Errors a coordinate (M,); their level comes from the residuals and from what was said, which counts as
        :data:`BELIEF` residuals more.
    """
    weight = np.ones(len(i)) if sigma_px is None else 1.0 / sigma_px
    matrix, inverse = differential(camera, matrix, xy[i], vectors[j], weight)
    left = xy[i] - expected_px(camera, matrix, vectors[j])
    # two coordinates a star, less the three angles of the rotation
    freedom = max(1, 2 * len(i) - 3)
    square = float(np.sum(np.square(left * weight[:, None])))
    level = max(square / freedom, FLOOR_PX**2) if sigma_px is None else (square + BELIEF) / (freedom + BELIEF)
    sigma = float(np.sqrt(np.sum(np.square(left)) / freedom))
    return Estimate(Attitude(matrix, inverse * level), i, j, left, sigma)


def differential(
    camera: Camera, matrix: Floats, xy: Floats, vectors: Floats, weight: Floats, steps: int = 2
) -> tuple[Floats, Floats]:
    """Gauss-Newton steps of the rotation alone; the new matrix and the inverse normal matrix (3, 3).

    Parameters
    ----------
    camera : Camera
        The camera, whose model is kept.
    matrix : Floats
        First rotation (3, 3), ICRS to camera axes.
    xy : Floats
        Recorded places (M, 2), px.
    vectors : Floats
        The same stars' ICRS unit vectors (M, 3).
    weight : Floats
        One over each place's error (M,), 1/px.
    steps : int
        How many steps are taken.
    """
    inverse: Floats = np.eye(3)
    for _ in range(steps):
        seen, jacobian = project_with_jacobian(camera, vectors @ matrix.T)
        left = ((xy - seen) * weight[:, None]).ravel()
        slope = (jacobian[:, :, :3] * weight[:, None, None]).reshape(-1, 3)
        normal = slope.T @ slope
        normal[np.diag_indices(3)] *= 1.0 + 1e-12
        inverse = np.asarray(np.linalg.pinv(normal, hermitian=True), dtype=np.float64)
        step = np.clip(inverse @ (slope.T @ left), -0.2, 0.2)
        matrix = small_rotation(step) @ matrix
    return matrix, np.asarray(inverse)


def expected_px(camera: Camera, matrix: Floats, vectors: Floats) -> Floats:
    """Where stars (S, 3) should be, px (S, 2); far outside the frame for those behind it."""
    places = camera.project(vectors @ matrix.T)
    return np.where(np.isfinite(places), places, -1e9)
