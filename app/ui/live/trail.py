"""Where the camera has pointed of late; it stays small however long the night is."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
MOST = 2000
STEP_RAD = np.radians(0.02)


class Trail:
    """Directions in order; one that adds nothing to the line before it is left out."""

    def __init__(self) -> None:
        self._points: list[Floats] = []
        self.here: Floats | None = None
        self.old = False

    def add(self, centre: Floats, old: bool = False) -> None:
        """The camera points to the ICRS unit vector (3,), or did when that is ``old``."""
        self.here, self.old = centre, old
        if self._points and float(np.linalg.norm(self._points[-1] - centre)) < STEP_RAD:
            return
        self._points.append(centre)
        if len(self._points) > MOST:  # the older half loses every other point
            half = MOST // 2
            self._points = self._points[:half:2] + self._points[half:]

    def clear(self) -> None:
        """Begin anew."""
        self._points, self.here, self.old = [], None, False

    @property
    def points(self) -> Floats:
        """All directions (N, 3)."""
        return np.array(self._points).reshape(-1, 3)
