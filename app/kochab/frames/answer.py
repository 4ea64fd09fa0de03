"""A frame, or a sentence, on its way out of the process that decodes: numbers as they lie in memory, all else as JSON.

    8 bytes: how many parts | 8 bytes a part: its length | JSON | an array a part

That process is not believed: what comes is read as JSON (bounded, of finite depth) and arrays of plain numbers, its
shapes against its lengths and its fields against what a frame may have. There is nothing in it that could be called.
"""

import math
import struct
from collections.abc import Mapping
from dataclasses import astuple, fields
from datetime import datetime
from json import dumps
from typing import IO, Any, BinaryIO

import numpy as np

from kochab.core.arrays import Array
from kochab.core.errors import FrameError
from kochab.core.frame import Frame, Hint, Site
from kochab.parsing.text_input import LARGEST_BYTES, parse_json

MOST_PARTS = 3
_TYPES = frozenset("|b1 |u1 |i1 <u2 >u2 <i2 >i2 <u4 >u4 <i4 >i4 <u8 >u8 <i8 >i8 <f2 >f2 <f4 >f4 <f8 >f8".split())  # noqa: SIM905
_LARGEST_INTEGER = 2**63


class DecoderFaultError(Exception):
    """What a decoder raised that is no sentence for a person."""


# -- Within the sandbox ---------------------------------------------------------------------------


def encoded(result: Frame | Exception, trace: str = "") -> list[memoryview]:
    """The parts of what a reader returned or raised, ``trace`` for the journal.

    Raises ValueError for a frame whose arrays are no plain numbers.
    """
    arrays: list[Array] = []
    if isinstance(result, Frame):
        arrays = [np.ascontiguousarray(a) for a in (result.pixels, result.colour) if a is not None]
        if any(a.dtype.str not in _TYPES for a in arrays):
            raise ValueError(f"pixels of type {arrays[0].dtype}")
        message: dict[str, Any] = {
            "frame": _described(result),
            "arrays": [[a.dtype.str, list(a.shape)] for a in arrays],
        }
    else:
        kinds = {"sentence": FrameError, "memory": MemoryError, "fault": Exception}
        kind = next(kind for kind, error in kinds.items() if isinstance(result, error))
        text = f"{type(result).__name__}: {result}" if kind == "fault" else str(result)
        message = {kind: text[:2000], "trace": trace[-20_000:]}
    text_bytes = dumps(message, allow_nan=False).encode("ascii")
    return [memoryview(text_bytes), *(a.reshape(-1).view(np.uint8).data for a in arrays)]


def send(pipe: BinaryIO, parts: list[memoryview]) -> None:
    """Write the parts, without a copy."""
    pipe.write(struct.pack(f"=Q{len(parts)}Q", len(parts), *(part.nbytes for part in parts)))
    for part in parts:
        pipe.write(part)
    pipe.flush()


def _described(frame: Frame) -> dict[str, Any]:
    hint = {f.name: getattr(frame.hint, f.name) for f in fields(Hint)}
    hint["time_utc"] = frame.hint.time_utc and frame.hint.time_utc.isoformat()
    hint["site"] = frame.hint.site and list(astuple(frame.hint.site))
    return {
        "bayer": frame.bayer,
        "saturation": _plain(frame.saturation),
        "path": str(frame.path),
        "warnings": [str(warning) for warning in frame.warnings],
        "hint": {name: _plain(value) for name, value in hint.items()},
        "header": [[str(name), _plain(value)] for name, value in frame.header.items()],
    }


def _plain(value: Any) -> Any:
    """A value that JSON has; numbers that it has not, and objects of libraries, as their text."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, int) and abs(value) < _LARGEST_INTEGER:
        return int(value)
    if isinstance(value, float) and math.isfinite(value):
        return float(value)
    return str(value)


# -- Outside of it --------------------------------------------------------------------------------


def received(pipe: IO[bytes], most_bytes: int) -> tuple[Frame | Exception, str]:
    """The frame or what was raised, and where.

    Raises ValueError, TypeError, LookupError or ArithmeticError for anything but an answer, or one larger than
    ``most_bytes``; EOFError when it ends before.
    """
    (count,) = struct.unpack("=Q", _filled(pipe, 8))
    if not 1 <= count <= MOST_PARTS:
        raise ValueError("parts")
    sizes = struct.unpack(f"={count}Q", _filled(pipe, 8 * count))
    if sizes[0] > LARGEST_BYTES or sum(sizes) > most_bytes:
        raise ValueError("size")
    message = parse_json(bytes(_filled(pipe, sizes[0])))
    trace = str(message.get("trace", ""))
    for kind, error in (("sentence", FrameError), ("memory", MemoryError), ("fault", DecoderFaultError)):
        if kind in message:
            return error("{text}", text=message[kind]) if error is FrameError else error(str(message[kind])), trace
    arrays = [_array(pipe, dtype, shape, n) for (dtype, shape), n in zip(message["arrays"], sizes[1:], strict=True)]
    return frame_of(message["frame"], arrays), ""


def _array(pipe: IO[bytes], dtype: str, shape: list[int], size: int) -> Array:
    """An array of plain numbers, of the bytes that were told."""
    if dtype not in _TYPES or not 2 <= len(shape) <= 3 or not all(type(side) is int and side > 0 for side in shape):
        raise ValueError("array")
    if math.prod(shape) * np.dtype(dtype).itemsize != size:
        raise ValueError("length")
    return np.frombuffer(_filled(pipe, size), dtype).reshape(shape)


def frame_of(message: Mapping[str, Any], arrays: list[Array]) -> Frame:
    """The frame of what was told of it, every field of its own kind; else ValueError, TypeError or LookupError."""
    pixels, colour = arrays[0], arrays[1] if len(arrays) > 1 else None
    if pixels.ndim != 2 or min(pixels.shape) < 1 or not pixels.dtype.isnative:
        raise ValueError("pixels")
    if colour is not None and colour.shape != (*pixels.shape, 3):
        raise ValueError("colour")
    given = message["hint"]
    site = given["site"] and Site(*_numbers(given["site"], 3))
    hint = Hint(
        scale_arcsec_px=given["scale_arcsec_px"] and (*_numbers(given["scale_arcsec_px"], 2),),
        centre_deg=given["centre_deg"] and (*_numbers(given["centre_deg"], 3),),
        time_utc=given["time_utc"] and _aware(given["time_utc"]),
        exposure_s=_number(given["exposure_s"]),
        site=site or None,
        camera=str(given["camera"]),
        source=str(given["source"]),
        time_of_file=bool(given["time_of_file"]),
    )
    bayer = message["bayer"]
    if bayer is not None and (len(bayer) != 4 or not set(bayer) <= set("RGB")):
        raise ValueError("bayer")
    header = {str(name): value for name, value in message["header"]}
    if not all(value is None or isinstance(value, str | int | float | list) for value in header.values()):
        raise ValueError("header")
    warnings = tuple(map(str, message["warnings"]))
    return Frame(pixels, colour, bayer, _number(message["saturation"]), str(message["path"]), hint, warnings, header)


def _number(value: Any) -> float | None:
    if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise TypeError("number")
    return value


def _numbers(values: Any, count: int) -> Any:
    if len(values) != count or any(_number(value) is None for value in values):
        raise ValueError("numbers")
    return values


def _aware(text: str) -> datetime:
    time = datetime.fromisoformat(text)
    if time.tzinfo is None:
        raise ValueError("time")
    return time


def _filled(pipe: IO[bytes], size: int) -> memoryview:
    whole = np.empty(size, np.uint8).data  # bytearray would write zeros first
    at = 0
    while at < size:
        count = pipe.readinto(whole[at:])  # type: ignore[attr-defined]
        if not count:
            raise EOFError
        at += count
    return whole
