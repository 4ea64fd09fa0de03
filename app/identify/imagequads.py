"""Which fours of detections to ask the index about, the most promising first."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def image_quads(xy: Floats, neighbours: int, smallest_px: float) -> Ints:
    """Quads (Q, 4): each detection with three of its nearest among ``xy`` (N, 2), each set once.

    Neighbours closer than ``smallest_px`` are passed over: noise would dominate their shape.
    """
    n = len(xy)
    if n < 4:
        return np.zeros((0, 4), dtype=np.int64)
    d2 = ((xy[:, None] - xy[None]) ** 2).sum(axis=2)
    d2[d2 < smallest_px**2] = np.inf
    k = min(neighbours, n - 1)
    near = np.argsort(d2, axis=1)[:, :k]
    combos = np.array(list(combinations(range(k), 3)))
    quads = np.concatenate(
        [np.broadcast_to(np.arange(n)[:, None, None], (n, len(combos), 1)), near[:, combos]], axis=2
    ).reshape(-1, 4)
    quads = np.sort(quads, axis=1)
    quads = quads[(np.diff(quads, axis=1) > 0).all(axis=1)]
    return quads[np.sort(np.unique(quad_marks(quads), return_index=True)[1])]


def quad_marks(quads: Ints) -> Ints:
    """One number for each set of four detections (Q, 4), sorted, each below 4096."""
    return np.asarray((quads[:, 0] << 36) | (quads[:, 1] << 24) | (quads[:, 2] << 12) | quads[:, 3])
