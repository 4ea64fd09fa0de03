"""Which detection is which catalogue star, by place alone."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def mutual_nearest(a: Floats, b: Floats, tolerance_px: float) -> tuple[Ints, Ints]:
    """Indices (K,), (K,) of the points of ``a`` (N, 2) and ``b`` (M, 2) that choose each other.

    A pair counts when each is the other's nearest and they are within ``tolerance_px``. Points
    that are not finite pair with nothing.
    """
    i, j, distance2 = _close(a, b, tolerance_px)
    if len(i) == 0:
        return i, j
    order = np.argsort(distance2, kind="stable")
    best_of_a = _first_of(i[order], len(a))
    best_of_b = _first_of(j[order], len(b))
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    chosen = (best_of_a[i] == rank) & (best_of_b[j] == rank)
    return i[chosen], j[chosen]


def without_companions(places: Floats, resolution_px: float) -> NDArray[np.bool_]:
    """Which of the places (N, 2), brightest first, a camera sees as stars of their own.

    A star closer than ``resolution_px`` to a brighter one is part of that one's image.
    """
    i, j, _ = _close(places, places, resolution_px)
    alone = np.ones(len(places), dtype=np.bool_)
    alone[j[i < j]] = False
    return alone


def _close(a: Floats, b: Floats, tolerance_px: float) -> tuple[Ints, Ints, Floats]:
    """All pairs within the tolerance: b sorted by x, and for each of a the slice of b near it."""
    finite = np.flatnonzero(np.isfinite(b).all(axis=1))
    order = finite[np.argsort(b[finite, 0], kind="stable")]
    xs = b[order, 0]
    low = np.searchsorted(xs, a[:, 0] - tolerance_px)
    count = np.searchsorted(xs, a[:, 0] + tolerance_px, side="right") - low
    count[~np.isfinite(a).all(axis=1)] = 0
    i = np.repeat(np.arange(len(a), dtype=np.int64), count)
    within = np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count)
    j = order[np.repeat(low, count) + within].astype(np.int64)
    distance2 = np.sum(np.square(a[i] - b[j]), axis=1)
    near = distance2 <= tolerance_px**2
    return i[near], j[near], distance2[near]


def _first_of(labels: Ints, size: int) -> Ints:
    """Position of the first occurrence of every label below ``size``; -1 where there is none."""
    first = np.full(size, -1, dtype=np.int64)
    first[labels[::-1]] = np.arange(len(labels))[::-1]
    return first
