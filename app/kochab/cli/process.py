"""The process of a command: standard streams as they come, and signals that end it."""

import codecs
import io
import os
import signal
import sys
import threading
import unicodedata
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType
from typing import Any

from kochab.core.errors import printable


def make_ready() -> None:
    """Let neither a closed stream nor a file's strange name cost an answer.

    What a stream's encoding has no letter for is spelt in ASCII, see :func:`spelt`; a stream that was closed by whoever
    started us (or is not there, as in a Windows program without a console) is replaced by one that takes everything.
    """
    codecs.register_error(SPELT, _replaced)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        # Those that raise: the usual one, and the one of Windows' pipes and of LC_ALL=C, which is for names alone.
        elif isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape", "surrogatepass"):
            stream.reconfigure(errors=SPELT)


SPELT = "kochab.spelt"
_SPELT = {
    **{"°": "deg", "″": '"', "′": "'", "±": "+/-", "×": "x", "−": "-", "–": "-", "—": "-", "…": "...", "µ": "u"},
    **{"’": "'", "‘": "'", "“": '"', "”": '"', "·": ".", "▲": "up", "▼": "down", "▶": ">", "◀": "<"},
}


def spelt(letter: str) -> str:
    """A letter in ASCII: eta for η, deg for °, 2 for ², an escape for one that has no such form."""
    if letter in _SPELT:
        return _SPELT[letter]
    words = unicodedata.name(letter, "").split()
    if words[:2] == ["GREEK", "SMALL"] and len(words) == 4:
        return words[3].lower().replace("lamda", "lambda")  # as Unicode writes it
    plain = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode("ascii")
    return plain or letter.encode("unicode_escape").decode("ascii")


def _replaced(error: UnicodeError) -> tuple[str, int]:
    """An error handler of :mod:`codecs`."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(spelt, error.object[error.start : error.end])), error.end


def say(sentence: str) -> None:
    """One sentence on standard error, if that takes it."""
    try:
        print(f"kochab: {printable(sentence)}", file=sys.stderr, flush=True)
    except OSError:
        give_up()  # from Python 3.13 on, what is left in it would make the exit code 120


def show_journal() -> None:
    """Show all that is logged on standard error as well."""
    import logging

    from kochab.gear.journal import JournalFormatter

    handler = logging.StreamHandler()
    handler.setFormatter(JournalFormatter("%(asctime)s %(levelname)s %(name)s %(message)s"))
    root = logging.getLogger("kochab")
    root.addHandler(handler)
    root.setLevel(logging.DEBUG)


def journal_path() -> str | None:
    """The journal's file, None when there is none.

    A worker process has no file open; its handler is named after the parent's.
    """
    import logging

    handlers = logging.getLogger("kochab").handlers
    files = (h.baseFilename if isinstance(h, logging.FileHandler) else h.name for h in handlers)
    return next(filter(None, files), None)


def fault(error: Exception) -> str:
    """Log an unexpected exception with its traceback; one sentence that says where to find it."""
    import logging

    root = logging.getLogger("kochab")
    journal = journal_path()
    if root.handlers:  # else logging itself would print the traceback
        # The journal's own name, for what is logged under it is shown nowhere else unasked.
        logging.getLogger("kochab.gear.journal").critical("fault", exc_info=error)
    where = f"the journal has the details: {journal}" if journal else "--debug shows the details"
    first = (str(error).splitlines() or [""])[0].rstrip(".")
    return f"A fault in Kochab: {type(error).__name__}: {first}; {where}."


def give_up() -> None:
    """Drop what no stream would take, so that the interpreter's end does not try again."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


# Signals that ask a program to end; they end it as Ctrl-C does, and nothing is left running.

POLITE = ("SIGTERM", "SIGHUP")
"""A polite kill, and the terminal that was closed or the line to another computer that broke."""


def ended_by_signals() -> AbstractContextManager[None]:
    """Let each of them raise KeyboardInterrupt meanwhile; one that is ignored, as nohup has it, stays so."""
    there = (getattr(signal, name) for name in POLITE if hasattr(signal, name))
    return signals_handled([n for n in there if signal.getsignal(n) is signal.SIG_DFL], _end)


@contextmanager
def signals_handled(numbers: Iterable[int], handler: Any) -> Iterator[None]:
    """Give signals another handler meanwhile; outside the main thread, where none can be caught, nothing is done."""
    here = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, handler) for number in numbers if here}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


@contextmanager
def signals_kept() -> Iterator[None]:
    """Keep signals that end a program while something is done that must not be left half done; at its end they do."""
    kept: list[int] = []
    numbers = [signal.SIGINT, *(getattr(signal, name) for name in POLITE if hasattr(signal, name))]
    with signals_handled([n for n in numbers if callable(signal.getsignal(n))], lambda number, _: kept.append(number)):
        yield
    if kept:
        raise KeyboardInterrupt


def _end(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
