"""Long tasks: progress, time limit, stage times, and how to run one without a window.

A task is a generator: it yields :class:`Progress` and returns its result. Every yield is a point
where the driver may stop asking, which is how a task is cancelled.
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TypeVar

from kochab.core.values import frozen

T = TypeVar("T")


@frozen
class Progress:
    """How far a task is: ``fraction`` in 0..1 or None when unknown, and what it is doing."""

    stage: str
    fraction: float | None = None
    detail: str = ""


Task = Generator[Progress, None, T]


def run(task: Task[T], report: Callable[[Progress], None] | None = None) -> T:
    """Drive ``task`` to its end in this thread and return its result."""
    while True:
        try:
            progress = next(task)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        if report is not None:
            report(progress)


# -- Stage times and the limit of a search -----------------------------------------------------

STAGES = ("read", "detect", "identify", "attitude")
PREPARING = "patterns"
"""The stage in which an identifier makes its index, once on a machine: not the frame's time."""


class TimedOut(Exception):  # noqa: N818 (a signal inside this room, not an error)
    """The search went past its limit."""


class Stopwatch:
    """Milliseconds a stage, and the moment the search must be over."""

    def __init__(self, timeout_s: float | None = None, read_ms: float = 0.0) -> None:
        self._start = perf_counter()
        # Reading has already used part of the time allowed.
        self._limit = None if timeout_s is None else self._start + timeout_s - read_ms / 1e3
        self._ms = dict.fromkeys(STAGES, 0.0)
        self._ms["read"] = read_ms

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of the block to stage ``name``."""
        start = perf_counter()
        try:
            yield
        finally:
            self._ms[name] += (perf_counter() - start) * 1e3

    def elapsed_ms(self) -> dict[str, float]:
        """Stage times and their ``total``, reading included."""
        total = self._ms["read"] + (perf_counter() - self._start) * 1e3
        return {**{k: round(v, 3) for k, v in self._ms.items()}, "total": round(total, 3)}

    def check(self) -> None:
        """Raise :class:`TimedOut` when the limit has passed."""
        if self._limit is not None and perf_counter() > self._limit:
            raise TimedOut

    def watch(self, task: Task[T]) -> Task[T]:
        """The same task, which ends with :class:`TimedOut` at the first yield past the limit.

        What it spends preparing does not count.
        """
        stage = ""
        try:
            while True:
                self.check()
                step = perf_counter()
                try:
                    progress = next(task)
                except StopIteration as end:
                    return end.value  # type: ignore[no-any-return]
                # The step just made began when the task had said that it prepares: it moves the limit out.
                if stage == PREPARING and self._limit is not None:
                    self._limit += perf_counter() - step
                stage = progress.stage
                yield progress
        finally:
            task.close()


def without_preparing(task: Task[T]) -> Task[T | None]:
    """The same task, which ends with None where it would wait until an index is made, perhaps for minutes."""
    try:
        while True:
            try:
                progress = next(task)
            except StopIteration as end:
                return end.value  # type: ignore[no-any-return]
            if progress.stage == PREPARING:
                return None
            yield progress
    finally:
        task.close()
