"""Peaks of the smoothed frame, one for each star, and the stamps cut around them."""

from dataclasses import field
from functools import partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from kochab.core import pairing
from kochab.core.arrays import Array, Bools, Floats, Floats32, Indices, Ints, Table
from kochab.core.threads import in_threads
from kochab.core.values import frozen
from kochab.detection.background import BROKEN, Halving, Mesh, Smoother

STRIP, STRIP_PX, FEWEST_ROWS = 160, 600_000, 32
"""Rows of the frame in a strip at most, pixels in it as far as possible, and rows at least, for eight more are read.

What a strip needs then fits the cache of one processor, and a thread that begins anew has little memory to ask for.
"""
LARGE_PX = 4_000_000  # a frame of more is done in threads


def find_peaks(pixels: Array, how: Halving, mesh: Mesh, sigmas: float, limit: int) -> Floats:
    """Positions (N, 2) px of maxima higher than ``sigmas`` in noise, highest first.

    At most ``limit`` are returned; a position is the middle of 2 x 2 pixels.

    Parameters
    ----------
    pixels : Array
        The frame (H, W), as read.
    how : Halving
        How pixels are halved and smoothed before peaks are looked for.
    mesh : Mesh
        Background and noise over the frame.
    sigmas : float
        Least height above the background, in noise of the halved pixels.
    limit : int
        How many peaks are returned at most.
    """
    pixels = pixels[: pixels.shape[0] // 2 * 2]
    strip = min(STRIP, max(FEWEST_ROWS, STRIP_PX // pixels.shape[1] // 2 * 2))
    tops = np.arange(0, len(pixels), strip)
    smoother = Smoother(how, float(mesh.level.mean()))
    columns = 2.0 * np.arange(pixels.shape[1] // 2 + 2) - 1.5
    lines = _lines(mesh, tops, strip, columns, sigmas * how.noise_gain / how.gain)
    lines *= how.gain
    lines = _as_thresholds(lines, smoother.dtype(pixels))
    in_turn = in_threads if pixels.size > LARGE_PX else map
    found = list(in_turn(partial(_strip_peaks, pixels, smoother, strip), lines, tops.tolist()))
    counts = [len(hit) for hit, _ in found]
    hit, value = (np.concatenate(kind) for kind in zip(*found, strict=True))
    row, column = np.divmod(hit, len(columns))
    xy = np.stack([columns[column], np.repeat(tops, counts) + 2.0 * row - 1.5], axis=1)
    level, noise = mesh.at(xy[:, 0], xy[:, 1])
    heights = (value / how.gain - level) / (noise * (how.noise_gain / how.gain))
    high = np.flatnonzero(heights > sigmas)
    return xy[high[np.lexsort((xy[high, 0], xy[high, 1], -heights[high]))][:limit]]


def _lines(mesh: Mesh, tops: Indices, strip: int, columns: Floats, rise: float) -> Floats:
    """The lowest threshold (S, C) in each strip of so many rows at ``columns`` (C,) px."""
    grid = mesh.level + rise * mesh.noise
    knots = np.arange(len(mesh.rows))
    ends = np.interp(np.stack([tops, tops + strip]), mesh.rows, knots)
    lowest = np.full((len(tops), grid.shape[1]), np.inf)
    for at in (ends[0], ends[1], ends.mean(axis=0)):
        i = np.minimum(at.astype(np.intp), max(0, len(grid) - 2))
        j, part = np.minimum(i + 1, len(grid) - 1), (at - i)[:, None]
        lowest = np.minimum(lowest, grid[i] * (1.0 - part) + grid[j] * part)
    return np.stack([np.interp(columns, mesh.columns, line) for line in lowest])


def _strip_peaks(pixels: Array, smoother: Smoother, strip: int, line: Array, top: int) -> tuple[Indices, Array]:
    """Flat indices and values of maxima in the ``strip`` rows from ``top``; neighbours are looked at too.

    The smoothed strip has one row more above and below, and one column more at each side.
    """
    height = pixels.shape[0]
    # Four rows of overlap: two halved rows for the kernel and the neighbours of the strip's edge.
    first, last = max(0, top - 4), min(height, top + strip + 4)
    smoothed = smoother(pixels[first:last], (2 * (first == top), 2 * (last == height), 2))
    rows, columns = smoothed.shape
    hit = _where(smoother.above(smoothed, line))
    a, b = np.searchsorted(hit, (columns, min(rows - 1, strip // 2 + 1) * columns))
    hit = hit[a:b]
    hit = hit[_is_maximum(smoothed, hit)]
    return hit, smoothed.ravel()[hit].astype(np.float64)


def _where(above: NDArray[np.bool_]) -> Indices:
    """Indices of what is true in a flat mask, looking at eight at a time because little is."""
    whole = len(above) // 8 * 8
    words = np.flatnonzero(above[:whole].view(np.uint64) != 0)
    near = (words[:, None] * 8 + np.arange(8)).ravel()
    near = np.concatenate([near, np.arange(whole, len(above))])
    return np.asarray(near[above[near]])


def _is_maximum(field: Array, hit: Indices) -> NDArray[np.bool_]:
    """Whether each is above its eight neighbours; of equals the last counts."""
    flat, row = field.ravel(), field.shape[1]
    value = flat[hit]
    keep = np.ones(len(hit), dtype=np.bool_)
    for step in (1, row - 1, row, row + 1):
        # With >= on one side and > on the other exactly one of two equal neighbours is the peak.
        keep &= (value >= flat[hit - step]) & (value > flat[hit + step])
    return keep


def _as_thresholds(lines: Floats, dtype: type[np.generic]) -> Array:
    """``lines`` in the type of what is compared, which then is not converted pixel by pixel.

    They are overwritten. The outermost columns, which have no neighbour, are never above.
    """
    lines[:, [0, -1]] = np.inf
    if np.issubdtype(dtype, np.floating):
        return lines.astype(dtype)
    most = np.iinfo(dtype).max  # type: ignore[type-var]
    # Whole numbers above the floor are those above the line itself.
    np.floor(lines, out=lines)
    np.clip(lines, 0, most, out=lines)
    return lines.astype(dtype)


# -- One star, one detection: duplicates, bumps on brighter stars, blends ----------------------


def close_pairs(xy: Floats, radius_px: float | Floats) -> tuple[Ints, Ints]:
    """Pairs (i, j), i < j, of positions (N, 2) not farther apart than ``radius_px``, which may be each i's own."""
    i, j, _ = pairing.close_pairs(xy, xy, radius_px)
    ordered = i < j
    return i[ordered], j[ordered]


def apart(xy: Floats, reach: Floats) -> Bools:
    """Which of positions (N, 2), brightest first, have no brighter kept one within its reach.

    ``reach`` (N,) px belongs to the brighter of a pair.
    """
    return _kept(len(xy), *close_pairs(xy, reach))


def standing_out(pixels: Array, xy: Floats, height: Floats, noise: Floats, reach: Floats) -> Bools:
    """Which of positions, brightest first, have a valley between them and brighter ones.

    Between two stars the light sinks below the fainter peak by a quarter of it or more; on a plateau, a halo or a trail
    it does not.

    Parameters
    ----------
    pixels : Array
        The frame (H, W).
    xy : Floats
        Positions (N, 2), px, brightest first.
    height : Floats
        Peak (N,) above the background.
    noise : Floats
        Noise (N,) of a pixel there.
    reach : Floats
        How far (N,) the brighter star's light may go, px.
    """
    i, j = close_pairs(xy, reach)
    if not len(i):
        return np.ones(len(xy), dtype=np.bool_)
    valley = _lowest_between(pixels, xy[i], xy[j])
    peak = _means(pixels, xy[j])
    bump = peak - valley < np.maximum(0.25 * np.abs(height[j]), 1.5 * noise[j])
    return _kept(len(xy), i[bump], j[bump])


def _kept(count: int, i: Ints, j: Ints) -> Bools:
    """What is left (count,) when each kept i, from the brightest on, takes its j away."""
    keep = np.ones(count, dtype=np.bool_)
    for a in np.argsort(i, kind="stable"):
        if keep[i[a]]:
            keep[j[a]] = False
    return keep


def _lowest_between(pixels: Array, a: Floats, b: Floats) -> Floats:
    """Lowest 3 x 3 mean (N,) on the straight way from ``a`` to ``b``, both (N, 2)."""
    # The ends are left out: there the mean would be of the peaks themselves.
    along = np.linspace(0.1, 0.9, 12)
    path = a[:, None] + along[None, :, None] * (b - a)[:, None]
    return np.asarray(_means(pixels, path.reshape(-1, 2)).reshape(len(a), 12).min(axis=1))


def _means(pixels: Array, xy: Floats) -> Floats:
    """Means (N,) of the 3 x 3 pixels around positions (N, 2)."""
    height, width = pixels.shape
    x, y = np.rint(xy).astype(np.intp).T
    total = np.zeros(len(xy))
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            total += pixels[np.clip(y + dy, 0, height - 1), np.clip(x + dx, 0, width - 1)]
    return total / 9.0


# -- Small squares of the frame around stars, gathered at once ---------------------------------


@frozen(eq=False)
class Stamps(Table):
    """``value`` (N, K, K) above background; ``weight`` (N, K, K) is 1 where a pixel may be used.

    ``x``, ``y`` (N,) are the columns and rows of the middle pixel.
    """

    value: Floats32
    weight: Floats32
    x: NDArray[np.intp]
    y: NDArray[np.intp]

    @property
    def offsets(self) -> Floats32:
        """Pixel offsets (K,) from the middle."""
        half = self.value.shape[1] // 2
        return np.arange(-half, half + 1, dtype=np.float32)

    def core(self, reach: int) -> Floats32:
        """The middle (N, 2 reach + 1, 2 reach + 1) of the values."""
        half = self.value.shape[1] // 2
        middle = slice(half - reach, half + reach + 1)
        return self.value[:, middle, middle]


def cut(pixels: Array, how: Halving, xy: Floats, level: Floats, half: int) -> Stamps:
    """Square stamps around positions, the background removed.

    Pixels outside the frame, not finite, and the red and blue of a mosaic get weight 0 and value 0.

    Parameters
    ----------
    pixels : Array
        The frame (H, W).
    how : Halving
        Says which pixels of a mosaic are green.
    xy : Floats
        Positions (N, 2), px; the stamp is centred on the nearest pixel.
    level : Floats
        Background (N,) to take away.
    half : int
        A stamp has ``2 half + 1`` pixels a side.
    """
    height, width = pixels.shape
    x = np.clip(np.rint(xy[:, 0]).astype(np.intp), 0, width - 1)
    y = np.clip(np.rint(xy[:, 1]).astype(np.intp), 0, height - 1)
    reach, side = np.arange(-half, half + 1), 2 * half + 1
    columns, rows = x[:, None] + reach, y[:, None] + reach
    use = np.ones((len(x), side, side), dtype=np.bool_)
    if min(height, width) < side:
        raw, use[:] = _beyond_edges(pixels, rows, columns)
    else:
        # A view of all squares of the frame: to copy some takes a third of the time of picking each pixel.
        squares = sliding_window_view(pixels, (side, side))
        top, left = np.clip(y - half, 0, height - side), np.clip(x - half, 0, width - side)
        raw = squares[top, left]
        over = np.flatnonzero((top != y - half) | (left != x - half))
        if len(over):
            raw[over], use[over] = _beyond_edges(pixels, rows[over], columns[over])
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


def _beyond_edges(pixels: Array, rows: Indices, columns: Indices) -> tuple[Array, Bools]:
    """Pixels (N, K, K) at rows and columns (N, K), the frame's edge repeated, and which the frame has."""
    height, width = pixels.shape
    inside_y, inside_x = (rows >= 0) & (rows < height), (columns >= 0) & (columns < width)
    near_rows, near_columns = np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)
    return pixels[near_rows[:, :, None], near_columns[:, None, :]], inside_y[:, :, None] & inside_x[:, None, :]


# -- What the steps of a detection share: the pixels and what is already known of them ---------


@frozen(eq=False)
class PreparedFrame:
    """Pixels (H, W), how they are halved, their background, and hot pixels (M, 2) as x, y."""

    pixels: Array
    how: Halving
    mesh: Mesh
    hot: Floats = field(default_factory=lambda: np.empty((0, 2)))

    def stamps(self, xy: Floats, half: int) -> tuple[Stamps, Floats, Floats]:
        """Stamps around places (N, 2) px without background and hot pixels, level and noise."""
        level, noise = self.mesh.at(xy[:, 0], xy[:, 1])
        stamps = cut(self.pixels, self.how, xy, level, half)
        if len(self.hot) and len(xy):
            leave_out(stamps, self.hot)
        return stamps, level, noise


def leave_out(stamps: Stamps, hot: Floats) -> None:
    """Give hot pixels (M, 2) no weight in those stamps that hold them, in place."""
    half = stamps.value.shape[1] // 2
    centres = np.stack([stamps.x, stamps.y], axis=1).astype(np.float64)
    star, other = close_pairs(np.concatenate([centres, hot]), 1.5 * half)
    mixed = (star < len(centres)) & (other >= len(centres))
    star, at = star[mixed], hot[other[mixed] - len(centres)].astype(np.intp)
    column, row = at[:, 0] - stamps.x[star] + half, at[:, 1] - stamps.y[star] + half
    inside = (abs(column - half) <= half) & (abs(row - half) <= half)
    star, column, row = star[inside], column[inside], row[inside]
    stamps.weight[star, row, column] = 0.0
    stamps.value[star, row, column] = 0.0
