"""The worker: a process that has everything loaded, and becomes the command that is handed over to it.

For every command it forks. The child takes over the command's streams, folder, variables, umask and limits and runs it
as the command line does; the parent never solves a frame itself. So one command cannot spoil the next, a killed one
costs nobody else anything, and answers are the same bytes as without a worker. A thread of the child listens to the
command's own process: its signals are raised here too, and its end cancels the work.

A fork shares memory until one side writes to it, which Python does wherever it counts references: a child's first frame
takes a third longer than its second. So one child is forked ahead while nobody waits, does frames that nobody reads,
asks for the memory that a larger frame needs, and stands by for the next command.

Only its owner is served: the folder of the socket is closed to others (0700, the socket 0600), and the system is asked
who connects. It ends when idle, and when a command of another version comes.
"""

import gc
import io
import math
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from typing import Any, NoReturn

from kochab.core.errors import UsageError
from kochab.core.values import mutable
from kochab.server.hand_over import DONE, MAGIC, OTHER_VERSION, WRITTEN, Place, connected, limit_numbers, peer

Run = Callable[[Sequence[str]], int]
"""A command line that returns its exit code."""
MOST_BYTES, MOST_CHILDREN, REQUEST_S = 8_000_000, 64, 5.0
OLD_S = 5.0
"""How long a child whose command has gone may take to cancel its work."""
AHEAD_S = 0.3
"""How long nobody must have come before a child is forked ahead: a loop of commands has the processor for itself."""
ANOTHER_ASKED = 75
"""A child's exit code when another version was asked for: the parent then ends."""
ROOM_BYTES, PART_BYTES = 16 << 20, 1 << 20
"""Memory that the arrays of a frame of 1.5 MP need, and the parts that it is written to in."""
PASSED = {signal.SIGINT, signal.SIGTERM, *({signal.SIGHUP} if hasattr(signal, "SIGHUP") else ())}


@mutable
class _Standby:
    """A child that was forked ahead: its number, the line to it, and whether it has done its frames."""

    child: int
    line: socket.socket
    ready: bool = False


class Worker:
    """Listens at ``place`` until nobody has come for ``idle_s`` seconds; ``run`` does a command.

    Raises UsageError when another worker listens there already, or nothing can.

    Parameters
    ----------
    place : Place
        Where it listens.
    run : Run
        The command line.
    idle_s : float
        After how long it ends.
    ahead : Sequence[Sequence[str]]
        The commands that a child does which is forked ahead; none is without any.
    """

    def __init__(self, place: Place, run: Run, idle_s: float, ahead: Sequence[Sequence[str]] = ()) -> None:
        self._place, self._run, self._idle_s, self._ahead = place, run, idle_s, ahead
        self._standby: _Standby | None = None
        self._ahead_from = math.inf if not ahead else 0.0
        self._listener = _listener(place.path)
        self._inode = os.stat(place.path).st_ino
        self._children: set[int] = set()
        self._ended = False

    def serve(self) -> None:
        """Serve until idle, until another version is asked for, or until a signal, which raises KeyboardInterrupt."""
        limit_numbers()  # loads what every child would
        gc.collect()
        gc.freeze()  # what is loaded stays shared: a collection in a child would copy it
        wake, waker = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.signal(signal.SIGCHLD, lambda number, frame: None)
        # A flag, no exception: one that is raised while Python forks is lost (its hooks' are only reported).
        before = {number: signal.signal(number, self._end) for number in PASSED}
        signal.set_wakeup_fd(waker, warn_on_full_buffer=False)
        last = time.monotonic()
        try:
            while self._children or time.monotonic() - last < self._idle_s:
                if self._ended:
                    raise KeyboardInterrupt
                left = max(self._idle_s - (time.monotonic() - last), 0.05)
                if self._standby is None and not self._children:
                    left = min(left, max(self._ahead_from - time.monotonic(), 0.0))
                lines = [] if self._standby is None or self._standby.ready else [self._standby.line]
                watched: list[socket.socket | int] = [self._listener, wake, *lines]
                ready = select.select(watched, [], [], left)[0]
                if wake in ready:
                    with suppress(BlockingIOError):
                        os.read(wake, 512)
                    if self._reaped():
                        return
                    last = time.monotonic()
                if lines and lines[0] in ready and self._standby is not None:
                    self._standby.ready = True  # or it has ended, which is seen when it is asked
                if self._listener in ready:
                    last = time.monotonic()
                    self._take()
                elif self._standby is None and not self._children and time.monotonic() >= self._ahead_from:
                    self._fork_ahead()
        finally:
            signal.set_wakeup_fd(-1)
            os.close(wake)
            os.close(waker)
            for number, handler in before.items():
                signal.signal(number, handler)
            self.close()

    def _end(self, number: int, frame: object) -> None:
        self._ended = True

    def close(self) -> None:
        """Listen no more; commands that run go on by themselves."""
        self._listener.close()
        self._drop_standby()
        inode, self._inode = self._inode, 0
        with suppress(OSError):
            # A worker that came after us may have put its own there.
            if os.stat(self._place.path).st_ino == inode:
                os.unlink(self._place.path)

    def _reaped(self) -> bool:
        """Let children that have ended go; whether one of them was asked for another version."""
        other = False
        if self._standby is not None and os.waitpid(self._standby.child, os.WNOHANG)[0]:
            self._drop_standby()
            self._ahead_from = time.monotonic() + 100 * AHEAD_S  # whatever ended it may end the next
        for child in list(self._children):
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                self._children.discard(child)
                other |= os.waitstatus_to_exitcode(status) == ANOTHER_ASKED
        return other

    def _take(self) -> None:
        """Fork for a connection of our own user; the others, and one too many, are closed unread."""
        try:
            connection = self._listener.accept()[0]
        except OSError:
            return
        with connection:
            if peer(connection)[1] != os.geteuid() or len(self._children) >= MOST_CHILDREN:
                return
            self._ahead_from = max(self._ahead_from, time.monotonic() + AHEAD_S)
            if self._handed(connection):
                return
            try:
                child = os.fork()
            except OSError:  # too many processes: whoever asked does it alone
                return
            if child == 0:
                self._become(connection)
            self._children.add(child)

    def _handed(self, connection: socket.socket) -> bool:
        """Whether the child that was forked ahead has taken the command."""
        standby = self._standby
        if standby is None or not standby.ready:
            return False
        try:
            socket.send_fds(standby.line, [b"c"], [connection.fileno()])
        except OSError:  # it has ended
            return False
        self._standby = None
        standby.line.close()
        self._children.add(standby.child)
        return True

    def _fork_ahead(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            try:
                child = os.fork()
            except OSError:
                ours.close()
                self._ahead_from = time.monotonic() + 100 * AHEAD_S
                return
            if child == 0:
                ours.close()
                self._stand_by(theirs)
        self._standby = _Standby(child, ours)

    def _drop_standby(self) -> None:
        """Close the line to it, which ends it."""
        if self._standby is not None:
            self._standby.line.close()
            self._standby = None

    def _stand_by(self, line: socket.socket) -> NoReturn:
        """In the child: do frames, wait for the command, do it, and end this process."""
        code = 1
        try:
            self._part()
            warm(self._run, self._ahead)
            make_room()
            line.send(b"r")
            descriptors = socket.recv_fds(line, 1, 1)[1]
            line.close()
            code = self._answered(socket.socket(fileno=descriptors[0])) if descriptors else 0
        except BaseException:  # nothing of the parent's may run on in a child
            code = 1
        finally:
            os._exit(code)

    def _part(self) -> None:
        """In a child: leave what is the parent's."""
        # Ctrl-C at the worker's own terminal is not for the commands of others.
        os.setpgid(0, 0)
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        self._listener.close()

    def _become(self, connection: socket.socket) -> NoReturn:
        """In the child: do the command that ``connection`` brings, and end this process."""
        code = 1
        try:
            self._part()
            code = self._answered(connection)
        except BaseException:  # nothing of the parent's may run on in a child
            code = 1
        finally:
            os._exit(code)

    def _answered(self, connection: socket.socket) -> int:
        request = _received(connection, self._place.identity)
        if request is None:
            return 0
        if isinstance(request, bytes):
            connection.send(request)
            return ANOTHER_ASKED
        _take_over(connection, request)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for number in PASSED - {signal.SIGINT}:
            signal.signal(number, signal.SIG_DFL)
        gc.disable()  # as the command's own process does
        over = threading.Event()
        threading.Thread(target=_follow, args=(connection, over), daemon=True).start()
        try:
            code = self._run(request.arguments)
        except KeyboardInterrupt:
            code = 130
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 2
        over.set()
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        with suppress(OSError):
            connection.send(DONE + (code & 0xFFFFFFFF).to_bytes(4, "big"))
        return 0


class _Request:
    """A command with all that makes its process what it is."""

    def __init__(self, fields: list[bytes], descriptors: list[int]) -> None:
        """ValueError for what no command of ours sends."""
        limits = len(limit_numbers())
        numbers = [int(field) for field in fields[: limits + 3]]
        self.umask, self.nice, self.limits, count = numbers[0], numbers[1], numbers[2:-1], numbers[-1]
        rest = [os.fsdecode(field) for field in fields[limits + 3 :]]
        if count < 1 or count > len(rest) or not 0 <= self.umask <= 0o777:
            raise ValueError(count)
        self.arguments = rest[:count]
        self.variables = dict(pair.split("=", 1) for pair in rest[count:])
        self.descriptors = descriptors


def _listener(path: str) -> socket.socket:
    """A socket that its owner alone may use, in a folder that nobody else may enter."""
    folder = os.path.dirname(path)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    before = os.umask(0o177)
    try:
        os.umask(0o077)
        os.makedirs(folder, mode=0o700, exist_ok=True)
        around = os.lstat(folder)
        if around.st_uid != os.geteuid():
            raise UsageError(f"{folder} belongs to another user.")
        os.chmod(folder, 0o700)
        if (other := connected(path)) is not None:
            other.close()
            raise UsageError("A worker runs already.")
        with suppress(FileNotFoundError):  # of one that was killed
            os.unlink(path)
        os.umask(0o177)
        listener.bind(path)
        listener.listen(MOST_CHILDREN)
    except OSError as error:
        listener.close()
        raise UsageError(f"A worker cannot listen at {path}: {error.strerror or error}.") from None
    except UsageError:
        listener.close()
        raise
    finally:
        os.umask(before)
    return listener


def _received(connection: socket.socket, identity: bytes) -> "_Request | bytes | None":
    """The request; what to say to one for another version; None for what is none."""
    connection.settimeout(REQUEST_S)
    try:
        head, descriptors, _, _ = socket.recv_fds(connection, len(MAGIC) + 4, 4)
        size = int.from_bytes(head[len(MAGIC) :], "big")
        if not head.startswith(MAGIC) or len(head) < len(MAGIC) + 4 or len(descriptors) != 4 or size > MOST_BYTES:
            return None
        body = b""
        while len(body) < size:
            part = connection.recv(size - len(body))
            if not part:
                return None
            body += part
        asked, *fields = body.split(b"\0")
        if asked != identity:
            # The same world and another version, or a name that two worlds share: the latter costs nobody a worker.
            return OTHER_VERSION if asked.partition(b"\n")[2] == identity.partition(b"\n")[2] else None
        return _Request(fields, descriptors)
    except (OSError, ValueError):
        return None
    finally:
        connection.settimeout(None)


class _Told(io.FileIO):
    """A stream's file that says once when the first byte is written."""

    def __init__(self, descriptor: int, connection: socket.socket) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._connection: socket.socket | None = connection

    def write(self, data: Any) -> int:
        """Write, and say so before the first time."""
        if self._connection is not None:
            with suppress(OSError):
                self._connection.send(WRITTEN)
            self._connection = None
        return super().write(data)


def _take_over(connection: socket.socket, request: _Request) -> None:
    """Make this process what the command's own would be."""
    import resource

    for number, descriptor in enumerate(request.descriptors[:3]):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.fchdir(request.descriptors[3])
    os.close(request.descriptors[3])
    os.umask(request.umask)
    os.environ.clear()
    os.environ.update(request.variables)
    with suppress(OSError):
        os.nice(max(request.nice - os.nice(0), 0))
    for number, soft in zip(limit_numbers(), request.limits, strict=True):
        with suppress(OSError, ValueError):
            resource.setrlimit(number, (soft, resource.getrlimit(number)[1]))
    time.tzset()
    sys.stdin = open(0, encoding=sys.stdin.encoding, errors=sys.stdin.errors, closefd=False)  # noqa: SIM115
    for name, number in (("stdout", 1), ("stderr", 2)):
        old: io.TextIOWrapper = getattr(sys, f"__{name}__")
        buffer = io.BufferedWriter(_Told(number, connection))
        # As the interpreter makes them: lines on a terminal, and what is said of errors at once.
        lines = name == "stderr" or os.isatty(number)
        new = io.TextIOWrapper(buffer, old.encoding, old.errors, line_buffering=lines, write_through=old.write_through)
        setattr(sys, name, new)
        setattr(sys, f"__{name}__", new)


def _follow(connection: socket.socket, over: threading.Event) -> None:
    """Raise here the signals that the command's process gets; its end cancels the work, within `OLD_S`."""
    while True:
        try:
            signals = connection.recv(1)
        except OSError:
            signals = b""
        if not signals:
            break
        if signals[0] in PASSED:
            os.kill(os.getpid(), signals[0])
    if not over.is_set():
        os.kill(os.getpid(), signal.SIGTERM)
        if not over.wait(OLD_S):
            os.killpg(0, signal.SIGKILL)  # and what it has started


def warm(run: Run, samples: Sequence[Sequence[str]]) -> None:
    """Do commands whose answers nobody reads, so that everything they need is loaded."""
    for arguments in samples:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            run(arguments)


def make_room() -> None:
    """Allocate memory, write to it and free it, so that the next frame finds it in this process.

    The first write to a page costs up to 8 us on a virtual machine, and a frame of 1.5 MP writes to a thousand pages.
    glibc keeps freed memory once a block as large as all of it has been freed.
    """
    bytearray(ROOM_BYTES)
    parts = [bytearray(PART_BYTES) for _ in range(ROOM_BYTES // PART_BYTES - 1)]
    del parts
