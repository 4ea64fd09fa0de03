"""The file of a table: named arrays that come back exactly as they were written, or not at all.

::

    8 bytes   CRC-32 of all that follows, and the header's length, both u4 little endian
    ...       the header: JSON {name: [dtype, shape]}
    ...       the arrays, each at a multiple of 64 bytes

NumPy's own archives tell of damage within an array, but a flip in one of their headers can cut an
array short or lose it unseen.
"""

import json
import math
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]
ALIGN = 64
START = struct.calcsize("<II")


def packed(arrays: Arrays) -> bytes:
    """The file's bytes."""
    told = {name: (array.dtype.str, array.shape) for name, array in arrays.items()}
    header = json.dumps(told).encode("ascii")
    data = bytearray(struct.pack("<II", 0, len(header)) + header)
    for array in arrays.values():
        data.extend(bytes(_aligned(len(data)) - len(data)))
        data.extend(array.tobytes())
    struct.pack_into("<I", data, 0, _crc(data))
    return bytes(data)


def unpacked(data: bytearray) -> Arrays | None:
    """The arrays, which share ``data``, or None when it is not as it was written."""
    if len(data) < START:
        return None
    crc, length = struct.unpack_from("<II", data)
    if crc != _crc(data):
        return None
    arrays, start = {}, START + length
    for name, (dtype, shape) in json.loads(data[START:start]).items():
        start = _aligned(start)
        arrays[name] = np.frombuffer(data, dtype, math.prod(shape), start).reshape(shape)
        start += arrays[name].nbytes
    return arrays


def _crc(data: bytearray) -> int:
    return zlib.crc32(memoryview(data)[4:])


def _aligned(offset: int) -> int:
    return -(-offset // ALIGN) * ALIGN
