"""One star, one detection: duplicates, bumps on brighter stars, blends."""

import numpy as np
from numpy.typing import NDArray

from app.detect.strips import Pixels

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.intp]


def close_pairs(xy: Floats, radius_px: float) -> tuple[Index, Index]:
    """Index pairs (i, j), i < j, of positions (N, 2) not farther apart than ``radius_px``."""
    order = np.argsort(xy[:, 0], kind="stable")
    x, y = xy[order, 0], xy[order, 1]
    end = np.searchsorted(x, x + radius_px, side="right")
    firsts: list[Index] = []
    seconds: list[Index] = []
    for step in range(1, int((end - np.arange(len(x))).max(initial=1))):
        i = np.flatnonzero(end - np.arange(len(x)) > step)
        j = i + step
        near = np.hypot(x[i] - x[j], y[i] - y[j]) <= radius_px
        firsts.append(order[i[near]])
        seconds.append(order[j[near]])
    if not firsts:
        return np.empty(0, np.intp), np.empty(0, np.intp)
    a, b = np.concatenate(firsts), np.concatenate(seconds)
    return np.minimum(a, b), np.maximum(a, b)


def apart(xy: Floats, reach: Floats) -> Bools:
    """Which of positions (N, 2), brightest first, have no brighter kept one within its reach.

    ``reach`` (N,) px belongs to the brighter of a pair.
    """
    return _kept(len(xy), *_within(xy, reach))


def standing_out(pixels: Pixels, xy: Floats, height: Floats, noise: Floats, reach: Floats) -> Bools:
    """Which of positions (N, 2), brightest first, have a valley between them and brighter ones.

    ``height`` (N,) is the peak above background, ``noise`` (N,) that of a pixel, ``reach`` (N,)
    how far the brighter star's light may go. Between two stars the light sinks below the fainter
    peak by a quarter of it or more; on a plateau, a halo or a trail it does not.
    """
    i, j = _within(xy, reach)
    if not len(i):
        return np.ones(len(xy), dtype=np.bool_)
    valley = _lowest_between(pixels, xy[i], xy[j])
    peak = _means(pixels, xy[j])
    bump = peak - valley < np.maximum(0.25 * np.abs(height[j]), 1.5 * noise[j])
    return _kept(len(xy), i[bump], j[bump])


def _within(xy: Floats, reach: Floats) -> tuple[Index, Index]:
    """Pairs i < j of positions (N, 2), the second within the reach (N,) of the first."""
    i, j = close_pairs(xy, float(reach.max(initial=0.0)))
    near = np.hypot(*(xy[i] - xy[j]).T) <= reach[i]
    return i[near], j[near]


def _kept(count: int, i: Index, j: Index) -> Bools:
    """What is left (count,) when each kept i, from the brightest on, takes its j away."""
    keep = np.ones(count, dtype=np.bool_)
    for a in np.argsort(i, kind="stable"):
        if keep[i[a]]:
            keep[j[a]] = False
    return keep


def _lowest_between(pixels: Pixels, a: Floats, b: Floats) -> Floats:
    """Lowest 3 x 3 mean (N,) on the straight way from ``a`` to ``b``, both (N, 2)."""
    along = np.linspace(0.1, 0.9, 12)
    path = a[:, None] + along[None, :, None] * (b - a)[:, None]
    return np.asarray(_means(pixels, path.reshape(-1, 2)).reshape(len(a), 12).min(axis=1))


def _means(pixels: Pixels, xy: Floats) -> Floats:
    """Means (N,) of the 3 x 3 pixels around positions (N, 2)."""
    height, width = pixels.shape
    x, y = np.rint(xy).astype(np.intp).T
    total = np.zeros(len(xy))
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            total += pixels[np.clip(y + dy, 0, height - 1), np.clip(x + dx, 0, width - 1)]
    return total / 9.0
