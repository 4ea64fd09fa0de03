"""Renders a live frame for the screen in a few ms: binned, stretched, with its levels."""

from dataclasses import field
from time import monotonic

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage

from kochab.core.arrays import Array
from kochab.core.frame import Frame
from kochab.core.progress import run
from kochab.core.values import frozen
from kochab.frames.samples import clipping_level
from kochab.window.image import frame_image
from kochab.window.image.frame_image import BINS, ScreenStretch, sky_level, storable
from kochab.window.image.screen_image import BLUE, GREEN, GREY, RED, Parts, Planes, RenderedFrame, coloured

SMALLEST_PX = 200  # no side is binned below it


def binned(stored: Array, scale: float, mosaic: bool = False) -> Array:
    """Bin 2 x 2 until a pixel is about one of the screen; a mosaic at least once, which makes it grey."""
    must = mosaic
    while (scale <= 0.5 and min(stored.shape) >= 2 * SMALLEST_PX) or (must and min(stored.shape) >= 2):
        stored = frame_image.halved(stored)
        scale, must = scale * 2.0, False
    return stored


def channels(frame: Frame, stored: Array, scale: float) -> Planes | None:
    """Red, green and blue (H, W) of a frame at ``scale`` screen px a px of the frame; None when it has none.

    ``stored`` are its pixels as they are shown. The four pixels of a Bayer cell become one.
    """
    if frame.colour is not None:
        colour = run(storable(frame.colour))
        planes = tuple(binned(colour[..., c], scale) for c in range(3))
        if colour.dtype == np.uint8 and stored.dtype == np.uint16:
            return tuple(plane.astype(np.uint16) << 2 for plane in planes)  # the mono pixels are R + 2 G + B
        return planes
    if frame.bayer is None or len(frame.bayer) != 4 or min(stored.shape) < 2:
        return None
    # A cell is two pixels wide, so less is left to bin.
    return tuple(binned(p, 2.0 * scale) for p in _cells(stored, frame.bayer))


def _cells(mosaic: Array, pattern: str) -> tuple[Array, Array, Array]:
    """Red, the mean of both greens, and blue of each 2 x 2 cell."""
    high, wide = mosaic.shape[0] // 2 * 2, mosaic.shape[1] // 2 * 2
    at: dict[str, list[Array]] = {"R": [], "G": [], "B": []}
    for number, letter in enumerate(pattern):
        at[letter].append(mosaic[number // 2 : high : 2, number % 2 : wide : 2])
    first, second = at["G"]
    # The mean of two in their own type, in which their sum would overflow.
    green = (first >> 1) + (second >> 1) + (first & second & 1)
    return at["R"][0], green, at["B"][0]


STATISTICS_EVERY_S = 0.5
SAMPLE = 100_000
FULL_16 = 65535.0  # where floats are counts, not shares of full scale


@frozen
class DisplaySettings:
    """How to show frames: ``stretch`` is None for the automatic one.

    ``red`` shows red light only; ``scale`` is screen pixels per frame pixel; ``colour`` shows the
    colours of a colour camera, except in red.
    """

    stretch: ScreenStretch | None = None
    red: bool = False
    scale: float = 1.0
    colour: bool = True


@frozen(eq=False)
class Levels:
    """How a frame is exposed, as fractions of full scale.

    ``counts`` (BINS,) over the cube root of 0..1; ``sky`` is the median, ``top`` the brightest
    pixel but the hottest, ``clipped`` the share of pixels that are full.
    """

    counts: NDArray[np.float64] = field(default_factory=lambda: np.zeros(BINS))
    sky: float = 0.0
    top: float = 0.0
    clipped: float = 0.0


class LiveRenderer:
    """Keeps the stretch and the statistics from frame to frame; for one thread."""

    def __init__(self) -> None:
        self.levels = Levels()
        self._auto = ScreenStretch()
        self._range = (0.0, 1.0)
        self._histogram = np.zeros(BINS)
        self._measured_s = float("-inf")
        self._shift = (0.0, 0.0, 0.0)

    def picture(self, frame: Frame, settings: DisplaySettings) -> RenderedFrame:
        """The rendered frame."""
        stored = run(storable(frame.pixels))
        now = monotonic()
        if now - self._measured_s >= STATISTICS_EVERY_S:
            self._measured_s = now
            self._measure(frame, stored, settings)
        in_colour = settings.colour and not settings.red
        planes = channels(frame, stored, settings.scale) if in_colour else None
        parts: Parts = tuple(zip((RED, GREEN, BLUE), self._shift, strict=True))
        if planes is None:
            planes = (binned(stored, settings.scale, bool(frame.bayer)),)
            parts = ((RED if settings.red else GREY, 0.0),)
        pixels = coloured(planes, settings.stretch or self._auto, self._range, parts)
        high, wide = pixels.shape
        # QImage borrows the array, which RenderedFrame keeps.
        image = QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGB32)
        return RenderedFrame(frame.width, frame.height, image, self._auto, self._histogram, pixels)

    def _measure(self, frame: Frame, stored: Array, settings: DisplaySettings) -> None:
        """Another automatic stretch and other levels; a range that sliders stand on is held."""
        sample = frame_image.sampled(stored, SAMPLE)
        # (0, 1) is the range before the first frame.
        if settings.stretch is None or self._range == (0.0, 1.0):
            # A mosaic's sky is that of its mean colour.
            whole = frame_image.sampled(binned(stored, 0.5, True), SAMPLE) if frame.bayer else sample
            self._auto, low, high = frame_image.automatic(np.ascontiguousarray(whole))
            self._range = (low, high)
            planes = None if self._auto.mid >= 0.5 else channels(frame, stored, 1.0)
            self._shift = (0.0, 0.0, 0.0)
            if planes is not None:
                self._shift = frame_image.sky_shift((plane[::3, ::3] for plane in planes), sky_level(whole))
        self._histogram = frame_image.histogram(sample, *self._range)
        raw = np.asarray(frame_image.sampled(frame.pixels, SAMPLE), dtype=np.float64)
        self.levels = levels_of(raw[np.isfinite(raw)], full_scale(frame))


def full_scale(frame: Frame) -> float:
    """The level at which the camera's pixels are full, as well as it is known."""
    full = frame.saturation or clipping_level(frame.pixels.dtype)
    return full or (FULL_16 if float(np.nanmax(frame.pixels)) > 1.0 else 1.0)


def levels_of(values: NDArray[np.float64], full: float) -> Levels:
    """How the pixels ``values`` (N,) of a frame fill a camera that holds ``full``."""
    if not values.size or full <= 0:
        return Levels()
    shares = values / full
    top = float(np.partition(shares, -2)[-2]) if shares.size > 1 else float(shares[0])
    clipped = float(np.mean(shares >= 0.98))
    return Levels(frame_image.histogram(shares, 0.0, 1.0), float(np.median(shares)), top, clipped)
