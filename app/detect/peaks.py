"""Local maxima of the smoothed frame above the mesh, strip by strip."""

import numpy as np
from numpy.typing import NDArray

from app.detect.mesh import Mesh
from app.detect.strips import Halving, Pixels, Smoother

Floats = NDArray[np.float64]
Index = NDArray[np.intp]
STRIP = 160  # rows of the frame; what a strip needs fits the cache


def find_peaks(
    pixels: Pixels, how: Halving, mesh: Mesh, sigmas: float, limit: int
) -> tuple[Floats, Floats]:
    """Positions (N, 2) px and heights (N,) in noise of maxima above ``sigmas``, highest first.

    At most ``limit`` are returned; a position is the middle of 2 x 2 pixels.
    """
    pixels = pixels[: pixels.shape[0] // 2 * 2]
    tops = np.arange(0, len(pixels), STRIP)
    smoother = Smoother(how, float(mesh.level.mean()))
    columns = 2.0 * np.arange(pixels.shape[1] // 2 + 2) - 1.5
    lines = _lines(mesh, tops, columns, sigmas * how.noise_gain / how.gain)
    lines *= how.gain
    lines = _as_thresholds(lines, smoother.dtype(pixels))
    found = [
        _strip_peaks(pixels, smoother, line, int(top))
        for top, line in zip(tops, lines, strict=True)
    ]
    counts = [len(hit) for hit, _ in found]
    hit, value = (np.concatenate(kind) for kind in zip(*found, strict=True))
    row, column = np.divmod(hit, len(columns))
    xy = np.stack([columns[column], np.repeat(tops, counts) + 2.0 * row - 1.5], axis=1)
    level, noise = mesh.at(xy[:, 0], xy[:, 1])
    heights = (value / how.gain - level) / (noise * (how.noise_gain / how.gain))
    high = np.flatnonzero(heights > sigmas)
    order = high[np.lexsort((xy[high, 0], xy[high, 1], -heights[high]))][:limit]
    return xy[order], heights[order]


def _lines(mesh: Mesh, tops: Index, columns: Floats, rise: float) -> Floats:
    """The lowest threshold (S, C) in each strip at ``columns`` (C,) px."""
    grid = mesh.level + rise * mesh.noise
    knots = np.arange(len(mesh.rows))
    ends = np.interp(np.stack([tops, tops + STRIP]), mesh.rows, knots)
    lowest = np.full((len(tops), grid.shape[1]), np.inf)
    for at in (ends[0], ends[1], ends.mean(axis=0)):
        i = np.minimum(at.astype(np.intp), max(0, len(grid) - 2))
        j, part = np.minimum(i + 1, len(grid) - 1), (at - i)[:, None]
        lowest = np.minimum(lowest, grid[i] * (1.0 - part) + grid[j] * part)
    return np.stack([np.interp(columns, mesh.columns, line) for line in lowest])


def _strip_peaks(
    pixels: Pixels, smoother: Smoother, line: Pixels, top: int
) -> tuple[Index, Pixels]:
    """Flat indices and values of maxima in the rows from ``top``; neighbours are looked at too.

    The smoothed strip has one row more above and below, and one column more at each side.
    """
    height = pixels.shape[0]
    first, last = max(0, top - 4), min(height, top + STRIP + 4)
    smoothed = smoother(pixels[first:last], (2 * (first == top), 2 * (last == height), 2))
    rows, columns = smoothed.shape
    hit = _where(smoother.above(smoothed, line))
    a, b = np.searchsorted(hit, (columns, min(rows - 1, STRIP // 2 + 1) * columns))
    hit = hit[a:b]
    hit = hit[_is_maximum(smoothed, hit)]
    return hit, smoothed.ravel()[hit].astype(np.float64)


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


def _as_thresholds(lines: Floats, dtype: type[np.generic]) -> Pixels:
    """``lines`` in the type of what is compared, which then is not converted pixel by pixel.

    They are overwritten. The outermost columns, which have no neighbour, are never above.
    """
    lines[:, [0, -1]] = np.inf
    if np.issubdtype(dtype, np.floating):
        return lines.astype(dtype)
    most = np.iinfo(dtype).max  # type: ignore[type-var]
    np.floor(lines, out=lines)
    np.clip(lines, 0, most, out=lines)
    return lines.astype(dtype)
