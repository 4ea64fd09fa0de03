"""Bytes that came over a line to a frame."""

import tempfile
from dataclasses import replace
from pathlib import Path

from app.core.frame import Frame


def frame_of(data: bytes, suffix: str, name: str) -> Frame:
    """The picture in ``data``; ``suffix`` (".fits", ".jpg", ".cr2") says of what kind it is.

    FITS never touches the disk. ``name`` stands for the file's in sentences.

    Raises
    ------
    app.core.errors.FrameError
        The bytes are no picture, or are cut short.

    """
    from app.frames import read_frame
    from app.frames.fits import read_fits_bytes

    if data.startswith(b"SIMPLE  ="):
        return read_fits_bytes(data, name)
    with tempfile.TemporaryDirectory(prefix="kochab-") as folder:
        path = Path(folder, f"frame{suffix}")
        path.write_bytes(data)
        return replace(read_frame(path), path=name)
