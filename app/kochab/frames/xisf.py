"""XISF, PixInsight's format, through the ``xisf`` package."""

import contextlib
import io
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.frames.fits import parse_value
from kochab.frames.hints import frame_with_keywords
from kochab.frames.samples import PATTERNS, check_size
from kochab.frames.sandbox import decoding, leave_to_sandbox
from kochab.text.translation import tr


def read_xisf(path: Path) -> Frame:
    """Read the first image of a monolithic XISF file; floats run from 0 to 1 there.

    Raises FrameError when it is cut short, damaged or too large.
    """
    leave_to_sandbox()
    with decoding("XISF"):
        with contextlib.redirect_stdout(io.StringIO()):  # it prints what it does not know
            file = _opened(path)
        metas = file.get_images_metadata()
        if not metas:
            raise FrameError("holds no image.")
        samples = _samples(file, metas[0], path.stat().st_size)
    values = _keywords(metas[0])
    notes = (tr("Only the first of {many} images is read.", many=len(metas)),) if len(metas) > 1 else ()
    saturation = 1.0 if samples.dtype.kind == "f" else None  # the format's own bounds of floats
    return frame_with_keywords(samples, path, values, {}, notes, saturation, _pattern(file))


def _opened(path: Path) -> Any:
    """The file, its properties left unread: none is used, and they may be anything."""
    from xisf import XISF

    class File(XISF):  # type: ignore[misc]  # the package has no types
        def _process_property(self, _: Any) -> bool:
            return False

        def _read_attached_data_block(self, block: Mapping[str, Any]) -> Any:
            codec, size, item_size = block.get("compression", ("", 0, None))
            if not codec.startswith("zlib"):  # the other codecs are told the size themselves
                return super()._read_attached_data_block(block)
            packed = {key: value for key, value in block.items() if key != "compression"}
            data = _unzipped(super()._read_attached_data_block(packed), size)
            return self._unshuffle(data, item_size) if item_size else data

    return File(str(path))


def _unzipped(packed: bytes, size: int) -> bytes:
    """``size`` bytes and no more, however much is packed."""
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(packed, size)
    # One byte more would come out: more is packed than was told.
    if len(data) != size or unpacker.decompress(unpacker.unconsumed_tail, 1):
        raise FrameError("is a damaged XISF: its sizes do not agree.")
    return data


def _samples(file: Any, meta: Mapping[str, Any], packed_bytes: int) -> Any:
    width, height, channels = (int(n) for n in meta["geometry"])
    dtype = np.dtype(meta["dtype"])
    check_size(width, height, channels * dtype.itemsize, packed_bytes)
    count = width * height * channels
    if not 1 <= channels <= 16:
        raise FrameError("claims {channels} colour channels.", channels=channels)
    if "compression" in meta and int(meta["compression"][1]) != count * dtype.itemsize:
        raise FrameError("is a damaged XISF: its sizes do not agree.")
    samples = file.read_image(0, data_format="channels_first")
    if str(meta.get("pixelStorage", "planar")).lower() == "normal":
        samples = samples.reshape(height, width, channels)
    else:
        samples = np.moveaxis(samples, 0, -1)
    if meta.get("byteOrder") == "big":
        samples = samples.view(dtype.newbyteorder(">"))
    return samples


def _keywords(meta: Mapping[str, Any]) -> dict[str, Any]:
    """FITS keywords kept in the file, as numbers where they are numbers."""
    values = {}
    for name, entries in meta.get("FITSKeywords", {}).items():
        text = str(entries[0]["value"])
        value, _, ok = parse_value(text)
        values[str(name)] = value if ok else text
    return values


def _pattern(file: Any) -> str | None:
    for element in file.get_metadata_xml().iter():
        if str(element.tag).endswith("ColorFilterArray"):
            named = str(element.attrib.get("pattern", "")).upper()
            return named if named in PATTERNS else None
    return None
