"""Automatic screen stretch: from linear samples to the 8 bits of a display.

The midtones transfer function ``m(x) = (m - 1) x / ((2 m - 1) x - m)`` keeps 0 and 1 and takes ``m`` to one half;
the automatic choice puts black some deviations below the sky and the sky itself at a fixed grey.
"""

import numpy as np

from kochab.core.arrays import Array, Bytes, Floats
from kochab.core.frame import Frame
from kochab.core.robust import mad_sigma, median
from kochab.core.values import frozen

SKY_LEVEL = 0.2  # brightness the median is shown at, 0 to 1
SHADOW_SIGMAS = 2.8  # so many deviations below the median is black
_SAMPLE = 250_000
_BINS = 16384


@frozen
class Stretch:
    """How samples become grey: ``black`` and ``white`` in sample units, ``mid`` in (0, 1).

    ``mid`` is the share of the way from black to white that is shown half bright; 0.5 is linear.
    """

    black: float
    white: float
    mid: float = 0.5


def stretch_parameters(array: Array) -> Stretch:
    """The automatic stretch of samples, from the median and median deviation of some of them.

    ``array`` (H, W) or (H, W, 3) is of any real type; all channels share one stretch.
    """
    sample = _sample(array)
    if not len(sample):
        return Stretch(0.0, 1.0)
    low, high = float(sample.min()), float(sample.max())
    level = median(sample)
    sigma = mad_sigma(sample, level)
    if array.dtype.kind in "iu":
        sigma = max(sigma, 0.3)  # a flat sky of whole numbers is still uncertain by rounding
    black = max(low, level - SHADOW_SIGMAS * sigma)
    # A frame of nothing but sky would otherwise stretch its own noise to full white.
    white = max(high, level + 20.0 * sigma)
    if not white > black:
        return Stretch(black, black + 1.0)
    sky = (level - black) / (white - black)
    if sky <= 0.0:
        return Stretch(black, white)
    mid = float(midtones(np.array(sky), SKY_LEVEL))
    return Stretch(black, white, min(max(mid, 1e-6), 1.0 - 1e-6))


def midtones(x: Floats, m: float) -> Floats:
    """The midtones transfer of ``x`` in 0..1; ``midtones(x, y)`` is also the m taking x to y."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((m - 1.0) * x / ((2.0 * m - 1.0) * x - m))


def apply(array: Array, stretch: Stretch | tuple[Stretch, Stretch, Stretch]) -> Bytes:
    """Samples as 8-bit grey (H, W) or colour (H, W, 3), by a table where the type allows.

    A triple of stretches, as from `white_balanced`, is for the three channels of colour.
    """
    if isinstance(stretch, tuple):
        return np.stack([apply(array[..., i], s) for i, s in enumerate(stretch)], axis=-1)
    if array.dtype.kind == "b":
        array = array.view(np.uint8)
    if array.dtype in (np.uint8, np.uint16, np.int8, np.int16):
        info = np.iinfo(array.dtype)
        table = _curve(np.arange(info.min, info.max + 1, dtype=np.float64), stretch)
        if array.dtype.kind == "i":  # negative numbers index the table from its far end
            table = np.roll(table, info.min)
        # Reinterpreted, a signed number is the unsigned one a table wants.
        return np.asarray(np.take(table, array.view(f"u{array.itemsize}"), mode="wrap"))
    span = max(stretch.white - stretch.black, 1e-300)
    with np.errstate(invalid="ignore", over="ignore"):
        share = (array.astype(np.float32) - np.float32(stretch.black)) * np.float32(_BINS / span)
        np.nan_to_num(share, copy=False, nan=0.0)
        np.clip(share, 0, _BINS, out=share)
    # The table is finer near black, where the curve is steep: it is indexed by the square root.
    steps = np.sqrt(share * np.float32(_BINS)).astype(np.uint16)
    levels = (np.arange(_BINS + 1) / _BINS) ** 2
    table = _curve(stretch.black + levels * span, stretch)
    return np.asarray(np.take(table, steps))


def _curve(values: Floats, stretch: Stretch) -> Bytes:
    share = (values - stretch.black) / max(stretch.white - stretch.black, 1e-300)
    share = np.clip(share, 0.0, 1.0)
    return np.asarray(np.rint(255.0 * midtones(share, stretch.mid)), dtype=np.uint8)


def _sample(array: Array) -> Floats:
    """About a quarter of a million finite samples, spread over rows and columns."""
    height, width = array.shape[:2]
    step = max(1, int((height * width / _SAMPLE) ** 0.5))
    # An odd step sees all four colours of a mosaic.
    step += 1 - step % 2
    some = array[::step, ::step].astype(np.float64).ravel()
    return some[np.isfinite(some)]


def debayer_preview(frame: Frame, factor: int = 2) -> Array:
    """A mosaic as colour (H // f, W // f, 3), from one 2 x 2 cell of sensor in each f x f.

    ``factor`` f is even and at least 2; the two greens are averaged. A frame without ``bayer``
    gives its colour, or else its pixels, thinned by the factor instead.
    """
    if frame.bayer is None:
        return binned(frame.pixels if frame.colour is None else frame.colour, factor)
    step = max(2, factor // 2 * 2)
    height, width = frame.height // step * step, frame.width // step * step
    mosaic = frame.pixels[:height, :width]
    cells = [mosaic[r::step, c::step] for r in (0, 1) for c in (0, 1)]
    out = np.empty((height // step, width // step, 3), mosaic.dtype)
    out[..., 0] = cells[frame.bayer.index("R")]
    out[..., 2] = cells[frame.bayer.index("B")]
    first, second = (cells[i] for i, letter in enumerate(frame.bayer) if letter == "G")
    whole = mosaic.dtype.kind in "iu"
    # Halved before they are added: 16 bits would overflow.
    out[..., 1] = (first >> 1) + (second >> 1) if whole else (first + second) / 2
    return out


def white_balanced(colour: Array) -> tuple[Stretch, Stretch, Stretch]:
    """A stretch for each of red, green and blue (H, W, 3), so that the sky comes out grey."""
    red, green, blue = (stretch_parameters(colour[..., i]) for i in range(3))
    return red, green, blue


def binned(array: Array, factor: int) -> Array:
    """Every ``factor``-th row and column, a cheap thinning for display.

    For a view zoomed out: (H // f, W // f[, 3]). Two samples of each cell are read, which keeps
    stars visible at a small part of the cost of a full mean.
    """
    if factor <= 1:
        return array
    height, width = (n // factor * factor for n in array.shape[:2])
    a, half = array[:height, :width], factor // 2
    parts = (a[::factor, ::factor], a[half::factor, half::factor])
    return np.maximum(*parts)
