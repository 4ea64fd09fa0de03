"""SER, the video format of planetary cameras: a header of 178 bytes, raw frames, and often the time of each.

The format is Heiko Wilkens' and Grischa Hahn's ("SER format description version 3", 2014). Frames are read by hand:
their place in the file follows from the header.
"""

import struct
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from kochab.core.errors import FrameError, printable
from kochab.core.frame import Frame
from kochab.core.values import frozen
from kochab.frames.hints import frame_with_keywords
from kochab.frames.samples import check_size
from kochab.text.translation import tr

HEADER = struct.Struct("<14s7i40s40s40s2q")
_PATTERNS = {8: "RGGB", 9: "GRBG", 10: "GBRG", 11: "BGGR"}
_RGB, _BGR = 100, 101
_COLOURS = (0, *_PATTERNS, 16, 17, 18, 19, _RGB, _BGR)
"""What a pixel may be: grey, a mosaic of red, green and blue or of cyan, yellow and magenta, or three planes."""
_TICKS = (1 << 62) - 1  # above them .NET writes what clock it was


@frozen
class _Header:
    """What a file says of its frames; ``times`` are .NET ticks, 0 when not told."""

    colour: int
    width: int
    height: int
    depth: int
    count: int
    little_endian: bool
    texts: tuple[str, ...]
    started: int

    @property
    def planes(self) -> int:
        """Numbers a pixel."""
        return 3 if self.colour in (_RGB, _BGR) else 1

    @property
    def bytes_px(self) -> int:
        """Bytes a pixel."""
        return self.planes * (2 if self.depth > 8 else 1)

    @property
    def frame_bytes(self) -> int:
        """Bytes a frame."""
        return self.width * self.height * self.bytes_px


def read_ser(path: Path, number: int = 1) -> Frame:
    """Read one frame of a SER video, the first unless ``number`` says otherwise.

    Its time is the frame's own where the file has one. Raises FrameError when the video is damaged, too large, or has
    no such frame.
    """
    with path.open("rb") as file:
        header = _header(file.read(HEADER.size))
        check_size(header.width, header.height, header.bytes_px)
        end = file.seek(0, 2)
        whole = (end - HEADER.size) // header.frame_bytes
        count = min(header.count or whole, whole)  # a recording that was cut off may say 0
        if not whole:
            raise FrameError("is cut short.")
        check_number(number, count)
        file.seek(HEADER.size + (number - 1) * header.frame_bytes)
        samples = _samples(file.read(header.frame_bytes), header)
        ticks = _ticks(file, header, number) or header.started
    observer, instrument, telescope = header.texts
    values = {"OBSERVER": observer, "INSTRUME": instrument, "TELESCOP": telescope, "DATE-OBS": _date(ticks)}
    named = {name: text for name, text in values.items() if text}
    pattern = _PATTERNS.get(header.colour)
    return frame_with_keywords(samples, path, named, {}, one_of(count, number), _saturation(samples, header), pattern)


def check_number(number: int, count: int) -> None:
    """Refuse a frame that a video of ``count`` frames does not have."""
    if not 1 <= number <= count:
        raise FrameError("has {count} frames, not a frame {number}.", count=count, number=number)


def one_of(count: int, number: int) -> tuple[str, ...]:
    """The note that others of a video's frames are left out, where there are others and none was asked for."""
    return (tr("Only the first of {many} frames is read.", many=count),) if count > 1 and number == 1 else ()


def _header(data: bytes) -> _Header:
    if len(data) < HEADER.size:
        raise FrameError("is cut short.")
    _, _, colour, endian, width, height, depth, count, *texts, local, utc = HEADER.unpack(data)
    if colour not in _COLOURS or not 1 <= depth <= 16 or count < 0:
        raise FrameError("is a damaged or cut short {kind} file.", kind="SER")
    words = tuple(printable(text.decode("latin-1").strip("\0 ")) for text in texts)
    return _Header(colour, width, height, depth, count, bool(endian), words, utc or local)


def _samples(data: bytes, header: _Header) -> NDArray[Any]:
    shape = (header.height, header.width) + ((3,) if header.planes == 3 else ())
    if header.depth <= 8:
        samples = np.frombuffer(data, np.uint8).reshape(shape)
    else:
        samples = np.frombuffer(data, _order(data, header)).reshape(shape)
    return samples[..., ::-1] if header.colour == _BGR else samples


def _order(data: bytes, header: _Header) -> str:
    """The byte order in which neighbours are most alike; programs disagree about what the header's flag means."""
    step = 4 * header.planes  # the same colour of a mosaic, too
    unlike = {}
    for order in ("<u2", ">u2"):
        values = np.frombuffer(data, order).astype(np.int32)
        unlike[order] = int(np.abs(values[step:] - values[:-step]).sum(dtype=np.int64))
    if unlike["<u2"] == unlike[">u2"]:
        return "<u2" if header.little_endian else ">u2"
    return min(unlike, key=lambda order: unlike[order])


def _saturation(samples: NDArray[Any], header: _Header) -> float:
    """Where pixels clip: 9 to 15 bits are stored from the lowest bit, and by some programs up to the highest."""
    lowest = float(2**header.depth - 1)
    return lowest if float(samples.max()) <= lowest else float(np.iinfo(samples.dtype).max)


def _ticks(file: BinaryIO, header: _Header, number: int) -> int:
    """When the frame was taken, as the trailer has it; 0 when there is none."""
    file.seek(HEADER.size + header.count * header.frame_bytes + 8 * (number - 1))
    data = file.read(8)
    return int.from_bytes(data, "little") if len(data) == 8 else 0


def _date(ticks: int) -> str:
    """Ticks of 100 ns since the year 1, in UTC, as FITS writes them; empty for none, or for no year of cameras."""
    try:
        moment = datetime(1, 1, 1, tzinfo=UTC) + timedelta(microseconds=(ticks & _TICKS) // 10)
    except OverflowError:
        return ""
    return moment.strftime("%Y-%m-%dT%H:%M:%S.%f") if moment.year > 1990 else ""
