"""A picture as Alpaca sends it: ImageBytes, or JSON from servers that know no better.

ASCOM's arrays are [x][y] or [x][y][colour]; here they become rows.
"""

import json
import math
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.cameras.alpaca_link import raise_refusal
from app.core.errors import NoAnswerError

Pixels = NDArray[Any]
ACCEPT = "application/imagebytes"
_HEADER = struct.Struct("<11i")
_TYPES = {1: "<i2", 2: "<i4", 3: "<f8", 4: "<f4", 5: "<u8", 6: "u1", 7: "<i8", 8: "<u2", 9: "<u4"}
_LARGEST = 300_000_000


def image_of(data: bytes, content_type: str) -> Pixels:
    """Rows (H, W) or (H, W, 3) of an answer, in the type it was sent in.

    Raises
    ------
    NoAnswerError
        It is no picture, or cut short.
    app.core.errors.DeviceError
        The server said in its place why there is none.

    """
    return _from_bytes(data) if ACCEPT in content_type else _from_json(data)


def _from_bytes(data: bytes) -> Pixels:
    if len(data) < _HEADER.size:
        raise NoAnswerError("The camera's picture was cut short.")
    _, error, _, _, start, _, kind, rank, *sides = _HEADER.unpack_from(data)
    if error:
        raise_refusal(error, data[max(start, _HEADER.size) :].decode("utf-8", "replace"))
    shape = tuple(sides[:rank])
    if kind not in _TYPES or rank not in (2, 3) or min(shape, default=0) < 1 or start < 0:
        raise NoAnswerError("The camera's picture is in a form Kochab does not know.")
    dtype = np.dtype(_TYPES[kind])
    size = math.prod(shape)
    if size > _LARGEST or len(data) - start < size * dtype.itemsize:
        raise NoAnswerError("The camera's picture was cut short.")
    return _rows(np.frombuffer(data, dtype, size, start).reshape(shape))


def _from_json(data: bytes) -> Pixels:
    try:
        told = json.loads(data)
        raise_refusal(int(told.get("ErrorNumber", 0)), str(told.get("ErrorMessage", "")))
        array = np.asarray(told["Value"], dtype=np.float64 if told.get("Type") == 3 else np.int32)
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        raise NoAnswerError("The camera's picture is in a form Kochab does not know.") from None
    if array.ndim not in (2, 3) or not array.size:
        raise NoAnswerError("The camera's picture is in a form Kochab does not know.")
    return _rows(array)


def _rows(array: Pixels) -> Pixels:
    return array.swapaxes(0, 1)


def sensor_numbers(rows: Pixels, most: int | None) -> Pixels:
    """The same as unsigned 8 or 16 bits where ``most`` (MaxADU) allows it, contiguous."""
    if rows.dtype.kind not in "iu" or most is None or most > 65535:
        wide = rows.dtype.newbyteorder("=")
        if wide.itemsize == 8:
            wide = np.dtype(np.float32)
        return np.ascontiguousarray(rows, dtype=wide)
    small: type[np.uint8] | type[np.uint16] = np.uint8 if rows.dtype == np.uint8 else np.uint16
    if rows.dtype.kind == "i" or rows.dtype.itemsize > 2:
        rows = np.clip(rows, 0, 65535)
    return np.ascontiguousarray(rows, dtype=small)
