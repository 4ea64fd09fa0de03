"""Halving and smoothing: the pass that touches every pixel of the frame.

Pixels are summed 2 x 2 (of a Bayer mosaic only the two greens) and smoothed by a 3 x 3 binomial
kernel. Whole numbers stay whole: unsigned pixels are summed by viewing neighbours as one word of
twice the width. The result is ``gain`` times the mean level of the pixels under the kernel, and
white noise of RMS s a pixel becomes ``noise_gain * s``.
"""

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[Any]
BROKEN = 1e15  # what is larger, or not a number, is not light
WIDTH: dict[int, type[np.unsignedinteger[Any]]] = {8: np.uint8, 16: np.uint16}
WORD: dict[int, type[np.unsignedinteger[Any]]] = {1: np.uint16, 2: np.uint32}


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

    def sums(self, rows: Pixels, out: Pixels, spare: Pixels) -> None:
        """Sums of rows (2 n, W), W even or odd, into ``out`` (n, W // 2); ``spare`` is as large."""
        rows = rows[:, : rows.shape[1] // 2 * 2]
        size = rows.dtype.itemsize
        if rows.dtype.kind != "u":
            self._plain(rows, out)
        elif rows.strides[0] % (2 * size) or rows.strides[1] != size:
            self._plain(rows.astype(out.dtype), out)
        else:
            self._words(rows.view(WORD[size]), out, spare, 8 * size)

    def _words(self, pairs: Pixels, out: Pixels, spare: Pixels, bits: int) -> None:
        """The low and the high half of every word are neighbouring pixels."""
        low, high = pairs.dtype.type((1 << bits) - 1), pairs.dtype.type(bits)
        even, odd = pairs[0::2], pairs[1::2]
        if self.greens is not None:
            np.right_shift(even if self.greens else odd, high, out=out)
            np.bitwise_and(odd if self.greens else even, low, out=spare)
            np.add(out, spare, out=out)
            return
        if int(pairs.view(WIDTH[bits]).max()) < 1 << (bits - 1):  # two rows at once do not overflow
            np.add(even, odd, out=spare)
            np.bitwise_and(spare, low, out=out)
            np.right_shift(spare, high, out=spare)
            np.add(out, spare, out=out)
            return
        np.bitwise_and(even, low, out=out)
        np.right_shift(even, high, out=spare)
        np.add(out, spare, out=out)
        np.bitwise_and(odd, low, out=spare)
        np.add(out, spare, out=out)
        np.right_shift(odd, high, out=spare)
        np.add(out, spare, out=out)

    def _plain(self, rows: Pixels, out: Pixels) -> None:
        if self.greens is None:
            both = rows[0::2] + rows[1::2]
            np.add(both[:, 0::2], both[:, 1::2], out=out)
        else:
            np.add(rows[0::2, self.greens :: 2], rows[1::2, 1 - self.greens :: 2], out=out)


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
    if rows.dtype in (np.uint8, np.uint16):
        return rows
    if rows.dtype == np.bool_:
        return rows.view(np.uint8)
    with np.errstate(over="ignore"):
        out = rows.astype(np.float32, copy=False)
    with np.errstate(invalid="ignore", over="ignore"):
        total = float(np.dot(out.ravel(), out.ravel())) if out.size else 0.0
    if not total < BROKEN**2:
        out = np.where(np.abs(out) < BROKEN, out, np.float32(fill))
    return out


class _Kept(threading.local):
    """Memory of this thread, a few MB, kept because new pages cost as much as the sums."""

    def __init__(self) -> None:
        self.arrays: dict[str, Pixels] = {}


_KEPT = _Kept()


@dataclass(slots=True)
class Smoother:
    """Halves and smooths rows in memory that all smoothers of a thread share."""

    how: Halving
    fill: float = 0.0

    def __call__(self, rows: Pixels, pad: tuple[int, int, int]) -> Pixels:
        """Smoothed (n + above + below - 2, m + 2 sides - 2) of rows (2 n, 2 m or 2 m + 1).

        ``pad`` = (above, below, sides) halved pixels repeat the edges. The result is overwritten
        by the next call.
        """
        rows = as_summable(rows, self.fill)
        above, below, sides = pad
        n, m = len(rows) // 2, rows.shape[1] // 2
        dtype = self.dtype(rows)
        sums = self._memory("sums", (n + above + below, m + 2 * sides), dtype)
        spare = self._memory("wide", (n + above + below, m + 2 * sides), dtype)
        inner = sums[above : above + n, sides : sides + m]
        self.how.sums(rows, inner, spare[above : above + n, sides : sides + m])
        if sides:
            sums[:, :sides] = sums[:, sides : sides + 1]
            sums[:, -sides:] = sums[:, -sides - 1 : -sides]
        if above:
            sums[:above] = sums[above]
        if below:
            sums[-below:] = sums[-below - 1]
        return self._binomial(sums, spare)

    def dtype(self, pixels: Pixels) -> type[np.number[Any]]:
        """The type of sums and smoothed values of such pixels."""
        if pixels.dtype == np.bool_:
            return np.uint16
        return WORD.get(pixels.dtype.itemsize if pixels.dtype.kind == "u" else 0, np.float32)

    def halved(self, rows: Pixels) -> Pixels:
        """Sums (n, m) of rows (2 n, 2 m or 2 m + 1), overwritten by the next call as well."""
        rows = as_summable(rows, self.fill)
        shape = len(rows) // 2, rows.shape[1] // 2
        sums, spare = (self._memory(name, shape, self.dtype(rows)) for name in ("sums", "wide"))
        self.how.sums(rows, sums, spare)
        return sums

    def blocks(self, pixels: Pixels, tops: NDArray[np.intp], rows: int) -> Pixels:
        """``rows`` rows of ``pixels`` below each of ``tops``, all in one; overwritten as well."""
        shape = (len(tops) * rows, pixels.shape[1])
        out = self._memory("rows", shape, pixels.dtype.type)
        for k, top in enumerate(tops):
            out[k * rows : (k + 1) * rows] = pixels[top : top + rows]
        return out

    def above(self, smoothed: Pixels, floor: Pixels) -> NDArray[np.bool_]:
        """Flat mask of where ``smoothed`` (n, m) exceeds ``floor`` (m,); overwritten as well."""
        out = self._memory("above", (smoothed.shape[0], smoothed.shape[1]), np.bool_)
        return np.asarray(np.greater(smoothed, floor, out=out).ravel())

    def _binomial(self, sums: Pixels, wide: Pixels) -> Pixels:
        """Weights 1 2 1 along each axis."""
        n, m = sums.shape
        np.add(sums[:, :-1], sums[:, 1:], out=wide[:, :-1])
        np.add(wide[:, : m - 2], wide[:, 1 : m - 1], out=sums[:, : m - 2])
        across = sums[:, : m - 2]
        np.add(across[:-1], across[1:], out=wide[: n - 1, : m - 2])
        out = self._memory("sums", (n - 2, m - 2), sums.dtype.type)  # the sums are done with
        np.add(wide[: n - 2, : m - 2], wide[1 : n - 1, : m - 2], out=out)
        return out

    def _memory(self, name: str, shape: tuple[int, int], dtype: type[np.generic]) -> Pixels:
        size = shape[0] * shape[1]
        size *= np.dtype(dtype).itemsize
        kept = _KEPT.arrays.get(name)
        if kept is None or len(kept) < size:
            kept = _KEPT.arrays[name] = np.empty(size, dtype=np.uint8)
        return kept[:size].view(dtype).reshape(shape)
