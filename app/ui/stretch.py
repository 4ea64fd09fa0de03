"""How pixel values become brightness on the screen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

TARGET = 0.22  # where the sky background goes on the screen
CLIP_SIGMA = 2.6  # the black point, below the median


@dataclass(frozen=True, slots=True)
class Stretch:
    """Black, middle and white, each in 0..1 of the picture's range.

    ``mid`` is the value between black (0) and white (1) that is shown at half brightness: 0.5 is
    linear, less is brighter.
    """

    black: float = 0.0
    mid: float = 0.5
    white: float = 1.0

    def apply(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Brightness 0..1 of values ``x`` in 0..1 of the picture's range."""
        span = max(self.white - self.black, 1e-6)
        return midtones(np.clip((x - self.black) / span, 0.0, 1.0), self.mid)

    def table(self, levels: int, low: float, high: float) -> NDArray[np.uint8]:
        """Look-up table (levels,) for integer values 0..levels-1, where low..high is the range."""
        x = (np.arange(levels, dtype=np.float64) - low) / max(high - low, 1e-9)
        return np.asarray(np.rint(self.apply(x) * 255.0), dtype=np.uint8)


def midtones(x: NDArray[np.float64], m: float) -> NDArray[np.float64]:
    """The rational curve through (0, 0), (m, 1/2) and (1, 1)."""
    m = min(max(m, 1e-5), 1.0 - 1e-5)
    return np.asarray((m - 1.0) * x / ((2.0 * m - 1.0) * x - m))


def automatic(sample: NDArray[np.float64]) -> Stretch:
    """The stretch that shows the sky dark grey and faint stars clearly.

    ``sample`` holds values in 0..1 of the picture's range. The black point goes
    ``CLIP_SIGMA`` robust deviations below the median; the middle is chosen so that the median
    lands on ``TARGET``.
    """
    if not len(sample):
        return Stretch()
    median = float(np.median(sample))
    sigma = 1.4826 * float(np.median(np.abs(sample - median)))
    black = max(0.0, median - CLIP_SIGMA * max(sigma, 1e-4))
    sky = (median - black) / max(1.0 - black, 1e-6)
    if sky >= 0.5:  # a daylight picture: leave it alone
        return Stretch()
    return Stretch(black, _middle_for(sky), 1.0)


def _middle_for(sky: float) -> float:
    """The ``m`` for which ``midtones(sky, m)`` is ``TARGET``."""
    sky = max(sky, 1e-5)
    return float(sky * (1.0 - TARGET) / (sky * (1.0 - 2.0 * TARGET) + TARGET))
