"""Files to frames: which reader a file belongs to, and where it is read."""

import os
import warnings
from collections.abc import Callable
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from kochab.core.errors import FrameError, printable
from kochab.core.frame import Frame
from kochab.core.progress import Task, run
from kochab.core.registry import Registry
from kochab.core.values import frozen
from kochab.frames.sandbox import Outside, in_sandbox, leave_to_sandbox, memory_text
from kochab.text.translation import tr, tr_noop

Reader = Callable[..., Frame]
"""Takes the path; one of videos the number of the frame, too."""

# -- Which reader a file belongs to, decided by what it holds before what it is called ---------


@frozen
class Format:
    """A kind of file: its ``reader`` (``module:function``), its suffixes, the bytes it may begin with, and its names.

    ``names`` are what people read where Kochab says what it opens; of a ``video`` one frame is read. Files that begin
    alike are told apart in :func:`kind_of`.
    """

    reader: str
    suffixes: str
    beginnings: tuple[bytes, ...]
    names: str
    video: bool = False


_RAW = ".cr2 .cr3 .crw .nef .nrw .arw .srf .sr2 .dng .raf .orf .rw2 .raw .pef .srw .3fr .iiq .x3f"
_OWN = {
    "FITS": Format(
        "kochab.frames.fits:read_fits",
        ".fit .fits .fts .fz .gz .bz2",
        (b"SIMPLE  =", b"\x1f\x8b", b"BZh"),
        tr_noop("FITS"),
    ),
    "XISF": Format("kochab.frames.xisf:read_xisf", ".xisf", (b"XISF0100",), tr_noop("XISF")),
    "TIFF": Format(
        "kochab.frames.tiff:read_tiff", ".tif .tiff", (b"II*\x00", b"MM\x00*", b"II+\x00", b"MM\x00+"), tr_noop("TIFF")
    ),
    "picture": Format(
        "kochab.frames.picture:read_picture",
        ".png .jpg .jpeg .bmp .gif .webp",
        (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"GIF8", b"BM"),
        tr_noop("PNG, JPEG, BMP, GIF, WebP"),
    ),
    "HEIF": Format("kochab.frames.picture:read_heif", ".heic .heif .hif", (), tr_noop("HEIC")),
    "SER": Format("kochab.frames.ser:read_ser", ".ser", (b"LUCAM-RECORDER",), tr_noop("SER"), video=True),
    "AVI": Format("kochab.frames.avi:read_avi", ".avi", (), tr_noop("AVI"), video=True),
    "raw": Format(
        "kochab.frames.tiff:read_raw",
        _RAW,
        (b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\x00", b"FOVb"),
        tr_noop("camera RAW"),
    ),
}
"""Everything that Kochab knows of a format stands in its row."""

FORMATS: Registry[Frame] = Registry("format", "kochab.formats", {name: row.reader for name, row in _OWN.items()})
"""Readers, functions of a path. Another package's is named by its files' suffix: ``asdf``."""

_PACKERS = (".gz", ".bz2")  # of any file
_PACKED = (".fz", *_PACKERS)
_SUFFIXES = {suffix: name for name, row in _OWN.items() for suffix in row.suffixes.split()}


def suffixes() -> dict[str, str]:
    """The suffixes of the files that can be read, in small letters with their dot, and the format of each.

    Other packages' formats are among them.
    """
    return _SUFFIXES | {f".{name}": name for name in FORMATS.others()}


def named_as_fits(path: str | os.PathLike[str], packed: bool = True) -> bool:
    """Whether a file's name is one of FITS; also where what it holds is ``packed``, unless that is no help."""
    suffix = os.path.splitext(path)[1].lower()
    return _SUFFIXES.get(suffix) == "FITS" and (packed or suffix not in _PACKED)


def named_as_frame(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a frame by its name: ``m42.png`` and ``m42.fits.gz``, not ``stars.csv.gz`` or ``._m42.png``."""
    name = os.path.basename(path).lower()
    stem, suffix = os.path.splitext(name)
    if suffix in _PACKERS:
        suffix = os.path.splitext(stem)[1]
    return suffix in suffixes() and suffix not in _PACKERS and not name.startswith(".")


def frames_of(folder: Path) -> list[Path]:
    """The frames in a folder, by name; OSError when it cannot be read."""
    return sorted(path for path in folder.iterdir() if named_as_frame(path) and path.is_file())


def file_pattern() -> str:
    """Suffix patterns for a file dialog, in lower and upper case for systems that distinguish them."""
    return " ".join(f"*{suffix} *{suffix.upper()}" for suffix in suffixes())


def format_names() -> str:
    """What can be opened, for people: ``FITS, XISF, ... or camera RAW``."""
    *names, last = (tr(row.names) for row in _OWN.values())
    return tr("{names} or {last}", names=", ".join([*names, *FORMATS.others()]), last=last)


READ_LIMIT_S = 60.0
"""After so many seconds a decoder is stopped, unless a caller says otherwise."""


def read_frame(
    path: str | os.PathLike[str], timeout_s: float | None = READ_LIMIT_S, number: int | None = None
) -> Frame:
    """Read the picture in a file.

    Parameters
    ----------
    path
        A file in any of `FORMATS`; its content decides which, its suffix only between kinds
        that begin alike (a DNG is a TIFF).
    timeout_s
        Limit for a decoder in a process of its own, s; None for no limit.
    number
        The frame of a video (SER, AVI), counted from 1; None for a picture, and for the first of a video.

    Returns
    -------
    Frame
        ``pixels`` (H, W) native and contiguous, row 0 at the top of the screen; no file's rows
        are turned over, so that pixel positions stay those of the file.

    Raises `FrameError` with one sentence naming the file, for whatever is wrong with it.
    """
    return run(reading(path, timeout_s, number))


def reading(
    path: str | os.PathLike[str], timeout_s: float | None = READ_LIMIT_S, number: int | None = None
) -> Task[Frame]:
    """:func:`read_frame` as a task: closing it stops the decoder, whatever that does."""
    path = Path(path)
    kind = _sniff(path)
    foreign = "" if kind in FORMATS.own else f"format '{kind}' ({FORMATS[kind]})"
    reader = FORMATS.load(kind)
    if number is not None:
        if kind not in _OWN or not _OWN[kind].video:
            raise FrameError("{name} is no video (SER, AVI): it has no frame {number}.", name=path.name, number=number)
        reader = partial(reader, number=number)
    return (yield from _anywhere(path.name, timeout_s, _read, reader, path, foreign))


def read_fits_bytes(data: bytes, name: str) -> Frame:
    """The frame of a FITS file in memory, as a camera server sends it; ``name`` stands for its path.

    Raises `FrameError` as :func:`read_frame`, with one sentence that names it.
    """
    from kochab.frames.fits import read_fits_file

    return run(_anywhere(name, READ_LIMIT_S, _read_bytes, read_fits_file, data, name))


def _anywhere(name: str, timeout_s: float | None, function: Callable[..., Frame], *arguments: Any) -> Task[Frame]:
    """Read in this process, at once, unless the reader leaves it to the sandbox."""
    try:
        return function(*arguments)
    except Outside:
        return (yield from in_sandbox(name, timeout_s, function, *arguments))


def _read_bytes(reader: Callable[[BinaryIO, Path], Frame], data: bytes, name: str) -> Frame:
    return _read(partial(reader, BytesIO(data)), Path(name), "")


def _read(reader: Reader, path: Path, foreign: str) -> Frame:
    """The frame; what is wrong becomes one sentence that names the file, and whose reader it is if not ours."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _foreign(reader, path, foreign) if foreign else reader(path)
    except FrameError as error:
        text = str(error)
        raise (
            error if printable(path.name) in text else FrameError("{name} {text}", name=path.name, text=text)
        ) from None
    except MemoryError:
        raise FrameError(
            "{name} does not fit into the {memory} there is for reading it.", name=path.name, memory=memory_text()
        ) from None
    except OSError as error:
        raise FrameError("{name} cannot be read: {plain}.", name=path.name, plain=_plain(error)) from None


def _foreign(reader: Reader, path: Path, whose: str) -> Frame:
    """The frame from another package's reader; whatever else that raises becomes a FrameError."""
    leave_to_sandbox()
    try:
        frame = reader(path)
        if not isinstance(frame, Frame):
            raise TypeError(f"the reader returned {type(frame).__name__}, not a Frame")
    except (FrameError, MemoryError, OSError):
        raise
    except Exception as error:  # another package's code may raise anything
        cause = f"{type(error).__name__}: {_plain(error)}"
        raise FrameError(
            "{name} cannot be read: a fault in the {whose}, {cause}.", name=path.name, whose=whose, cause=cause
        ) from error
    return frame


def _sniff(path: Path) -> str:
    try:
        if path.is_dir():
            raise FrameError("{path} is a folder, not an image.", path=path)
        if path.exists() and not path.is_file():  # a pipe would keep us waiting for ever
            raise FrameError("{path} is a pipe or a device, not a file.", path=path)
        with path.open("rb") as file:
            head = file.read(64)
    except FileNotFoundError:
        raise FrameError("{path} does not exist.", path=path) from None
    except PermissionError:
        raise FrameError("Can't open {path}: permission denied.", path=path) from None
    except (OSError, ValueError) as error:
        raise FrameError("Can't open {path}: {plain}.", path=path, plain=_plain(error)) from None
    if not head:
        raise FrameError("{name} is empty.", name=path.name)
    suffix = path.suffix.lower()
    if kind := kind_of(head, suffix):
        return kind
    if suffix[1:] in FORMATS.others():
        return suffix[1:]
    raise FrameError("Can't open {name}: not a supported image ({known}).", name=path.name, known=format_names())


def kind_of(head: bytes, suffix: str) -> str | None:
    """The key of `FORMATS` for a file that begins with ``head``, None when unknown."""
    named = _SUFFIXES.get(suffix)
    # ISO base media files: Canon's CR3 among them has the brand "crx ".
    if head[4:8] == b"ftyp":
        return "raw" if head[8:12] == b"crx " else "HEIF"
    if head[:4] == b"RIFF":
        return {b"WEBP": "picture", b"AVI ": "AVI"}.get(head[8:12])
    for kind, row in _OWN.items():
        if row.beginnings and head.startswith(row.beginnings):
            # Most cameras' raw files are TIFF inside; only the name tells them from a picture.
            return "raw" if kind == "TIFF" and (named == "raw" or head[8:10] == b"CR") else kind
    return "raw" if named == "raw" else None


def _plain(error: Exception) -> str:
    """An exception's own words on one line, without a full stop."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())[:200].rstrip(".")
