"""Tables that take long to make, kept on disk by content: what they were made from names the file.

A table is one file in the user's cache folder (or ``KOCHAB_CACHE``). Its name holds a digest of the
catalogue's checksums and of every option, so a table of another catalogue or other options is never
taken for it. Damaged files are made anew, and a disk that cannot be written to is no error.
"""

import contextlib
import hashlib
import io
import json
import time
import zlib
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.arrays import Array
from kochab.folders import cache_folder
from kochab.parsing.text_input import read_json

Arrays = dict[str, Array]
CRC_BYTES = 4


def packed(arrays: Arrays) -> bytes:
    """The file's bytes: a CRC-32 and NumPy's archive.

    The archive's own checksums cover the arrays but not its headers, where a flipped bit can cut an
    array short or lose it unseen.
    """
    file = io.BytesIO()
    np.savez(file, **arrays)  # type: ignore[arg-type]  # names are not options
    data = file.getvalue()
    return zlib.crc32(data).to_bytes(CRC_BYTES, "little") + data


def unpacked(data: bytes | bytearray) -> Arrays | None:
    """The arrays, or None when ``data`` is not as it was written."""
    archive = memoryview(data)[CRC_BYTES:]
    if not archive or zlib.crc32(archive) != int.from_bytes(data[:CRC_BYTES], "little"):
        return None
    with np.load(io.BytesIO(archive)) as arrays:
        return dict(arrays)


TABLE_FORMAT = 3  # raised when what a table holds changes: no older one is read then
ENDING = ".table"
WORTH_S = 0.2  # what takes no longer to make is not kept
MOST_BYTES = 600_000_000  # the oldest tables go when there are more


def cached_table(name: str, options: Mapping[str, Any], make: Callable[[], Arrays]) -> Arrays:
    """The arrays that ``make`` returns, from disk when they are there.

    ``name`` is a word that can be part of a file's name; ``options`` are all that ``make`` depends on
    besides the shipped catalogue, as JSON can hold it.
    """
    content = json.dumps([TABLE_FORMAT, name, catalogue_checksums(), dict(options)], sort_keys=True)
    digest = hashlib.sha256(content.encode()).hexdigest()[:20]
    path = table_folder() / f"{name}-{digest}{ENDING}"
    found = _read(path)
    if found is not None:
        return found
    started = time.perf_counter()
    arrays = make()
    if time.perf_counter() - started >= WORTH_S:
        _write(path, arrays)
    return arrays


def table_folder() -> Path:
    """Where tables lie."""
    return cache_folder() / f"tables-{TABLE_FORMAT}"


def cached_tables() -> dict[str, int]:
    """The kept tables and their sizes in bytes."""
    with contextlib.suppress(OSError):
        return {p.name: p.stat().st_size for p in sorted(table_folder().glob(f"*{ENDING}"))}
    return {}


@lru_cache(maxsize=1)
def catalogue_checksums() -> str:
    """The checksums of the shipped catalogue's files."""
    from kochab.sky import shipped_folder

    manifest = read_json(shipped_folder() / "manifest.json")
    return json.dumps({k: v["sha256"] for k, v in manifest["files"].items()}, sort_keys=True)


def _read(path: Path) -> Arrays | None:
    try:
        return unpacked(path.read_bytes())
    except OSError:
        return None


def _write(path: Path, arrays: Arrays) -> None:
    with contextlib.suppress(OSError):
        from kochab.frames.atomic_file import write_atomically

        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, packed(arrays))
        _thin_out(path)


def _thin_out(newest: Path) -> None:
    """Delete the oldest tables while all together are more than ``MOST_BYTES``."""
    files = sorted(newest.parent.glob(f"*{ENDING}"), key=lambda p: p.stat().st_mtime)
    total = sum(p.stat().st_size for p in files)
    for old in files:
        if total <= MOST_BYTES or old == newest:
            return
        total -= old.stat().st_size
        old.unlink()
