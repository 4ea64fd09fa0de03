"""Bytes that came over a line to a frame."""

import re
import tempfile
import zlib
from dataclasses import replace
from pathlib import Path

from app.core.errors import FrameError
from app.core.frame import Frame

LARGEST_BYTES = 1_200_000_000


def frame_of(data: bytes, suffix: str, name: str) -> Frame:
    """The picture in ``data``; ``suffix`` (".fits", ".jpg", ".cr2") says of what kind it is.

    FITS never touches the disk; ".fits.z" is unpacked first, as older INDI drivers pack it.
    ``name`` stands for the file's in sentences.

    Raises
    ------
    FrameError
        The bytes are no picture, or are cut short.

    """
    from app.frames import read_frame
    from app.frames.fits import read_fits_bytes

    suffix = re.sub(r"[^A-Za-z0-9.]", "", suffix)[-12:]  # a server's word becomes a file's name
    if suffix.endswith(".z"):
        data, suffix = _unpacked(data, name), suffix.removesuffix(".z")
    if data.startswith(b"SIMPLE  ="):
        return read_fits_bytes(data, name)
    with tempfile.TemporaryDirectory(prefix="kochab-", ignore_cleanup_errors=True) as folder:
        path = Path(folder, f"frame{suffix}")
        path.write_bytes(data)
        try:
            return replace(read_frame(path), path=name)
        except FrameError as error:
            raise FrameError(str(error).replace(path.name, name)) from None


def _unpacked(data: bytes, name: str) -> bytes:
    stream = zlib.decompressobj()
    try:
        out = stream.decompress(data, LARGEST_BYTES)
    except zlib.error:
        raise FrameError(f"{name} is damaged: it does not unpack.") from None
    if not stream.eof:
        raise FrameError(f"{name} is cut short, or too large.")
    return out
