"""Red, green and blue of a live frame, no finer than the screen shows them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.frame import Frame
from app.core.progress import run
from app.ui.live.binning import binned
from app.ui.picture import storable

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Channels:
    """``planes`` are red, green and blue (H, W); ``gain`` times a value is one of ``pixels``."""

    planes: tuple[Array, Array, Array]
    gain: float = 1.0

    def skies(self) -> tuple[float, float, float]:
        """The levels of the sky, in the units of the frame's ``pixels``."""
        red, green, blue = (self.gain * sky_level(p[::3, ::3]) for p in self.planes)
        return red, green, blue


def sky_level(values: Array) -> float:
    """The mean of the middle half of ``values``: a median that is no whole number."""
    low, high = np.percentile(values, (25, 75))
    return float(np.mean(values[(values >= low) & (values <= high)]))


def channels(frame: Frame, stored: Array, scale: float) -> Channels | None:
    """The colours of a frame at ``scale`` screen px a px of the frame; None when it has none.

    ``stored`` are its pixels as they are shown. The four pixels of a Bayer cell become one.
    """
    if frame.colour is not None:
        colour = run(storable(frame.colour))
        # Luminance of 8 bits is kept whole, as R + 2 G + B.
        gain = 4.0 if colour.dtype == np.uint8 and stored.dtype == np.uint16 else 1.0
        red, green, blue = (binned(colour[..., c], scale) for c in range(3))
        return Channels((red, green, blue), gain)
    if frame.bayer is None or len(frame.bayer) != 4 or min(stored.shape) < 2:
        return None
    red, green, blue = (binned(p, 2.0 * scale) for p in _cells(stored, frame.bayer))
    return Channels((red, green, blue))


def _cells(mosaic: Array, pattern: str) -> tuple[Array, Array, Array]:
    """Red, the mean of both greens, and blue of each 2 x 2 cell."""
    high, wide = mosaic.shape[0] // 2 * 2, mosaic.shape[1] // 2 * 2
    at: dict[str, list[Array]] = {"R": [], "G": [], "B": []}
    for number, letter in enumerate(pattern):
        at[letter].append(mosaic[number // 2 : high : 2, number % 2 : wide : 2])
    first, second = at["G"]
    green = (first >> 1) + (second >> 1) + (first & second & 1)
    return at["R"][0], green, at["B"][0]
