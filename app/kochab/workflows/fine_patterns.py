"""Builds the small-field patterns and the index of the user's stars in a process of its own, beside the window.

In a thread of the window's process the long sorts would hold Python's lock for a fifth of a
second now and then. No Qt is imported there.
"""

import os
import signal
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection

from kochab.core.errors import CatalogueError, KochabError
from kochab.core.progress import Progress, Task
from kochab.text.translation import tr

LOOK_EVERY_S = 0.2
ENDING_S = 0.5  # a long sort hears nothing for seconds


def make_elsewhere() -> Task[None]:
    """Make the patterns in another process; closing this task ends it.

    Raises CatalogueError when they cannot be made.
    """
    context = get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=make_here, args=(theirs,), daemon=True)
    process.start()
    theirs.close()  # or the end of the process would not end the pipe
    step: Progress | str = Progress("patterns")
    try:
        while isinstance(step, Progress):
            yield step
            if ours.poll(LOOK_EVERY_S):
                step = ours.recv()
    except EOFError:  # it has ended
        step = tr("Can't build the small-field index.")
    finally:
        ours.close()
        process.terminate()
        process.join(ENDING_S)
        process.kill()
        process.join()
        _clear_up()
    if step:
        raise CatalogueError(step)


def _clear_up() -> None:
    """Remove what a process that was killed has left and cannot go on from, unless another program makes it."""
    from kochab.identification.index import fine_folder
    from kochab.identification.index_build import acquire, drop_unless_begun, release

    lock = fine_folder().with_suffix(".lock")
    with suppress(OSError):
        if lock.exists() and (handle := acquire(lock)) is not None:
            drop_unless_begun(lock.with_suffix(".part"))
            release(handle, lock)


def _every_index() -> Task[None]:
    """That of small fields, and that of the user's own stars."""
    from kochab.identification.index_build import make_fine
    from kochab.solver.own_index import make_own

    yield from make_fine()
    yield from make_own()


def make_here(steps: "Connection[Progress | str, None]") -> None:
    """Make them, and send each step and at last why it went wrong, or nothing."""
    # It ends at once when asked, and the window clears up: an exception within a search would take the arrays from
    # under SciPy's threads, which crash.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches us too; the window decides
    if hasattr(os, "nice"):
        os.nice(10)
    task = _every_index()
    try:
        for step in task:
            steps.send(step)
        steps.send("")
    except KochabError as error:
        steps.send(str(error))
    except BrokenPipeError:  # the window was killed
        task.close()
