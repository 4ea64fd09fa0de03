"""The k-vector: a range search in a sorted array that needs hardly a comparison.

After Mortari, as the thesis on spherical triangles tells it (sections 3.8.1 and 3.8.2). A curve
through the first and the last value says where a value ought to lie; a table says how many values
truly lie below the curve there. The curve is a line for cosines of angles and a parabola for areas.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LINEAR, PARABOLIC = 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class KVector:
    """``values`` (N,) ascending; ``below`` (N + 1,) how many of them are under the curve at 0..N.

    The curve is ``values[0] + span (i / N) ** power``, ``power`` 1 (linear) or 2 (parabolic).
    """

    values: Floats
    below: Ints
    power: int

    def between(self, low: ArrayLike, high: ArrayLike) -> tuple[Ints, Ints]:
        """Slices ``start``, ``stop`` of the values with ``low <= value <= high``, many at once.

        An empty range gives ``start == stop``.
        """
        lows, highs = np.atleast_1d(np.asarray(low, float)), np.atleast_1d(np.asarray(high, float))
        n = len(self.values)
        if n == 0:
            return np.zeros(lows.shape, dtype=np.int64), np.zeros(lows.shape, dtype=np.int64)
        start = self.below[np.maximum(self._place(lows) - 1, 0)]
        stop = self.below[np.maximum(self._place(highs) - 1, 0)]
        while (late := (start < n) & (self.values[np.minimum(start, n - 1)] < lows)).any():
            start = start + late
        while (late := (stop < n) & (self.values[np.minimum(stop, n - 1)] <= highs)).any():
            stop = stop + late
        return start, np.maximum(start, stop)

    def _place(self, values: Floats) -> Ints:
        """The last place of the curve, 0..N, that is not above each value."""
        n = len(self.values)
        span = float(self.values[-1] - self.values[0])
        share = np.clip((values - self.values[0]) / (span or 1.0), 0.0, 1.0)
        return np.asarray(np.floor(share ** (1.0 / self.power) * n), dtype=np.int64)


def make_kvector(values: Floats, power: int = LINEAR) -> KVector:
    """The k-vector of ``values`` (N,), ascending; ``power`` of its curve as in `KVector`."""
    n = len(values)
    if n == 0:
        return KVector(values, np.zeros(1, dtype=np.int64), power)
    curve = values[0] + (values[-1] - values[0]) * np.linspace(0.0, 1.0, n + 1) ** power
    return KVector(values, np.searchsorted(values, curve, "left").astype(np.int64), power)
