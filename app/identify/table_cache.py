"""Tables of the classic methods, kept on disk by content: what they were made from names the file.

A table is one file (:mod:`~app.identify.table_file`) in the user's cache folder (or
``KOCHAB_CACHE``). Its name holds a digest of the catalogue's own checksums and of every option, so
a table of another catalogue or other options is never taken for it. What was made in an instant is
not kept, files that are damaged are made anew, and a disk that cannot be written to is no error.
"""

import contextlib
import hashlib
import json
import os
import time
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from app.frames.whole_file import write_whole
from app.identify.table_file import Arrays, packed, unpacked

FORMAT = 2
ENDING = ".table"
WORTH_S = 0.2  # what takes no longer to make is not kept
MOST_BYTES = 600_000_000  # the oldest tables go when there are more


def kept(name: str, options: Mapping[str, Any], make: Callable[[], Arrays]) -> Arrays:
    """The arrays that ``make`` returns, from disk when they are there.

    Parameters
    ----------
    name : str
        What the table is, a word that can be part of a file's name.
    options : mapping
        All that ``make`` depends on besides the shipped catalogue, as JSON can hold it.
    make : callable
        Makes the arrays; called at most once.

    """
    path = folder() / f"{name}-{_digest(name, options)}{ENDING}"
    found = _read(path)
    if found is not None:
        return found
    started = time.perf_counter()
    arrays = make()
    if time.perf_counter() - started >= WORTH_S:
        _write(path, arrays)
    return arrays


def folder() -> Path:
    """Where tables lie: ``KOCHAB_CACHE`` or the user's cache."""
    from platformdirs import user_cache_path

    base = os.environ.get("KOCHAB_CACHE")
    root = Path(base) if base else user_cache_path("kochab", appauthor=False)
    return root / f"tables-{FORMAT}"


def tables() -> dict[str, int]:
    """The kept tables and their sizes in bytes."""
    with contextlib.suppress(OSError):
        return {p.name: p.stat().st_size for p in sorted(folder().glob(f"*{ENDING}"))}
    return {}


def _digest(name: str, options: Mapping[str, Any]) -> str:
    told = json.dumps([FORMAT, name, _catalogue(), dict(options)], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()[:20]


@lru_cache(maxsize=1)
def _catalogue() -> str:
    """The checksums of the shipped catalogue's files."""
    from app.sky.catalogue import shipped_folder

    manifest = json.loads((shipped_folder() / "manifest.json").read_text("utf-8"))
    return json.dumps({k: v["sha256"] for k, v in manifest["files"].items()}, sort_keys=True)


def _read(path: Path) -> Arrays | None:
    try:
        return unpacked(bytearray(path.read_bytes()))
    except OSError:
        return None


def _write(path: Path, arrays: Arrays) -> None:
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, packed(arrays))
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
