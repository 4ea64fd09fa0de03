r"""The file a catalogue lives in: a short header in JSON, then plain columns, memory mapped.

::

    8 bytes   b"KOCHAB1\n"
    8 bytes   length and CRC-32 of the header, both u4 little endian
    ...       the header: JSON with ``sections`` {name: [offset, dtype, count]} and facts
    ...       the columns, each starting at a multiple of 64 bytes, little endian

Offsets count from the first column. Nothing in it depends on when or where it was written.
"""

import json
import mmap
import struct
import zlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.core.errors import CatalogueError

MAGIC = b"KOCHAB1\n"
ALIGN = 64


class Container:
    """A catalogue file, opened but not read: ``facts`` and columns by name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with open(path, "rb") as file:
                self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except FileNotFoundError:
            raise CatalogueError(f"The star catalogue {path} is missing.") from None
        except (OSError, ValueError) as error:
            raise CatalogueError(f"The star catalogue {path} cannot be opened: {error}.") from None
        self.facts, self._start = self._header()
        self._sections: dict[str, list[Any]] = self.facts.pop("sections")
        ends = [o + np.dtype(t).itemsize * n for o, t, n in self._sections.values()]
        if len(self._map) != self._start + max(ends, default=0):
            raise CatalogueError(f"The star catalogue {path} is cut short or has been altered.")

    def _header(self) -> tuple[dict[str, Any], int]:
        damaged = CatalogueError(f"{self.path} is not a Kochab star catalogue, or is damaged.")
        if len(self._map) < 16 or self._map[:8] != MAGIC:
            raise damaged
        length, crc = struct.unpack("<II", self._map[8:16])
        text = self._map[16 : 16 + length]
        if len(text) != length or zlib.crc32(text) != crc:
            raise damaged
        return json.loads(text), _aligned(16 + length)

    def column(self, name: str) -> NDArray[Any]:
        """The column ``name``, read-only, read from disk only where it is touched."""
        try:
            offset, dtype, count = self._sections[name]
        except KeyError:
            raise CatalogueError(f"{self.path} lacks the column {name}.") from None
        return np.frombuffer(self._map, dtype, count, self._start + offset)

    def __contains__(self, name: str) -> bool:
        return name in self._sections


def write_container(
    path: Path, facts: Mapping[str, Any], columns: Mapping[str, NDArray[Any]]
) -> None:
    """Write ``columns`` and ``facts``; the same input gives the same bytes."""
    sections: dict[str, list[Any]] = {}
    offset = 0
    for name, column in columns.items():
        dtype = column.dtype.newbyteorder("<")
        sections[name] = [offset, dtype.str, len(column)]
        offset = _aligned(offset + dtype.itemsize * len(column))
    text = json.dumps({**facts, "sections": sections}, sort_keys=True).encode("ascii")
    temporary = path.with_name(path.name + ".part")
    try:
        with open(temporary, "wb") as file:
            file.write(MAGIC + struct.pack("<II", len(text), zlib.crc32(text)) + text)
            for column in columns.values():
                file.write(b"\0" * (-file.tell() % ALIGN))
                file.write(np.ascontiguousarray(column, column.dtype.newbyteorder("<")).tobytes())
        temporary.replace(path)
    except OSError as error:
        why = error.strerror or error
        raise CatalogueError(f"The star catalogue {path} cannot be written: {why}.") from None
    finally:
        with suppress(OSError):  # it has its name by now, unless something failed
            temporary.unlink()


def _aligned(offset: int) -> int:
    return -(-offset // ALIGN) * ALIGN
