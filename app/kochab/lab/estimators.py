"""Published attitude estimators: TRIAD, plate constants, and accumulated averages.

Source: "Lost in space" for robotic telescopes (thesis, 2018), section 5.4.1, equations 5.8 to
5.17; the algorithm is Black's (1964, AIAA J. 2, 1350).
"""

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from kochab.attitude import directions, sigma_rad
from kochab.core.arrays import Floats
from kochab.core.attitude import (
    Attitude,
    cross_product,
    east_north,
    radec_deg,
    rotation_vector,
    small_rotation,
    unit,
    unit_vectors,
    wrapped,
)
from kochab.core.camera import Camera
from kochab.core.registry import choice, integer, number
from kochab.core.values import frozen


@frozen
class Triad:
    """Two stars out of the list; all others are ignored.

    ``partner`` chooses the second star, which only sets the roll: "farthest" the one that is farthest from parallel
    with the first, "next" the second of the list. The thesis takes two and does not say which. It warns of two that
    are nearly parallel or opposite without a number. ``sigma_px`` sets the covariance.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 5.4.1"

    partner: str = choice("farthest", ("farthest", "next"), "which star is the second")
    least_angle_deg: float = number(0.01, "deg", 0.0, 90.0, "the two are at least so far apart")
    sigma_px: float | None = number(None, "px", 1e-4, 100.0, "error of a centroid along an axis", "from the residuals")

    def estimate(self, xy_px: Floats, vectors: Floats, camera: Camera) -> Attitude:
        """The attitude from the first and one more of M >= 2 stars at ``xy_px`` (M, 2).

        ValueError with fewer than two stars, or when the two are nearly parallel: the roll is free.
        """
        seen, icrs = directions(xy_px, vectors, camera, 2)
        sines = np.linalg.norm(cross_product(icrs[0], icrs[1:]), axis=1)
        second = 1 + (int(np.argmax(sines)) if self.partner == "farthest" else 0)
        b, v = seen[[0, second]], icrs[[0, second]]
        apart = min(float(np.linalg.norm(cross_product(*pair))) for pair in (b, v))
        if apart < 1e-9:
            raise ValueError("The two stars lie in one direction and leave the roll free.")
        if apart < np.sin(np.radians(self.least_angle_deg)):
            raise ValueError(
                f"The second star is less than {self.least_angle_deg:g} degrees from parallel with"
                " the first, too near for a roll: allow a smaller least angle."
            )
        matrix = _axes(*b).T @ _axes(*v)  # equation 5.17, with the axes as rows
        sigma = sigma_rad(seen, icrs, matrix, camera, self.sigma_px)
        # for directions with a sigma of 1 each (Shuster and Oh 1981, section IV)
        cosine, sine2, both = float(b[0] @ b[1]), float(np.sum(cross_product(*b) ** 2)), np.outer(*b)
        covariance = np.eye(3) + cosine / sine2 * (both + both.T)
        return Attitude(matrix, sigma**2 * covariance)


def _axes(first: Floats, second: Floats) -> Floats:
    """Rows r1, r2, r3 (3, 3) of equations 5.8 to 5.16."""
    across = unit(cross_product(first, second))
    return np.stack([first, across, cross_product(first, across)])


# -- Plate constants: a linear map from the frame to the sky's tangent plane --------------------
# Source: the thesis on attitude from stellar images, section 2.4: equations 2.8 to 2.15 (six plate constants by least
# squares), 2.16 to 2.19 (standard coordinates and back) and the iteration for the image centre of section 2.4.3.


@frozen
class PlateConstants:
    """Six constants from M >= 3 stars that are not on one line.

    The constants also hold a wrong scale, a shear and a shifted origin, so that the focal length need not be right;
    that freedom costs precision when it is. The origin is the camera's principal point, and the camera's distortion
    is taken out first, which the paper does not do. The attitude is the rotation nearest to the constants.
    """

    paper: ClassVar[str] = "Attitude from stellar images, section 2.4"

    tolerance_arcsec: float = number(1.0, "arcsec", 1e-6, 3600.0, "the iteration ends when the centre moves less")
    most_rounds: int = integer(50, "rounds", 1, 1000, "at most so many")

    def estimate(self, xy_px: Floats, vectors: Floats, camera: Camera) -> Attitude:
        """The attitude from M stars at ``xy_px`` (M, 2) px, ICRS unit ``vectors`` (M, 3).

        Its covariance comes from the residuals, and is None for three stars, which leave none.
        ValueError for fewer than three stars, all on one line, stars in more than half the sky, a
        centre that does not settle, or a picture that is mirrored against the camera.
        """
        seen, icrs = directions(xy_px, vectors, camera, 3)
        xy = seen[:, :2] / seen[:, 2:]
        design = np.column_stack([xy, np.ones(len(xy))])
        middle = xy.mean(axis=0)
        spread = np.linalg.svd(xy - middle, compute_uv=False)
        if spread[1] < 1e-6 * max(spread[0], 1e-12):
            raise ValueError("The stars lie on one line: it has no plate constants.")
        centre, tolerance = _first_centre(xy, icrs), np.radians(self.tolerance_arcsec / 3600.0)
        for _ in range(self.most_rounds):
            standard = standard_coordinates(icrs, centre)
            constants = np.linalg.lstsq(design, standard - xy, rcond=None)[0]  # (3, 2)
            east, north = east_north(centre)
            new = unit(centre + constants[2, 0] * east + constants[2, 1] * north)  # equations 2.18 to 2.21
            if float(np.linalg.norm(new - centre)) < tolerance:
                break
            centre = new
        else:
            raise ValueError("The image centre does not settle.")
        turn = constants[:2].T + np.eye(2)  # (xi, eta) = turn @ (x, y)
        if np.linalg.det(turn) <= 0:
            raise ValueError("The image is mirrored compared with the camera.")
        roll = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
        residual = standard - xy - design @ constants
        return Attitude(_matrix(centre, roll, new), _plate_covariance(design, residual, roll, turn))


def standard_coordinates(icrs: Floats, centre: Floats) -> Floats:
    """Standard coordinates (M, 2) xi, eta about a centre: 2.16 and 2.17 as vectors."""
    depth = icrs @ centre
    if depth.min() < 0.01:
        raise ValueError("The stars are not in one half of the sky.")
    return np.asarray(icrs @ east_north(centre).T) / depth[:, None]


def _first_centre(xy: Floats, icrs: Floats) -> Floats:
    """Straight lines of RA and Dec against x and against y, at the origin, averaged (2.4.3).

    RA is counted from that of the stars' mean direction, so that 0 h is no edge. Near a pole the
    lines mean nothing; when they lead away from the stars, their mean direction is taken.
    """
    mean = icrs.mean(axis=0)
    if np.linalg.norm(mean) < 1e-6:
        raise ValueError("The stars are not in one half of the sky.")
    mean = unit(mean)
    zero = radec_deg(mean)[0]
    ra = np.degrees(np.arctan2(icrs[:, 1], icrs[:, 0])) - zero
    angles = np.stack([wrapped(ra), np.degrees(np.arcsin(icrs[:, 2]))], axis=1)
    offset = xy - xy.mean(axis=0)
    power = np.sum(offset**2, axis=0)
    slopes = offset.T @ angles / np.where(power > 0, power, np.inf)[:, None]  # of x, of y
    ra0, dec0 = angles.mean(axis=0) - 0.5 * (xy.mean(axis=0) @ slopes)
    first = unit_vectors(float(ra0 + zero), float(np.clip(dec0, -90.0, 90.0)))
    return first if (icrs @ first).min() > 0.5 * (icrs @ mean).min() else mean


def _matrix(centre: Floats, roll: float, boresight: Floats) -> Floats:
    """Attitude matrix (3, 3): the x axis is ``roll`` rad from east to north at ``centre`` (3,).

    From there it is carried the last little way to the ``boresight`` (3,).
    """
    east, north = east_north(centre)
    x = np.cos(roll) * east + np.sin(roll) * north
    x = unit(x - (x @ boresight) * boresight)
    return np.stack([x, cross_product(boresight, x), boresight])


def _plate_covariance(design: Floats, residual: Floats, roll: float, turn: Floats) -> Floats | None:
    """Covariance (3, 3), rad^2, of a rotation about the camera axes, from the residuals (M, 2)."""
    freedom = 2 * len(design) - 6
    if freedom <= 0:
        return None
    one = np.linalg.inv(design.T @ design) * float(np.sum(residual**2)) / freedom
    c, s = np.cos(roll), np.sin(roll)
    twice = float(np.hypot(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))
    of_xi = np.array([[0, 0, s], [0, 0, c], [-s / twice, -c / twice, 0]])  # by a, b, c
    of_eta = np.array([[0, 0, -c], [0, 0, s], [c / twice, -s / twice, 0]])  # by d, e, f
    return np.asarray(of_xi @ one @ of_xi.T + of_eta @ one @ of_eta.T)


# -- Accumulated averages: many attitudes of one camera make one better one --------------------
# Liebe (1992, IEEE Aerosp. Electron. Syst. Mag. 7(6), 34, section "Predictional Estimate") averages
# the estimates of successive frames, which takes 15 arcsec to under 2. The errors of N independent
# frames leave ``sigma / sqrt(N)`` while the camera stands still among the stars.


def average(attitudes: Iterable[Attitude]) -> Attitude:
    """The weighted mean of attitudes with covariances, up to a few degrees apart.

    Its covariance is that of the mean: of N equal ones, an N-th. ValueError when there are none, or
    one of them has no covariance.
    """
    first: Floats | None = None
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for attitude in attitudes:
        if attitude.covariance is None:
            raise ValueError("An average needs the covariance of every attitude.")
        first = attitude.matrix if first is None else first
        # Weighted by the inverse of its covariance; rotation vectors add up where attitudes are a few degrees apart.
        weight = np.linalg.inv(attitude.covariance)
        normal += weight
        right += weight @ rotation_vector(attitude.matrix @ first.T)
    if first is None:
        raise ValueError("There is nothing to average.")
    covariance = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    return Attitude(small_rotation(covariance @ right) @ first, covariance)
