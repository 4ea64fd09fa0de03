"""FITS: the first image of the file, plain, compressed (.fz) or gzipped.

Plain images are read by hand, straight into the frame's memory and turned into native unsigned
numbers strip by strip while they are in the processor's cache; tile compression is astropy's.
"""

import gzip
import io
import math
import os
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from app.core.errors import FrameError
from app.core.frame import Frame
from app.frames.bayer import bayer_pattern
from app.frames.fits_header import BLOCK, Header, read_header
from app.frames.header_hint import hint_from_keywords
from app.frames.planes import MAX_PIXELS, check_size, clipping_level, finite, native, split

Pixels = NDArray[Any]

_TYPES = {8: ">u1", 16: ">i2", 32: ">i4", 64: ">i8", -32: ">f4", -64: ">f8"}
_MAX_HDUS = 1000
_CHUNK_BYTES = 1 << 19


@dataclass(slots=True)
class _Image:
    """Where an image lies: its header (with the primary's keywords), index, offset, shape."""

    header: Header
    index: int
    offset: int
    shape: tuple[int, ...]
    bitpix: int
    compressed: bool


def read_fits(path: Path) -> Frame:
    """Read the first image of a FITS file; row 0 of the array is the top of the screen.

    ``ROWORDER`` turns nothing over, so that the solution belongs to the file's own pixels; it
    only tells how the Bayer pattern is meant.

    Raises
    ------
    FrameError
        When the file is cut short, damaged, too large, or holds no image.
    """
    with path.open("rb") as file:
        if file.read(2) == b"\x1f\x8b":
            return _read(_unzip(path), path)
        file.seek(0)
        return _read(file, path)


def read_fits_bytes(data: bytes, name: str) -> Frame:
    """The same of a file in memory, as a camera server sends it; ``name`` stands for its path.

    Raises
    ------
    FrameError
        As :func:`read_fits`, with one sentence that names it.
    """
    try:
        return _read(io.BytesIO(data), Path(name))
    except FrameError as error:
        raise FrameError(f"{name} {error}") from None


def _read(file: BinaryIO, path: Path) -> Frame:
    image = _find_image(file)
    header = image.header
    wanted, notes = _choose(image.shape)
    samples = _decompress(file, image) if image.compressed else _read_plain(file, image, wanted)
    samples = samples.reshape(wanted)
    if len(wanted) == 3 and wanted[0] in (3, 4) and wanted[2] > 4:
        samples = np.moveaxis(samples, 0, -1)
    pixels, colour, _ = split(samples)
    pixels, gaps = finite(pixels)
    if header.unparsed:
        names = ", ".join(dict.fromkeys(header.unparsed[:8]))
        notes = (*notes, f"The FITS header has cards that break the standard: {names}.")
    hint, doubts = hint_from_keywords(header.values, header.comments, pixels.shape)
    return Frame(
        pixels,
        colour,
        bayer_pattern(header.values, pixels.shape[0]) if colour is None else None,
        _saturation(header, pixels.dtype),
        str(path),
        hint,
        (*notes, *gaps, *doubts),
        dict(header.values),
    )


def _unzip(path: Path) -> BinaryIO:
    """The unpacked file in memory, refusing what would grow beyond the largest frame."""
    limit = MAX_PIXELS * 4
    try:
        with gzip.open(path, "rb") as packed:
            data = packed.read(limit + 1)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        raise FrameError("is cut short or damaged: it does not unzip.") from None
    if len(data) > limit:
        raise FrameError("unzips to more than Kochab opens.")
    if not data.startswith(b"SIMPLE  ="):
        raise FrameError("holds no FITS image.")
    return io.BytesIO(data)


def _find_image(file: BinaryIO) -> _Image:
    end = file.seek(0, os.SEEK_END)
    file.seek(0)
    primary: Header | None = None
    for index in range(_MAX_HDUS):
        start = file.tell()
        if index and file.read(8) != b"XTENSION":
            break  # whatever follows is no part of the file the standard knows
        file.seek(start)
        header = read_header(file)
        if header is None:
            break
        primary = primary or header
        values = header.values
        compressed = values.get("ZIMAGE") is True
        kind = values.get("XTENSION", "IMAGE")
        if compressed or (kind in ("IMAGE", "IUEIMAGE") and "NAXIS" in values):
            prefix = "Z" if compressed else ""
            shape = tuple(s for s in header.shape(prefix) if s != 1)
            if len(shape) >= 2 and all(shape):
                bitpix = header.integer(f"{prefix}BITPIX")
                if bitpix not in _TYPES:
                    raise FrameError(f"is a damaged FITS file: BITPIX is {bitpix}.")
                both = Header(
                    {**primary.values, **values},
                    {**primary.comments, **header.comments},
                    header.unparsed,
                )
                return _Image(both, index, file.tell(), shape, bitpix, compressed)
            if any(s == 0 for s in shape) and len(shape) >= 2:
                raise FrameError("holds an image without pixels.")
        size = abs(header.integer("BITPIX", 8)) // 8 * header.integer("GCOUNT", 1)
        whole = header.shape()
        size *= header.integer("PCOUNT", 0) + (math.prod(whole) if whole else 0)
        following = file.tell() + max(0, -(-size // BLOCK) * BLOCK)
        if following >= end:
            break
        file.seek(following)
    raise FrameError("holds no image.")


def _choose(shape: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """The part of the array that is read, and what is said of the rest."""
    notes: tuple[str, ...] = ()
    if len(shape) > 3:
        shape, notes = shape[-3:], (f"Of {shape[:-3]} sub-cubes only the first is read.",)
    if len(shape) == 3:
        if (shape[0] in (3, 4) and shape[2] > 4) or shape[2] in (3, 4):
            height, width = shape[1:] if shape[2] > 4 else shape[:2]
            check_size(width, height)
            return shape, notes
        notes = (*notes, f"Of {shape[0]} planes only the first is read.")
        shape = shape[1:]
    check_size(shape[1], shape[0])
    return shape, notes


def _read_plain(file: BinaryIO, image: _Image, wanted: tuple[int, ...]) -> Pixels:
    stored = np.dtype(_TYPES[image.bitpix])
    count = math.prod(wanted)
    available = file.seek(0, os.SEEK_END) - image.offset
    if available < count * stored.itemsize:
        share = 100 * max(0, available) // (count * stored.itemsize)
        raise FrameError(f"is cut short: {share} % of its image is there.")
    file.seek(image.offset)
    zero, scale = image.header.number("BZERO", 0.0), image.header.number("BSCALE", 1.0)
    offset_type = _unsigned(image.bitpix, zero, scale)
    out = np.empty(count, stored.newbyteorder("=") if offset_type is None else offset_type)
    half = np.array(1 << (8 * stored.itemsize - 1)).astype(out.dtype)
    step = _CHUNK_BYTES // stored.itemsize
    for start in range(0, count, step):
        part = out[start : start + step]
        if file.readinto(part.view(np.uint8).data) != part.nbytes:  # type: ignore[attr-defined]
            raise FrameError("is cut short.")
        _swap(part)
        if offset_type is not None:
            part ^= half
    if offset_type is None and (zero != 0.0 or scale != 1.0):
        return _scaled(out, image.header, zero, scale)
    return out


def _swap(part: Pixels) -> None:
    """Turn big-endian numbers into native ones, in place; shifts outrun numpy's byteswap."""
    if part.itemsize == 1 or sys.byteorder == "big":
        return
    if part.itemsize != 2:
        part.byteswap(inplace=True)
        return
    words = part.view(np.uint16)
    high = words << 8
    words >>= 8
    words |= high


def _unsigned(bitpix: int, zero: float, scale: float) -> np.dtype[Any] | None:
    """The type meant by the standard's offset for the other signedness, if this is one."""
    if scale != 1.0:
        return None
    kinds = {(8, -128.0): "i1", (16, 32768.0): "u2", (32, 2147483648.0): "u4"}
    kind = kinds.get((bitpix, zero))
    return np.dtype(kind) if kind else None


def _scaled(stored: Pixels, header: Header, zero: float, scale: float) -> Pixels:
    with np.errstate(over="ignore", invalid="ignore"):
        values = (stored * np.float64(scale) + zero).astype(np.float32)
    blank = header.values.get("BLANK")
    if stored.dtype.kind in "iu" and isinstance(blank, int) and not isinstance(blank, bool):
        values[stored == blank] = np.nan
    return values


def _decompress(file: BinaryIO, image: _Image) -> Pixels:
    from astropy.io import fits

    file.seek(0)
    try:
        with fits.open(file, memmap=False, ignore_missing_simple=True) as hdus:
            data = hdus[image.index].data
    except Exception:  # the codecs raise a dozen kinds for damaged tiles
        raise FrameError("is damaged: its tiles do not decompress.") from None
    if data is None:
        raise FrameError("is damaged: its tiles do not decompress.")
    shape, _ = _choose(image.shape)
    flat = np.asarray(data).reshape(-1)
    if flat.size < math.prod(shape):
        raise FrameError("is cut short.")
    return native(flat[: math.prod(shape)])


def _saturation(header: Header, dtype: np.dtype[Any]) -> float | None:
    for name in ("SATURATE", "SATLEVEL", "DATAMAX"):
        level = header.number(name, 0.0)
        if 0.0 < level < 1e9:
            return level
    return clipping_level(dtype)
