"""Several files, one after another or in several processes, each printed as soon as it is done."""

import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, TypeVar

from app.cli.output import Json, ProgressLine, card, to_line
from app.core.errors import KochabError
from app.core.progress import Task, run

Item = TypeVar("Item")
NO_MEMORY = (
    "There is not enough memory for this: use fewer --workers, or ask less of the method (--set)."
)


def run_batch(
    work: Callable[[Item], Task[Json]], items: Sequence[Item], as_json: bool, workers: int = 1
) -> int:
    """Print the outcome of ``work(item)`` for every item, in order, and return the exit code.

    ``work`` is a task that returns the outcome; with several ``workers`` it and the items must
    be picklable. An outcome's ``failures`` are sentences about files that could not be written.
    """
    many = workers > 1 and len(items) > 1
    outcomes = _in_processes(work, items, workers) if many else _one_by_one(work, items)
    with closing(outcomes):
        return max((_print(outcome, as_json) for outcome in outcomes), default=0)


def _print(outcome: Json, as_json: bool) -> int:
    """Print one outcome and return the exit code it asks for."""
    failures = outcome.pop("failures", [])
    if as_json:
        if failures:
            outcome["warnings"] = [*outcome["warnings"], *failures]
        print(to_line(outcome), flush=True)
    elif "error" in outcome:
        failures = [_named(outcome["file"], outcome["error"])]
    else:
        print(card(outcome), flush=True)
    for sentence in failures:
        print(f"kochab: {sentence}", file=sys.stderr)
    return 2 if failures else _code(outcome)


def _named(file: str, sentence: str) -> str:
    """The sentence with the file's name, once."""
    return sentence if sentence.startswith((file, Path(file).name)) else f"{file}: {sentence}"


def attempt(work: Callable[[Item], Task[Json]], item: Item, report: Any = None) -> Json:
    """The outcome of one item; what a person can act on becomes ``{"file", "error"}``.

    A fault of our own becomes the same, named as one, so that it does not cost the other files.
    """
    file = str(getattr(item, "file", item))
    try:
        return run(work(item), report)
    except KochabError as error:
        return {"file": file, "error": str(error)}
    except MemoryError:
        return {"file": file, "error": NO_MEMORY}
    except Exception as error:
        first = (str(error).splitlines() or [""])[0]
        return {"file": file, "error": f"A fault in Kochab: {type(error).__name__}: {first}"}


def _one_by_one(
    work: Callable[[Item], Task[Json]], items: Sequence[Item]
) -> Generator[Json, None, None]:
    for item in items:
        line = ProgressLine(str(getattr(item, "file", item)))
        try:
            outcome = attempt(work, item, line)
        finally:
            line.clear()
        yield outcome


def _in_processes(
    work: Callable[[Item], Task[Json]], items: Sequence[Item], workers: int
) -> Generator[Json, None, None]:
    from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
    from multiprocessing import get_context

    pool = ProcessPoolExecutor(min(workers, len(items)), get_context("spawn"), initializer=_begin)
    finished = False
    try:
        with _interrupts_left():
            jobs = [pool.submit(attempt, work, item) for item in items]
        for item, job in zip(items, jobs, strict=True):
            try:
                yield job.result()
            except BrokenExecutor:  # killed from outside, out of memory most likely
                file = str(getattr(item, "file", item))
                yield {"file": file, "error": "Its process was ended from outside."}
        finished = True
    finally:
        if not finished:  # interrupted: nobody waits for what is still being solved
            for process in list(pool._processes.values()):
                process.kill()
        pool.shutdown(wait=finished, cancel_futures=True)


def _begin() -> None:
    """Ctrl-C and warnings are the parent's business; if it was killed, nobody stays behind."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _interrupts_left() -> Iterator[None]:
    """Processes started meanwhile leave Ctrl-C to us from their first moment."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _code(outcome: Json) -> int:
    if "error" in outcome:
        return 2
    return 0 if outcome["solved"] else 1
