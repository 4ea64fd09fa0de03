"""A lock between programs that ends with the program that holds it, however that ends."""

import os
import sys
from contextlib import suppress
from pathlib import Path


def acquire(path: Path) -> int | None:
    """Lock the file at ``path``, made if need be; its handle, or None when another holds it.

    The system gives the lock up when its holder dies. A file system without locks lets everyone
    in. Raises OSError when the file cannot be made.
    """
    handle = os.open(path, os.O_CREAT | os.O_RDWR)
    try:
        _lock(handle)
    except (BlockingIOError, PermissionError):
        os.close(handle)
        return None
    except OSError:
        return handle
    if _is_at(handle, path):
        return handle
    os.close(handle)  # its last holder has just removed it
    return None


def release(handle: int, path: Path) -> None:
    """Give the lock up and remove its file."""
    if sys.platform != "win32":  # before the lock is given up, or another may hold a removed file
        path.unlink(missing_ok=True)
    os.close(handle)
    if sys.platform == "win32":  # an open file cannot be removed there
        with suppress(OSError):  # another has it by now
            path.unlink(missing_ok=True)


def _lock(handle: int) -> None:
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _is_at(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False
