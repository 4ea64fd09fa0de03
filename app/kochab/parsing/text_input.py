"""Text and JSON that somebody else wrote, the one way in: bounded, decoded, and only what can be used.

What is read here may hold anything. Everything that is wrong with it raises `TextError` with one sentence; a caller
that knows better what the file should have been catches it as a ValueError and says that.
"""

import json
import math
import os
from os import PathLike
from pathlib import Path
from typing import Any

from kochab.core.errors import UsageError

LARGEST_BYTES = 50_000_000
DEEPEST = 64
"""Levels of lists and objects in JSON: nothing that is read here has more than six, and 1,000 end Python's own."""
_INTEGERS = 2**63


class TextError(UsageError, ValueError):
    """A file that is no text, or JSON that cannot be used."""


def read_text(path: str | PathLike[str], errors: str = "strict", largest_bytes: int = LARGEST_BYTES) -> str:
    """The text of a file: UTF-8, or UTF-16 with its mark as PowerShell writes it.

    Parameters
    ----------
    path
        A file, or a pipe that ends.
    errors
        What becomes of bytes that are no text, as ``bytes.decode`` has it.
    largest_bytes
        The size above which it is not read.

    Raises `TextError` when it is missing, too large, no text, or holds a NUL, which no text has.
    """
    return decoded(read_bytes(path, largest_bytes), path, errors)


def read_bytes(path: str | PathLike[str], largest_bytes: int = LARGEST_BYTES) -> bytes:
    """What a file holds; `TextError` when it cannot be read or is larger, however much a device would give."""
    try:
        with open(path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            # a pipe and a device have no size; of a file no more room is taken than it has
            data = b"" if size > largest_bytes else file.read(size or largest_bytes + 1)
    except (OSError, ValueError) as error:  # a name with a NUL is a ValueError
        why = getattr(error, "strerror", None) or str(error)
        raise TextError("{path} cannot be read: {why}.", path=Path(path), why=why.rstrip(".")) from None
    if max(size, len(data)) > largest_bytes:
        raise TextError("{path} is too large: more than {most} MB.", path=Path(path), most=largest_bytes // 1_000_000)
    return data


def decoded(data: bytes, path: str | PathLike[str], errors: str = "strict") -> str:
    """The text of bytes; ``path`` is what a sentence calls them. Raises `TextError`, see :func:`read_text`."""
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"  # spreadsheets write a mark too
    try:
        text = data.decode(encoding, errors)
    except UnicodeDecodeError:
        raise TextError("{path} is not a text file.", path=Path(path)) from None
    if "\0" in text and errors == "strict":
        raise TextError("{path} is not a text file.", path=Path(path))
    return text


def read_json(path: str | PathLike[str]) -> Any:
    """The JSON of a file; `TextError` as :func:`read_text` and :func:`parse_json`."""
    text = read_text(path)
    try:
        return parse_json(text)
    except TextError as error:
        raise TextError("{path} is damaged: {why}", path=Path(path), why=error) from None


def parse_json(text: str | bytes) -> Any:
    """The value of JSON text.

    Raises `TextError` when it is none, has numbers that are not finite or have more than 64 bits, or is nested more
    than `DEEPEST` deep.
    """
    try:
        value = json.loads(text, parse_constant=_refused, parse_float=_finite, parse_int=_short)
    except TextError:
        raise
    except json.JSONDecodeError as error:
        raise TextError("No JSON in line {line}, column {column}.", line=error.lineno, column=error.colno) from None
    except UnicodeDecodeError:
        raise TextError("It is not a text file.") from None
    except RecursionError:
        raise _too_deep() from None
    level = [value]
    for _ in range(DEEPEST):
        level = [child for node in level for child in _children(node) if isinstance(child, dict | list)]
    if level:
        raise _too_deep()
    return value


def _children(node: Any) -> Any:
    return node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()


def _too_deep() -> TextError:
    return TextError("Its JSON is nested more than {deepest} deep.", deepest=DEEPEST)


def _refused(name: str) -> float:
    raise TextError("{name} is not a number that can be used.", name=name)


def _finite(digits: str) -> float:
    value = float(digits)
    return value if math.isfinite(value) else _refused(digits[:40])


def _short(digits: str) -> int:
    value = int(digits) if len(digits) < 21 else _INTEGERS
    return value if -_INTEGERS <= value < _INTEGERS else int(_refused(digits[:40]))
