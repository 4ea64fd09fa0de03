"""The live error while nobody turns a bolt: a mean over frames, started anew at every movement."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.polar.error import PolarError
from app.polar.live import LiveError
from app.polar.rotations import ARCSEC, tangents

Floats = NDArray[np.float64]

JUMP2 = 16.0
"""Squared Mahalanobis distance from the mean, two dimensions, beyond which a bolt was turned."""
FEWEST, ENOUGH = 3, 16
"""Frames before which nothing is settled, and after which it is in any case."""

SMALL_ARCSEC, CLEAR = 4.0, 25.0
"""A noise so small, or so many times smaller than the error, is settled."""

MOST = 60  # frames; slow drifts must not be averaged away


@dataclass(frozen=True, slots=True, eq=False)
class SteadyError:
    """The mean of ``frames`` live errors since the last movement.

    ``settled`` when it is good enough to act on: its noise is small beside the error itself, or
    small at all, or will not get much smaller.

    ``noise_arcsec`` is its one-sigma error along altitude and azimuth on the sky without what all
    frames share: how small a movement it can show.
    """

    error: PolarError
    frames: int
    settled: bool
    noise_arcsec: tuple[float, float] = (0.0, 0.0)


class Steady:
    """Averages live errors; its covariance keeps what all frames share, the measurement's own."""

    def __init__(self) -> None:
        self._kept: list[LiveError] = []
        self.movements = 0

    def update(self, live: LiveError) -> SteadyError:
        """The mean with one more frame, or that frame alone when the axis moved."""
        if self._kept and self._jumped(live):
            self._kept.clear()
            self.movements += 1
        self._kept = [*self._kept[-(MOST - 1) :], live]
        count = len(self._kept)
        alt, az = np.sqrt(np.diag(live.frame_covariance) / count) / ARCSEC
        noise = (float(alt), float(az))
        mean = self._mean()
        size = float(np.hypot(*noise))
        clear = size < max(SMALL_ARCSEC, mean.total_arcsec / CLEAR) or count >= ENOUGH
        return SteadyError(mean, count, count >= FEWEST and clear, noise)

    def forget(self) -> None:
        """Start anew, as after a measurement."""
        self._kept.clear()

    def _mean(self) -> PolarError:
        last, count = self._kept[-1], len(self._kept)
        axis = np.mean([live.error.axis for live in self._kept], axis=0)
        shared = last.error.covariance - last.frame_covariance
        covariance = shared + last.frame_covariance / count
        return PolarError(
            axis / np.linalg.norm(axis), last.error.pole, covariance, last.error.unseen
        )

    def _jumped(self, live: LiveError) -> bool:
        mean = self._mean()
        gap = np.stack(tangents(mean.axis)) @ (live.error.axis - mean.axis)
        spread = live.frame_covariance * (1.0 + 1.0 / len(self._kept))
        return float(gap @ np.linalg.solve(spread, gap)) > JUMP2
