"""Chunks of an archive on Dask: in processes here, or on a cluster that is there already.

Dask starts, watches and restarts the workers, and gives a lost worker's chunk to another. What kills every worker that
takes it is found here: its chunk is parted, and the one input that kills a worker which has nothing else is told.
"""

import gc
import logging
import signal
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import field
from functools import partial
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from kochab.cli.process import signals_kept
from kochab.core import __version__
from kochab.core.errors import UsageError
from kochab.core.threads import keep_to_one
from kochab.core.values import mutable
from kochab.workflows.archive.run import Chunk, Outcome

if TYPE_CHECKING:
    from distributed import Client, Future

PATIENCE_S = 20
"""To reach a scheduler."""
WAITING = 2
"""Chunks a worker has in hand or before it: none waits for us, and few are lost with us."""
SETTINGS = {
    "logging.distributed": "critical",  # a worker that ends is not an event here
    "distributed.worker.preload": [__name__],
    "distributed.scheduler.allowed-failures": 1,  # of a chunk; before an input is told it has three times as many
    # Dask has workers give memory back at once: the pages of every array are asked for anew, 60 % more processor time.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
    # The work is done in a thread, whose own arena gives memory back as readily: a tenth of the processor time.
    "distributed.nanny.pre-spawn-environ.MALLOC_ARENA_MAX": 1,
    "distributed.worker.profile.enabled": False,  # it would look at the stack of the work every 10 ms
    # Scheduler, nannies and workers wake 50 times a second each to time their event loops: 5 % of a core here.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    # Each line to a worker keeps its last 1000 messages, of a chunk each: 20,000 inputs and more of every worker.
    "distributed.admin.low-level-log-length": 0,
}
HERE = {"dashboard_address": "127.0.0.1:0", "silence_logs": logging.CRITICAL, "memory_limit": None}
STARTS, POLL_S, LOOK_S, RESTART_S, LOST_S = 5, 0.1, 1.0, 10.0, 300.0
KILLED = "Its worker process was ended from outside each time, most likely for lack of memory."


@mutable
class Workers:
    """A client of a cluster; of one that is ``here`` the workers are kept as many as ``count``."""

    client: "Client"
    here: Any = None
    count: int = 0
    _whole: float = field(default_factory=time.monotonic)
    _looked: float = 0.0
    _spares: int = 0

    @property
    def threads(self) -> int:
        """How many chunks are worked on at once."""
        return sum(self.client.nthreads().values())

    def keep(self) -> None:
        """Start a worker for one that is gone for good: Dask starts those again that end, but not twice in a moment.

        Raises UsageError when there has been none for `LOST_S`.
        """
        now = time.monotonic()
        if self.here is None or now - self._looked < LOOK_S:
            return
        self._looked = now
        short = self.count - len(self.client.nthreads())
        if short <= 0:
            self._whole, self._spares = now, 0
        elif short == self.count and now - self._whole > LOST_S:
            raise UsageError("All workers ended, and none could be started again.")
        elif now - self._whole > RESTART_S * (self._spares + 1):
            self._spares += 1
            self.here.scale(len(self.here.worker_spec) + short)


@contextmanager
def cluster(address: str | None, workers: int) -> "Iterator[Workers]":
    """So many processes here, or the workers of the scheduler at an address or in a scheduler file.

    Raises UsageError where there is none, or where its workers have another Kochab.
    """
    import dask
    from distributed import Client, LocalCluster

    with dask.config.set(SETTINGS):
        if address is None:
            with _closed_in_peace(ExitStack()) as opened:
                with _out_of_reach():
                    here = opened.enter_context(_started(partial(LocalCluster, workers, threads_per_worker=1, **HERE)))
                    client = opened.enter_context(Client(here))
                yield Workers(client, here, workers)
            return
        where = {"scheduler_file": address} if address.endswith(".json") else {"address": address}
        try:
            client = Client(**where, timeout=PATIENCE_S)
        except (OSError, ValueError, TimeoutError) as error:
            raise UsageError("No Dask scheduler at {address}: {why}.", address=address, why=_plain(error)) from None
        with client:
            _check_versions(client)
            yield Workers(client)


@contextmanager
def _closed_in_peace(opened: ExitStack) -> Iterator[ExitStack]:
    """Close what was opened at the end, however often Ctrl-C is pressed meanwhile."""
    try:
        yield opened
    finally:
        with _out_of_reach():
            opened.close()


@contextmanager
def _out_of_reach() -> Iterator[None]:
    """Keep Ctrl-C until this is done, and from processes that are started here until :func:`dask_setup` is called.

    Dask leaves a trace of a cluster that is half made, and so does a worker that is half started.
    """
    block = getattr(signal, "pthread_sigmask", None)  # Windows has none
    with signals_kept():
        if block:
            resource_tracker.ensure_running()  # it would let Ctrl-C through again when it starts
        before = block(signal.SIG_BLOCK, [signal.SIGINT]) if block else None
        try:
            yield
        finally:
            if block:
                block(signal.SIG_SETMASK, before)


def dask_setup(worker: object) -> None:
    """What Dask calls in a worker that starts here. Ctrl-C is the business of whoever asked for the work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    keep_to_one()
    gc.freeze()  # what Dask has loaded is no rubbish, and was looked through again and again: a tenth of the time


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
    workers: Workers, chunks: Iterator[Chunk], work: Callable[[Chunk], Outcome], lost: Callable[[Chunk], Outcome]
) -> Generator[Outcome, None, None]:
    """What ``work`` makes of every chunk, in the order in which they end; close it to stop.

    Parameters
    ----------
    workers : Workers
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
    yield from _rounds(workers, lambda: again.pop() if again else next(chunks, None), work, again, suspects)
    # One at a time, each with the cluster to itself: who shared a worker with the culprit is cleared.
    for suspect in suspects:
        once, guilty = iter([suspect]), list[Chunk]()
        yield from _rounds(workers, partial(next, once, None), work, [], guilty)
        yield from map(lost, guilty)


def _rounds(
    workers: Workers,
    take: Callable[[], Chunk | None],
    work: Callable[[Chunk], Outcome],
    again: list[Chunk],
    killers: list[Chunk],
) -> Generator[Outcome, None, None]:
    """Outcomes of what ``take`` gives; chunks that ended their workers go to ``again`` in parts, or to ``killers``."""
    from distributed import KilledWorker, as_completed

    waiting: dict[str, Chunk] = {}
    done = as_completed()

    def fill() -> None:
        room = WAITING * max(workers.threads, 1)
        while len(waiting) < room and (chunk := take()) is not None:
            future = workers.client.submit(work, chunk, pure=False)
            waiting[future.key] = chunk
            done.add(future)

    fill()
    while waiting:
        if not done.has_ready():
            with done.thread_condition:  # told of a chunk that is done
                done.thread_condition.wait(POLL_S)
            workers.keep()
            continue
        future = next(done)
        chunk = waiting.pop(future.key)
        try:
            yield _result(future, workers)
        except KilledWorker:
            (again.extend if len(chunk.items) > 1 else killers.extend)(chunk.alone())
        fill()


def _result(future: "Future[Outcome]", workers: Workers) -> Outcome:
    """What a chunk that is done came to.

    The worker that has it may end before it is fetched: then it is done again, and there must be workers for that.
    """
    while True:
        try:
            outcome: Outcome = future.result(timeout=LOOK_S)
            return outcome
        except (TimeoutError, UnboundLocalError):  # the latter: distributed cancels its own wait
            if future.status == "error":
                raise
            workers.keep()
