"""HEIC and its kin, as telephones write them, through libheif."""

from pathlib import Path

import numpy as np

from app.core.errors import FrameError
from app.core.frame import Frame
from app.frames.exif_hint import exif_from_bytes, hint_from_exif
from app.frames.planes import check_size, split


def read_heif(path: Path) -> Frame:
    """Read the main picture, upright, of 8 to 12 bits.

    Raises
    ------
    FrameError
        When it is cut short, damaged or too large.

    """
    import pillow_heif

    try:
        file = pillow_heif.open_heif(path, convert_hdr_to_8bit=False)
        image = file[file.primary_index]
        check_size(*image.size)
        samples = np.asarray(image)
        block = image.info.get("exif")
        exif = exif_from_bytes(block if isinstance(block, bytes) else None)
    except (FrameError, MemoryError):
        raise
    except Exception:  # libheif's words are for programmers
        raise FrameError("is a damaged or cut short HEIF file.") from None
    pixels, colour, saturation = split(samples)
    hint, header, doubts = hint_from_exif(exif, image.size)
    return Frame(pixels, colour, None, saturation, str(path), hint, doubts, header)
