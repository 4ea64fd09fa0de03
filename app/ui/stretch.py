"""How stored pixel values become brightness on the screen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.frames.stretch import midtones, stretch_parameters

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Stretch:
    """Black and middle, each in 0..1 of the picture's range.

    ``mid`` is the share of the way from black to white that is shown at half brightness: 0.5 is
    linear, less is brighter.
    """

    black: float = 0.0
    mid: float = 0.5

    def apply(self, x: Floats) -> Floats:
        """Brightness 0..1 of values ``x`` in 0..1 of the picture's range."""
        share = np.clip((x - self.black) / max(1.0 - self.black, 1e-6), 0.0, 1.0)
        return midtones(share, min(max(self.mid, 1e-6), 1.0 - 1e-6))

    def table(self, levels: int, low: float, high: float) -> NDArray[np.uint8]:
        """Look-up table (levels,) for integer values 0..levels-1, where low..high is the range."""
        x = (np.arange(levels, dtype=np.float64) - low) / max(high - low, 1e-9)
        return np.asarray(np.rint(self.apply(x) * 255.0), dtype=np.uint8)


def automatic(stored: NDArray[np.generic]) -> tuple[Stretch, float, float]:
    """The stretch that shows the sky dark grey and faint stars clearly.

    Returns it with the range (low, high), in stored values, that it is a share of.
    """
    chosen = stretch_parameters(stored)
    low = float(min(chosen.black, stored.min()))
    high = max(float(chosen.white), float(stored.max()), low + 1.0)
    black = (chosen.black - low) / (high - low)
    # The middle is a share of black..white; white is moved to the top of the range here.
    span = (chosen.white - chosen.black) / max(high - chosen.black, 1e-9)
    return Stretch(black, min(max(chosen.mid * span, 1e-6), 0.5)), low, high
