"""Sky brightness, trails and focus of a frame that did not solve."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats
from kochab.core.frame import Detections, Frame

SIDE_PX = 1200
"""Frames are binned to about this many pixels a side before shapes are looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class Bins:
    """A frame made small: ``image`` (H, W), finite, the mean of ``step`` by ``step`` pixels."""

    image: Floats
    step: int


@dataclass(frozen=True, slots=True)
class FrameLevels:
    """Levels of a frame: ``background_share`` and ``saturated_share`` are fractions of 1.

    ``background_share`` is the median level over the clipping level. ``contrast`` is how far the
    brightest thousandth stands above the median, in units of the noise; 0 in an empty frame.
    ``glare_share`` is the part of the frame that the largest bright patch covers, and
    ``glare_aspect`` that patch's length over its width.
    """

    background_share: float
    saturated_share: float
    contrast: float
    glare_share: float
    glare_aspect: float


@dataclass(frozen=True, slots=True)
class Trails:
    """Shapes of the bright patches: ``aspect`` is length over width, 1 when round.

    ``length_px`` is the median length; ``angle_deg`` its direction from +x towards +y in
    [0, 180), NaN when the patches do not agree on one; ``count`` of patches looked at.
    """

    length_px: float = 0.0
    aspect: float = 1.0
    angle_deg: float = float("nan")
    count: int = 0


def binned(frame: Frame) -> Bins:
    """The frame in bins, about SIDE_PX a side, whole colour cells of a mosaic together."""
    step = max(1, round(max(frame.width, frame.height) / SIDE_PX))
    if frame.bayer:
        step = max(2, step + step % 2)
    step = min(step, frame.width, frame.height)
    h, w = frame.height // step, frame.width // step
    rows = np.zeros((h, w * step), dtype=np.float32)
    for i in range(step):  # row by row: no second copy of a large frame
        rows += frame.pixels[i : h * step : step, : w * step]
    small = rows.reshape(h, w, step).sum(axis=2, dtype=np.float64) / step**2
    return Bins(np.nan_to_num(small, nan=0.0, posinf=0.0, neginf=0.0), step)


def measure_light(frame: Frame, bins: Bins) -> FrameLevels:
    """Levels of the frame, whose bins are given."""
    small = bins.image
    median, noise = _level(small)
    top = float(np.quantile(small, 0.999))
    whole = frame.pixels.dtype.kind in "iu"
    clip = frame.saturation or float(np.iinfo(frame.pixels.dtype).max if whole else np.nanmax(frame.pixels))
    saturated = float(np.mean(frame.pixels[::3, ::3] >= clip))
    contrast = (top - median) / noise if noise > 0 else 0.0
    share = median / clip if clip > 0 else 0.0
    return FrameLevels(float(np.clip(share, 0, 1)), saturated, contrast, *_glare(small, clip))


def measure_trails(bins: Bins) -> Trails:
    """Shapes of whatever stands out of the background, vast patches left out."""
    from scipy import ndimage

    small, step = bins.image, bins.step
    small = small - ndimage.uniform_filter(small, max(31, min(small.shape) // 12))
    median, noise = _level(small)
    if noise <= 0:
        return Trails()
    # Where trails fill the frame they are the noise: then the brightest pixels must serve.
    limit = min(median + 5.0 * noise, float(np.quantile(small, 0.985)))
    limit = max(limit, median + 2.0 * noise)
    labels, count = ndimage.label(small > limit, np.ones((3, 3)))
    major, minor, angle, area = _moments(labels, count)
    fair = (area >= 6) & (area < 0.03 * small.size)
    chosen = np.flatnonzero(fair)[np.argsort(-area[fair])[:60]]
    if len(chosen) == 0:
        return Trails()
    length = np.sqrt(12.0 * major[chosen]) * step
    aspect = np.sqrt(major[chosen] / minor[chosen])
    direction = np.mean(np.exp(2j * angle[chosen]))
    agreed = abs(direction) > 0.6
    shown = float(np.degrees(np.angle(direction)) / 2 % 180.0) if agreed else float("nan")
    return Trails(float(np.median(length)), float(np.median(aspect)), shown, len(chosen))


def half_flux_diameter_px(frame: Frame, detections: Detections) -> float:
    """Median over the brightest unsaturated stars of ``2 sum(f r) / sum(f)``, px; NaN without."""
    good = np.flatnonzero(~detections.saturated & ~detections.blended)[:15]
    reach = [4 if not np.isfinite(w) else int(np.clip(2.5 * w, 4, 30)) for w in detections.fwhm_px]
    values = [_hfd(frame, detections.xy[i], reach[i]) for i in good]
    finite = [v for v in values if np.isfinite(v)]
    return float(np.median(finite)) if finite else float("nan")


def _hfd(frame: Frame, xy: Floats, reach: int) -> float:
    x, y = (round(float(c)) for c in xy)
    if not (reach <= x < frame.width - reach and reach <= y < frame.height - reach):
        return float("nan")
    stamp = frame.pixels[y - reach : y + reach + 1, x - reach : x + reach + 1].astype(np.float64)
    rim = np.concatenate([stamp[0], stamp[-1], stamp[:, 0], stamp[:, -1]])
    light = np.clip(stamp - np.median(rim) - 2.0 * np.std(rim), 0.0, None)
    total = light.sum()
    if not total > 0:
        return float("nan")
    axis = np.arange(-reach, reach + 1)
    radius = np.hypot(axis[None, :] + x - xy[0], axis[:, None] + y - xy[1])
    return float(2.0 * (light * radius).sum() / total)


def _level(image: Floats) -> tuple[float, float]:
    """Median and noise; the noise of a quantised dark frame is at least its least step."""
    sample = image[::2, ::2]
    median = float(np.median(sample))
    noise = 1.4826 * float(np.median(np.abs(sample - median)))
    if noise == 0.0:
        noise = 0.2 * float(np.std(sample))
    return median, noise


def _glare(small: Floats, clip: float) -> tuple[float, float]:
    """Share of the frame in its largest patch brighter than half the clip, and its aspect."""
    from scipy import ndimage

    labels, count = ndimage.label(small > 0.5 * clip)
    if count == 0:
        return 0.0, 1.0
    major, minor, _, area = _moments(labels, count)
    largest = int(np.argmax(area))
    return float(area[largest] / small.size), float(np.sqrt(major[largest] / minor[largest]))


def _moments(labels: NDArray[np.integer], count: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Variances along and across, direction (rad) and area of each labelled patch, bins."""
    y, x = np.nonzero(labels)
    which = labels[y, x] - 1
    area = np.bincount(which, minlength=count).astype(np.float64)

    def mean(values: NDArray[np.float64]) -> Floats:
        return np.asarray(np.bincount(which, values, count) / area)

    dx, dy = x - mean(x.astype(float))[which], y - mean(y.astype(float))[which]
    xx, yy, xy = mean(dx * dx) + 1 / 12, mean(dy * dy) + 1 / 12, mean(dx * dy)
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    return middle + half, np.maximum(middle - half, 1 / 12), angle, area
