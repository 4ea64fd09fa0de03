"""What a worker does in place of solving: Dask finds it by the name of this module, and each worker imports it."""

import os
import signal

from kochab.cli.cluster import KILLED
from kochab.workflows.archive.run import Chunk, Outcome


def ends_for_poison(chunk: Chunk) -> Outcome:
    """Rows with their URLs alone; an input called poison takes its process with it."""
    for item in chunk.items:
        if "poison" in item.url:
            os.kill(os.getpid(), signal.SIGKILL)
    return Outcome("", [{"url": item.url} for item in chunk.items])


def told_as_lost(chunk: Chunk) -> Outcome:
    """What is said of an input that ended its worker each time."""
    return Outcome("", [{"url": item.url, "error": KILLED} for item in chunk.items])
