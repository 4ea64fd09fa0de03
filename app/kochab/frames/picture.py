"""PNG, JPEG, BMP, GIF, WebP and HEIC, through Pillow; PNG of 16 bits through libpng."""

import os
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import (  # the plugins of _FORMATS: Pillow would load all of its forty to find them
    BmpImagePlugin,  # noqa: F401
    GifImagePlugin,  # noqa: F401
    Image,
    ImageOps,
    JpegImagePlugin,  # noqa: F401
    MpoImagePlugin,  # noqa: F401
    PngImagePlugin,  # noqa: F401
    WebPImagePlugin,  # noqa: F401
)

from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.frames.hints import exif_of, frame_with_exif
from kochab.frames.samples import check_size
from kochab.frames.sandbox import decoding, leave_to_sandbox
from kochab.text.translation import tr

Image.MAX_IMAGE_PIXELS = None  # check_size refuses first, with a sentence

_FORMATS = ("PNG", "JPEG", "BMP", "DIB", "GIF", "WEBP", "MPO")
_ORIENTATION = 274
_QUICK = ("PNG", "JPEG", "MPO", "BMP")
_QUICK_PIXELS = 64_000_000  # a second or two
_TAIL_BYTES = 1 << 17
_MOST_SCANS = 32  # progressive JPEGs have ten; each costs a walk over the whole image

# EXIF orientation -> what turns the stored rows and columns upright (EXIF 2.3, tag 274).
_UPRIGHT: dict[Any, Callable[[NDArray[Any]], NDArray[Any]]] = {
    2: lambda a: a[:, ::-1],
    3: lambda a: a[::-1, ::-1],
    4: lambda a: a[::-1],
    5: lambda a: a.swapaxes(0, 1),
    6: lambda a: a.swapaxes(0, 1)[:, ::-1],
    7: lambda a: a[::-1, ::-1].swapaxes(0, 1),
    8: lambda a: a.swapaxes(0, 1)[::-1],
}


def read_picture(path: Path) -> Frame:
    """Read a picture of everyday kind, turned upright as its EXIF orientation says.

    Raises FrameError when it is cut short, damaged or too large.
    """
    with decoding("image"), Image.open(path, formats=_FORMATS) as image:
        check_size(*image.size, _bytes_px(image, path), path.stat().st_size)
        if image.format not in _QUICK or image.width * image.height > _QUICK_PIXELS:
            leave_to_sandbox()
        count = getattr(image, "n_frames", 1)
        notes = (tr("Only the first of {many} images is read.", many=count),) if count > 1 else ()
        tags = _exif(image, path)
        size = image.size
        samples = _samples(image, path, tags.get(_ORIENTATION))
        exif = exif_of(tags)
    return frame_with_exif(samples, path, exif, size, notes)


def _exif(image: Image.Image, path: Path) -> Image.Exif:
    """The picture's tags; a PNG's own ``getexif`` would decode all of it to look behind it."""
    if image.format == "PNG" and "exif" not in image.info:
        with path.open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - _TAIL_BYTES))
            tail = file.read()
        at = tail.rfind(b"eXIf")  # where ExifTool may write it
        size = int.from_bytes(tail[at - 4 : at]) if at >= 4 else len(tail)
        checked = tail[at : at + 4 + size], tail[at + 4 + size : at + 8 + size]
        if zlib.crc32(checked[0]) == int.from_bytes(checked[1]):
            image.info["exif"] = checked[0][4:]
    return Image.Image.getexif(image)


def _samples(image: Image.Image, path: Path, orientation: Any) -> NDArray[Any]:
    if image.format == "PNG" and (image.mode in ("L", "RGB") or _png_depth(path) == 16):
        import imagecodecs

        # Twice as quick as through Pillow, which besides keeps 8 of 16 bits in colour.
        data = path.read_bytes()
        if data.rfind(b"IEND") < 0:
            raise FrameError("is cut short.")
        samples = np.asarray(imagecodecs.png_decode(data))
        return _upright(samples, orientation)
    if image.format in ("JPEG", "MPO") and image.mode in ("L", "RGB"):
        return _upright(_jpeg(path), orientation)
    image.load()
    upright = ImageOps.exif_transpose(image)
    if upright.mode in ("L", "LA", "La", "I;16", "I;16B", "I;16L", "I", "F", "RGB", "RGBA", "RGBX"):
        return np.asarray(upright)
    return np.asarray(upright.convert("L" if upright.mode == "1" else "RGB"))


def _jpeg(path: Path) -> NDArray[Any]:
    """A JPEG by libjpeg straight into an array, twice as quick as through Pillow."""
    import imagecodecs

    data = path.read_bytes()
    # The decoder fills what is missing with grey; the end marker tells whether all is there.
    if data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"):
        raise FrameError("is cut short.")
    if data.count(b"\xff\xda") > _MOST_SCANS:
        leave_to_sandbox()
    return np.asarray(imagecodecs.jpeg8_decode(data))


def _upright(samples: NDArray[Any], orientation: Any) -> NDArray[Any]:
    turned = _UPRIGHT.get(orientation)
    return np.ascontiguousarray(turned(samples)) if turned else samples


def _bytes_px(image: Image.Image, path: Path) -> int:
    """What a decoded pixel takes; a palette becomes colours."""
    channels = 3 if image.mode == "P" else len(image.getbands())
    if image.format == "PNG" and _png_depth(path) == 16:
        return 2 * channels
    return (4 if image.mode in ("I", "F") else 1) * channels


def _png_depth(path: Path) -> int:
    with path.open("rb") as file:
        head = file.read(25)
    return head[24] if len(head) == 25 else 8


def read_heif(path: Path) -> Frame:
    """Read the main image of a telephone's HEIC file, upright, of 8 to 12 bits.

    Raises FrameError when it is cut short, damaged or too large.
    """
    leave_to_sandbox()
    import pillow_heif

    with decoding("HEIF"):
        file = pillow_heif.open_heif(path, convert_hdr_to_8bit=False)
        image = file[file.primary_index]
        check_size(*image.size, 6)
        samples = np.asarray(image)
        exif = exif_of(image.info.get("exif"))
    return frame_with_exif(samples, path, exif, image.size)
