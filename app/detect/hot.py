"""Hot pixels: telling them from stars, and looking behind them.

A star image explains a star better than any single pixel does: seen through the star image its
significance exceeds that of its brightest pixel. For a hot pixel it is the other way about, by
the same factor, so that comparing the two is the test of likelihoods.
"""

import numpy as np
from numpy.typing import NDArray

from app.detect.fit import fit_stars
from app.detect.view import View

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
REACH = 5  # px: how far a hot pixel may hide a star's peak from the smoothed frame
# px^2: a sharp star; wider ones are even less like a single pixel. Seen through it a single pixel
# has 0.57 of its own significance, and 0.81 among half the pixels; a star of FWHM 1.2 px has 0.98.
QUICK = np.eye(2) * 0.9**2


def quick_look(view: View, xy: Floats, snr: float) -> tuple[Bools, Floats]:
    """Look at the 5 x 5 pixels of peaks (N, 2): which may be stars, and where pixels are hot.

    Returns a mask (N,) and the hot pixels (M, 2), px.
    """
    stamps, _, noise = view.stamps(xy, 2)
    fit = fit_stars(stamps, QUICK, 1)
    flat = stamps.value.reshape(len(xy), -1)
    at = flat.argmax(axis=1)
    peak = np.take_along_axis(flat, at[:, None], axis=1)[:, 0]
    single = fit.snr < (0.8 if view.how.greens is None else 0.92) * peak
    hot = np.flatnonzero(single & (peak > 3.0 * noise))
    places = np.stack([stamps.x[hot] + at[hot] % 5 - 2, stamps.y[hot] + at[hot] // 5 - 2], axis=1)
    return (fit.snr > 0.4 * snr * noise) & ~single, places.astype(np.float64)


def behind(view: View, snr: float) -> Floats:
    """Peaks (K, 2) px of 3 x 3 pixels around the view's hot ones, which are left out."""
    if not len(view.hot):
        return np.empty((0, 2))
    stamps, _, noise = view.stamps(view.hot, REACH)
    rows = stamps.value[:, :-2] + stamps.value[:, 1:-1] + stamps.value[:, 2:]
    boxes = rows[:, :, :-2] + rows[:, :, 1:-1] + rows[:, :, 2:]
    side = boxes.shape[1]
    flat = boxes.reshape(len(boxes), -1)
    at = flat.argmax(axis=1)
    high = np.take_along_axis(flat, at[:, None], axis=1)[:, 0] > 3.0 * snr * noise
    offset = np.stack([at % side, at // side], axis=1) - side // 2
    return np.asarray((view.hot + offset)[high])
