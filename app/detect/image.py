"""What a star looks like in this frame: its size and shape, and where pixels clip."""

import numpy as np
from numpy.typing import NDArray

from app.detect.moments import PIXEL_VARIANCE, adaptive_moments, principal_axes
from app.detect.stamps import cut
from app.detect.view import View

Floats = NDArray[np.float64]
TYPICAL = np.eye(2) * 1.2**2  # px^2: a FWHM of 2.8 px, when the frame does not tell
SHARPEST = 0.6  # px: a narrower star image is not told from a hot pixel
ENOUGH = 50  # stars tell how wide they are
ROUND = 1.4  # the elongation up to which stars are fitted as round


def clip_level(view: View, xy: Floats, told: float | None) -> float:
    """The level at which pixels count as saturated, guessed from flat tops when not ``told``."""
    if told is not None and np.isfinite(told):
        return 0.98 * float(told)
    values = cut(view.pixels, view.how, xy[:300], np.zeros(min(len(xy), 300)), 2).value
    top = float(values.max(initial=0.0))
    flat = (values >= 0.98 * top).sum(axis=(1, 2)) >= 5
    return 0.98 * top if flat.any() else float(np.inf)


def star_image(view: View, xy: Floats, clip: float) -> tuple[Floats, bool]:
    """Second moments (2, 2), px^2, of the frame's stars, from the brightest of ``xy`` (N, 2) px.

    Also whether most of them are well inside a few pixels. When not, stars are large or trailed,
    or are not stars.
    """
    stamps, level, _ = view.stamps(xy[:1000], 1)
    xy = xy[:1000][stamps.value.max(axis=(1, 2), initial=0.0) + level < clip][:ENOUGH]
    if len(xy) < 3:
        return TYPICAL, True
    found, settled = _usual_moments(view, xy, 8)
    if settled < 0.5:  # large stars, or lines and edges instead of stars
        larger, of_larger = _usual_moments(view, xy, 20)
        if of_larger >= 0.5 or of_larger > 2.0 * settled:
            found = larger
    return TYPICAL if found is None else _held(found), settled >= 0.5


def unweighted(moments: Floats, covariance: Floats) -> Floats:
    """Second moments (N, 3) of the light itself from those weighted by the star image.

    Through a Gaussian weight W a Gaussian of moments C has M = (C^-1 + W^-1)^-1.
    """
    weight = np.linalg.inv(covariance + PIXEL_VARIANCE * np.eye(2))
    m = np.empty((len(moments), 2, 2))
    m[:, 0, 0], m[:, 1, 1] = np.maximum(moments[:, 0], 0.02), np.maximum(moments[:, 1], 0.02)
    most = 0.98 * np.sqrt(m[:, 0, 0] * m[:, 1, 1])
    m[:, 0, 1] = m[:, 1, 0] = np.clip(moments[:, 2], -most, most)
    values, vectors = np.linalg.eigh(np.linalg.inv(m) - weight)
    values = 1.0 / np.maximum(values, 1.0 / (100.0 * covariance.trace()))
    full = (vectors * values[:, None, :]) @ vectors.transpose(0, 2, 1)
    return np.stack([full[:, 0, 0], full[:, 1, 1], full[:, 0, 1]], axis=1)


def _usual_moments(view: View, xy: Floats, half: int) -> tuple[Floats | None, float]:
    """Medians of the moments over those stars whose size is usual, and the share that settled.

    A weight that has grown to fill the stamp has not found a star's edge. None when fewer than
    three settle.
    """
    stamps, _, _ = view.stamps(xy, half)
    least = 0.2 if view.how.greens is None else 0.8  # among greens a weight must hold several
    shapes = adaptive_moments(stamps, 1.5, 5 if half < 12 else 12, least)
    good = shapes.good & (np.hypot(shapes.dx, shapes.dy) < 0.3 * half)
    good &= shapes.axes()[0] < 0.6 * half
    if good.sum() < 3:
        return None, 0.0
    area = np.sqrt(np.maximum(shapes.xx * shapes.yy - shapes.xy**2, 1e-6))
    usual = np.percentile(area[good], 40)
    near = good & (area > usual / 1.6) & (area < usual * 1.6)
    xx, yy, xy_ = (float(np.median(m[near])) for m in (shapes.xx, shapes.yy, shapes.xy))
    return np.array([[xx, xy_], [xy_, yy]]), float(good.mean())


def _held(found: Floats) -> Floats:
    """Round when nearly so, never sharper than can be told, and without the pixel's own width."""
    major, minor, _ = principal_axes(found[:1, 0], found[1:, 1], found[:1, 1])
    if major[0] < ROUND * minor[0]:
        found = np.eye(2) * float(major[0] * minor[0])
    scale = max(1.0, (SHARPEST**2 + PIXEL_VARIANCE) / float(minor[0] ** 2))
    return np.asarray(scale * found - PIXEL_VARIANCE * np.eye(2))
