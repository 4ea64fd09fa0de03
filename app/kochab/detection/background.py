"""Background and noise of a frame, and its halving and smoothing, strip by strip.

Both are measured on the smoothed pixels that peaks are looked for in, so that the noise includes
what compression, demosaicing or nebulosity have correlated.
"""

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Array, Floats
from kochab.core.robust import median
from kochab.core.values import frozen, mutable

# -- Halving and smoothing: the pass that touches every pixel of the frame ---------------------
# Pixels are summed 2 x 2 (of a Bayer mosaic only the two greens) and smoothed by a 3 x 3 binomial
# kernel. Whole numbers stay whole: unsigned pixels are summed by viewing neighbours as one word of
# twice the width. The result is ``gain`` times the mean level of the pixels under the kernel, and
# white noise of RMS s a pixel becomes ``noise_gain * s``.

BROKEN = 1e15  # what is larger, or not a number, is not light
WIDTH: dict[int, type[np.unsignedinteger[Any]]] = {8: np.uint8, 16: np.uint16}
WORD: dict[int, type[np.unsignedinteger[Any]]] = {1: np.uint16, 2: np.uint32}


@frozen
class Halving:
    """How 2 x 2 pixels become one; ``greens`` is 0 or 1, the column of the green of even rows."""

    greens: int | None = None

    @property
    def gain(self) -> float:
        """Smoothed value of a flat frame of level 1."""
        return 64.0 if self.greens is None else 32.0

    @property
    def noise_gain(self) -> float:
        """RMS of the smoothed value for white noise of RMS 1 a pixel."""
        return 6.0 * float(np.sqrt(4.0 if self.greens is None else 2.0))

    def sums(self, rows: Array, out: Array, spare: Array) -> None:
        """Sums of rows (2 n, W), W even or odd, into ``out`` (n, W // 2); ``spare`` is as large."""
        rows = rows[:, : rows.shape[1] // 2 * 2]
        size = rows.dtype.itemsize
        if rows.dtype.kind != "u":
            self._plain(rows, out)
        elif rows.strides[0] % (2 * size) or rows.strides[1] != size:
            self._plain(rows.astype(out.dtype), out)
        else:
            self._words(rows.view(WORD[size]), out, spare, 8 * size)

    def _words(self, pairs: Array, out: Array, spare: Array, bits: int) -> None:
        """The low and the high half of every word are neighbouring pixels."""
        low, high = pairs.dtype.type((1 << bits) - 1), pairs.dtype.type(bits)
        even, odd = pairs[0::2], pairs[1::2]
        if self.greens is not None:
            np.right_shift(even if self.greens else odd, high, out=out)
            np.bitwise_and(odd if self.greens else even, low, out=spare)
            np.add(out, spare, out=out)
            return
        if int(pairs.view(WIDTH[bits]).max()) < 1 << (bits - 1):  # two rows at once do not overflow
            np.add(even, odd, out=spare)
            np.bitwise_and(spare, low, out=out)
            np.right_shift(spare, high, out=spare)
            np.add(out, spare, out=out)
            return
        np.bitwise_and(even, low, out=out)
        np.right_shift(even, high, out=spare)
        np.add(out, spare, out=out)
        np.bitwise_and(odd, low, out=spare)
        np.add(out, spare, out=out)
        np.right_shift(odd, high, out=spare)
        np.add(out, spare, out=out)

    def _plain(self, rows: Array, out: Array) -> None:
        if self.greens is None:
            both = rows[0::2] + rows[1::2]
            np.add(both[:, 0::2], both[:, 1::2], out=out)
        else:
            np.add(rows[0::2, self.greens :: 2], rows[1::2, 1 - self.greens :: 2], out=out)


GREENS = {"RGGB": 1, "BGGR": 1, "GRBG": 0, "GBRG": 0}


def halving(bayer: str | None) -> Halving:
    """The halving that suits a mosaic; one whose green is not on a diagonal is summed whole."""
    return Halving(GREENS.get((bayer or "").upper()))


def as_summable(rows: Array, fill: float) -> Array:
    """Rows as uint8, uint16 or float32, with what is not finite replaced by ``fill``."""
    if rows.dtype in (np.uint8, np.uint16):
        return rows
    if rows.dtype == np.bool_:
        return rows.view(np.uint8)
    with np.errstate(over="ignore"):
        out = rows.astype(np.float32, copy=False)
    with np.errstate(invalid="ignore", over="ignore"):
        # One pass of BLAS finds NaN, infinity and absurd values together; the mask is made only when it does.
        total = float(np.dot(out.ravel(), out.ravel())) if out.size else 0.0
    if not total < BROKEN**2:
        out = np.where(np.abs(out) < BROKEN, out, np.float32(fill))
    return out


class _Buffers(threading.local):
    """Memory of this thread, a few MB, kept because new pages cost as much as the sums."""

    def __init__(self) -> None:
        self.arrays: dict[str, Array] = {}


_BUFFERS = _Buffers()


@mutable
class Smoother:
    """Halves and smooths rows in memory that all smoothers of a thread share."""

    how: Halving
    fill: float = 0.0

    def __call__(self, rows: Array, pad: tuple[int, int, int]) -> Array:
        """Smoothed (n + above + below - 2, m + 2 sides - 2) of rows (2 n, 2 m or 2 m + 1).

        ``pad`` = (above, below, sides) halved pixels repeat the edges. The result is overwritten by the next call.
        """
        above, below, sides = pad
        sums, spare = self._sums(rows, pad)
        if sides:
            sums[:, :sides] = sums[:, sides : sides + 1]
            sums[:, -sides:] = sums[:, -sides - 1 : -sides]
        if above:
            sums[:above] = sums[above]
        if below:
            sums[-below:] = sums[-below - 1]
        return self._binomial(sums, spare)

    def dtype(self, pixels: Array) -> type[np.number[Any]]:
        """The type of sums and smoothed values of such pixels."""
        if pixels.dtype == np.bool_:
            return np.uint16
        return WORD.get(pixels.dtype.itemsize if pixels.dtype.kind == "u" else 0, np.float32)

    def halved(self, rows: Array) -> Array:
        """Sums (n, m) of rows (2 n, 2 m or 2 m + 1), overwritten by the next call as well."""
        return self._sums(rows, (0, 0, 0))[0]

    def _sums(self, rows: Array, pad: tuple[int, int, int]) -> tuple[Array, Array]:
        """The sums with room for ``pad`` around them, and spare memory as large."""
        rows = as_summable(rows, self.fill)
        above, below, sides = pad
        n, m = len(rows) // 2, rows.shape[1] // 2
        shape = n + above + below, m + 2 * sides
        sums, spare = (self._memory(name, shape, self.dtype(rows)) for name in ("sums", "wide"))
        inner = np.s_[above : above + n, sides : sides + m]
        self.how.sums(rows, sums[inner], spare[inner])
        return sums, spare

    def blocks(self, pixels: Array, tops: NDArray[np.intp], rows: int) -> Array:
        """``rows`` rows of ``pixels`` below each of ``tops``, all in one; overwritten as well."""
        shape = (len(tops) * rows, pixels.shape[1])
        out = self._memory("rows", shape, pixels.dtype.type)
        for k, top in enumerate(tops):
            out[k * rows : (k + 1) * rows] = pixels[top : top + rows]
        return out

    def above(self, smoothed: Array, floor: Array) -> NDArray[np.bool_]:
        """Flat mask of where ``smoothed`` (n, m) exceeds ``floor`` (m,); overwritten as well."""
        out = self._memory("above", (smoothed.shape[0], smoothed.shape[1]), np.bool_)
        return np.asarray(np.greater(smoothed, floor, out=out).ravel())

    def _binomial(self, sums: Array, wide: Array) -> Array:
        """Weights 1 2 1 along each axis."""
        n, m = sums.shape
        np.add(sums[:, :-1], sums[:, 1:], out=wide[:, :-1])
        np.add(wide[:, : m - 2], wide[:, 1 : m - 1], out=sums[:, : m - 2])
        across = sums[:, : m - 2]
        np.add(across[:-1], across[1:], out=wide[: n - 1, : m - 2])
        out = self._memory("sums", (n - 2, m - 2), sums.dtype.type)  # the sums are done with
        np.add(wide[: n - 2, : m - 2], wide[1 : n - 1, : m - 2], out=out)
        return out

    def _memory(self, name: str, shape: tuple[int, int], dtype: type[np.generic]) -> Array:
        size = shape[0] * shape[1] * np.dtype(dtype).itemsize
        kept = _BUFFERS.arrays.get(name)
        if kept is None or len(kept) < size:
            kept = _BUFFERS.arrays[name] = np.empty(size, dtype=np.uint8)
        return kept[:size].view(dtype).reshape(shape)


QUARTILE = 0.6745  # of a unit normal


@frozen(eq=False)
class Mesh:
    """Level and noise at tile centres and around them, in units of one pixel of the frame.

    ``level`` and ``noise`` (R, C); ``rows`` (R,) and ``columns`` (C,) are the places, px.
    ``noise`` is that RMS which as white noise would make the smoothed pixels as noisy as they are.
    """

    level: Floats
    noise: Floats
    rows: Floats
    columns: Floats

    def at(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Level and noise, each (N,), at pixels by bilinear interpolation."""
        # outside the nodes np.interp holds the first and the last
        r = np.interp(y, self.rows, np.arange(len(self.rows)))
        c = np.interp(x, self.columns, np.arange(len(self.columns)))
        i, j = r.astype(np.intp), c.astype(np.intp)
        i1, j1 = np.minimum(i + 1, len(self.rows) - 1), np.minimum(j + 1, len(self.columns) - 1)
        u, v = r - i, c - j
        weights = ((1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v)
        corners = ((i, j), (i, j1), (i1, j), (i1, j1))
        level, noise = (
            sum(w * grid[at] for w, at in zip(weights, corners, strict=True)) for grid in (self.level, self.noise)
        )
        return np.asarray(level), np.asarray(noise)


def measure_mesh(pixels: Array, how: Halving) -> Mesh:
    """The mesh of a frame (H, W), both at least 8."""
    height, width = pixels.shape
    # Tiles hold some hundred samples, enough for quartiles; large frames afford larger tiles and sparser rows.
    tile = 64 if pixels.size < 4_000_000 else 128
    every = 8 if pixels.size < 1_500_000 else tile // 4 if tile < 128 else tile // 2
    tops = np.arange(0, height - 5, every)
    samples = _sampled_rows(pixels, Smoother(how, _any_level(pixels)), tops)
    x = 2.0 * np.arange(samples.shape[1], dtype=np.float64) + 2.5  # of the samples, px
    y = tops.astype(np.float64) + 2.5
    cells = _Cells.of(samples.shape, round(width / tile), round(height / tile))
    level, spread = cells.quartiles(samples)
    steps = np.concatenate([np.abs(np.diff(level, axis=k)).ravel() for k in (0, 1)])
    # Where the level rises by more than the noise from tile to tile, as under vignetting or moonlight.
    if steps.size and np.count_nonzero(steps > median(spread)) > 0.1 * steps.size:
        level, spread = cells.quartiles(samples, _median3(level))  # a slope would count as noise
    quantum = 1.0 if pixels.dtype.kind in "iub" else 0.0  # between the values that pixels can have
    return cells.mesh(x, y, level / how.gain, spread / how.noise_gain, quantum)


@frozen(eq=False)
class _Cells:
    """Tiles of the samples: the first row and column of each, and how many columns one has."""

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    wide: int

    @classmethod
    def of(cls, shape: tuple[int, ...], across: int, down: int) -> "_Cells":
        down, across = (max(1, min(n, m)) for n, m in zip((down, across), shape, strict=True))
        rows = np.linspace(0, shape[0], down + 1).round().astype(np.intp)
        columns = np.linspace(0, shape[1], across + 1).round().astype(np.intp)
        return cls(rows, columns, int(np.diff(columns).min()))

    def quartiles(self, samples: Array, level: Floats | None = None) -> tuple[Floats, Floats]:
        """Median and, from the lower quartile, RMS of every tile; stars are above the median.

        With the ``level`` of the tiles known, its slope within each is taken off first.
        """
        found = np.empty((3, len(self.rows) - 1, len(self.columns) - 1))
        slopes = None if level is None else [_slope(level, axis) for axis in (0, 1)]
        for r in range(found.shape[1]):
            band = samples[self.rows[r] : self.rows[r + 1]]
            tiles = np.stack([band[:, c : c + self.wide] for c in self.columns[:-1]])
            if slopes is not None:
                tall, wide = tiles.shape[1:]
                down = (np.arange(tall, dtype=np.float32) - (tall - 1) / 2) / np.float32(tall)
                right = (np.arange(wide, dtype=np.float32) - (wide - 1) / 2) / np.float32(wide)
                tiles = tiles.astype(np.float32)
                tiles -= slopes[0][r][:, None, None] * down[:, None]
                tiles -= slopes[1][r][:, None, None] * right
            tiles = tiles.reshape(found.shape[2], -1)
            tiles.sort(axis=1)  # what is not a number comes last
            n = tiles.shape[1]
            found[:, r] = tiles[:, [n // 4, n // 2, (3 * n) // 4]].T
            for k in np.flatnonzero(tiles[:, -1] != tiles[:, -1]):
                n = int(np.isfinite(tiles[k]).sum())
                found[:, r, k] = tiles[k, [n // 4, n // 2, (3 * n) // 4]]
        known = np.isfinite(found).all(axis=0)
        found[:, ~known] = median(found[1, known]) if known.any() else 0.0
        low, middle, high = found
        # Quantised dark frames may have low == median; only then is the upper quartile used.
        return middle, np.where(middle > low, middle - low, high - middle) / QUARTILE

    def mesh(self, x: Floats, y: Floats, level: Floats, noise: Floats, quantum: float) -> Mesh:
        """The mesh with a ring more of nodes half a tile outside, where slopes go on."""
        rows = 0.5 * (y[self.rows[:-1]] + y[self.rows[1:] - 1])
        columns = 0.5 * (x[self.columns[:-1]] + x[self.columns[:-1] + self.wide - 1])
        return Mesh(
            _with_margin(_median3(level)),
            np.pad(_median3(_with_floor(noise, quantum)), 1, mode="edge"),
            _with_margin(rows),
            _with_margin(columns),
        )


def _slope(level: Floats, axis: int) -> NDArray[np.float32]:
    """How much the level rises across each tile along an axis."""
    if level.shape[axis] < 2:
        return np.zeros(level.shape, dtype=np.float32)
    return np.asarray(np.gradient(level, axis=axis), dtype=np.float32)


def _with_margin(grid: Floats) -> Floats:
    """One more node on every side, half a step on along the slope there."""
    for axis in range(grid.ndim):
        g = np.moveaxis(grid, axis, 0)
        if len(g) > 1:
            ends = g[0] + 0.5 * (g[0] - g[1]), g[-1] + 0.5 * (g[-1] - g[-2])
        else:
            ends = (g[0] - (0.5 if g.ndim == 1 else 0.0), g[-1] + (0.5 if g.ndim == 1 else 0.0))
        grid = np.moveaxis(np.concatenate([ends[0][None], g, ends[1][None]]), 0, axis)
    return grid


def _sampled_rows(pixels: Array, smoother: Smoother, tops: NDArray[np.intp]) -> Array:
    """One smoothed row (T, W // 2 - 2) from the six rows below each of ``tops`` (T,).

    Not a number where any pixel that went in was none.
    """
    found = []
    for k in range(0, len(tops), 16):
        rows = smoother.blocks(pixels, tops[k : k + 16], 6)
        found.append(smoother(rows, (0, 0, 0))[::3].copy())
        if rows.dtype.kind == "f" and not (np.abs(rows) < BROKEN).all():
            broken = (~(np.abs(rows) < BROKEN)).astype(np.float32)
            found[-1][smoother(broken, (0, 0, 0))[::3] > 0] = np.nan
    return np.concatenate(found)


def _with_floor(noise: Floats, quantum: float) -> Floats:
    """No tile is much quieter than the frame, nor than rounding makes it; filled ones are usual."""
    usual = median(noise[noise > 0]) if (noise > 0).any() else 0.0
    least = max(0.3 * usual, 0.25 * quantum, 1e-30)
    return np.maximum(np.where(noise > 0, noise, max(usual, least) if quantum == 0 else 0.0), least)


def _median3(grid: Floats) -> Floats:
    """Median over each tile and its neighbours; slopes go on beyond the edges."""
    padded = grid
    for axis in (0, 1):
        width = [(1, 1) if k == axis else (0, 0) for k in (0, 1)]
        if grid.shape[axis] > 1:
            padded = np.pad(padded, width, mode="reflect", reflect_type="odd")
        else:
            padded = np.pad(padded, width, mode="edge")
    rows, columns = grid.shape
    nine = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return np.asarray(np.sort(np.stack(nine, axis=-1), axis=-1)[..., 4])


def _any_level(pixels: Array) -> float:
    """A finite level near the middle of the frame's values."""
    if pixels.dtype.kind != "f":
        return 0.0
    some = pixels[:: max(1, pixels.shape[0] // 64), :: max(1, pixels.shape[1] // 64)]
    some = some[np.abs(some) < BROKEN]
    return median(some) if some.size else 0.0
