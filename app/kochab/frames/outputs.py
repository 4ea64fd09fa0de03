"""Which files an output may replace: never one that is read, another only when a person says so."""

import os
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from kochab.core.errors import UsageError

Name = str | os.PathLike[str]

_HEAD_BYTES = 1 << 15


def refuse_overwriting(targets: Iterable[Name], inputs: Iterable[Name] = (), overwrite: bool = False) -> None:
    """Refuse outputs that would cost a person a file; call it before any work.

    Parameters
    ----------
    targets
        What is to be written. Devices such as ``/dev/null`` and folders are let pass: nothing is replaced there.
    inputs
        What is read. None of it is ever replaced, under whatever name.
    overwrite
        Whether a person asked for other files to be replaced.

    Raises UsageError when a target is one of the inputs, or is there already.
    """
    names = list(inputs)
    for target in map(Path, targets):
        refuse_input(target, names)
        if target.is_file() and not overwrite:
            raise UsageError(
                "{target} exists already: name another file, or add --overwrite to replace it.", target=target
            )


def refuse_input(target: Name, inputs: Iterable[Name]) -> None:
    """Refuse to write over a file that is read, also by a link or another spelling of its name.

    Raises UsageError when ``target`` is one of ``inputs``.
    """
    if any(same_file(target, name) for name in inputs):
        raise UsageError("{target} is an input file and is never overwritten: name another file.", target=target)


def is_solution_file(path: Name, own: bool = False) -> bool:
    """Whether a solver wrote this ``.wcs``, ``.ini`` or ``.csv``, which the next may replace; ``own``: Kochab did."""
    try:
        with open(path, "rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError:
        return False
    header_only = head.startswith(b"SIMPLE  =") and b"NAXIS   =                    0" in head
    # After a failure ASTAP leaves an .ini whose first line is empty; a list of its stars has this head.
    solved = head.lstrip(b"\r\n").startswith((b"PLTSOLVD=", b"x,y,hfd,snr,flux")) or (
        header_only and b"PLTSOLVD=" in head
    )
    return solved and (not own or b"solved by Kochab" in head)


def same_file(one: Name, other: Name) -> bool:
    """Whether two names are of one file, also by a link or by letters that some drives do not tell apart."""
    try:
        if os.path.samefile(one, other):  # links of both kinds
            return True
    except (OSError, ValueError):
        pass  # one of them is not there
    return spelling(one) == spelling(other)


def spelling(name: Name, path: Any = os.path) -> str:
    """A name as the drive that tells fewest apart has it: links followed, no case, one form of accents, no end of dots.

    Where case matters two such names are two files, until they are copied to a drive where it does not: Windows' and
    macOS's usual ones. Windows drops dots and spaces at a name's end. ``path`` is `posixpath` or `ntpath`.
    """
    try:
        real = str(path.realpath(name))
    except (OSError, ValueError):  # a link that leads to itself, a NUL
        real = str(path.abspath(os.fspath(name)))
    folder, file = path.split(real)
    return unicodedata.normalize("NFC", str(path.join(folder, file.rstrip(". ") or file))).casefold()
