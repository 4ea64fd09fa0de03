"""Background and noise over the frame, from a few rows of it.

Both are measured on the smoothed pixels that peaks are looked for in, so that the noise includes
what compression, demosaicing or nebulosity have correlated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.detect.strips import BROKEN, Halving, Pixels, Smoother

Floats = NDArray[np.float64]
QUARTILE = 0.6745  # of a unit normal


@dataclass(frozen=True, slots=True, eq=False)
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
        r, c = _between(y, self.rows), _between(x, self.columns)
        i, j = r.astype(np.intp), c.astype(np.intp)
        i1, j1 = np.minimum(i + 1, len(self.rows) - 1), np.minimum(j + 1, len(self.columns) - 1)
        u, v = r - i, c - j
        weights = ((1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v)
        corners = ((i, j), (i, j1), (i1, j), (i1, j1))
        level, noise = (
            sum(w * grid[at] for w, at in zip(weights, corners, strict=True))
            for grid in (self.level, self.noise)
        )
        return np.asarray(level), np.asarray(noise)


def measure_mesh(pixels: Pixels, how: Halving, step: float) -> Mesh:
    """The mesh of a frame (H, W), both at least 8; ``step`` is the quantum of its pixels or 0."""
    height, width = pixels.shape
    tile = 64 if pixels.size < 4_000_000 else 128
    every = 8 if pixels.size < 1_500_000 else tile // 4 if tile < 128 else tile // 2
    tops = np.arange(0, height - 5, every)
    samples = _sampled_rows(pixels, Smoother(how, _any_level(pixels)), tops)
    x = 2.0 * np.arange(samples.shape[1], dtype=np.float64) + 2.5  # of the samples, px
    y = tops.astype(np.float64) + 2.5
    cells = _Cells.of(samples.shape, round(width / tile), round(height / tile))
    level, spread = cells.quartiles(samples)
    steps = np.concatenate([np.abs(np.diff(level, axis=k)).ravel() for k in (0, 1)])
    if steps.size and np.percentile(steps, 90) > float(np.median(spread)):
        level, spread = cells.quartiles(samples, _median3(level))  # a slope would count as noise
    return cells.mesh(x, y, level / how.gain, spread / how.noise_gain, step)


@dataclass(frozen=True, slots=True, eq=False)
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

    def quartiles(self, samples: Pixels, level: Floats | None = None) -> tuple[Floats, Floats]:
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
        found[:, ~known] = np.median(found[1, known]) if known.any() else 0.0
        low, middle, high = found
        return middle, np.where(middle > low, middle - low, high - middle) / QUARTILE

    def mesh(self, x: Floats, y: Floats, level: Floats, noise: Floats, step: float) -> Mesh:
        """The mesh with a ring more of nodes half a tile outside, where slopes go on."""
        rows = 0.5 * (y[self.rows[:-1]] + y[self.rows[1:] - 1])
        columns = 0.5 * (x[self.columns[:-1]] + x[self.columns[:-1] + self.wide - 1])
        return Mesh(
            _ringed(_median3(level)), np.pad(_median3(_floored(noise, step)), 1, mode="edge"),
            _ringed(rows), _ringed(columns),
        )  # fmt: skip


def _slope(level: Floats, axis: int) -> NDArray[np.float32]:
    """How much the level rises across each tile along an axis."""
    if level.shape[axis] < 2:
        return np.zeros(level.shape, dtype=np.float32)
    return np.asarray(np.gradient(level, axis=axis), dtype=np.float32)


def _ringed(grid: Floats) -> Floats:
    """One more node on every side, half a step on along the slope there."""
    for axis in range(grid.ndim):
        g = np.moveaxis(grid, axis, 0)
        if len(g) > 1:
            ends = g[0] + 0.5 * (g[0] - g[1]), g[-1] + 0.5 * (g[-1] - g[-2])
        else:
            ends = (g[0] - (0.5 if g.ndim == 1 else 0.0), g[-1] + (0.5 if g.ndim == 1 else 0.0))
        grid = np.moveaxis(np.concatenate([ends[0][None], g, ends[1][None]]), 0, axis)
    return grid


def _sampled_rows(pixels: Pixels, smoother: Smoother, tops: NDArray[np.intp]) -> Pixels:
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


def _floored(noise: Floats, step: float) -> Floats:
    """No tile is much quieter than the frame, nor than rounding makes it; filled ones are usual."""
    usual = float(np.median(noise[noise > 0])) if (noise > 0).any() else 0.0
    least = max(0.3 * usual, 0.25 * step, 1e-30)
    return np.maximum(np.where(noise > 0, noise, max(usual, least) if step == 0 else 0.0), least)


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


def _any_level(pixels: Pixels) -> float:
    """A finite level near the middle of the frame's values."""
    if pixels.dtype.kind != "f":
        return 0.0
    some = pixels[:: max(1, pixels.shape[0] // 64), :: max(1, pixels.shape[1] // 64)]
    some = some[np.abs(some) < BROKEN]
    return float(np.median(some)) if some.size else 0.0


def _between(at: Floats, knots: Floats) -> Floats:
    """Fractional index of positions in ascending ``knots``, held inside their range."""
    return np.asarray(np.interp(at, knots, np.arange(len(knots))))
