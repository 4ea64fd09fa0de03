"""TIFF through tifffile, and camera raw files, most of them TIFF inside, through LibRaw."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.frames.hints import Exif, exif_of, frame_with_exif, hint_from_exif
from kochab.frames.samples import check_size, split
from kochab.frames.sandbox import decoding, leave_to_sandbox
from kochab.text.translation import tr

_CFA = 32803


def read_tiff(path: Path) -> Frame:
    """Read the first page of a TIFF; a camera's raw file in disguise goes to the raw reader.

    Raises FrameError when it is cut short, damaged or too large.
    """
    leave_to_sandbox()
    import logging

    import tifffile

    # It logs every odd tag; what matters comes as an exception.
    logging.getLogger("tifffile").setLevel(logging.CRITICAL)
    with decoding("TIFF"), tifffile.TiffFile(path) as file:
        if _is_raw(file):
            return read_raw(path)
        page: Any = file.pages[0]
        deep = int(page.samplesperpixel) * -(-int(page.bitspersample) // 8)
        check_size(int(page.imagewidth), int(page.imagelength), deep, path.stat().st_size)
        samples, inverted = _samples(page)
        count = len(file.pages)
    if inverted and samples.dtype.kind == "u":
        samples = np.iinfo(samples.dtype).max - samples
    notes = (tr("Only the first of {many} pages is read.", many=count),) if count > 1 else ()
    return frame_with_exif(samples, path, exif_of(path), (samples.shape[1], len(samples)), notes)


def _samples(page: Any) -> tuple[NDArray[Any], bool]:
    data = np.asarray(page.asarray())
    while data.ndim > 3 or (data.ndim == 3 and 1 in data.shape[:1]):
        data = data[0]
    # 2: planes one after the other.
    if data.ndim == 3 and page.planarconfig == 2:
        data = np.moveaxis(data, 0, -1)
    if page.photometric == 3 and page.colormap is not None and data.ndim == 2:
        data = np.moveaxis(np.asarray(page.colormap), 0, -1)[data]
    if data.ndim not in (2, 3):
        raise FrameError("holds no flat picture.")
    return data, page.photometric == 0


def _is_raw(file: Any) -> bool:
    page = file.pages[0]
    if 50706 in page.tags or page.photometric == _CFA:  # DNGVersion
        return True
    return any(p.photometric == _CFA for p in (page.pages or ()))


# A camera's raw file, through LibRaw: the mosaic as the sensor gave it, nothing interpolated.

_EXIF_SEARCH_BYTES = 1 << 20


def read_raw(path: Path) -> Frame:
    """Read the visible part of the sensor, unturned; ``bayer`` is read from its pixel (0, 0).

    Levels stay the sensor's own, black level included (``header["BLACK"]``), unless the four
    colours have different black levels, which are then brought to the lowest. Sensors that are
    not Bayer mosaics (X-Trans, layered, already linear) are interpolated by LibRaw instead.

    Raises FrameError when LibRaw does not know the file or it is damaged.
    """
    leave_to_sandbox()
    import rawpy

    with decoding("raw"), rawpy.RawPy() as raw:
        try:
            raw.open_file(str(path))
        except rawpy.LibRawFileUnsupportedError:
            raise FrameError("is not a raw file that LibRaw knows.") from None
        check_size(int(raw.sizes.raw_width), int(raw.sizes.raw_height), 2, path.stat().st_size)
    # Opened anew: whoever has asked for its sizes may not unpack it, with a rawpy before 0.25.
    with decoding("raw"), rawpy.RawPy() as raw:
        raw.open_file(str(path))
        raw.unpack()
        pixels, colour, bayer, saturation, header = _from_raw(raw)
    height, width = pixels.shape
    check_size(width, height)
    hint, facts, doubts = hint_from_exif(_exif(path), (width, height))
    return Frame(pixels, colour, bayer, saturation, str(path), hint, doubts, {**facts, **header})


def _from_raw(raw: Any) -> tuple[NDArray[Any], NDArray[Any] | None, str | None, float | None, dict[str, Any]]:
    bayer = _bayer(raw)
    if bayer is None:
        pixels, colour, saturation = split(_developed(raw))
        return pixels, colour, None, saturation, {}
    pixels = np.array(raw.raw_image_visible, order="C")
    black = [float(b) for b in raw.black_level_per_channel]
    _even_out(pixels, np.asarray(raw.raw_colors_visible[:2, :2]), black)
    white = float(raw.white_level) if raw.white_level else None
    return pixels, None, bayer, white, {"BLACK": min(black, default=0.0)}


def _bayer(raw: Any) -> str | None:
    """The pattern from the visible pixel (0, 0); None when the sensor is no Bayer mosaic."""
    import rawpy

    flat = raw.raw_type == rawpy.RawType.Flat and raw.raw_image_visible.ndim == 2
    if not flat or raw.raw_pattern is None or raw.raw_pattern.shape != (2, 2):
        return None
    letters = raw.color_desc.decode("ascii", "replace")
    bayer = "".join(letters[int(i)] for i in raw.raw_colors_visible[:2, :2].ravel())
    return bayer if bayer in ("RGGB", "BGGR", "GRBG", "GBRG") else None


def _even_out(pixels: NDArray[Any], colours: NDArray[Any], black: list[float]) -> None:
    lowest = min(black, default=0.0)
    for row in (0, 1):
        for column in (0, 1):
            excess = int(black[int(colours[row, column])] - lowest)
            if excess > 0:
                # Clamped before it is subtracted: unsigned numbers below their black level would wrap to white.
                part = pixels[row::2, column::2]
                np.subtract(np.maximum(part, excess), excess, out=part, casting="unsafe")


def _developed(raw: Any) -> NDArray[Any]:
    """Colours (H, W, 3) as LibRaw interpolates them, linear, 16 bits."""
    import rawpy

    linear = rawpy.DemosaicAlgorithm.LINEAR
    samples = raw.postprocess(
        demosaic_algorithm=linear, user_flip=0, gamma=(1, 1), no_auto_bright=True, use_camera_wb=True, output_bps=16
    )
    return np.asarray(samples)


def _exif(path: Path) -> Exif:
    """The EXIF block, wherever the maker put it: TIFF at the start, CR3 boxes, a RAF's JPEG."""
    with path.open("rb") as file:
        head = file.read(_EXIF_SEARCH_BYTES)
    if head[4:8] == b"ftyp":
        merged = Exif()
        for box in (b"CMT1", b"CMT2", b"CMT4"):
            at = head.find(box)
            if at > 4:
                (size,) = struct.unpack(">I", head[at - 4 : at])
                tags = exif_of(head[at + 4 : at - 4 + size]).tags
                (merged.gps if box == b"CMT4" else merged.tags).update(tags)
        return merged
    if not head.startswith(b"FUJIFILM"):
        return exif_of(path)
    at = head.find(b"Exif\x00\x00")
    return exif_of(head[at + 6 :]) if at >= 0 else Exif()
