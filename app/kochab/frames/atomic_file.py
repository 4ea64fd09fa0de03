"""Files that are written whole or not at all."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Where to write what is to lie at ``path``, which it does when the block ends well.

    A full disk leaves neither half a file nor an empty one. Raises OSError when the file cannot
    take its place.
    """
    target = Path(path)
    if target.exists() and not target.is_file():  # /dev/null and its like are written into
        yield target
        return
    target = target.resolve()  # a link stays one
    part = target.with_name(f".{os.getpid()}-{threading.get_ident()}.part")
    try:
        yield part
        part.replace(target)
    finally:
        with suppress(OSError):  # it has its name by now, unless something failed
            part.unlink()


def write_atomically(path: str | os.PathLike[str], content: bytes | str) -> None:
    """Write ``content``, text as UTF-8, as a :func:`whole_file`; OSError when it cannot be."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    with atomic_file(path) as part:
        part.write_bytes(data)
