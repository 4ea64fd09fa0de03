"""Light where stars are expected: pixels are read there alone (predictive centroiding).

A window around each expected place, its own background and noise, the highest smoothed peak in it,
and there a fit of the star image as the default detector makes it. What a window holds is the
brightest thing in it, whether or not it is the star; that is for whoever asks to say.
"""

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Bools, Floats
from kochab.core.frame import Frame
from kochab.core.robust import median
from kochab.core.values import frozen
from kochab.detection.background import Halving, halving
from kochab.detection.peaks import Stamps, close_pairs, cut
from kochab.detection.star_fit import PIXEL_VARIANCE, adaptive_moments, fit_stars, refit_bright, unweighted

SNR = 5.0
FLOOR_PX = 0.03
SATURATED_PX = 0.4
SHAPED, FEWEST_SHAPED = 12, 4  # finds that tell the star image
LONGEST_PX = 7.0  # RMS along a trail of 24 px
UNLIKE = 1.8  # ratio of the largest second moments from which an image is another one


@frozen(eq=False)
class WindowStars:
    """What W windows hold: ``xy`` (W, 2) px, ``sigma_px`` (W,) a coordinate, ``snr`` (W,).

    ``found`` (W,) says whether there is anything that looks like a star. ``moments`` (3,) are xx,
    yy, xy, px^2, of the usual star here, NaN when too few were found.
    """

    xy: Floats
    sigma_px: Floats
    snr: Floats
    found: Bools
    moments: Floats


def look(
    frame: Frame, places: Floats, half: int, covariance: Floats, *, adapt: bool = False, sharp: bool = False
) -> WindowStars:
    """Look for stars in windows of ``2 half + 1`` px a side.

    Parameters
    ----------
    frame : Frame
        Its pixels.
    places : Floats
        Where the windows are centred (W, 2), px.
    half : int
        Their half size, px.
    covariance : Floats
        Second moments (2, 2) px^2 of the star image.
    adapt : bool
        Whether the star image is measured first, which costs a third more.
    sharp : bool
        Stars are single pixels; else such are held for hot ones.
    """
    count = len(places)
    if count == 0:
        none = np.zeros(0)
        return WindowStars(places, none, none, np.zeros(0, dtype=np.bool_), np.full(3, np.nan))
    how = halving(frame.bayer)
    wide = cut(frame.pixels, how, places, np.zeros(count), half)
    level, noise = _background(wide)
    peak, height = _peaks(wide, level, noise)
    smeared = False
    if adapt:
        covariance, smeared = _image_here(frame, how, peak, level, height / noise, covariance)
    major = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    near = int(np.clip(np.ceil(2.5 * major) + 1, 4, 16))
    stamps = cut(frame.pixels, how, peak, level, near)
    if smeared:  # the highest pixel of a trail may be anywhere along it
        middle = adaptive_moments(stamps, major, 6)
        moved = np.stack([middle.dx, middle.dy], axis=1) * middle.good[:, None]
        peak = peak + moved
        stamps = cut(frame.pixels, how, peak, level, near)
    fit = fit_stars(stamps, covariance)
    refit_bright(stamps, fit, covariance, np.maximum(level, 10.0 * noise))
    xy = np.stack([stamps.x + fit.dx, stamps.y + fit.dy], axis=1)
    snr = fit.snr / noise
    top = stamps.core(1).max(axis=(1, 2))
    found = (snr > SNR) & (sharp | (snr > top / noise)) & (np.hypot(*(xy - peak).T) < max(2.0, 1.5 * major))
    found &= major < LONGEST_PX  # the middle of a trail that leaves its window is not known
    found &= np.all(np.abs(xy - places) <= half, axis=1) & _first_of_close(xy, max(1.5, major))
    sigma = np.hypot(FLOOR_PX, 1.2 * major / np.maximum(snr, 1.0))
    if frame.saturation is not None:
        clipped = top + level >= 0.98 * frame.saturation
        sigma = np.where(clipped, np.maximum(sigma, SATURATED_PX), sigma)
    shapes = fit.moments[found & (snr > 15)]
    moments = [median(m) for m in unweighted(shapes, covariance).T] if len(shapes) >= 3 else [np.nan] * 3
    return WindowStars(xy, sigma, snr, found, np.asarray(moments))


def _background(windows: Stamps) -> tuple[Floats, Floats]:
    """Median and RMS (W,) of each window; stars are above the median."""
    values = np.where(windows.weight > 0, windows.value, np.nan).reshape(len(windows.value), -1)
    values.sort(axis=1)  # what has no weight comes last
    n = np.maximum(np.isfinite(values).sum(axis=1), 1)
    row = np.arange(len(values))
    low, middle = values[row, n // 4], values[row, n // 2]
    level = np.nan_to_num(middle).astype(np.float64)
    noise = np.nan_to_num(middle - low).astype(np.float64) / 0.6745
    usual = median(noise)
    return level, np.maximum(noise, max(0.3 * usual, 0.3))


def _image_here(
    frame: Frame, how: Halving, peak: Floats, level: Floats, height: Floats, expected: Floats
) -> tuple[Floats, bool]:
    """The star image (2, 2) of this frame, and whether it is not as ``expected``.

    It is taken from the brightest finds: a mount that begins to move smears all stars alike.
    """
    bright = np.argsort(-height, kind="stable")[:SHAPED]
    bright = bright[height[bright] > 10.0]
    if len(bright) < FEWEST_SHAPED:
        return expected, False
    stamps = cut(frame.pixels, how, peak[bright], level[bright], 12)
    shapes = adaptive_moments(stamps, float(np.sqrt(np.trace(expected) / 2.0)), 8)
    if shapes.good.sum() < FEWEST_SHAPED:
        return expected, False
    xx, yy, xy = (median(m[shapes.good]) for m in (shapes.xx, shapes.yy, shapes.xy))
    found = np.array([[xx, xy], [xy, yy]]) - PIXEL_VARIANCE * np.eye(2)
    ratio = np.linalg.eigvalsh(found)[-1] / np.linalg.eigvalsh(expected)[-1]
    if found[0, 0] <= 0.2 or found[1, 1] <= 0.2 or 1.0 / UNLIKE < ratio < UNLIKE:
        return expected, False
    return found, True


def _peaks(windows: Stamps, level: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """Place (W, 2) px and height (W,) of the highest pixel of each window, smoothed 3 x 3."""
    value = (windows.value - level[:, None, None].astype(np.float32)) * windows.weight
    light, share = _smoothed(value), _smoothed(windows.weight)
    # over the root of the share the noise is about the same where pixels are missing
    light = np.where(share > 0.3, light / np.sqrt(np.maximum(share, 1e-6)), -np.inf)
    flat = light.reshape(len(light), -1)
    at = flat.argmax(axis=1)
    height = flat[np.arange(len(flat)), at].astype(np.float64)
    half, side = windows.value.shape[1] // 2, light.shape[2]
    x, y = at % side + 1 - half, at // side + 1 - half
    return np.stack([windows.x + x, windows.y + y], axis=1).astype(np.float64), height


def _smoothed(value: NDArray[np.float32]) -> NDArray[np.float32]:
    """Binomial means of 3 x 3 pixels (W, K - 2, K - 2)."""
    lines = 0.25 * (value[:, :-2] + value[:, 2:]) + 0.5 * value[:, 1:-1]
    return np.asarray(0.25 * (lines[:, :, :-2] + lines[:, :, 2:]) + 0.5 * lines[:, :, 1:-1])


def _first_of_close(xy: Floats, distance_px: float) -> Bools:
    """Which places no earlier one is as near to: one star is one witness, however many look."""
    first = np.ones(len(xy), dtype=np.bool_)
    first[close_pairs(xy, distance_px)[1]] = False
    return first
