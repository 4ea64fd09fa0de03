"""Plate constants: a straight-line map from the picture to the sky's tangent plane.

Source: the thesis on attitude from stellar images, section 2.4: equations 2.8 to 2.15 (six plate
constants by least squares), 2.16 to 2.19 (standard coordinates and back) and the iteration for
the image centre of section 2.4.3.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.attitude.measured import directions
from app.core.attitude import Attitude, radec_deg, unit_vectors
from app.core.camera import Camera
from app.core.options import integer, number

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PlateConstants:
    """Six constants from M >= 3 stars that are not on one line.

    ``tolerance_arcsec`` (above 0) ends the iteration when the centre moves less; the paper's
    example is 1. ``most_rounds`` (1 to 1000) bounds it.

    The constants also hold a wrong scale, a shear and a shifted origin, so that the focal length
    need not be right; that freedom costs precision when it is. The origin is the camera's
    principal point, and the camera's distortion is taken out first, which the paper does not do.
    The attitude is the rotation nearest to the constants.
    """

    paper: ClassVar[str] = "Attitude from stellar images, section 2.4"

    tolerance_arcsec: float = number(
        1.0, "arcsec", 1e-6, 3600.0, "the iteration ends when the centre moves less"
    )
    most_rounds: int = integer(50, "rounds", 1, 1000, "at most so many")

    def estimate(self, xy_px: Floats, vectors: Floats, camera: Camera) -> Attitude:
        """The attitude from M stars at ``xy_px`` (M, 2) px, ICRS unit ``vectors`` (M, 3).

        Its covariance comes from the residuals, and is None for three stars, which leave none.

        Raises
        ------
        ValueError
            Fewer than three stars, all on one line, stars in more than half the sky, a centre
            that does not settle, or a picture that is mirrored against the camera.

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
            standard = _standard(icrs, centre)
            constants = np.linalg.lstsq(design, standard - xy, rcond=None)[0]  # (3, 2)
            new = _on_the_sky(constants[2], centre)  # equations 2.20 and 2.21
            if float(np.linalg.norm(new - centre)) < tolerance:
                break
            centre = new
        else:
            raise ValueError("The image centre does not settle.")
        turn = constants[:2].T + np.eye(2)  # (xi, eta) = turn @ (x, y)
        if np.linalg.det(turn) <= 0:
            raise ValueError("The picture is mirrored against the camera.")
        roll = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
        residual = standard - xy - design @ constants
        return Attitude(_matrix(centre, roll, new), _covariance(design, residual, roll, turn))


def _tangents(centre: Floats) -> tuple[Floats, Floats]:
    """Unit vectors east and north (3,) at a direction (3,); at a pole, those of RA 0."""
    ra = np.arctan2(centre[1], centre[0])
    east = np.array([-np.sin(ra), np.cos(ra), 0.0])
    return east, np.cross(centre, east)


def _standard(icrs: Floats, centre: Floats) -> Floats:
    """Standard coordinates (M, 2) xi, eta about a centre: 2.16 and 2.17 as vectors."""
    depth = icrs @ centre
    if depth.min() < 0.01:
        raise ValueError("The stars are not in one half of the sky.")
    return np.stack([icrs @ axis for axis in _tangents(centre)], axis=1) / depth[:, None]


def _on_the_sky(standard: Floats, centre: Floats) -> Floats:
    """The direction (3,) with ``standard`` (2,) coordinates: 2.18 and 2.19 as vectors."""
    east, north = _tangents(centre)
    out = centre + standard[0] * east + standard[1] * north
    return np.asarray(out / np.linalg.norm(out))


def _first_centre(xy: Floats, icrs: Floats) -> Floats:
    """Straight lines of RA and Dec against x and against y, at the origin, averaged (2.4.3).

    RA is counted from that of the stars' mean direction, so that 0 h is no edge. Near a pole the
    lines mean nothing; when they lead away from the stars, their mean direction is taken.
    """
    mean = icrs.mean(axis=0)
    if np.linalg.norm(mean) < 1e-6:
        raise ValueError("The stars are not in one half of the sky.")
    mean = mean / np.linalg.norm(mean)
    zero = radec_deg(mean)[0]
    ra = np.degrees(np.arctan2(icrs[:, 1], icrs[:, 0])) - zero
    angles = np.stack([(ra + 180.0) % 360.0 - 180.0, np.degrees(np.arcsin(icrs[:, 2]))], axis=1)
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
    east, north = _tangents(centre)
    x = np.cos(roll) * east + np.sin(roll) * north
    x -= (x @ boresight) * boresight
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(boresight, x), boresight])


def _covariance(design: Floats, residual: Floats, roll: float, turn: Floats) -> Floats | None:
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
