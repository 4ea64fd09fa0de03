"""A process of its own for decoders that cannot be trusted: it is killed at a cancel or at a deadline.

    reader -> leave_to_sandbox() raises Outside -> in_sandbox(function, ...) -> a warm process -> the result

What is read by hand, or by a library that is bounded by the size of the image, never comes here. A
process takes 0.2 to 0.3 s to start, is kept for the next file, and ends with its parent. It gives up all
that it does not need (`confinement`), and what it answers is not believed (`answer`): we send it
pickles, it sends none.
"""

import contextlib
import logging
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any

from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.core.progress import Progress, Task
from kochab.frames.answer import encoded, received, send
from kochab.frames.confinement import confine
from kochab.frames.samples import free_bytes

Answer = tuple[Frame | Exception, str]
"""What a function returned or raised, and where it did."""
_logger = logging.getLogger(__name__)

MOST_BYTES = 4_000_000_000
"""What reading one file may take: twice the largest decoded image, and the frame made of it."""
LEAST_BYTES = 1_000_000_000  # of address space, of which a library's threads reserve much and use little
_POLL_S = 0.05
WATCHED = sys.platform not in ("linux", "win32")
"""Where nothing bounds a process's memory (macOS), the one that waits for it asks how much it has every `_WATCH_S`."""
_WATCH_S = 0.25
_PIPE_BYTES = 1 << 20
_START = "import sys; from pickle import load; sys.path[:] = load(sys.stdin.buffer); " + (
    "from kochab.frames.sandbox import serve; serve()"
)
_READER = "read-in-a-process-of-its-own"


class Outside(Exception):  # noqa: N818 (a signal inside this room, not an error)
    """What is wanted must be done in the sandbox, and here is none."""


# -- Within the sandbox ------------------------------------------------------------------------

_inside = False
_own_program = False
_limit_bytes: int | None = None
_job: int | None = None


def leave_to_sandbox() -> None:
    """Raise `Outside` unless this process is a sandbox, before a library is asked that may hang."""
    # A frozen program is no interpreter: only Kochab's own can be started once more.
    if not _inside and (_own_program or not getattr(sys, "frozen", False)):
        raise Outside


def support_frozen(arguments: list[str]) -> None:
    """In a frozen program, before all else: be the sandbox if started as one, else let it be started so."""
    global _own_program
    if arguments == [_READER]:
        serve()
    _own_program = True


@contextlib.contextmanager
def decoding(kind: str) -> Iterator[None]:
    """Make one sentence of whatever a library raises for a damaged file of this kind."""
    try:
        yield
    except (FrameError, MemoryError, Outside):
        raise
    except Exception as error:  # tags, codecs and bindings fail in a hundred ways
        cut = "truncated" in str(error).lower() or isinstance(error, EOFError)
        raise FrameError("is cut short." if cut else "is a damaged or cut short {kind} file.", kind=kind) from None


def memory_text() -> str:
    """The memory that reading may take here, as ``4.0 GB``."""
    room = _limit_bytes or free_bytes()
    return f"{room / 1e9:.1f} GB" if room else "memory"


def serve() -> None:
    """Answer calls from standard input until it ends."""
    global _inside
    _inside = True
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches us too; the parent decides
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # libraries print
    confine()  # while there is one thread
    calls: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(calls,), daemon=True).start()
    while True:
        send(answers, _answer(calls.get()))


def _listen(calls: "SimpleQueue[bytes]") -> None:
    """Put calls where the main thread finds them; end the process with its parent, even in mid-call."""
    source = sys.stdin.buffer if sys.stdin else open(0, "rb")  # a windowed program has no sys.stdin  # noqa: SIM115
    while True:
        try:
            sys.path[:] = pickle.load(source)
            with contextlib.suppress(OSError):
                os.chdir(pickle.load(source))
            calls.put(pickle.load(source))
        except EOFError:
            os._exit(0)


def _answer(call: bytes) -> list[memoryview]:
    try:
        function, arguments, memory_bytes, timeout_s = pickle.loads(call)
        _bound(memory_bytes, timeout_s)
        return encoded(function(*arguments))
    except Exception as error:
        return encoded(error, traceback.format_exc())


def _bound(memory_bytes: int | None, timeout_s: float | None) -> None:
    """Bound what may still be taken, in bytes, and time for when nobody is left to kill us; None: we are watched."""
    global _limit_bytes
    if memory_bytes is not None:
        with contextlib.suppress(OSError, ValueError, AttributeError):
            (_bound_windows if sys.platform == "win32" else _bound_linux)(memory_bytes)
            _limit_bytes = memory_bytes
    if sys.platform != "win32":
        import resource

        with contextlib.suppress(OSError, ValueError):
            most = resource.getrlimit(resource.RLIMIT_CPU)[1]
            # Several threads may decode at once.
            seconds = most if timeout_s is None else int(time.process_time() + 4.0 * timeout_s) + 60
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, most))


def _bound_linux(memory_bytes: int) -> None:
    """The address space, by `getrlimit(2)` and `proc(5)`."""
    import resource

    with open("/proc/self/statm", encoding="ascii") as file:
        taken = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + memory_bytes, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _bound_windows(memory_bytes: int) -> None:
    """Committed memory and processes, by a job object with this one in it; Microsoft's documents name its parts."""
    import ctypes

    global _job
    kernel = ctypes.windll.kernel32  # type: ignore[attr-defined,unused-ignore]
    own = ctypes.c_void_p(kernel.GetCurrentProcess())
    counters = (ctypes.c_uint64 * 9)(72)  # PROCESS_MEMORY_COUNTERS; its PagefileUsage is what is committed
    kernel.K32GetProcessMemoryInfo(own, counters, 72)
    limits = (ctypes.c_uint64 * 18)()  # JOBOBJECT_EXTENDED_LIMIT_INFORMATION
    # JOB_OBJECT_LIMIT_PROCESS_MEMORY and _ACTIVE_PROCESS: it starts no program
    limits[2], limits[5], limits[14] = 0x108, 1, counters[7] + memory_bytes
    kernel.CreateJobObjectW.restype = ctypes.c_void_p
    job = ctypes.c_void_p(_job or kernel.CreateJobObjectW(None, None))
    if not kernel.SetInformationJobObject(job, 9, limits, 144):
        raise OSError("no limit")
    if _job is None and kernel.AssignProcessToJobObject(job, own):
        _job = job.value


# -- Outside of it -----------------------------------------------------------------------------


def in_sandbox(name: str, timeout_s: float | None, function: Callable[..., Frame], *arguments: Any) -> Task[Frame]:
    """The frame that ``function`` returns, called in another process; that is killed when this task is closed.

    Parameters
    ----------
    name
        Of the file, for sentences.
    timeout_s
        After so many seconds the process is killed; None for no limit.
    function, arguments
        Picklable; the function is found by its module and name.

    Raises `FrameError` when the reader does, the deadline has passed, or the process ended: it crashed, or the system
    ended it, or what it answered is no answer. MemoryError as the reader does, DecoderFaultError for all else.
    """
    deadline = None if timeout_s is None else time.monotonic() + timeout_s
    try:
        sandbox = _kept() or _Sandbox()
    except OSError as error:
        raise FrameError(
            "{name} cannot be read: no process starts to read it ({strerror}).", name=name, strerror=error.strerror
        ) from None
    try:
        memory_bytes = max(LEAST_BYTES, min(MOST_BYTES, free_bytes() or MOST_BYTES))
        answer = sandbox.call((function, arguments, None if WATCHED else memory_bytes, timeout_s), memory_bytes)
        seen = time.monotonic()
        while not answer.done():
            if WATCHED and time.monotonic() > seen + _WATCH_S:
                if sandbox.resident_bytes() > memory_bytes:
                    room = f"{memory_bytes / 1e9:.1f} GB"
                    raise FrameError(
                        "{name} does not fit into the {room} there is for reading it.", name=name, room=room
                    )
                seen = time.monotonic()
            if deadline is not None and time.monotonic() > deadline:
                raise FrameError(
                    "{name} was not read within {timeout:g} s. Is it damaged? Else allow more time.",
                    name=name,
                    timeout=timeout_s,
                )
            yield Progress("read", None, name)
            with contextlib.suppress(TimeoutError):
                answer.exception(_POLL_S)
        if answer.exception() is not None:
            raise FrameError("{name} cannot be read: its decoder crashed, or the memory ran out.", name=name)
    except BaseException:  # also when this task is closed
        sandbox.kill()
        raise
    # It answered, if only by a sentence: the process is sound and serves the next file.
    _idle.append(sandbox)
    found, trace = answer.result()
    if isinstance(found, Exception):
        _logger.debug("In the process that reads %s: %s", name, trace)
        raise found
    return found


class _Sandbox:
    """One process, and the thread that waits for its answer."""

    def __init__(self) -> None:
        import subprocess  # some milliseconds of each start, for files that come here alone

        no_window = 0x08000000 if os.name == "nt" else 0  # else a console flashes up
        # -P: a file pickle.py beside the frames is not Python's. One thread: each reserves memory.
        self._process = subprocess.Popen(
            [sys.executable, _READER] if _own_program else [sys.executable, "-P", "-W", "ignore", "-c", _START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            creationflags=no_window,
            pipesize=_PIPE_BYTES,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"},
        )
        self._thread: threading.Thread | None = None
        self._started = _own_program  # which knows where its modules are

    def call(self, call: tuple[Any, ...], most_bytes: int) -> "Future[Answer]":
        """Send ``call``; the answer comes, or an exception when the process has ended or answers something else."""
        answer: Future[Answer] = Future()
        self._thread = threading.Thread(target=self._exchange, args=(call, most_bytes, answer), daemon=True)
        self._thread.start()
        return answer

    def _exchange(self, call: tuple[Any, ...], most_bytes: int, answer: "Future[Answer]") -> None:
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        try:
            if not self._started:
                pickle.dump(sys.path, stdin)
                self._started = True
            pickle.dump(sys.path, stdin)  # by now it may hold more, and we may be in another folder
            pickle.dump(_folder(), stdin)
            pickle.dump(pickle.dumps(call), stdin)
            stdin.flush()
            answer.set_result(received(stdout, most_bytes))
        except Exception as error:  # else nobody would learn that no answer comes
            answer.set_exception(error)

    @property
    def alive(self) -> bool:
        """Whether the process has not ended."""
        return self._process.poll() is None

    def resident_bytes(self) -> int:
        """What of it is in memory, 0 when the system does not say."""
        import subprocess

        try:
            command = ["ps", "-o", "rss=", "-p", str(self._process.pid)]
            done = subprocess.run(command, capture_output=True, timeout=5.0, check=False)
            return int(done.stdout or 0) * 1024
        except (OSError, ValueError, subprocess.SubprocessError):
            return 0

    def kill(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        for _ in range(100):  # one that waits for a dead network drive ends when that answers; 1 s at most
            if not self.alive:
                break
            time.sleep(0.01)
        if self._thread is not None:
            self._thread.join(1.0)
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if pipe is not None:
                    pipe.close()


_idle: list[_Sandbox] = []
if hasattr(os, "register_at_fork"):  # two processes cannot share one's pipes
    os.register_at_fork(after_in_child=_idle.clear)


def _kept() -> _Sandbox | None:
    """A process that waits for work."""
    with contextlib.suppress(IndexError):  # of several threads each takes its own
        while True:
            sandbox = _idle.pop()
            if sandbox.alive:
                return sandbox
            sandbox.kill()
    return None


def _folder() -> str:
    """The current folder, from which a file's name may be told; the one to stay in when it is gone."""
    try:
        return os.getcwd()
    except OSError:
        return os.curdir
