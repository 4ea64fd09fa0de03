"""Background and noise over the frame, from a few rows of it.

Both are measured on the smoothed pixels that peaks are looked for in, so that the noise includes
what compression, demosaicing or nebulosity have correlated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.detect.strips import Halving, Pixels, Smoother

Floats = NDArray[np.float64]
QUARTILE = 0.6745  # of a unit normal


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Level and noise at tile centres, in units of one pixel of the frame.

    ``level`` and ``noise`` (R, C); ``rows`` (R,) and ``columns`` (C,) are the tile centres, px.
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
    tile = 64 if height * width < 4_000_000 else 128
    fill = _any_level(pixels)
    every = tile // (4 if tile < 128 else 2)
    tops = np.arange(0, height - 5, every)
    samples = _sampled_rows(pixels, Smoother(how, fill), tops)
    across, down = max(1, round(width / tile)), max(1, round(height / tile))
    columns = np.linspace(0, samples.shape[1], across + 1).round().astype(int)
    rows = np.linspace(0, len(samples), down + 1).round().astype(int)
    n = int(np.diff(columns).min())
    quartiles = np.empty((3, down, across))
    for r in range(down):
        band = samples[rows[r] : rows[r + 1]]
        cells = np.stack([band[:, c : c + n] for c in columns[:-1]]).reshape(across, -1)
        cells.sort(axis=1)
        k = cells.shape[1]
        quartiles[:, r] = cells[:, [k // 4, k // 2, (3 * k) // 4]].T
    low, middle, high = quartiles
    spread = np.where(middle > low, middle - low, high - middle) / QUARTILE
    noise = _floored(spread / how.noise_gain, step)
    return Mesh(
        _median3(middle / how.gain),
        _median3(noise),
        tops[0] + 2.5 + every * ((rows[:-1] + rows[1:] - 1) / 2),
        columns[:-1] * 2.0 + n + 1.5,
    )


def _sampled_rows(pixels: Pixels, smoother: Smoother, tops: NDArray[np.intp]) -> Pixels:
    """One smoothed row (T, W // 2 - 2) from the six rows below each of ``tops`` (T,)."""
    found = []
    for k in range(0, len(tops), 16):
        rows = (tops[k : k + 16, None] + np.arange(6)).ravel()
        found.append(smoother(pixels[rows], (0, 0, 0))[::3].copy())
    return np.concatenate(found)


def _floored(noise: Floats, step: float) -> Floats:
    """No tile is much quieter than the frame, nor than rounding makes it."""
    return np.maximum(noise, max(0.3 * float(np.median(noise)), 0.25 * step, 1e-30))


def _median3(grid: Floats) -> Floats:
    """Median over each tile and its neighbours, edges repeated."""
    padded = np.pad(grid, 1, mode="edge")
    views = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return np.asarray(np.median(views, axis=(2, 3)))


def _any_level(pixels: Pixels) -> float:
    """A finite level near the middle of the frame's values."""
    if pixels.dtype.kind != "f":
        return 0.0
    some = pixels[:: max(1, pixels.shape[0] // 64), :: max(1, pixels.shape[1] // 64)]
    some = some[np.isfinite(some) & (np.abs(some) < 1e30)]
    return float(np.median(some)) if some.size else 0.0


def _between(at: Floats, knots: Floats) -> Floats:
    """Fractional index of positions in ascending ``knots``, held inside their range."""
    return np.asarray(np.interp(at, knots, np.arange(len(knots))))
