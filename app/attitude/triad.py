"""TRIAD: the attitude from two stars, the first of which is believed without reserve.

Source: "Lost in space" for robotic telescopes (thesis, 2018), section 5.4.1, equations 5.8 to
5.17; the algorithm is Black's (1964, AIAA J. 2, 1350).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.attitude.measured import directions, sigma_rad
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.options import choice, number

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Triad:
    """Two stars out of the list; whatever the other stars say is not heard.

    ``partner`` chooses the second star, on which only the roll leans: "farthest" the one that is
    farthest from parallel with the first, "next" the second of the list. The thesis takes two
    and does not say which. ``least_angle_deg`` (0 to 90) is how far from parallel or opposite the
    two must be; the thesis warns of the case without a number. ``sigma_px`` is the one-sigma error
    of a centroid along one axis, px, above 0, which sets the covariance; None takes it from the
    residuals of all stars.
    """

    paper: ClassVar[str] = "Lost in space for robotic telescopes, 2018, section 5.4.1"

    partner: str = choice("farthest", ("farthest", "next"), "which star is the second")
    least_angle_deg: float = number(0.01, "deg", 0.0, 90.0, "the two are at least so far apart")
    sigma_px: float | None = number(
        None, "px", 1e-4, 100.0, "error of a centroid along an axis", "from the residuals"
    )

    def estimate(self, xy_px: Floats, vectors: Floats, camera: Camera) -> Attitude:
        """The attitude from the first and one more of M >= 2 stars at ``xy_px`` (M, 2).

        Raises
        ------
        ValueError
            Fewer than two stars, or the two are nearly parallel: the roll is free.

        """
        seen, icrs = directions(xy_px, vectors, camera, 2)
        sines = np.linalg.norm(np.cross(icrs[0], icrs[1:]), axis=1)
        second = 1 + (int(np.argmax(sines)) if self.partner == "farthest" else 0)
        b, v = seen[[0, second]], icrs[[0, second]]
        apart = min(float(np.linalg.norm(np.cross(*pair))) for pair in (b, v))
        if apart < 1e-9:
            raise ValueError("The two stars lie in one direction: the roll is free.")
        if apart < np.sin(np.radians(self.least_angle_deg)):
            raise ValueError(
                f"The second star is less than {self.least_angle_deg:g} degrees from parallel with"
                " the first, and the roll leans on it: allow a smaller least angle."
            )
        matrix = _axes(*b).T @ _axes(*v)  # equation 5.17, with the axes as rows
        sigma = sigma_rad(seen, icrs, matrix, camera, self.sigma_px)
        return Attitude(matrix, sigma**2 * _covariance(*b))


def _axes(first: Floats, second: Floats) -> Floats:
    """Rows r1, r2, r3 (3, 3) of equations 5.8 to 5.16."""
    across = np.cross(first, second)
    across /= np.linalg.norm(across)
    return np.stack([first, across, np.cross(first, across)])


def _covariance(first: Floats, second: Floats) -> Floats:
    """Covariance (3, 3) for directions with a sigma of 1 each (Shuster and Oh 1981, section IV)."""
    cosine, sine2 = float(first @ second), float(np.sum(np.cross(first, second) ** 2))
    both = np.outer(first, second)
    return np.asarray(np.eye(3) + cosine / sine2 * (both + both.T))
