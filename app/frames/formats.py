"""Which reader a file belongs to, decided by what it holds before what it is called."""

import importlib
import os
import warnings
from collections.abc import Callable
from pathlib import Path

from app.core.errors import FrameError
from app.core.frame import Frame

FORMATS: dict[str, str] = {
    "FITS": "app.frames.fits:read_fits",
    "XISF": "app.frames.xisf:read_xisf",
    "TIFF": "app.frames.tiff:read_tiff",
    "picture": "app.frames.picture:read_picture",
    "HEIF": "app.frames.heif:read_heif",
    "raw": "app.frames.raw:read_raw",
}

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
            return _reader(kind)(path)
    except FrameError as error:
        text = str(error)
        raise (error if path.name in text else FrameError(f"{path.name} {text}")) from None
    except MemoryError:
        raise FrameError(f"{path.name} does not fit into this computer's memory.") from None
    except OSError as error:
        raise FrameError(f"{path.name} cannot be read: {_plain(error)}.") from None


def _reader(kind: str) -> Callable[[Path], Frame]:
    module, name = FORMATS[kind].split(":")
    reader: Callable[[Path], Frame] = getattr(importlib.import_module(module), name)
    return reader


def _sniff(path: Path) -> str:
    try:
        if path.is_dir():
            raise FrameError(f"{path} is a folder, not a picture.")
        if path.exists() and not path.is_file():  # a pipe would keep us waiting for ever
            raise FrameError(f"{path} is a pipe or a device, not a file.")
        with path.open("rb") as file:
            head = file.read(64)
    except FileNotFoundError:
        raise FrameError(f"{path} does not exist.") from None
    except PermissionError:
        raise FrameError(f"{path} may not be read: permission denied.") from None
    except (OSError, ValueError) as error:
        raise FrameError(f"{path} cannot be read: {_plain(error)}.") from None
    if not head:
        raise FrameError(f"{path.name} is empty.")
    kind = kind_of(head, path.suffix.lower())
    if kind is None:
        raise FrameError(
            f"{path.name} is not a picture Kochab knows (FITS, XISF, TIFF, PNG, JPEG, BMP, GIF,"
            " WebP, HEIC or a camera's raw file)."
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
