"""Several files, one after another or in several processes, with what is written beside each."""

import gc
import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Protocol, TypeVar

from kochab.cli.output import card, with_progress
from kochab.cli.process import POLITE, fault, journal_path, say, signals_handled
from kochab.core.errors import KochabError, printable
from kochab.core.progress import Task, run
from kochab.core.threads import keep_to_one
from kochab.workflows.solution_json import Json, to_line

if TYPE_CHECKING:  # they load numpy, which --help has no need of
    from multiprocessing.context import BaseContext

    from kochab.core.arrays import Floats
    from kochab.core.frame import Frame
    from kochab.core.solution import Solution
    from kochab.sky.layer import Layers
    from kochab.sky.solar_system import Moving
    from kochab.workflows.frame_objects import FrameObject


class OfFile(Protocol):
    """What is asked of one file."""

    @property
    def file(self) -> str:
        """Its name, as it was given."""


Item = TypeVar("Item", bound=OfFile)
NO_MEMORY = "Out of memory: use fewer --workers, or lower the limits of the method (--set)."


def run_batch(work: Callable[[Item], Task[Json]], items: Sequence[Item], as_json: bool, workers: int = 1) -> int:
    """Print the outcome of ``work(item)`` for every item, in order, and return the exit code.

    An outcome's ``failures`` are sentences about files that could not be written.

    Parameters
    ----------
    work : Callable[[Item], Task[Json]]
        A task that returns the outcome of one item; picklable where there are several workers.
    items : Sequence[Item]
        What to work on; picklable where there are several workers.
    as_json : bool
        Whether one JSON object a line is printed in place of text.
    workers : int
        Processes at most; with 1 the work is done in this one.
    """
    if len(items) > 1:
        gc.enable()  # a short command starts without
    with closing(_each(work, items, workers, partial(_rendered, as_json=as_json))) as outcomes:
        return max((_print(**rendered) for rendered in outcomes), default=0)


def outcomes_of(
    work: Callable[[Item], Task[Json]], items: Sequence[Item], workers: int = 1
) -> Generator[Json, None, None]:
    """The outcomes of all items, in order; close the generator to stop. A failed item yields ``{"file", "error"}``."""
    return _each(work, items, workers, dict)


def _each(
    work: Callable[[Item], Task[Json]], items: Sequence[Item], workers: int, then: Callable[[Json], Json]
) -> Generator[Json, None, None]:
    """What ``then`` makes of every outcome, in the process that has it."""
    many = workers > 1 and len(items) > 1
    return _in_processes(work, items, workers, then) if many else _one_by_one(work, items, then)


def _rendered(outcome: Json, as_json: bool) -> Json:
    """What :func:`_print` is given of an outcome: a line of hundreds of stars is text where they were found."""
    failures = outcome.pop("failures", [])
    text = None
    if as_json:
        if failures:
            outcome["warnings"] = [*outcome["warnings"], *failures]
        text = to_line(outcome)
    elif "error" in outcome:
        failures = [with_file_name(outcome["file"], outcome["error"])]
    else:
        text = card(outcome)
    return {"text": text, "sentences": failures, "code": 2 if failures else _code(outcome)}


def _print(text: str | None, sentences: Sequence[str], code: int) -> int:
    """Print one outcome and return the exit code it asks for."""
    if text is not None:
        print(text, flush=True)
    for sentence in sentences:
        say(sentence)
    return code


def with_file_name(file: str, sentence: str) -> str:
    """A sentence about a file with the file's name, once."""
    names_it = sentence.removeprefix("Can't open ").startswith((printable(file), printable(Path(file).name)))
    return sentence if names_it else f"{file}: {sentence}"


def attempt(file: str, work: Callable[[], Json]) -> Json:
    """The outcome of one file; what a person can act on becomes ``{"file", "error"}``.

    A fault of our own becomes the same, named as one, so that it does not cost the other files.
    """
    try:
        return work()
    except KochabError as error:
        return {"file": file, "error": str(error)}
    except MemoryError:
        return {"file": file, "error": NO_MEMORY}
    except Exception as error:
        return {"file": file, "error": fault(error)}


def _one_by_one(
    work: Callable[[Item], Task[Json]], items: Sequence[Item], then: Callable[[Json], Json]
) -> Generator[Json, None, None]:
    for item in items:
        yield then(attempt(item.file, partial(with_progress, item.file, work(item))))


def _in_processes(
    work: Callable[[Item], Task[Json]], items: Sequence[Item], workers: int, then: Callable[[Json], Json]
) -> Generator[Json, None, None]:
    from concurrent.futures import BrokenExecutor, ProcessPoolExecutor

    root = logging.getLogger("kochab")
    journal = (root.level, journal_path()) if root.handlers else None
    pool = ProcessPoolExecutor(min(workers, len(items)), _context(), _begin, (journal,))
    finished = False
    try:
        with signals_handled([signal.SIGINT], signal.SIG_IGN):  # processes leave Ctrl-C to us from their first moment
            jobs = [pool.submit(_attempt_in_worker, work, item, then) for item in items]
        # In the order given, not as they end: the lines of a batch do not depend on the number of workers.
        for number, (item, job) in enumerate(zip(items, jobs, strict=True)):
            try:
                outcome, records = job.result()
            except BrokenExecutor:  # killed from outside, out of memory most likely
                # Nobody knows whose process it was, and the others' work is lost with it. Alone, a file ends its own.
                if len(items) > 1:
                    for again in filter(None, ([item], items[number + 1 :])):
                        yield from _in_processes(work, again, workers, then)
                    break
                outcome, records = then({"file": item.file, "error": "Its process was ended from outside."}), []
            for record in records:
                logging.getLogger(record.name).handle(record)
            yield outcome
        finished = True
    finally:
        if not finished:  # interrupted: nobody waits for what is still being solved
            for process in list(pool._processes.values()):
                process.kill()
        pool.shutdown(wait=finished, cancel_futures=True)


def _context() -> "BaseContext":
    """Forked where nothing else runs in this process: what is loaded is not loaded again by each.

    A fork copies no threads, and what they held stays held; so it is for Linux, where the system counts them.
    """
    from multiprocessing import get_context

    alone = sys.platform == "linux" and len(os.listdir("/proc/self/task")) == 1
    if alone:
        gc.collect()
        gc.freeze()  # a collection in a child would copy what is loaded
    return get_context("fork" if alone else "spawn")


_records: "SimpleQueue[logging.LogRecord]" = SimpleQueue()
"""What a worker process has logged and not yet handed to its parent."""


def _attempt_in_worker(
    work: Callable[[Item], Task[Json]], item: Item, then: Callable[[Json], Json]
) -> tuple[Json, list[logging.LogRecord]]:
    """The outcome, and what was logged: the parent writes it, as one process alone can rotate a file."""
    outcome = then(attempt(item.file, lambda: run(work(item))))
    return outcome, [_records.get() for _ in range(_records.qsize())]


def _begin(journal: tuple[int, str | None] | None) -> None:
    """Prepare a worker: Ctrl-C and warnings are left to the parent, and it ends with the parent.

    ``journal`` is the level and the file of the parent's log, None when it keeps none.
    """
    keep_to_one()
    for name in POLITE:  # our parent's, where we were forked
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)
    if journal is not None:
        from logging.handlers import QueueHandler

        handler, root = QueueHandler(_records), logging.getLogger("kochab")
        root.handlers.clear()
        handler.name = journal[1]
        root.addHandler(handler)
        root.setLevel(journal[0])
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    from multiprocessing import parent_process  # 1 ms, for a batch alone

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _code(outcome: Json) -> int:
    if "error" in outcome:
        return 2
    return 0 if outcome["solved"] else 1


# Files that are written beside a solution; each returns sentences about what could not be.


def refuse_wcs_over(targets: Iterable[str], inputs: Sequence[str], overwrite: bool) -> None:
    """Refuse, before any work, ``.wcs`` files that would replace what Kochab did not write.

    Raises UsageError when one is an input, or is there and is not Kochab's.
    """
    from kochab.frames.outputs import is_solution_file, refuse_overwriting

    for target in targets:
        refuse_overwriting([target], inputs, overwrite or is_solution_file(target, own=True))


def write_wcs_to(target: str, solution: "Solution") -> list[str]:
    """Write a ``.wcs`` file."""
    from kochab.frames.wcs import write_wcs

    return _written(target, lambda: write_wcs(solution, target))


def write_picture(
    target: str,
    frame: "Frame",
    solution: "Solution",
    more: "Sequence[Moving]" = (),
    layers: "Layers | None" = None,
    detected: "Floats | None" = None,
) -> list[str]:
    """Write the picture with the sky drawn over it; the sentences of what failed.

    Parameters
    ----------
    target : str
        The file to write; its ending is its format.
    frame : Frame
        The frame whose pixels are drawn.
    solution : Solution
        Where it points.
    more : Sequence[Moving]
        Tables of moving bodies beside the shipped ones.
    layers : Layers or None
        What is drawn; None for the usual.
    detected : Floats or None
        Places (N, 2) px of the stars detected; None when they are not drawn.
    """
    from kochab.workflows.annotated_image import NOTHING, USUAL, annotate

    found = NOTHING if detected is None else detected
    return _written(target, lambda: annotate(frame, solution, target, more, layers or USUAL, found))


def write_objects(target: str, frame: "Frame", solution: "Solution", found: "Sequence[FrameObject]") -> list[str]:
    """Write the objects of the frame: a table, DS9's regions, or Stellarium's script, by the ending.

    Parameters
    ----------
    target : str
        The file to write: ``.csv``, ``.ssc`` (Stellarium's script), else DS9's regions.
    frame : Frame
        The frame they lie in.
    solution : Solution
        Where it points.
    found : Sequence[FrameObject]
        The objects to write.
    """
    from kochab.frames.atomic_file import write_atomically
    from kochab.workflows.annotated_image import write_stellarium
    from kochab.workflows.frame_objects import objects_csv, sky_regions

    ending = Path(target).suffix.lower()
    if ending == ".ssc":
        return _written(target, lambda: write_stellarium(frame, solution, target))
    text = objects_csv(found) if ending == ".csv" else sky_regions(solution, found)
    return _written(target, lambda: write_atomically(target, text))


def _written(target: str, write: Callable[[], None]) -> list[str]:
    try:
        write()
    except OSError as error:
        return [f"{target} cannot be written: {error.strerror or error}."]
    return []
