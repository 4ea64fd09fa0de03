"""TIFF of 8, 16 and 32 bits, integer and float, grey and colour, through tifffile."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.errors import FrameError
from app.core.frame import Frame
from app.frames.exif_hint import exif_from_bytes, hint_from_exif
from app.frames.planes import check_size, finite, split

_CFA = 32803


def read_tiff(path: Path) -> Frame:
    """Read the first page of a TIFF; a camera's raw file in disguise goes to the raw reader.

    Raises
    ------
    FrameError
        When it is cut short, damaged or too large.
    """
    import logging

    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)
    try:
        with tifffile.TiffFile(path) as file:
            if _is_raw(file):
                from app.frames.raw import read_raw

                return read_raw(path)
            page: Any = file.pages[0]
            check_size(int(page.imagewidth), int(page.imagelength))
            samples, inverted = _samples(page)
            count = len(file.pages)
    except (FrameError, MemoryError):
        raise
    except Exception:  # tags of a damaged file fail in many ways
        raise FrameError("is a damaged or cut short TIFF file.") from None
    if inverted and samples.dtype.kind == "u":
        samples = np.iinfo(samples.dtype).max - samples
    pixels, colour, saturation = split(samples)
    pixels, gaps = finite(pixels)
    notes = (f"Of {count} pages only the first is read.",) if count > 1 else ()
    hint, header, doubts = hint_from_exif(exif_from_bytes(path), (pixels.shape[1], len(pixels)))
    return Frame(
        pixels, colour, None, saturation, str(path), hint, (*notes, *gaps, *doubts), header
    )  # fmt: skip


def _samples(page: Any) -> tuple[NDArray[Any], bool]:
    data = np.asarray(page.asarray())
    while data.ndim > 3 or (data.ndim == 3 and 1 in data.shape[:1]):
        data = data[0]
    if data.ndim == 3 and page.planarconfig == 2:
        data = np.moveaxis(data, 0, -1)
    if page.photometric == 3 and page.colormap is not None and data.ndim == 2:
        data = np.moveaxis(np.asarray(page.colormap), 0, -1)[data]
    if data.ndim not in (2, 3):
        raise FrameError("holds no flat picture.")
    return data, page.photometric == 0


def _is_raw(file: Any) -> bool:
    page = file.pages[0]
    if 50706 in page.tags or page.photometric == _CFA:
        return True
    return any(p.photometric == _CFA for p in (page.pages or ()))
