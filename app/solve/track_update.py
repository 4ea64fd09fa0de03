"""What the tracker tells of one frame."""

from dataclasses import dataclass, replace
from datetime import datetime
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.core.attitude import Attitude
from app.core.solution import NoSolution, Solution

Floats = NDArray[np.float64]
Mode = Literal["lost", "tracking"]


@dataclass(frozen=True, slots=True, eq=False)
class TrackUpdate:
    """What one frame told. Everything in it belongs to ``time_utc``, the frame's own moment.

    ``solution`` is what this frame's stars say alone, None when there is none and ``reason`` says
    why. ``mode`` tells how it was found. ``filtered`` is the attitude after all frames so far, of
    the solution's camera, and :attr:`filtered_centre` where that points; its ``sigma_arcsec`` are
    smaller than the solution's. ``rates_deg_s`` are the camera's angular velocities against the
    stars about its own x, y and z (x right, y down, z out), and
    ``rates_sigma_deg_s`` their errors. All three are None when this frame has no answer: nothing
    old is ever told as new. ``expected`` stars were looked for and ``matched`` found.
    """

    time_utc: datetime
    mode: Mode
    solution: Solution | None
    reason: NoSolution | None
    filtered: Attitude | None = None
    rates_deg_s: tuple[float, float, float] | None = None
    rates_sigma_deg_s: tuple[float, float, float] | None = None
    expected: int = 0
    matched: int = 0
    manoeuvre: bool = False

    @property
    def filtered_centre(self) -> Floats | None:
        """ICRS unit vector (3,) of the frame's middle by the filter."""
        if self.filtered is None or self.solution is None:
            return None
        return replace(self.solution, attitude=self.filtered).centre_vector

    @property
    def sigma_arcsec(self) -> tuple[float, float, float] | None:
        """One-sigma errors of ``filtered`` along x, along y, and of roll."""
        return None if self.filtered is None else self.filtered.sigma_arcsec
