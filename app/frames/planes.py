"""From decoded samples to what a `Frame` holds: luminance, colour, finite numbers, limits."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.errors import FrameError

Pixels = NDArray[Any]

MAX_PIXELS = 300_000_000
MAX_SIDE_PX = 100_000
_STRIP_ROWS = 64


def check_size(width: int, height: int) -> None:
    """Refuse sizes that no camera has before memory is asked for.

    Raises
    ------
    FrameError
        When a side is less than 2 px or the whole is beyond `MAX_PIXELS`.
    """
    if width < 2 or height < 2:
        raise FrameError(f"holds no picture: it is {width} x {height} pixels.")
    if width * height > MAX_PIXELS or max(width, height) > MAX_SIDE_PX:
        raise FrameError(
            f"claims {width} x {height} pixels, more than the {MAX_PIXELS // 1_000_000} million"
            " Kochab opens."
        )


def split(samples: Pixels) -> tuple[Pixels, Pixels | None, float | None]:
    """Detection's plane, the colour for display and the clipping level of a decoded picture.

    Parameters
    ----------
    samples
        (H, W) or (H, W, C); the first three channels are red, green, blue, a second or
        fourth is opacity and is left out.

    Returns
    -------
    pixels, colour, saturation
        As in `Frame`. Luminance is ``R + 2 G + B``: for 8 bits kept whole as uint16, so that
        no steps appear; for wider samples divided by 4. A picture whose channels are equal is
        grey. Saturation is the end of the integer type, None for floats.
    """
    if samples.ndim == 3 and samples.shape[2] < 3:
        samples = samples[..., 0]
    if samples.ndim == 2:
        pixels = native(samples)
        return pixels, None, clipping_level(pixels.dtype)
    rgb = native(samples[..., :3])
    if _is_grey(rgb):
        pixels = np.ascontiguousarray(rgb[..., 1])
        return pixels, None, clipping_level(pixels.dtype)
    pixels = luminance(rgb)
    whole = clipping_level(rgb.dtype)
    return pixels, rgb, 4.0 * whole if rgb.dtype == np.uint8 and whole else whole


def luminance(rgb: Pixels) -> Pixels:
    """``R + 2 G + B`` (H, W) of (H, W, 3): uint16 for uint8, else a quarter in the same type."""
    r, g, b = rgb[..., 0], rgb[..., 1], rgb[..., 2]
    if rgb.dtype.kind == "f":
        return np.asarray((r + b) * 0.25 + g * 0.5, dtype=rgb.dtype)
    out = np.empty(r.shape, np.uint16 if rgb.dtype == np.uint8 else rgb.dtype)
    wide = np.uint16 if rgb.dtype == np.uint8 else np.int64
    for top in range(0, len(out), _STRIP_ROWS):
        rows = slice(top, top + _STRIP_ROWS)
        total = np.add(r[rows], b[rows], dtype=wide)
        total += g[rows]
        total += g[rows]
        out[rows] = total if rgb.dtype == np.uint8 else (total + 2) >> 2
    return out


def native(array: Pixels) -> Pixels:
    """The same values, contiguous, in this machine's byte order and a type detection takes.

    Booleans become uint8; 64-bit and half-precision numbers become float32.
    """
    kind, size = array.dtype.kind, array.dtype.itemsize
    if kind == "b":
        return np.ascontiguousarray(array, dtype=np.uint8) * np.uint8(255)
    if kind not in "iuf":
        raise FrameError("holds samples that are not real numbers.")
    if size == 8 or (kind == "f" and size != 4):
        with np.errstate(over="ignore"):  # a double beyond float32 becomes infinite: see finite
            return np.ascontiguousarray(array, dtype=np.float32)
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))


def finite(pixels: Pixels) -> tuple[Pixels, tuple[str, ...]]:
    """Pixels without NaN and infinity, which become the picture's median, and a note of it.

    Raises
    ------
    FrameError
        When no pixel has a value.
    """
    if pixels.dtype.kind != "f":
        return pixels, ()
    good = np.isfinite(pixels)
    if good.all():
        return pixels, ()
    count = int(np.count_nonzero(good))
    if not count:
        raise FrameError("holds no pixel with a value: all are undefined.")
    values = pixels[good]
    filled = np.where(good, pixels, np.median(values[:: max(1, count // 1_000_000)]))
    bad = pixels.size - count
    note = f"{bad} pixels have no value and are shown as background."
    return np.ascontiguousarray(filled, dtype=pixels.dtype), (note,)


def clipping_level(dtype: np.dtype[Any]) -> float | None:
    """The largest value of an integer type, None for floats."""
    return float(np.iinfo(dtype).max) if dtype.kind in "iu" else None


def _is_grey(rgb: Pixels) -> bool:
    few = rgb[:: max(1, len(rgb) // 16)]
    for part in (few, rgb):  # a few rows tell most colour pictures apart
        if not (np.array_equal(part[..., 0], part[..., 1])
                and np.array_equal(part[..., 1], part[..., 2])):  # fmt: skip
            return False
    return True
