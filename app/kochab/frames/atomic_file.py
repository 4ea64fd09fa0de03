"""Files that are written whole or not at all."""

import errno
import os
import shutil
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Where to write what is to lie at ``path``, which it does when the block ends well.

    A full disk leaves neither half a file nor an empty one. A file that is replaced keeps its mode,
    its owner and its hard links.

    Raises OSError when the file cannot take its place, or the one that is there is write-protected.
    """
    target = Path(path)
    if target.exists() and not target.is_file():  # /dev/null and its like are written into
        yield target
        return
    target = target.resolve()  # a link stays one
    before = target.stat() if target.exists() else None
    if before is not None and not stat.S_IMODE(before.st_mode) & 0o222:  # a rename would not ask
        raise PermissionError(errno.EACCES, "it is write-protected", str(target))
    part = target.with_name(f".{os.getpid()}-{threading.get_ident()}.part")
    needed = False
    try:
        yield part
        if before is None or _like(target, part, before):
            part.replace(target)
        else:
            needed = True  # until the target is whole again
            with part.open("rb") as new, target.open("r+b") as file:
                shutil.copyfileobj(new, file)
                file.truncate()
            needed = False
    finally:
        if not needed:
            with suppress(OSError):  # it has its name by now, unless something failed
                part.unlink()


def _like(target: Path, part: Path, before: os.stat_result) -> bool:
    """Give ``part`` the mode and owner of the target; whether it may take its place by its name alone."""
    if before.st_nlink > 1:
        return False
    mine = part.stat()
    try:
        if (mine.st_uid, mine.st_gid) != (before.st_uid, before.st_gid):
            os.chown(part, before.st_uid, before.st_gid)
        shutil.copystat(target, part)
        os.utime(part)  # it is written now
    except OSError:
        return False
    return True


def write_atomically(path: str | os.PathLike[str], content: bytes | str) -> None:
    """Write ``content``, text as UTF-8, as an :func:`atomic_file`; OSError when it cannot be."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    with atomic_file(path) as part:
        part.write_bytes(data)
