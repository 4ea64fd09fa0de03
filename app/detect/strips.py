"""Halving and smoothing: the pass that touches every pixel of the frame.

Pixels are summed 2 x 2 (of a Bayer mosaic only the two greens) and smoothed by a 3 x 3 binomial
kernel. Whole numbers stay whole: unsigned pixels are summed by viewing neighbours as one word of
twice the width. The result is ``GAIN`` times the mean level of the pixels under the kernel, and
white noise of RMS s a pixel becomes ``NOISE_GAIN * s``.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[Any]


@dataclass(frozen=True, slots=True)
class Halving:
    """How 2 x 2 pixels become one; ``greens`` is 0 or 1, the column of the green of even rows."""

    greens: int | None = None

    @property
    def gain(self) -> float:
        """Smoothed value of a flat frame of level 1."""
        return 64.0 if self.greens is None else 32.0

    @property
    def noise_gain(self) -> float:
        """RMS of the smoothed value for white noise of RMS 1 a pixel."""
        return 6.0 * float(np.sqrt(4.0 if self.greens is None else 2.0))

    def sums(self, rows: Pixels) -> Pixels:
        """Sums (n, W // 2) of an even number of rows (2 n, W), W even or odd."""
        rows = rows[:, : rows.shape[1] // 2 * 2]
        word = {1: np.uint16, 2: np.uint32}.get(rows.dtype.itemsize)
        if rows.dtype.kind != "u" or word is None:
            return self._plain(rows)
        if rows.strides[0] % (2 * rows.dtype.itemsize) or rows.strides[1] != rows.dtype.itemsize:
            return self._plain(rows.astype(word))
        pairs = rows.view(word)
        bits = 8 * rows.dtype.itemsize
        low, high = word((1 << bits) - 1), word(bits)
        if self.greens is not None:
            upper, lower = (pairs[0::2], pairs[1::2])[:: 1 if self.greens else -1]
            out = upper >> high
            out += lower & low
            return out
        out = pairs[0::2] & low
        out += pairs[0::2] >> high
        out += pairs[1::2] & low
        out += pairs[1::2] >> high
        return out

    def _plain(self, rows: Pixels) -> Pixels:
        if self.greens is None:
            both = rows[0::2] + rows[1::2]
            return np.asarray(both[:, 0::2] + both[:, 1::2])
        return np.asarray(rows[0::2, self.greens :: 2] + rows[1::2, 1 - self.greens :: 2])


def halving(bayer: str | None) -> Halving:
    """The halving that suits a mosaic; one whose green is not on a diagonal is summed whole."""
    pattern = (bayer or "").upper()
    if pattern in ("RGGB", "BGGR"):
        return Halving(1)
    if pattern in ("GRBG", "GBRG"):
        return Halving(0)
    return Halving()


def as_summable(rows: Pixels, fill: float) -> Pixels:
    """Rows as uint8, uint16 or float32, with what is not finite replaced by ``fill``."""
    if rows.dtype in (np.uint8, np.uint16, np.float32):
        out = rows
    elif rows.dtype == np.bool_:
        return rows.view(np.uint8)
    else:
        with np.errstate(over="ignore"):
            out = rows.astype(np.float32)
    if out.dtype.kind == "f":
        with np.errstate(invalid="ignore", over="ignore"):
            total = out.sum(dtype=np.float64)
        if not np.isfinite(total) or abs(total) > 1e30:
            out = np.where(np.abs(out) < 1e30, out, np.float32(fill))
    return out


def smooth(sums: Pixels) -> Pixels:
    """Binomial smoothing of (n, m) into (n - 2, m - 2): the weights of 1 2 1 along each axis."""
    wide = sums[:, :-1] + sums[:, 1:]
    wide = wide[:, :-1] + wide[:, 1:]
    tall = wide[:-1] + wide[1:]
    return np.asarray(tall[:-1] + tall[1:])
