"""Chunks of an archive on Dask: in processes here, or on a cluster that is there already.

Dask starts, watches and restarts the workers, and gives a lost worker's chunk to another. What kills every worker that
takes it is found here: its chunk is parted, and the one input that kills a worker which has nothing else is told.
"""

import signal
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from kochab.core import __version__
from kochab.core.errors import UsageError
from kochab.workflows.archive.run import Chunk, Outcome

if TYPE_CHECKING:
    from distributed import Client

PATIENCE_S = 20
"""To reach a scheduler."""
WAITING = 2
"""Chunks a worker has in hand or before it: none waits for us, and few are lost with us."""
SETTINGS = {
    "logging.distributed": "critical",  # a worker that ends is not an event here
    "distributed.worker.preload": [__name__],
    "distributed.scheduler.allowed-failures": 1,  # of a chunk; before an input is told it has three times as many
    "distributed.scheduler.no-workers-timeout": "120s",  # of those here; a cluster of others may make us wait
    # Dask has workers give memory back at once: the pages of every array are asked for anew, 60 % more processor time.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
}
HERE = {"dashboard_address": "127.0.0.1:0", "silence_logs": 50, "memory_limit": 0}
STARTS = 5
KILLED = "Its worker process was ended from outside each time, most likely for lack of memory."


@contextmanager
def cluster(address: str | None, workers: int) -> "Iterator[Client]":
    """A client of so many processes here, or of the scheduler at an address or in a scheduler file.

    Raises UsageError where there is none, or where its workers have another Kochab.
    """
    import dask
    from distributed import Client, LocalCluster

    with dask.config.set(SETTINGS):
        if address is None:
            with _started(partial(LocalCluster, workers, threads_per_worker=1, **HERE)) as here, Client(here) as client:
                yield client
            return
        where = {"scheduler_file": address} if address.endswith(".json") else {"address": address}
        try:
            client = Client(**where, timeout=PATIENCE_S)
        except (OSError, ValueError, TimeoutError) as error:
            raise UsageError("No Dask scheduler at {address}: {why}.", address=address, why=_plain(error)) from None
        with client:
            _check_versions(client)
            yield client


def dask_setup(worker: object) -> None:
    """What Dask calls in a worker that starts here: Ctrl-C is the business of whoever asked for the work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _started(make: Callable[[], Any]) -> Any:
    """A cluster; made again where a worker was ended while it started."""
    for left in reversed(range(STARTS)):
        try:
            return make()
        except RuntimeError:
            if not left:
                raise
    raise AssertionError


def _plain(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")


def _check_versions(client: "Client") -> None:
    try:
        found: dict[str, str] = client.run(version)
    except Exception as error:  # whatever a worker without Kochab raises
        why = _plain(error)
        raise UsageError("The Dask workers cannot run Kochab {own}: {why}.", own=__version__, why=why) from None
    for worker, there in found.items():
        if there != __version__:
            raise UsageError(
                "The Dask worker {worker} has Kochab {there}, here is {own}: install the same everywhere.",
                worker=worker,
                there=there,
                own=__version__,
            )


def version() -> str:
    """Kochab's, where this is called."""
    return __version__


def on_cluster(
    client: "Client", chunks: Iterator[Chunk], work: Callable[[Chunk], Outcome], lost: Callable[[Chunk], Outcome]
) -> Generator[Outcome, None, None]:
    """What ``work`` makes of every chunk, in the order in which they end; close it to stop.

    Parameters
    ----------
    client : Client
        Of the cluster.
    chunks : Iterator[Chunk]
        Asked for as workers become free.
    work : Callable[[Chunk], Outcome]
        What a worker does; picklable.
    lost : Callable[[Chunk], Outcome]
        What is said of a chunk of one input that ended its worker each time.
    """
    again: list[Chunk] = []
    suspects: list[Chunk] = []
    yield from _rounds(client, lambda: again.pop() if again else next(chunks, None), work, again, suspects)
    # One at a time, each with the cluster to itself: who shared a worker with the culprit is cleared.
    for suspect in suspects:
        once, guilty = iter([suspect]), list[Chunk]()
        yield from _rounds(client, partial(next, once, None), work, [], guilty)
        yield from map(lost, guilty)


def _rounds(
    client: "Client",
    take: Callable[[], Chunk | None],
    work: Callable[[Chunk], Outcome],
    again: list[Chunk],
    killers: list[Chunk],
) -> Generator[Outcome, None, None]:
    """Outcomes of what ``take`` gives; chunks that ended their workers go to ``again`` in parts, or to ``killers``."""
    from distributed import KilledWorker, as_completed
    from distributed.scheduler import NoValidWorkerError

    waiting: dict[str, Chunk] = {}
    done = as_completed()

    def fill() -> None:
        room = WAITING * max(sum(client.nthreads().values()), 1)
        while len(waiting) < room and (chunk := take()) is not None:
            future = client.submit(work, chunk, pure=False)
            waiting[future.key] = chunk
            done.add(future)

    fill()
    for future in done:
        chunk = waiting.pop(future.key)
        try:
            yield future.result()
        except NoValidWorkerError:
            raise UsageError("All workers ended and none could be started again.") from None
        except KilledWorker:
            (again.extend if len(chunk.items) > 1 else killers.extend)(chunk.alone())
        fill()
