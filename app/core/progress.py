"""What a long task says of itself, and how one is driven without a window.

A task is a generator: it yields :class:`Progress` and returns its result. Every yield is a point
where the driver may stop asking, which is how a task is cancelled.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
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
