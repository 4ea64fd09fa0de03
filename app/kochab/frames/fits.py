"""FITS: lenient headers, and the first image, plain, compressed (.fz), gzipped or bzipped.

Plain images are read by hand, in pieces that are turned into native unsigned numbers while they
are in the processor's cache; tile compression is astropy's.
A header card that breaks the standard (FITS 4.0, section 4) costs a warning, not the frame.
"""

import bz2
import gzip
import io
import math
import os
import re
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import field
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from kochab.core.arrays import Array
from kochab.core.errors import FrameError, printable
from kochab.core.frame import Frame
from kochab.core.threads import in_threads, thread_count
from kochab.core.values import mutable
from kochab.frames.hints import frame_with_keywords
from kochab.frames.samples import MAX_BYTES, check_size, native
from kochab.frames.sandbox import leave_to_sandbox
from kochab.text.translation import tr

BLOCK = 2880
CARD = 80
_MAX_BLOCKS = 2000  # 5.8 MB of header: more is no header

_STRING = re.compile(r"\s*'((?:[^']|'')*)'\s*(?:/.*)?$")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([EeDd][+-]?\d+)?$")
_NAME = re.compile(r"[A-Z0-9_-]*$")


@mutable
class Header:
    """Keyword values, the comments beside them, and the keywords of cards that did not parse."""

    values: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    unparsed: list[str] = field(default_factory=list)

    def integer(self, name: str, default: int | None = None) -> int:
        """A keyword that must be a whole number.

        Raises FrameError when it is absent without a default, or something else.
        """
        value = self.values.get(name, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int):
            raise FrameError("is a damaged FITS file: its header has no valid {name}.", name=name)
        return value

    def number(self, name: str, default: float) -> float:
        """A keyword that should be a number, else the default."""
        value = self.values.get(name, default)
        ok = isinstance(value, int | float) and not isinstance(value, bool)
        return float(value) if ok else default

    def shape(self, prefix: str = "") -> tuple[int, ...]:
        """The array's shape in numpy's order (last axis first); ``prefix`` Z for compressed."""
        count = self.integer(f"{prefix}NAXIS")
        if not 0 <= count <= 999:
            raise FrameError("is a damaged FITS file: it claims {count} axes.", count=count)
        sizes = [self.integer(f"{prefix}NAXIS{i + 1}") for i in range(count)]
        if any(s < 0 for s in sizes):
            raise FrameError("is a damaged FITS file: it claims an axis of negative length.")
        return tuple(reversed(sizes))


def read_header(file: BinaryIO) -> Header | None:
    """The header at the file's position, leaving it at the data; None at the end of the file.

    Raises FrameError when there is no END within the file.
    """
    cards: list[str] = []
    for number in range(_MAX_BLOCKS):
        block = file.read(BLOCK)
        # The last block may be short; a lone tail of zeros or line ends is padding that some programs add.
        if len(block) < BLOCK:
            if not number and not block.strip(b"\x00 \r\n"):
                return None
            # Some writers do not pad the last header block: END itself must be there.
            if b"END" + b" " * 77 not in block:
                raise FrameError("is cut short: its FITS header does not end.")
        text = block.decode("latin-1")
        lines = [text[i : i + CARD] for i in range(0, len(text), CARD)]
        for line in lines:
            if line.rstrip(" \x00") == "END":
                return parse_cards(cards)
            cards.append(line)
    raise FrameError("is a damaged FITS file: its header does not end.")


def parse_cards(cards: Iterable[str]) -> Header:
    """A header from cards of 80 characters; the first of repeated keywords wins."""
    header = Header()
    last = ""
    for card in cards:
        name = card[:8].rstrip()
        if name in ("COMMENT", "HISTORY", ""):
            continue
        if name == "CONTINUE":
            _continue(header, last, card[8:])
            continue
        body = card[10:]
        if name == "HIERARCH" and "=" in card:
            name, body = (part.strip() for part in card[9:].split("=", 1))
        elif card[8:9] == "=" and card[9:10].strip():
            body = card[9:]  # a value that lacks the space before it, as some programs write
        elif card[8:10].rstrip() != "=":
            if not _NAME.match(name):
                header.unparsed.append(printable(name))
            continue
        last = name
        if name in header.values:
            continue
        value, comment, ok = parse_value(body)
        header.values[name] = value
        header.comments[name] = comment
        if not ok:
            header.unparsed.append(printable(name))
    return header


def parse_value(body: str) -> tuple[Any, str, bool]:
    """A card's value, its comment, and whether it kept to the standard.

    What does not parse comes back as bare text, since it often still means something (``RA = 05 29 34``).
    """
    if string := _STRING.match(body):
        comment = body[string.end(1) + 1 :].partition("/")[2].strip()
        return string[1].replace("''", "'").rstrip(), comment, True
    text, _, comment = body.partition("/")
    text, comment = text.strip(), comment.strip()
    if text in ("T", "F"):
        return text == "T", comment, True
    if not text:
        return None, comment, True
    if number := _NUMBER.match(text):
        if number[2] is None and "." not in number[1]:
            return (int(text), comment, True) if len(text) < 25 else (float(text), comment, True)
        return float(text.upper().replace("D", "E")), comment, True
    return text.strip("' "), comment, False


def _continue(header: Header, name: str, body: str) -> None:
    held = header.values.get(name)
    value, _, ok = parse_value(body)
    if ok and isinstance(held, str) and held.endswith("&") and isinstance(value, str):
        header.values[name] = held[:-1] + value


_TYPES = {8: ">u1", 16: ">i2", 32: ">i4", 64: ">i8", -32: ">f4", -64: ">f8"}
_MAX_HDUS = 1000
_MOST_BYTES = 1 << 60  # of one part: beyond, no file can be positioned
_MAX_FIELDS = 999  # FITS standard 4.0, section 7.3.1
_MAX_TILE_PX = 1 << 24  # of a tile that spans several planes
_CHUNK_BYTES = 1 << 18  # with what it becomes, half of a processor's own cache
_LARGE_BYTES = 8 << 20  # of more, each thread reads a part


@mutable
class FitsImage:
    """Where an image lies: its header (with the primary's keywords) from ``start`` to ``offset``, index, shape."""

    header: Header
    index: int
    start: int
    offset: int
    shape: tuple[int, ...]
    bitpix: int
    compressed: bool


def read_fits(path: Path) -> Frame:
    """Read the first image of a FITS file; row 0 of the array is the top of the screen.

    ``ROWORDER`` turns nothing over, so that the solution belongs to the file's own pixels; it
    only tells how the Bayer pattern is meant.

    Raises FrameError when the file is cut short, damaged, too large, or holds no image.
    """
    with path.open("rb") as file:
        return read_fits_file(file, path)


def read_fits_file(file: BinaryIO, path: Path) -> Frame:
    """The same of an open file, plain or packed; ``path`` is what the frame is called."""
    packed_bytes = file.seek(0, os.SEEK_END)
    if (pack := pack_of(file)) is None:
        return _read(file, path, packed_bytes)
    leave_to_sandbox()
    try:
        with pack(file) as unzipped:
            if unzipped.read(9) != b"SIMPLE  =":
                raise FrameError("holds no FITS image.")
            return _read(unzipped, path, packed_bytes)  # type: ignore[arg-type]
    except (EOFError, zlib.error, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:  # of the disk
            raise
        raise FrameError("is cut short or damaged: it does not unzip.") from None


PACKED = gzip.GzipFile, bz2.BZ2File


def pack_of(file: BinaryIO) -> Callable[[BinaryIO], gzip.GzipFile | bz2.BZ2File] | None:
    """What unpacks an open file, which is at its beginning afterwards; None where it is plain."""
    file.seek(0)
    head = file.read(3)
    file.seek(0)
    if head.startswith(b"BZh"):
        return bz2.BZ2File
    return (lambda packed: gzip.GzipFile(fileobj=packed)) if head.startswith(b"\x1f\x8b") else None


def _read(file: BinaryIO, path: Path, packed_bytes: int) -> Frame:
    image = find_image(file)
    header = image.header
    packed = image.compressed or isinstance(file, PACKED)
    wanted, notes = _choose(image.shape, abs(image.bitpix) // 8, packed_bytes if packed else None)
    read = _decompress if image.compressed else _read_plain
    samples = read(file, image, wanted).reshape(wanted)
    # Colour stored as planes; a last axis of 3 or 4 is already interleaved.
    if len(wanted) == 3 and wanted[0] in (3, 4) and wanted[2] > 4:
        samples = np.moveaxis(samples, 0, -1)
    if header.unparsed:
        names = ", ".join(dict.fromkeys(header.unparsed[:8]))
        notes = (*notes, tr("The FITS header has cards that break the standard: {names}.", names=names))
    return frame_with_keywords(samples, path, header.values, header.comments, notes, _saturation(header))


def _headers(file: BinaryIO) -> Iterator[tuple[int, Header]]:
    """Each part's place and header, believable as far as tables go, with the file at the data after it."""
    file.seek(0)
    for index in range(_MAX_HDUS):
        start = file.tell()
        if index and file.read(8) != b"XTENSION":
            break  # whatever follows is no part of the file the standard knows
        file.seek(start)
        header = read_header(file)
        if header is None:
            break
        fields = header.integer("TFIELDS", 0)
        if not 0 <= fields <= _MAX_FIELDS:  # astropy makes room for each column
            raise FrameError("is a damaged FITS file: it claims a table of {fields} columns.", fields=fields)
        data = file.tell()
        yield start, header
        # FITS 4.0, section 4.4.1.2: |BITPIX| / 8 * GCOUNT * (PCOUNT + NAXIS1 * NAXIS2 * ...).
        size = abs(header.integer("BITPIX", 8)) // 8 * header.integer("GCOUNT", 1)
        whole = header.shape()
        size *= header.integer("PCOUNT", 0) + (math.prod(whole) if whole else 0)
        if size > _MOST_BYTES:
            raise FrameError("is a damaged FITS file: it claims {size:.2g} bytes of data.", size=size)
        file.seek(data + max(0, -(-size // BLOCK) * BLOCK))


def find_image(file: BinaryIO) -> FitsImage:
    """The first image of the file, plain or compressed; FrameError when there is none."""
    primary: Header | None = None
    tables = False
    for index, (start, header) in enumerate(_headers(file)):
        primary = primary or header
        values = header.values
        compressed = values.get("ZIMAGE") is True
        tables = tables or (not compressed and values.get("XTENSION") in ("BINTABLE", "TABLE"))
        kind = values.get("XTENSION", "IMAGE")
        if compressed or (kind in ("IMAGE", "IUEIMAGE") and "NAXIS" in values):
            prefix = "Z" if compressed else ""
            # Axes of length 1, as of Stokes or of a cube of one, are no axes of the picture.
            shape = tuple(s for s in header.shape(prefix) if s != 1)
            if len(shape) >= 2 and all(shape):
                bitpix = header.integer(f"{prefix}BITPIX")
                if bitpix not in _TYPES:
                    raise FrameError("is a damaged FITS file: BITPIX is {bitpix}.", bitpix=bitpix)
                both = Header({**primary.values, **values}, {**primary.comments, **header.comments}, header.unparsed)
                return FitsImage(both, index, start, file.tell(), shape, bitpix, compressed)
            if any(s == 0 for s in shape) and len(shape) >= 2:
                raise FrameError("holds an image without pixels.")
    if tables:
        raise FrameError("holds a table and no image: give the frame that it was made from.")
    raise FrameError("holds no image.")


def _choose(shape: tuple[int, ...], deep: int, packed_bytes: int | None) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """The part of the array that is read, ``deep`` bytes a sample, and what is said of the rest."""
    notes: tuple[str, ...] = ()
    if len(shape) > 3:
        shape, notes = shape[-3:], (tr("Only the first of {many} sub-cubes is read.", many=shape[:-3]),)
    if len(shape) == 3:
        if (shape[0] in (3, 4) and shape[2] > 4) or shape[2] in (3, 4):
            height, width = shape[1:] if shape[2] > 4 else shape[:2]
            check_size(width, height, deep * math.prod(shape) // (width * height or 1), packed_bytes)
            return shape, notes
        notes = (*notes, tr("Only the first of {many} planes is read.", many=shape[0]))
        shape = shape[1:]
    check_size(shape[1], shape[0], deep, packed_bytes)
    return shape, notes


def _read_plain(file: BinaryIO, image: FitsImage, wanted: tuple[int, ...]) -> Array:
    stored = np.dtype(_TYPES[image.bitpix])
    count = math.prod(wanted)
    zero, scale = image.header.number("BZERO", 0.0), image.header.number("BSCALE", 1.0)
    offset_type = _unsigned(image.bitpix, zero, scale)
    out = np.empty(count, stored.newbyteorder("=") if offset_type is None else offset_type)
    half = np.array(1 << (8 * stored.itemsize - 1)).astype(out.dtype)
    step = _CHUNK_BYTES // stored.itemsize
    readers = thread_count() if out.nbytes > _LARGE_BYTES and _has_places(file) else 1
    into = partial(_read_at, file.fileno()) if readers > 1 else partial(_read_on, file)
    file.seek(image.offset)

    def read(first: int, last: int) -> None:
        raw = np.empty(min(step, last - first), out.dtype)
        for start in range(first, last, step):
            part = out[start : min(start + step, last)]
            found = raw[: len(part)]
            filled = into(found.view(np.uint8).data, image.offset + start * stored.itemsize)
            if filled != part.nbytes:
                share = 100 * (start * stored.itemsize + filled) // out.nbytes
                raise FrameError("is cut short: {share} % of its image is there.", share=share)
            _make_native(found, part)
            if offset_type is not None:
                # Adding 2^15 to a signed 16-bit number flips its top bit: no wider type is needed.
                part ^= half

    ends = [count * k // readers for k in range(readers + 1)]
    in_turn = in_threads if readers > 1 else map
    list(in_turn(read, ends[:-1], ends[1:]))
    if offset_type is None and (zero != 0.0 or scale != 1.0):
        return _scaled(out, image.header, zero, scale)
    return out


def _has_places(file: BinaryIO) -> bool:
    """Whether several threads may read a file at once, each at its own position: a real file, where the system can."""
    return isinstance(file, io.BufferedReader) and hasattr(os, "preadv")


def _read_at(descriptor: int, buffer: memoryview, place: int) -> int:
    """Fill the buffer from a position in the file; returns the number of bytes read."""
    filled = 0
    while more := os.preadv(descriptor, [buffer[filled:]], place + filled):
        filled += more
    return filled


def _read_on(file: BinaryIO, buffer: memoryview, _: int) -> int:
    """Fill the buffer from the file's current position; returns the number of bytes read."""
    return int(file.readinto(buffer))  # type: ignore[attr-defined]


def _make_native(found: Array, out: Array) -> None:
    """Write big-endian numbers to ``out`` as native ones, overwriting ``found``: shifts are faster than byteswap."""
    if out.itemsize != 2 or sys.byteorder == "big":
        out[:] = found if out.itemsize == 1 or sys.byteorder == "big" else found.byteswap(inplace=True)
        return
    words, native = found.view(np.uint16), out.view(np.uint16)
    np.left_shift(words, 8, out=native)
    words >>= 8
    native |= words


def _unsigned(bitpix: int, zero: float, scale: float) -> np.dtype[Any] | None:
    """The type meant by the standard's offset for the other signedness, if this is one."""
    if scale != 1.0:
        return None
    kinds = {(8, -128.0): "i1", (16, 32768.0): "u2", (32, 2147483648.0): "u4"}
    kind = kinds.get((bitpix, zero))
    return np.dtype(kind) if kind else None


def _scaled(stored: Array, header: Header, zero: float, scale: float) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        values = (stored * np.float64(scale) + zero).astype(np.float32)
    blank = header.values.get("BLANK")
    if stored.dtype.kind in "iu" and isinstance(blank, int) and not isinstance(blank, bool):
        values[stored == blank] = np.nan
    return values


def _decompress(file: BinaryIO, image: FitsImage, wanted: tuple[int, ...]) -> Array:
    if isinstance(file, PACKED):  # astropy goes to a file's end and back
        file.seek(0)
        # Bounded: a bomb must not fill the memory.
        file = io.BytesIO(file.read(MAX_BYTES))
    _check_tiles(image, wanted, file.seek(0, os.SEEK_END) - image.offset)
    leave_to_sandbox()
    from astropy.io import fits

    whole = image.header.shape("Z")
    beyond = len(image.shape) - len(wanted)  # axes of the cube of which only the first is read
    part: list[int | slice] = []
    for size in whole:
        leave_out = size != 1 and beyond > 0
        beyond -= leave_out
        part.append(0 if size == 1 or leave_out else slice(None))
    file.seek(0)
    try:
        with fits.open(file, memmap=False, ignore_missing_simple=True) as hdus:
            data = np.asarray(hdus[image.index].section[tuple(part)])
    except Exception:  # the codecs raise a dozen kinds for damaged tiles
        raise FrameError("is damaged: its tiles do not decompress.") from None
    if data.shape != wanted:
        raise FrameError("is cut short.")
    return native(data.reshape(-1))


def _check_tiles(image: FitsImage, wanted: tuple[int, ...], available: int) -> None:
    """Refuse tiles that do not fit their picture, or its file, before memory is asked for.

    After the FITS standard 4.0, section 10: a row of the table for each tile.
    """
    header = image.header
    whole = header.shape("Z")
    axes = range(1, len(whole) + 1)
    tile = [header.integer(f"ZTILE{i}", whole[-1] if i == 1 else 1) for i in axes]
    sizes = list(zip(reversed(whole), tile, strict=True))
    if any(not 1 <= side <= max(size, 1) for size, side in sizes):
        raise FrameError("is a damaged FITS file: it claims tiles of {tile} pixels.", tile=tile)
    if math.prod(tile) > max(math.prod(wanted), _MAX_TILE_PX):
        raise FrameError("packs {prod} pixels into one tile, more than Kochab unpacks.", prod=math.prod(tile))
    row, rows = header.integer("NAXIS1"), header.integer("NAXIS2")
    if rows != math.prod(-(-size // side) for size, side in sizes):
        raise FrameError("is a damaged FITS file: it has {rows} tiles, which is not all.", rows=rows)
    if row * rows > available:
        raise FrameError("is cut short: its table of tiles is not all there.")


def _saturation(header: Header) -> float | None:
    levels = (header.number(name, 0.0) for name in ("SATURATE", "SATLEVEL", "DATAMAX"))
    return next((level for level in levels if 0.0 < level < 1e9), None)
