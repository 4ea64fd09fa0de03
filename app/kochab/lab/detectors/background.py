"""What the published detectors share: background subtraction and the measuring of stars.

The background is one number, the median, as in "Lost in space" for robotic telescopes (thesis,
2018), section 5.1.1. A sky with a slope needs the ``auto`` detector.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Floats32
from kochab.core.frame import Detections, Frame
from kochab.core.robust import mad_sigma, median
from kochab.core.values import frozen
from kochab.detection.background import BROKEN, Halving
from kochab.detection.peaks import Stamps, apart, cut
from kochab.detection.star_fit import FWHM_PER_SIGMA, PIXEL_VARIANCE, adaptive_moments

MIN_SIDE = 8  # px; smaller frames hold no star with a background around it
SAMPLES = 1_000_000  # pixels that are sorted for a median
HALF = 7  # px; of the stamp on which a star's width is measured
BATCH = 2000


@frozen(eq=False)
class Flat:
    """``image`` (H, W) above the median ``level``; 0 where ``broken`` (H, W) is set.

    ``spread`` is the standard deviation of all pixels, stars included; ``noise`` that of the
    background alone, from the median absolute deviation.
    """

    frame: Frame
    image: Floats32
    broken: NDArray[np.bool_]
    level: float
    spread: float
    noise: float

    def threshold(self, sigmas: float, clipped: bool) -> float:
        """``sigmas`` times the noise when ``clipped``, else times the spread of all pixels."""
        return sigmas * (self.noise if clipped else self.spread)

    def stamps(self, xy: Floats, half: int) -> Stamps:
        """Squares of ``2 half + 1`` pixels a side around places (N, 2) px."""
        stamps = cut(self.image, Halving(), xy, np.zeros(len(xy)), half)
        if self.broken.any():
            stamps.weight[:] *= cut(~self.broken, Halving(), xy, np.zeros(len(xy)), half).value
        return stamps


def without_background(frame: Frame) -> Flat | None:
    """The frame less its median; None when it is too small or all pixels are alike.

    Of a mosaic each of the four colours of a cell loses its own median; the chequers that are
    left in a star are not smoothed. What is not a number counts as background.
    """
    if frame.pixels.ndim != 2 or min(frame.pixels.shape) < MIN_SIDE:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        image = frame.pixels.astype(np.float32)
        broken = ~(np.abs(image) < BROKEN)
    if broken.all():
        return None
    levels, noises = [], []
    step = 1 if frame.bayer is None else 2
    for phase in np.ndindex(step, step):
        part = tuple(slice(first, None, step) for first in phase)
        # Of large frames every n-th row and column: about a million pixels do for a median.
        every = max(1, int(np.ceil(np.sqrt(image[part].size / SAMPLES))))
        good = image[part][::every, ::every][~broken[part][::every, ::every]]
        # A thinned sample may hold nothing but broken pixels; then all good ones are taken.
        good = good if len(good) else image[part][~broken[part]]
        level = median(good) if len(good) else 0.0
        image[part] -= np.float32(level)
        levels.append(level)
        noises.append(mad_sigma(good, level) if len(good) else 0.0)
    image[broken] = 0.0
    # Broken pixels are 0 here and would lower it; dividing by the root of the good share undoes that.
    spread = float(np.std(image, dtype=np.float64) / np.sqrt(np.mean(~broken)))
    if not spread > 0:
        return None
    noise = float(np.median(noises))
    return Flat(frame, image, broken, float(np.median(levels)), spread, noise or spread)


def no_detections(frame: Frame, flat: Flat | None = None) -> Detections:
    """No stars, with the background when it could be measured."""
    empty = Detections.from_list(np.empty((0, 2)), frame.width, frame.height)
    return empty if flat is None else replace(empty, background=flat.level, noise=flat.noise)


def box_light(flat: Flat, xy: Floats, half: int) -> tuple[Floats, Floats]:
    """Light (N,) in a box of ``2 half + 1`` px around places (N, 2), and its pixels (N,)."""
    light, pixels = np.empty(len(xy)), np.empty(len(xy))
    for k in range(0, len(xy), BATCH):
        stamps = flat.stamps(xy[k : k + BATCH], half)
        light[k : k + BATCH] = stamps.value.sum(axis=(1, 2))
        pixels[k : k + BATCH] = stamps.weight.sum(axis=(1, 2))
    return light, pixels


def separated_stars(flat: Flat, xy: Floats, half: int, reach_px: float) -> tuple[Floats, Floats, Floats]:
    """Places (N, 2), brightest first, without those near a brighter one; light and pixels in boxes (N,).

    Parameters
    ----------
    flat : Flat
        The frame without its background.
    xy : Floats
        Places (M, 2), px.
    half : int
        A box has ``2 half + 1`` pixels a side.
    reach_px : float
        How near is too near.
    """
    flux, pixels = box_light(flat, xy, half)
    order = np.argsort(-flux, kind="stable")
    order = order[apart(xy[order], np.full(len(order), reach_px))]
    return xy[order], flux[order], pixels[order]


def measured_detections(
    flat: Flat, xy: Floats, flux: Floats, pixels: Floats, most: int, rank: Floats | None = None
) -> Detections:
    """Detections of stars at given places.

    The SNR is against the background's noise alone; widths and shapes are NaN where a star is too faint or too odd for
    them, and in mosaics.

    Parameters
    ----------
    flat : Flat
        The frame without its background.
    xy : Floats
        Places (N, 2), px.
    flux : Floats
        Light (N,).
    pixels : Floats
        How many pixels (N,) that is of.
    most : int
        How many are kept, the first by ``rank``.
    rank : Floats or None
        Falling order (N,) of the result; None: by flux.
    """
    good = np.isfinite(xy).all(axis=1) & (flux > 0)
    good &= (xy > -0.5).all(axis=1) & (xy < np.array(flat.image.shape[::-1]) - 0.5).all(axis=1)
    keys = (flux,) if rank is None else (flux, rank)
    order = np.lexsort(tuple(-key for key in keys))
    order = order[good[order]][:most]
    if not len(order):
        return no_detections(flat.frame, flat)
    found = Detections.from_list(xy[order], flat.frame.width, flat.frame.height, np.arange(len(order), 0, -1.0))
    major, minor, angle = _shapes(flat, xy[order])
    limit, saturated = flat.frame.saturation, np.zeros(len(order), dtype=np.bool_)
    if limit is not None and np.isfinite(limit):  # a pixel that clips within two pixels
        raw = cut(flat.frame.pixels, Halving(), xy[order], np.zeros(len(order)), 2).value
        saturated = raw.max(axis=(1, 2)) >= 0.98 * limit
    return replace(
        found,
        flux=flux[order],
        snr=flux[order] / (flat.noise * np.sqrt(np.maximum(pixels[order], 1.0))),
        fwhm_px=FWHM_PER_SIGMA * np.sqrt(major * minor),
        elongation=major / minor,
        angle_rad=angle,
        saturated=saturated,
        background=flat.level,
        noise=flat.noise,
    )


def _shapes(flat: Flat, xy: Floats) -> tuple[Floats, Floats, Floats]:
    """Sigma of the major and the minor axis, px, and its angle, each (N,), NaN when unknown."""
    out = np.full((3, len(xy)), np.nan)
    if flat.frame.bayer is None:
        for k in range(0, len(xy), BATCH):
            shapes = adaptive_moments(flat.stamps(xy[k : k + BATCH], HALF), 1.5, 8)
            major, minor, angle = shapes.axes()
            # A pixel widens every image by its own variance; 0.04 is a floor of 0.2 px for stars narrower than that.
            minor = np.sqrt(np.maximum(minor**2 - PIXEL_VARIANCE, 0.04))
            major = np.maximum(np.sqrt(np.maximum(major**2 - PIXEL_VARIANCE, 0.04)), minor)
            part = np.stack([major, minor, angle])
            out[:, k : k + BATCH] = np.where(shapes.good & (shapes.flux > 0), part, np.nan)
    return out[0], out[1], out[2]
