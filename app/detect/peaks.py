"""Local maxima of the smoothed frame above the mesh, strip by strip."""

import numpy as np
from numpy.typing import NDArray

from app.detect.mesh import Mesh
from app.detect.strips import Halving, Pixels, Smoother

Floats = NDArray[np.float64]
Index = NDArray[np.intp]
STRIP = 128  # rows of the frame; what a strip needs fits the cache


def find_peaks(
    pixels: Pixels, how: Halving, mesh: Mesh, sigmas: float, limit: int
) -> tuple[Floats, Floats]:
    """Positions (N, 2) px and heights (N,) in noise of maxima above ``sigmas``, highest first.

    At most ``limit`` are returned; a position is the middle of 2 x 2 pixels.
    """
    pixels = pixels[: pixels.shape[0] // 2 * 2]
    tops = np.arange(0, len(pixels), STRIP)
    rise = sigmas * how.noise_gain / how.gain
    floors = _floors(mesh, tops, rise)
    columns = 2.0 * np.arange(pixels.shape[1] // 2 + 2) - 1.5

    smoother = Smoother(how, float(mesh.level.mean()))
    found = []
    for top, floor in zip(tops, floors, strict=True):
        line = np.interp(columns, mesh.columns, floor) * how.gain
        found.append(_strip_peaks(pixels, smoother, line, int(top)))
    xy, value = (np.concatenate(kind) for kind in zip(*found, strict=True))
    level, noise = mesh.at(xy[:, 0], xy[:, 1])
    heights = (value / how.gain - level) / (noise * (how.noise_gain / how.gain))
    high = np.flatnonzero(heights > sigmas)
    order = high[np.lexsort((xy[high, 0], xy[high, 1], -heights[high]))][:limit]
    return xy[order], heights[order]


def _floors(mesh: Mesh, tops: Index, rise: float) -> Floats:
    """The lowest threshold (S, C) in each strip at the mesh's columns."""
    grid = mesh.level + rise * mesh.noise
    knots = np.arange(len(mesh.rows))
    ends = np.interp(np.stack([tops, tops + STRIP]), mesh.rows, knots)
    lowest = np.full((len(tops), grid.shape[1]), np.inf)
    for at in (ends[0], ends[1], ends.mean(axis=0)):
        i = np.minimum(at.astype(np.intp), max(0, len(grid) - 2))
        j, part = np.minimum(i + 1, len(grid) - 1), (at - i)[:, None]
        lowest = np.minimum(lowest, grid[i] * (1.0 - part) + grid[j] * part)
    return lowest


def _strip_peaks(
    pixels: Pixels, smoother: Smoother, floor: Floats, top: int
) -> tuple[Floats, Floats]:
    """Places and values of maxima in the rows from ``top``; neighbours' rows are looked at too."""
    height = pixels.shape[0]
    first, last = max(0, top - 4), min(height, top + STRIP + 4)
    above, below = 2 * (first == top), 2 * (last == height)
    field = smoother(pixels[first:last], (above, below, 2))
    # one halved row and column more than the strip on every side
    hit = _where(smoother.above(field, _as_threshold(floor, field)))
    y, x = np.divmod(hit, field.shape[1])
    inside = (y > 0) & (y < field.shape[0] - 1) & (x > 0) & (x < field.shape[1] - 1)
    hit = hit[inside & (y <= STRIP // 2)]
    hit = hit[_is_maximum(field, hit)]
    y, x = np.divmod(hit, field.shape[1])
    return np.stack([2.0 * x - 1.5, top + 2.0 * y - 1.5], axis=1), field.ravel()[hit].astype(float)


def _where(above: NDArray[np.bool_]) -> Index:
    """Indices of what is true in a flat mask, looking at eight at a time because little is."""
    whole = len(above) // 8 * 8
    words = np.flatnonzero(above[:whole].view(np.uint64) != 0)
    near = (words[:, None] * 8 + np.arange(8)).ravel()
    near = np.concatenate([near, np.arange(whole, len(above))])
    return np.asarray(near[above[near]])


def _is_maximum(field: Pixels, hit: Index) -> NDArray[np.bool_]:
    """Whether each is above its eight neighbours; of equals the last counts."""
    flat, row = field.ravel(), field.shape[1]
    value = flat[hit]
    keep = np.ones(len(hit), dtype=np.bool_)
    for step in (1, row - 1, row, row + 1):
        keep &= (value >= flat[hit - step]) & (value > flat[hit + step])
    return keep


def _as_threshold(floor: Floats, field: Pixels) -> Pixels:
    """``floor`` in the dtype of ``field``, so that comparing does not convert every pixel."""
    if field.dtype.kind == "f":
        return floor.astype(field.dtype)
    top = np.iinfo(field.dtype).max
    return np.clip(np.floor(floor), 0, top).astype(field.dtype)
