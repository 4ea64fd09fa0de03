"""Files to frames: which reader a file belongs to, and from decoded samples to a `Frame`."""

import logging
import os
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.arrays import Array
from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.core.registry import Registry

Reader = Callable[[Path], Frame]
_logger = logging.getLogger(__name__)

# -- Which reader a file belongs to, decided by what it holds before what it is called ---------

FORMATS: Registry[Frame] = Registry(
    "format",
    "kochab.formats",
    {
        "FITS": "kochab.frames.fits:read_fits",
        "XISF": "kochab.frames.xisf:read_xisf",
        "TIFF": "kochab.frames.tiff:read_tiff",
        "picture": "kochab.frames.picture:read_picture",
        "HEIF": "kochab.frames.picture:read_heif",
        "raw": "kochab.frames.tiff:read_raw",
    },
)
"""Readers, functions of a path. Another package's is named by its files' suffix: ``asdf``."""

_RAW = (  # noqa: SIM905
    ".cr2 .cr3 .crw .nef .nrw .arw .srf .sr2 .dng .raf .orf .rw2 .raw .pef .srw .3fr .iiq .x3f"
).split()

SUFFIXES: dict[str, str] = {
    **dict.fromkeys((".fit", ".fits", ".fts", ".fz", ".gz"), "FITS"),
    **dict.fromkeys((".xisf",), "XISF"),
    **dict.fromkeys((".tif", ".tiff"), "TIFF"),
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".bmp", ".gif", ".webp"), "picture"),
    **dict.fromkeys((".heic", ".heif", ".hif"), "HEIF"),
    **dict.fromkeys(_RAW, "raw"),
}

_MAGIC: tuple[tuple[bytes, str], ...] = (
    (b"SIMPLE  =", "FITS"),
    (b"\x1f\x8b", "FITS"),
    (b"XISF0100", "XISF"),
    (b"\x89PNG\r\n\x1a\n", "picture"),
    (b"\xff\xd8\xff", "picture"),
    (b"GIF8", "picture"),
    (b"BM", "picture"),
    (b"FUJIFILMCCD-RAW", "raw"),
    (b"IIRO", "raw"),
    (b"IIRS", "raw"),
    (b"MMOR", "raw"),
    (b"IIU\x00", "raw"),
    (b"FOVb", "raw"),
    (b"II*\x00", "TIFF"),
    (b"MM\x00*", "TIFF"),
    (b"II+\x00", "TIFF"),
    (b"MM\x00+", "TIFF"),
)


def read_frame(path: str | os.PathLike[str]) -> Frame:
    """Read the picture in a file.

    Parameters
    ----------
    path
        A file in any of `FORMATS`; its content decides which, its suffix only between kinds
        that begin alike (a DNG is a TIFF).

    Returns
    -------
    Frame
        ``pixels`` (H, W) native and contiguous, row 0 at the top of the screen; no file's rows
        are turned over, so that pixel positions stay those of the file.

    Raises
    ------
    FrameError
        With one sentence naming the file, for whatever is wrong with it.
    """
    path = Path(path)
    kind = _sniff(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader: Reader = FORMATS.load(kind)
            return reader(path) if kind in FORMATS.own else _foreign(reader, path, kind)
    except FrameError as error:
        text = str(error)
        raise (error if path.name in text else FrameError(f"{path.name} {text}")) from None
    except MemoryError:
        raise FrameError(f"{path.name} does not fit into this computer's memory.") from None
    except OSError as error:
        raise FrameError(f"{path.name} cannot be read: {_plain(error)}.") from None


def _foreign(reader: Reader, path: Path, kind: str) -> Frame:
    """The frame from another package's reader; whatever else that raises becomes a FrameError."""
    try:
        frame = reader(path)
        if not isinstance(frame, Frame):
            raise TypeError(f"the reader returned {type(frame).__name__}, not a Frame")
    except (FrameError, MemoryError, OSError):
        raise
    except Exception as error:  # another package's code may raise anything
        _logger.debug("%s: %s", FORMATS[kind], path, exc_info=True)
        cause = f"{type(error).__name__}: {_plain(error)}"
        raise FrameError(
            f"{path.name} cannot be read: a fault in the format '{kind}' ({FORMATS[kind]}), {cause}."
        ) from error
    return frame


def _sniff(path: Path) -> str:
    try:
        if path.is_dir():
            raise FrameError(f"{path} is a folder, not an image.")
        if path.exists() and not path.is_file():  # a pipe would keep us waiting for ever
            raise FrameError(f"{path} is a pipe or a device, not a file.")
        with path.open("rb") as file:
            head = file.read(64)
    except FileNotFoundError:
        raise FrameError(f"{path} does not exist.") from None
    except PermissionError:
        raise FrameError(f"Can't open {path}: permission denied.") from None
    except (OSError, ValueError) as error:
        raise FrameError(f"Can't open {path}: {_plain(error)}.") from None
    if not head:
        raise FrameError(f"{path.name} is empty.")
    kind = kind_of(head, path.suffix.lower())
    if kind is None and path.suffix.lower()[1:] in FORMATS.others():
        return path.suffix.lower()[1:]
    if kind is None:
        raise FrameError(
            f"Can't open {path.name}: not a supported image (FITS, XISF, TIFF, PNG, JPEG, BMP, GIF,"
            " WebP, HEIC or camera RAW)."
        )
    return kind


def kind_of(head: bytes, suffix: str) -> str | None:
    """The key of `FORMATS` for a file that begins with ``head``, None when unknown."""
    named = SUFFIXES.get(suffix)
    if head[4:8] == b"ftyp":
        return "raw" if head[8:12] == b"crx " else "HEIF"
    if head[:4] == b"RIFF":
        return "picture" if head[8:12] == b"WEBP" else None
    for magic, kind in _MAGIC:
        if head.startswith(magic):
            # Most cameras' raw files are TIFF inside; only the name tells them from a picture.
            return "raw" if kind == "TIFF" and (named == "raw" or head[8:10] == b"CR") else kind
    return "raw" if named == "raw" else None


def _plain(error: Exception) -> str:
    """An exception's own words on one line, without a full stop."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())[:200].rstrip(".")


# -- From decoded samples to a frame: size limits, luminance, finite numbers --------------------

MAX_PIXELS = 300_000_000
MAX_SIDE_PX = 100_000
MAX_BYTES = 1_500_000_000
"""Of a decoded picture; `split` and `finite` need as much again for a moment."""
_STRIP_ROWS = 64


def check_size(width: int, height: int, bytes_px: int = 1) -> None:
    """Refuse sizes that no camera has before memory is asked for.

    Parameters
    ----------
    width, height
        Of the picture, px.
    bytes_px
        What a pixel takes once it is decoded, all its channels together.

    Raises
    ------
    FrameError
        When a side is less than 2 px, or the whole is beyond `MAX_PIXELS`, `MAX_BYTES` or the
        memory that is free.
    """
    if width < 2 or height < 2:
        raise FrameError(f"holds no picture: it is {width} x {height} pixels.")
    if width * height > MAX_PIXELS or max(width, height) > MAX_SIDE_PX:
        raise FrameError(
            f"claims {width} x {height} pixels, more than the {MAX_PIXELS // 1_000_000} million Kochab opens."
        )
    size, free = width * height * bytes_px, _free_bytes()
    if size > MAX_BYTES or (free is not None and 2 * size > free):
        limit = MAX_BYTES if size > MAX_BYTES else free // 2 if free else 0
        raise FrameError(
            f"claims {width} x {height} pixels of {8 * bytes_px} bits, {size / 1e9:.1f} GB, more"
            f" than the {limit / 1e9:.1f} GB there is room for."
        )


def _free_bytes() -> int | None:
    """Memory that programs may still take, None where the system does not say (`proc(5)`)."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            rows = (line.split() for line in file)
            return next((int(row[1]) * 1024 for row in rows if row[0] == "MemAvailable:"), None)
    except OSError:
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
        out[rows] = total if rgb.dtype == np.uint8 else (total + 2) >> 2
    return out


def native(array: Array) -> Array:
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


def finite(pixels: Array) -> tuple[Array, tuple[str, ...]]:
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


def _is_grey(rgb: Array) -> bool:
    parts = (rgb[:: max(1, len(rgb) // 16)], rgb)  # a few rows tell most colour images apart
    return all(np.array_equal(part[..., 1], part[..., k]) for part in parts for k in (0, 2))


# -- The colour pattern over a sensor, from what a header says of it ---------------------------

_PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")


def bayer_pattern(values: Mapping[str, Any], height: int) -> str | None:
    """The 2 x 2 pattern read from the array's pixel (0, 0), or None for a grey frame.

    ``XBAYROFF`` and ``YBAYROFF`` shift the named pattern; with ``ROWORDER = BOTTOM-UP`` it is
    named from the array's last row, which such programs show on top.
    """
    name = ""
    for key in ("BAYERPAT", "COLORTYP", "CFA_PAT", "FILTER"):
        name = str(values.get(key, "")).strip().upper()
        if name in _PATTERNS:
            break
    else:
        return None
    x, y = _offset(values.get("XBAYROFF")), _offset(values.get("YBAYROFF"))
    if str(values.get("ROWORDER", "")).strip().upper() == "BOTTOM-UP":
        y += height - 1
    return shifted(name, x, y)


def shifted(pattern: str, x: int, y: int) -> str:
    """The pattern seen from ``x`` columns and ``y`` rows further on."""
    at = [[0, 1], [2, 3]]
    return "".join(pattern[at[(r + y) % 2][(c + x) % 2]] for r in (0, 1) for c in (0, 1))


def _offset(value: Any) -> int:
    try:
        return int(float(value))
    except (TypeError, ValueError, OverflowError):
        return 0
