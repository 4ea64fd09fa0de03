"""Small squares of the frame around stars, gathered at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.detect.strips import BROKEN, Halving, Pixels

Floats = NDArray[np.float64]
Stamp = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Stamps:
    """``value`` (N, K, K) above background; ``weight`` (N, K, K) is 1 where a pixel may be used.

    ``x``, ``y`` (N,) are the columns and rows of the middle pixel.
    """

    value: Stamp
    weight: Stamp
    x: NDArray[np.intp]
    y: NDArray[np.intp]

    @property
    def offsets(self) -> Stamp:
        """Pixel offsets (K,) from the middle."""
        half = self.value.shape[1] // 2
        return np.arange(-half, half + 1, dtype=np.float32)

    def take(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> "Stamps":
        """Only the stamps that ``index`` selects."""
        return Stamps(self.value[index], self.weight[index], self.x[index], self.y[index])

    def core(self, reach: int) -> Stamp:
        """The middle (N, 2 reach + 1, 2 reach + 1) of the values."""
        half = self.value.shape[1] // 2
        middle = slice(half - reach, half + reach + 1)
        return self.value[:, middle, middle]


def cut(pixels: Pixels, how: Halving, xy: Floats, level: Floats, half: int) -> Stamps:
    """Stamps of ``2 half + 1`` pixels a side around positions (N, 2) px, ``level`` (N,) removed.

    Pixels outside the frame, not finite, and the red and blue of a mosaic get weight 0 and value 0.
    """
    height, width = pixels.shape
    x = np.clip(np.rint(xy[:, 0]).astype(np.intp), 0, width - 1)
    y = np.clip(np.rint(xy[:, 1]).astype(np.intp), 0, height - 1)
    reach = np.arange(-half, half + 1)
    columns, rows = x[:, None] + reach, y[:, None] + reach
    inside_x, inside_y = (columns >= 0) & (columns < width), (rows >= 0) & (rows < height)
    np.clip(columns, 0, width - 1, out=columns)
    np.clip(rows, 0, height - 1, out=rows)
    raw = pixels[rows[:, :, None], columns[:, None, :]]
    use = inside_y[:, :, None] & inside_x[:, None, :]
    if how.greens is not None:
        use &= ((rows[:, :, None] + columns[:, None, :]) & 1) == how.greens
    with np.errstate(over="ignore"):
        value = raw.astype(np.float32)
    if pixels.dtype.kind == "f":
        use &= np.abs(value) < BROKEN
        value[~use] = 0.0
    value -= level.astype(np.float32)[:, None, None]
    weight = use.astype(np.float32)
    value *= weight
    return Stamps(value, weight, x, y)
