"""What is asked of the thread of a mount's line."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from app.core.progress import Progress, Task
from app.mounts.guard import Guard

Make = Callable[[Guard], Task[Any]]
Outlives = Callable[[Progress], bool]


def never(_: Progress) -> bool:
    """An order that ends when the line breaks, as whatever moves must."""
    return False


@dataclass(frozen=True, slots=True)
class Order:
    """Something to do; ``stops`` is how often all was stopped when it was wished for.

    ``outlives`` tells by the newest progress whether it can wait for a line that is lost and found
    again: only what does not move the mount then.
    """

    name: str
    make: Make
    stops: int
    outlives: Outlives = never
