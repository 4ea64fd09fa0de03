"""A frame prepared for the screen: a pyramid of binned copies, its statistics, and its stretch."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Array, Floats
from kochab.core.frame import Frame
from kochab.core.progress import Progress, Task
from kochab.core.robust import mad_sigma, median
from kochab.core.values import frozen
from kochab.frames.stretch import debayer_preview, midtones, stretch_parameters
from kochab.text.translation import tr


@frozen
class ScreenStretch:
    """Black point and midtone, each in 0..1 of the image's range.

    ``mid`` is the share of the way from black to white shown at half brightness: 0.5 is linear.
    """

    black: float = 0.0
    mid: float = 0.5

    def apply(self, x: Floats) -> Floats:
        """Brightness 0..1 of values ``x`` in 0..1 of the picture's range."""
        share = np.clip((x - self.black) / max(1.0 - self.black, 1e-6), 0.0, 1.0)
        return midtones(share, min(max(self.mid, 1e-6), 1.0 - 1e-6))

    def table(self, levels: int, low: float, high: float) -> NDArray[np.uint8]:
        """Look-up table (levels,) for integer values 0..levels-1, where low..high is the range."""
        x = (np.arange(levels, dtype=np.float64) - low) / max(high - low, 1e-9)
        return np.asarray(np.rint(self.apply(x) * 255.0), dtype=np.uint8)


def automatic(stored: NDArray[np.generic], full: float | None = None) -> tuple[ScreenStretch, float, float]:
    """The automatic stretch, and the range (low, high) in stored values that it is a share of.

    A flat image has nothing to stretch: it is shown as bright as it is of ``full``, where its pixels clip.
    """
    if stored.dtype.kind == "u" and stored.min() == stored.max():
        level = float(stored.max())
        return ScreenStretch(), 0.0, max(level, full or float(2 ** (8 * stored.itemsize) - 1))
    chosen = stretch_parameters(stored)
    low = min(float(chosen.black), float(stored.min()))
    high = max(float(chosen.white), float(stored.max()), low + 1.0)
    black = (chosen.black - low) / (high - low)
    # The middle is a share of black..white; white is moved to the top of the range here.
    span = (chosen.white - chosen.black) / max(high - chosen.black, 1e-9)
    return ScreenStretch(black, min(max(chosen.mid * span, 1e-6), 0.5)), low, high


SAMPLE = 400_000
BINS = 256
STRIP_ROWS = 256  # a strip at a time, so that a task can be cancelled and memory stays low


@frozen(eq=False)
class FrameImage:
    """What the view draws. ``mono[k]`` and ``colour[k]`` are binned by ``2**k``, uint8 or uint16.

    ``low`` and ``high`` are the stored values at 0 and 1 of the stretch; ``histogram`` (BINS,) counts a sample over
    the cube root of that range, which spreads the dark end. ``colour`` is empty for a mono frame; ``sky_shift`` is
    its red, green and blue sky above the mono one, in stored values.
    """

    width: int
    height: int
    mono: tuple[Array, ...]
    colour: tuple[Array, ...]
    low: float
    high: float
    histogram: NDArray[np.float64]
    auto: ScreenStretch
    sky_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def level_for(self, scale: float) -> int:
        """The pyramid level whose pixels are nearest to, and not below, one screen pixel."""
        k = int(np.floor(np.log2(1.0 / scale))) if scale < 1.0 else 0
        return min(max(k, 0), len(self.mono) - 1)


def prepare(frame: Frame) -> Task[FrameImage]:
    """Build the :class:`FrameImage` of a frame; a few hundred ms for 61 MP."""
    yield Progress("display", None, tr("preparing the image"))
    base = yield from storable(frame.pixels)
    mono = yield from _pyramid(base)
    colour: tuple[Array, ...] = ()
    if frame.colour is not None:
        whole = yield from storable(frame.colour)
        if whole.dtype == np.uint8 and base.dtype == np.uint16:
            whole = whole.astype(np.uint16) << 2  # the mono pixels of 8 bits are R + 2 G + B
        colour = yield from _pyramid(whole)
    elif frame.bayer and len(frame.bayer) == 4 and min(base.shape) >= 4:
        colour = yield from _from_mosaic(frame, base)
    # A mosaic's sky is that of its mean colour.
    auto, low, high = automatic(
        mono[min(1, len(mono) - 1)] if frame.bayer else base,
        frame.saturation if base.dtype == frame.pixels.dtype else None,
    )
    yield Progress("display", 0.9)
    counts = histogram(sampled(base, SAMPLE), low, high)
    shift = (0.0, 0.0, 0.0)
    own = frame.path and frame.colour is not None and frame.colour.dtype == np.uint8  # a finished picture's colours
    if colour and auto.mid < 0.5 and not own:
        # On the smallest level, whose few pixels have the least noise.
        shift = sky_shift(np.moveaxis(colour[-1], -1, 0), sky_level(mono[-1]))
    return FrameImage(frame.width, frame.height, mono, colour, low, high, counts, auto, shift)


def sampled(pixels: Array, most: int) -> Array:
    """About ``most`` pixels of (H, W, ...)."""
    step = max(1, int(np.sqrt(pixels.shape[0] * pixels.shape[1] / most))) | 1  # odd: sees all colours of a mosaic
    return pixels[::step, ::step]


def histogram(values: Array, low: float, high: float) -> NDArray[np.float64]:
    """Counts (BINS,) over the cube root of low..high; few levels are spread, not left as spikes."""
    if values.dtype == np.uint8:
        counts = np.bincount(values.ravel(), minlength=256)
        at = low + (high - low) * (np.arange(BINS) / (BINS - 1)) ** 3
        return np.interp(at, np.arange(256), counts)
    share = np.clip((values - low) / max(high - low, 1e-9), 0.0, 1.0, dtype=np.float64)
    return np.bincount((np.cbrt(share).ravel() * (BINS - 1)).astype(np.intp), minlength=BINS).astype(np.float64)


def sky_level(values: Array) -> float:
    """The mean of the middle half of ``values``: a median that is no whole number."""
    low, high = np.percentile(values, (25, 75))
    return float(np.mean(values[(values >= low) & (values <= high)]))


def sky_shift(planes: Iterable[Array], sky: float) -> tuple[float, float, float]:
    """What the skies of the red, green and blue ``planes`` stand above the mean ``sky``, to be shown grey."""
    red, green, blue = (sky_level(plane) - sky for plane in planes)
    return red, green, blue


def storable(pixels: Array) -> Task[Array]:
    """The same image as uint8 or uint16; other types are scaled around the sky level."""
    if pixels.dtype in (np.dtype(np.uint8), np.dtype(np.uint16)):
        return pixels
    sample = np.asarray(sampled(pixels, SAMPLE), dtype=np.float64)
    sample = sample[np.isfinite(sample)]
    if not sample.size:
        sample = np.zeros(1)
    sky = median(sample)
    sigma = mad_sigma(sample, sky) or float(sample.std()) or 1.0
    # A few outliers must not leave the sky a handful of the 65,536 levels.
    low = max(float(sample.min()), sky - 20.0 * sigma)
    high = min(float(sample.max()), sky + 2000.0 * sigma)
    factor = 65535.0 / max(high - low, 1e-30)
    out = np.empty(pixels.shape, dtype=np.uint16)
    for y in range(0, len(pixels), STRIP_ROWS):
        strip = (np.asarray(pixels[y : y + STRIP_ROWS], dtype=np.float32) - low) * factor
        # NaN becomes black, infinity white.
        out[y : y + STRIP_ROWS] = np.clip(np.nan_to_num(strip, nan=0.0), 0.0, 65535.0)
        yield Progress("display", y / len(pixels))
    return out


def _pyramid(base: Array) -> Task[tuple[Array, ...]]:
    levels = [base]
    while max(levels[-1].shape[:2]) > 700 and min(levels[-1].shape[:2]) >= 4:
        levels.append((yield from _halve(levels[-1])))
    return tuple(levels)


def _halve(a: Array) -> Task[Array]:
    out = np.empty((a.shape[0] // 2, a.shape[1] // 2, *a.shape[2:]), dtype=a.dtype)
    for y in range(0, len(out), STRIP_ROWS):
        out[y : y + STRIP_ROWS] = halved(a[2 * y : 2 * (y + STRIP_ROWS)])
        yield Progress("display", y / len(out))
    return out


def halved(a: Array) -> Array:
    """Means of 2 x 2 pixels of (H, W, ...), uint8 or uint16; a last odd row or column is dropped."""
    high, wide = a.shape[0] // 2 * 2, a.shape[1] // 2 * 2
    # The sum of four needs two bits more.
    kind = np.uint16 if a.dtype == np.uint8 else np.uint32
    rows = np.add(a[0:high:2, :wide], a[1:high:2, :wide], dtype=kind)
    total = rows[:, 0::2] + rows[:, 1::2]
    total >>= 2
    return total.astype(a.dtype)


def _from_mosaic(frame: Frame, base: Array) -> Task[tuple[Array, ...]]:
    """Colour at half size from the four pixels of each Bayer cell; level 0 repeats it."""
    half = debayer_preview(replace(frame, pixels=base), 2)
    yield Progress("display", 0.5)
    full = np.repeat(np.repeat(half, 2, axis=0), 2, axis=1)
    rest = yield from _pyramid(half)
    return (full, *rest)
