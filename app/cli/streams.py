"""Standard output and error as they come: closed, full, or without a letter for a name."""

import io
import os
import sys
from contextlib import suppress


def make_ready() -> None:
    """Let neither a closed stream nor a file's strange name cost an answer.

    What a stream's encoding has no letter for is written as an escape; a stream that was closed
    by whoever started us (or is not there, as in a Windows program without a console) is
    replaced by one that takes everything.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")


def say(sentence: str) -> None:
    """One sentence on standard error, if that takes it."""
    with suppress(OSError):
        print(f"kochab: {sentence}", file=sys.stderr, flush=True)


def give_up() -> None:
    """Drop what no stream would take, so that the interpreter's end does not try again."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
