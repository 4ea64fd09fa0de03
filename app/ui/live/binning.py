"""Means of neighbouring pixels, for a screen that has fewer of them than the camera."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
SMALLEST_PX = 200


def binned(stored: Array, scale: float, mosaic: bool = False) -> Array:
    """Means of 2 x 2 px, again and again until a px is about one of the screen.

    A mosaic is binned at least once, which makes it grey.
    """
    must = mosaic
    while (scale <= 0.5 and min(stored.shape) >= 2 * SMALLEST_PX) or (
        must and min(stored.shape) >= 2
    ):
        high, wide = stored.shape[0] // 2 * 2, stored.shape[1] // 2 * 2
        kind = np.uint16 if stored.dtype == np.uint8 else np.uint32
        rows = np.add(stored[0:high:2, :wide], stored[1:high:2, :wide], dtype=kind)
        total = rows[:, 0::2] + rows[:, 1::2]
        total >>= 2
        stored = total.astype(stored.dtype)
        scale, must = scale * 2.0, False
    return stored
