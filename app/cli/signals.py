"""Signals that ask a program to end; they end it as Ctrl-C does, and nothing is left running."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

POLITE = ("SIGTERM", "SIGHUP")
"""A polite kill, and the terminal that was closed or the line to another computer that broke."""


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let each of them raise KeyboardInterrupt meanwhile.

    One that is ignored, as nohup has it, stays so. Outside the main thread, where no signal can
    be caught, nothing is done.
    """
    before = {}
    if threading.current_thread() is threading.main_thread():
        there = (getattr(signal, name) for name in POLITE if hasattr(signal, name))
        before = {n: signal.signal(n, _end) for n in there if signal.getsignal(n) is signal.SIG_DFL}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
