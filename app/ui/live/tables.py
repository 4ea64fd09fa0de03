"""Look-up tables from stored values to what a QImage holds, made anew only when they change."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.ui.stretch import Stretch

OPAQUE = 0xFF000000
GREY, RED, GREEN, BLUE = 0x010101, 0x010000, 0x000100, 0x000001
"""What one step of brightness adds to 0xffRRGGBB."""


class Tables:
    """Holds those that were last asked for."""

    def __init__(self) -> None:
        self._key: object = None
        self._made: tuple[NDArray[np.uint32], ...] = ()

    def get(
        self, kind: np.dtype[Any], stretch: Stretch, span: tuple[float, float],
        parts: tuple[tuple[int, float], ...], gain: float = 1.0,
    ) -> tuple[NDArray[np.uint32], ...]:  # fmt: skip
        """A table for each of ``parts``: its light, as :data:`GREY`, and how far it is too high.

        ``span`` are the values the stretch calls 0 and 1, ``gain`` times those of the picture. The
        sum of all tables' values is the colour of a pixel.
        """
        key = (kind, stretch, span, parts, gain)
        if key != self._key:
            levels = 256 if kind == np.uint8 else 65536
            made = []
            for number, (light, shift) in enumerate(parts):
                low, high = ((end + shift) / gain for end in span)
                bright = stretch.table(levels, low, high).astype(np.uint32) * np.uint32(light)
                made.append(bright + np.uint32(0 if number else OPAQUE))
            self._made, self._key = tuple(made), key
        return self._made
