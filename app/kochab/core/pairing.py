"""Which points of two lists are each other's nearest: detections and the places where stars are expected."""

import numpy as np

from kochab.core.arrays import Floats, Ints


def mutual_nearest(a: Floats, b: Floats, tolerance_px: float) -> tuple[Ints, Ints]:
    """Indices (K,), (K,) of the points of ``a`` (N, 2) and ``b`` (M, 2) that choose each other.

    A pair counts when each is the other's nearest and they are within ``tolerance_px``. Points
    that are not finite pair with nothing.
    """
    i, j, distance2 = close_pairs(a, b, tolerance_px)
    if len(i) == 0:
        return i, j
    order = np.argsort(distance2, kind="stable")
    # pairs by distance: the first of each point is its nearest, and a pair that is first for both is mutual
    best_of_a = _first_of(i[order], len(a))
    best_of_b = _first_of(j[order], len(b))
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    chosen = (best_of_a[i] == rank) & (best_of_b[j] == rank)
    return i[chosen], j[chosen]


def mutual_nearest_of_few(seen: Floats, expected: Floats, radius_px: float) -> tuple[Ints, Ints, Floats]:
    """The same by all distances at once, quicker while N times M is some ten thousand; also the distances squared (K,).

    ``radius_px`` itself is outside, and every coordinate has to be finite.
    """
    if len(seen) == 0 or len(expected) == 0:
        none = np.zeros(0, dtype=np.int64)
        return none, none, np.zeros(0)
    dx = seen[:, 0, None] - expected[None, :, 0]
    dy = seen[:, 1, None] - expected[None, :, 1]
    d2 = dx * dx + dy * dy
    j = d2.argmin(axis=1)
    best = d2[np.arange(len(seen)), j]
    i = (best < radius_px * radius_px).nonzero()[0]
    i = i[d2[:, j[i]].argmin(axis=0) == i]
    return i, j[i], best[i]


def close_pairs(a: Floats, b: Floats, tolerance_px: float | Floats) -> tuple[Ints, Ints, Floats]:
    """All pairs of ``a`` (N, 2) and ``b`` (M, 2) within the tolerance: indices (K,), (K,) and distances squared (K,).

    The tolerance may be each one's own (N,). ``b`` is sorted by x, and for each of ``a`` the slice of it near by is
    looked at.
    """
    finite = np.flatnonzero(np.isfinite(b).all(axis=1))
    order = finite[np.argsort(b[finite, 0], kind="stable")]
    xs, ys = b[order].T
    low = np.searchsorted(xs, a[:, 0] - tolerance_px)
    count = np.searchsorted(xs, a[:, 0] + tolerance_px, side="right") - low
    count[~np.isfinite(a).all(axis=1)] = 0
    i = np.repeat(np.arange(len(a), dtype=np.int64), count)
    at = np.arange(len(i)) + np.repeat(low - (np.cumsum(count) - count), count)
    dx, dy = a[i, 0] - xs[at], a[i, 1] - ys[at]
    distance2 = dx * dx + dy * dy
    near = np.flatnonzero(distance2 <= np.broadcast_to(np.square(tolerance_px), len(a))[i])
    return i[near], order[at[near]].astype(np.int64), distance2[near]


def _first_of(labels: Ints, size: int) -> Ints:
    """Position of the first occurrence of every label below ``size``; -1 where there is none."""
    first = np.full(size, -1, dtype=np.int64)
    # written from the last to the first, so that the first stays
    first[labels[::-1]] = np.arange(len(labels))[::-1]
    return first
