"""Local maxima of the smoothed frame above the mesh, strip by strip."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from app.detect.mesh import Mesh
from app.detect.strips import Halving, Pixels, as_summable, smooth

Floats = NDArray[np.float64]
STRIP = 64  # rows of the frame; what a strip needs fits the cache


def find_peaks(
    pixels: Pixels, how: Halving, mesh: Mesh, sigmas: float, limit: int, threads: int = 1
) -> tuple[Floats, Floats]:
    """Positions (N, 2) px and heights (N,) in noise of maxima above ``sigmas``, highest first.

    At most ``limit`` are returned; a position is the middle of 2 x 2 pixels.
    """
    height = pixels.shape[0] // 2 * 2
    tops = range(0, height, STRIP)

    def strip(top: int) -> tuple[Floats, Floats]:
        return _strip_peaks(pixels[:height], how, mesh, sigmas, top)

    if threads > 1 and len(tops) > 8:
        with ThreadPoolExecutor(threads) as pool:
            found = list(pool.map(strip, tops))
    else:
        found = [strip(top) for top in tops]
    xy = np.concatenate([f[0] for f in found])
    heights = np.concatenate([f[1] for f in found])
    order = np.argsort(-heights, kind="stable")[:limit]
    return xy[order], heights[order]


def _strip_peaks(
    pixels: Pixels, how: Halving, mesh: Mesh, sigmas: float, top: int
) -> tuple[Floats, Floats]:
    """Peaks whose rows begin at ``top``; two halved rows of each neighbour are looked at too."""
    height = pixels.shape[0]
    first, last = max(0, top - 4), min(height, top + STRIP + 4)
    sums = how.sums(as_summable(pixels[first:last], float(mesh.level.mean())))
    above, below = top - first == 0, last == top + STRIP or last == height
    sums = np.pad(sums, ((2 if above else 0, 2 if below else 0), (2, 2)), mode="edge")
    field = smooth(sums)  # one halved row and column more than the strip on every side
    columns = 2.0 * np.arange(field.shape[1]) - 1.5
    rise = sigmas * how.noise_gain / how.gain
    ends = [mesh.line(float(y), rise, columns) for y in (top, (top + last) / 2, last)]
    floor = np.minimum(np.minimum(*ends[:2]), ends[2]) * how.gain
    hit = _where(field, _as_threshold(floor, field))
    y, x = np.divmod(hit, field.shape[1])
    inside = (y > 0) & (y < field.shape[0] - 1) & (x > 0) & (x < field.shape[1] - 1)
    inside &= y <= STRIP // 2
    hit, y, x = hit[inside], y[inside], x[inside]
    keep = _is_maximum(field, hit)
    hit, y, x = hit[keep], y[keep], x[keep]
    xy = np.stack([2.0 * x - 1.5, top + 2.0 * y - 1.5], axis=1)
    level, noise = mesh.at(xy[:, 0], xy[:, 1])
    heights = (field.ravel()[hit] / how.gain - level) / (noise * (how.noise_gain / how.gain))
    keep = heights > sigmas
    return xy[keep], heights[keep]


def _where(field: Pixels, floor: Pixels) -> NDArray[np.intp]:
    """Flat indices above ``floor``, looking at eight at a time because few are."""
    above = (field > floor).ravel()
    whole = len(above) // 8 * 8
    words = np.flatnonzero(above[:whole].view(np.uint64))
    near = (words[:, None] * 8 + np.arange(8)).ravel()
    near = np.concatenate([near, np.arange(whole, len(above))])
    return near[above[near]]


def _is_maximum(field: Pixels, hit: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether each is above its eight neighbours; of equals the first counts."""
    flat, row = field.ravel(), field.shape[1]
    value = flat[hit]
    keep = np.ones(len(hit), dtype=np.bool_)
    for step in (1, row - 1, row, row + 1):
        keep &= (value > flat[hit - step]) & (value >= flat[hit + step])
    return keep


def _as_threshold(floor: Floats, field: Pixels) -> Pixels:
    """``floor`` in the dtype of ``field``, so that comparing does not convert every pixel."""
    if field.dtype.kind == "f":
        return floor.astype(field.dtype)
    top = np.iinfo(field.dtype).max
    return np.clip(np.floor(floor), 0, top).astype(field.dtype)
