"""Work on parts of one large array in threads, one for each processor that this process may use.

NumPy lets other threads run while it works on large parts. Small frames are quicker without, and so is a process that
shares the processors with as many others.
"""

import os
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

Outcome = TypeVar("Outcome")

MOST = 4  # the work is bounded by memory: more gain nothing
_most = MOST


def keep_to_one() -> None:
    """Do everything in one thread of this process from now on: it is one of several that share the processors."""
    global _most
    _most = 1


def processors() -> int:
    """Number of processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # neither on Windows nor on macOS
        return os.cpu_count() or 1


def thread_count() -> int:
    """Number of threads worth starting in this process."""
    return min(_most, processors())


def in_threads(work: Callable[..., Outcome], *parts: Iterable[Any]) -> list[Outcome]:
    """Results of ``work`` for all parts, in their order, as ``map`` gives them."""
    if thread_count() == 1:
        return list(map(work, *parts))
    from concurrent.futures import ThreadPoolExecutor  # 3 ms, for large frames alone

    with ThreadPoolExecutor(thread_count()) as pool:
        return list(pool.map(work, *parts))
