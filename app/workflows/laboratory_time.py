"""Processor time of a task, told apart by what it was doing."""

from time import thread_time
from typing import TypeVar

from app.core.progress import Task
from app.solve.stopwatch import PREPARING

T = TypeVar("T")


def timed(task: Task[T], limit_s: float) -> Task[tuple[T | None, dict[str, float]]]:
    """The task's result, None when it took longer than ``limit_s``; and seconds by stage.

    Preparing the patterns of small fields, once on a machine, counts for neither.
    """
    spent: dict[str, float] = {}
    stage = ""
    try:
        while True:
            start, result = thread_time(), None
            try:
                progress = next(task)
            except StopIteration as end:
                progress, result = None, end.value
            if stage != PREPARING:
                spent[stage] = spent.get(stage, 0.0) + thread_time() - start
            if progress is None or sum(spent.values()) > limit_s:
                return result, spent
            stage = progress.stage
            yield progress
    finally:
        task.close()
