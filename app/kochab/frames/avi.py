"""AVI: uncompressed and Motion JPEG videos by hand, what other codecs packed through FFmpeg where PyAV is installed.

A video is a tree of RIFF chunks (Microsoft, "AVI RIFF File Reference"; OpenDML 1.02 for those beyond a gigabyte): the
first video stream's header, then a chunk for each frame.
"""

import io
import struct
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from kochab.core.errors import FrameError, printable
from kochab.core.frame import Frame
from kochab.core.values import frozen
from kochab.frames.samples import check_size, split
from kochab.frames.sandbox import decoding, leave_to_sandbox
from kochab.frames.ser import check_number, one_of

_BITMAP = struct.Struct("<IiiHH4sIiiII")
_RGB = b"\0\0\0\0"
_GREY = {b"Y800": np.uint8, b"Y8  ": np.uint8, b"GREY": np.uint8, b"Y16 ": np.uint16, b"Y1\0\x10": np.uint16}
_LUMA = {b"YUY2": 0, b"YUYV": 0, b"UYVY": 1}
"""Where the brightness of a pixel stands in its two bytes."""
_PLANES = (b"I420", b"IYUV", b"YV12", b"NV12")
"""All of the brightness before all of the colour."""
_VIDEO_WHITE = 235.0  # of the brightness in video
_JPEG = b"MJPG"
_MOST_HEADER = 1 << 20
_DEEPEST = 4


@frozen
class _Stream:
    """The first video stream: its number, and how a frame of it is stored, the first row at the bottom or not."""

    number: int
    codec: bytes
    width: int
    height: int
    bits: int
    upwards: bool
    palette: NDArray[np.uint8] | None  # (256, 3)

    @property
    def chunks(self) -> tuple[bytes, bytes]:
        """What a frame's chunk is called."""
        return b"%02ddb" % self.number, b"%02ddc" % self.number


def read_avi(path: Path, number: int = 1) -> Frame:
    """Read one frame of an AVI video, the first unless ``number`` says otherwise.

    Raises FrameError when the video is damaged, too large, has no such frame, or a codec that PyAV is needed for.
    """
    leave_to_sandbox()  # its chunks may be millions
    with decoding("AVI"), path.open("rb") as file:
        stream, count = _headers(file)
        check_size(stream.width, stream.height, 6)
        decode = _decoder(stream)
        if decode is None:
            return _by_ffmpeg(path, number, stream)
        frames = _frames(file, stream)
        if number > 1:
            data = next(islice(frames, number - 1, None), None)
        else:
            data = next((one for one in frames if one[1]), None)  # a dropped frame is an empty chunk
        if data is None:
            check_number(number, sum(1 for _ in _frames(file, stream)))
            raise FrameError("holds no image.")
        at, size = data
        if not size:
            raise FrameError("lost its frame {number} while it was recorded.", number=number)
        file.seek(at)
        pixels = file.read(size)
        if len(pixels) < size:
            raise FrameError("is cut short.")
        samples = decode(pixels, stream)
    return _frame(samples, path, count, number, stream)


def _frame(samples: NDArray[Any], path: Path, count: int, number: int, stream: _Stream) -> Frame:
    plane, colour, saturation = split(samples)
    if stream.codec in _LUMA or stream.codec in _PLANES:
        saturation = _VIDEO_WHITE
    return Frame(plane, colour, None, saturation, str(path), warnings=one_of(count, number))


# -- The tree of chunks ------------------------------------------------------------------------


def _chunks(file: BinaryIO, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Name, place and size of the data of each chunk between two places in the file."""
    while start + 8 <= end:
        file.seek(start)
        head = file.read(8)
        if len(head) < 8:
            return
        name, size = head[:4], int.from_bytes(head[4:], "little")
        yield name, start + 8, size
        start += 8 + size + size % 2


def _lists(file: BinaryIO, start: int, end: int, depth: int = 0) -> Iterator[tuple[bytes, bytes, int, int]]:
    """All chunks below, lists entered: the list's kind, then the chunk's name, place and size."""
    for name, at, size in _chunks(file, start, end):
        if name not in (b"RIFF", b"LIST"):
            yield b"", name, at, size
        elif depth < _DEEPEST:
            file.seek(at)
            kind = file.read(4)
            stop = min(at + size, end) if size else end  # a recording that was cut off may say 0
            for inner, called, place, long in _lists(file, at + 4, stop, depth + 1):
                yield inner or kind, called, place, long


def _end(file: BinaryIO) -> int:
    return file.seek(0, 2)


def _headers(file: BinaryIO) -> tuple[_Stream, int]:
    """The first video stream, and how many frames the file says it has."""
    kind, count, streams = b"", 1, -1
    for inside, name, at, size in _lists(file, 0, _end(file)):
        if inside == b"movi":
            break
        if name == b"strh":
            data = _read(file, at, size, 36)
            streams += 1
            kind, count = data[:4], int.from_bytes(data[32:36], "little")
        elif name == b"strf" and kind == b"vids":
            return _stream(_read(file, at, size, _BITMAP.size), streams), count
    raise FrameError("holds no image.")


def _read(file: BinaryIO, at: int, size: int, least: int) -> bytes:
    file.seek(at)
    data = file.read(min(size, _MOST_HEADER))
    if len(data) < least:
        raise FrameError("is cut short.")
    return data


def _stream(data: bytes, number: int) -> _Stream:
    own, width, height, _, bits, codec, *_, colours, _ = _BITMAP.unpack_from(data)
    codec = codec.upper() if codec.isascii() else codec
    palette = None
    if codec == _RGB and bits == 8:
        table = np.frombuffer(data, np.uint8, offset=min(own, len(data)))[: 4 * min(colours or 256, 256)]
        palette = np.zeros((256, 3), np.uint8)
        known = table[: len(table) // 4 * 4].reshape(-1, 4)[:, 2::-1]
        palette[: len(known)] = known
        if not known.any():  # none: the numbers are the brightness
            palette[:] = np.arange(256)[:, None]
    return _Stream(number, codec, width, abs(height), bits, codec == _RGB and height > 0, palette)


def _frames(file: BinaryIO, stream: _Stream) -> Iterator[tuple[int, int]]:
    """Place and size of each frame's data."""
    end = _end(file)
    for _, name, at, size in _lists(file, 0, end):
        if name in stream.chunks:
            yield at, size


# -- What a frame's chunk holds ----------------------------------------------------------------


def _decoder(stream: _Stream) -> Any:
    """What makes samples of a chunk; None when FFmpeg must."""
    codec = stream.codec
    if codec == _RGB and stream.bits in (8, 24, 32):
        return _rgb
    if codec in _GREY:
        return _grey
    if codec in _LUMA or codec in _PLANES:
        return _luma
    return _jpeg if codec == _JPEG else None


def _rows(data: bytes, stream: _Stream, bytes_px: int) -> NDArray[np.uint8]:
    """The bytes of each row (H, W * bytes_px), which may end at a multiple of four."""
    width = stream.width * bytes_px
    stride = -(-width // 4) * 4
    if len(data) < stride * stream.height:
        stride = width
    if len(data) < stride * stream.height:
        raise FrameError("is cut short.")
    rows = np.frombuffer(data, np.uint8, stride * stream.height).reshape(stream.height, stride)[:, :width]
    return rows[::-1] if stream.upwards else rows


def _rgb(data: bytes, stream: _Stream) -> NDArray[Any]:
    rows = _rows(data, stream, stream.bits // 8)
    if stream.palette is not None:
        return stream.palette[rows]
    return rows.reshape(stream.height, stream.width, -1)[..., 2::-1]


def _grey(data: bytes, stream: _Stream) -> NDArray[Any]:
    kind = np.dtype(_GREY[stream.codec])
    return np.ascontiguousarray(_rows(data, stream, kind.itemsize)).view(kind.newbyteorder("<"))


def _luma(data: bytes, stream: _Stream) -> NDArray[Any]:
    if stream.codec in _PLANES:
        return _rows(data[: stream.width * stream.height], stream, 1)
    return _rows(data, stream, 2)[:, _LUMA[stream.codec] :: 2]


def _jpeg(data: bytes, stream: _Stream) -> NDArray[Any]:
    import imagecodecs
    from PIL import Image, JpegImagePlugin  # noqa: F401 (the plugin that opens it)

    with Image.open(io.BytesIO(data), formats=("JPEG",)) as image:
        check_size(*image.size, 3, len(data))
    return np.asarray(imagecodecs.jpeg8_decode(data))


def _by_ffmpeg(path: Path, number: int, stream: _Stream) -> Frame:
    """The frame as FFmpeg decodes it."""
    try:
        import av
    except ImportError:
        raise FrameError(
            "is packed by the codec {codec}: save it uncompressed or as SER, or install Kochab's extra webcam.",
            codec=printable(stream.codec.decode("latin-1")),
        ) from None
    with av.open(str(path), format="avi") as video:
        frames = video.decode(video=0)
        found = next(islice(frames, number - 1, None), None)
        count = video.streams.video[0].frames
        if found is None:
            check_number(number, count if 0 < count < number else number - 1)
            raise FrameError("is cut short.")
        check_size(found.width, found.height, 6)
        deep = any(c.bits > 8 for c in found.format.components)
        grey = len(found.format.components) == 1
        name = ("gray16le" if deep else "gray") if grey else ("rgb48le" if deep else "rgb24")
        samples = found.to_ndarray(format=name)
    return _frame(samples, path, count, number, stream)
