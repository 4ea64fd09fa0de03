"""The optimal attitude of all stars together: Wahba's problem."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.attitude.measured import directions, sigma_rad
from app.attitude.wahba import wahba
from app.core.attitude import Attitude
from app.core.camera import Camera
from app.core.options import number

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
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

    sigma_px: float | None = number(
        None, "px", 1e-4, 100.0, "error of a centroid along an axis", "from the residuals"
    )

    def estimate(self, xy_px: Floats, vectors: Floats, camera: Camera) -> Attitude:
        """The attitude from M >= 2 stars at ``xy_px`` (M, 2), ICRS unit ``vectors`` (M, 3)."""
        seen, icrs = directions(xy_px, vectors, camera, 2)
        matrix = wahba(seen, icrs).matrix
        return wahba(seen, icrs, sigma_rad(seen, icrs, matrix, camera, self.sigma_px))
