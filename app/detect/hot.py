"""Hot pixels: telling them from stars, and looking behind them.

A star image explains a star better than any single pixel does: seen through the star image its
significance exceeds that of its brightest pixel. For a hot pixel it is the other way about, by
the same factor, so that comparing the two is the test of likelihoods.
"""

import numpy as np
from numpy.typing import NDArray

from app.detect.fit import fit_stars
from app.detect.image import is_round
from app.detect.mesh import Mesh
from app.detect.stamps import Stamps, cut
from app.detect.strips import Halving, Pixels
from app.detect.weed import close_pairs

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
REACH = 5  # px: how far a hot pixel may hide a star's peak from the smoothed frame


def sort_out(
    pixels: Pixels, how: Halving, mesh: Mesh, xy: Floats, covariance: Floats, snr: float
) -> tuple[Bools, Floats]:
    """A quick look at 5 x 5 pixels: which peaks (N, 2) may be stars, and where pixels are hot.

    Returns a mask (N,) and the hot pixels (M, 2), px.
    """
    level, noise = mesh.at(xy[:, 0], xy[:, 1])
    stamps = cut(pixels, how, xy, level, 2)
    image = covariance if is_round(covariance) else np.eye(2) * np.sqrt(np.linalg.det(covariance))
    fit = fit_stars(stamps, image, 2)
    flat = stamps.value.reshape(len(xy), -1)
    at = flat.argmax(axis=1)
    peak = np.take_along_axis(flat, at[:, None], axis=1)[:, 0]
    single = fit.snr < 0.8 * peak
    hot = np.flatnonzero(single & (peak > 3.0 * noise))
    places = np.stack([stamps.x[hot] + at[hot] % 5 - 2, stamps.y[hot] + at[hot] // 5 - 2], axis=1)
    return (fit.snr > 0.4 * snr * noise) & ~single, places.astype(np.float64)


def behind(pixels: Pixels, how: Halving, mesh: Mesh, hot: Floats, snr: float) -> Floats:
    """Peaks (K, 2) px of 3 x 3 pixels around hot ones (M, 2) when those are left out."""
    if not len(hot):
        return np.empty((0, 2))
    level, noise = mesh.at(hot[:, 0], hot[:, 1])
    stamps = cut(pixels, how, hot, level, REACH)
    leave_out(stamps, hot)
    rows = stamps.value[:, :-2] + stamps.value[:, 1:-1] + stamps.value[:, 2:]
    boxes = rows[:, :, :-2] + rows[:, :, 1:-1] + rows[:, :, 2:]
    side = boxes.shape[1]
    flat = boxes.reshape(len(hot), -1)
    at = flat.argmax(axis=1)
    high = np.take_along_axis(flat, at[:, None], axis=1)[:, 0] > 3.0 * snr * noise
    offset = np.stack([at % side, at // side], axis=1) - side // 2
    return np.asarray((hot + offset)[high])


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
