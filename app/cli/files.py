"""Names of files as people type them where the shell leaves patterns alone, as Windows' does."""

from collections.abc import Iterable
from glob import glob
from pathlib import Path

from app.core.errors import UsageError


def named(given: Iterable[str]) -> list[str]:
    """The files meant, patterns such as ``*.fits`` filled in; one that fits none stays as it is.

    Raises
    ------
    UsageError
        A name is empty.

    """
    return [name for text in given for name in _filled_in(text)]


def _filled_in(text: str) -> list[str]:
    if not text.strip():  # a script's empty variable, not the folder we stand in
        raise UsageError("A file's name is empty.")
    if not set(text) & set("*?[") or Path(text).exists():
        return [text]
    return sorted(glob(text)) or [text]
