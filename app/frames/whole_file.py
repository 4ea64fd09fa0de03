"""A file that is there whole or, where it was there before, as it was."""

import os
import threading
from contextlib import suppress
from pathlib import Path


def write_whole(path: str | os.PathLike[str], content: bytes | str) -> None:
    """Write ``content``, text as UTF-8; a full disk leaves neither half a file nor an empty one.

    Raises OSError when that is not possible.
    """
    target = Path(path)
    data = content.encode("utf-8") if isinstance(content, str) else content
    if target.exists() and not target.is_file():  # /dev/null and its like are written into
        target.write_bytes(data)
        return
    target = target.resolve()  # a link stays one
    part = target.with_name(f".{os.getpid()}-{threading.get_ident()}.part")
    try:
        part.write_bytes(data)
        part.replace(target)
    finally:
        with suppress(OSError):  # it has its name by now, unless something failed
            part.unlink()
