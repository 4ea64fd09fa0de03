"""From decoded samples to a frame: size limits, luminance, finite numbers, the colour pattern."""

import math
import os
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from kochab.core.arrays import Array
from kochab.core.errors import FrameError
from kochab.text.translation import tr_n

MAX_PIXELS = 300_000_000
MAX_SIDE_PX = 100_000
MAX_BYTES = 1_500_000_000
"""Of a decoded picture; `split` and `finite` need as much again for a moment."""
MAX_PACKED = 500
"""A packed file whose image is larger than so many times itself is a bomb: stars and noise pack to a tenth."""
_LARGE_BYTES = 100_000_000
_STRIP_ROWS = 64


def check_size(width: int, height: int, bytes_px: int = 1, packed_bytes: int | None = None) -> None:
    """Refuse sizes that no camera has before memory is asked for.

    Parameters
    ----------
    width, height
        Of the picture, px.
    bytes_px
        What a pixel takes once it is decoded, all its channels together.
    packed_bytes
        The file's size when it is a compressed one.

    Raises `FrameError` when a side is less than 2 px, or the whole is beyond `MAX_PIXELS`, `MAX_BYTES` or the memory
    that is free, or packed by more than `MAX_PACKED`.
    """
    if width < 2 or height < 2:
        raise FrameError("holds no picture: it is {width} x {height} pixels.", width=width, height=height)
    if width * height > MAX_PIXELS or max(width, height) > MAX_SIDE_PX:
        raise FrameError(
            "claims {width} x {height} pixels, more than the {max} million Kochab opens.",
            width=width,
            height=height,
            max=MAX_PIXELS // 1_000_000,
        )
    size, free = width * height * bytes_px, free_bytes()
    if packed_bytes is not None and size > max(_LARGE_BYTES, MAX_PACKED * packed_bytes):
        raise FrameError(
            "claims {width} x {height} pixels, {size:.1f} GB, packed into {packed:.2g} MB: no "
            "camera's image packs so small.",
            width=width,
            height=height,
            size=size / 1e9,
            packed=packed_bytes / 1e6,
        )
    # Half of what is free: split and finite hold the picture twice for a moment.
    limit = MAX_BYTES if free is None or size > MAX_BYTES else free / 2
    if size > limit:
        raise FrameError(
            "claims {width} x {height} pixels of {bytes} bits, {size:.1f} GB, more than the "
            "{limit:.1f} GB there is room for.",
            width=width,
            height=height,
            bytes=8 * bytes_px,
            size=size / 1e9,
            limit=limit / 1e9,
        )


def free_bytes() -> int | None:
    """Memory that programs may still take (`proc(5)`); half of all where that is not told, None if nothing is."""
    try:
        if sys.platform == "win32":
            import ctypes

            status = (ctypes.c_uint64 * 8)(64)  # MEMORYSTATUSEX, whose third is ullAvailPhys
            return int(status[2]) if ctypes.windll.kernel32.GlobalMemoryStatusEx(status) else None
        with open("/proc/meminfo", encoding="ascii") as file:
            rows = (line.split() for line in file)
            return next((int(row[1]) * 1024 for row in rows if row[0] == "MemAvailable:"), None)
    except OSError:
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2
    except (AttributeError, OSError, ValueError):
        return None


def split(samples: Array) -> tuple[Array, Array | None, float | None]:
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


def luminance(rgb: Array) -> Array:
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
        # The + 2 rounds to nearest.
        out[rows] = total if rgb.dtype == np.uint8 else (total + 2) >> 2
    return out


def native(array: Array) -> Array:
    """The same values, contiguous, in this machine's byte order and a type detection takes.

    Booleans become uint8; 64-bit and half-precision numbers become float32.
    """
    kind, size = array.dtype.kind, array.dtype.itemsize
    if kind == "b":
        return np.ascontiguousarray(array, dtype=np.uint8) * np.uint8(255)  # true is white
    if kind not in "iuf":
        raise FrameError("holds samples that are not real numbers.")
    if size == 8 or (kind == "f" and size != 4):
        with np.errstate(over="ignore"):  # a double beyond float32 becomes infinite: see finite
            return np.ascontiguousarray(array, dtype=np.float32)
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))


def finite(pixels: Array) -> tuple[Array, tuple[str, ...]]:
    """Pixels without NaN and infinity, which become the picture's median, and a note of it.

    Raises `FrameError` when no pixel has a value.
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
    note = tr_n(
        "{n} pixel has no value and is shown as background.",
        "{n} pixels have no value and are shown as background.",
        bad,
    )
    return np.ascontiguousarray(filled, dtype=pixels.dtype), (note,)


def clipping_level(dtype: np.dtype[Any]) -> float | None:
    """The largest value of an integer type, None for floats."""
    return float(np.iinfo(dtype).max) if dtype.kind in "iu" else None


def _is_grey(rgb: Array) -> bool:
    parts = (rgb[:: max(1, len(rgb) // 16)], rgb)  # a few rows tell most colour images apart
    return all(np.array_equal(part[..., 1], part[..., k]) for part in parts for k in (0, 2))


# -- The colour pattern over a sensor, from what a header says of it ---------------------------

PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")


def bayer_pattern(values: Mapping[str, Any], height: int) -> str | None:
    """The 2 x 2 pattern read from the array's pixel (0, 0), or None for a grey frame.

    ``XBAYROFF`` and ``YBAYROFF`` shift the named pattern; with ``ROWORDER = BOTTOM-UP`` it is
    named from the array's last row, which such programs show on top.
    """
    named = (str(values.get(key, "")).strip().upper() for key in ("BAYERPAT", "COLORTYP", "CFA_PAT", "FILTER"))
    name = next((name for name in named if name in PATTERNS), None)
    if name is None:
        return None
    x, y = (int(number_or_none(values.get(key)) or 0) for key in ("XBAYROFF", "YBAYROFF"))
    if str(values.get("ROWORDER", "")).strip().upper() == "BOTTOM-UP":
        # The pattern is named from the row that such a program shows on top, our last one.
        y += height - 1
    return shifted(name, x, y)


def shifted(pattern: str, x: int, y: int) -> str:
    """The pattern seen from ``x`` columns and ``y`` rows further on."""
    return "".join(pattern[(r + y) % 2 * 2 + (c + x) % 2] for r in (0, 1) for c in (0, 1))


def number_or_none(value: Any) -> float | None:
    """A finite number, also when written as text; None for anything else."""
    if value is None or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) else None
