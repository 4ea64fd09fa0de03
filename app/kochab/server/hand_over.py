"""A command's side of the worker (:mod:`kochab.server.worker`): find it, hand the command over, return its exit code.

Loaded before anything heavy, with the standard library alone, and of that without what takes longer to load than all
that is done here: `socket` and `signal` (their compiled halves do), `collections`, `contextlib`, `struct`, `zlib`. The
socket lies in a folder that only its owner may enter; its name stands for what must be equal on both sides: this
installation, and the variables that change what Kochab reads and how it writes. The command's own streams and folder
are handed over: nothing is copied, a terminal stays a terminal.

Whatever goes wrong before the command has written anything, the command is done here, as without a worker.
"""

import _signal  # type: ignore[import-not-found]  # typeshed has none
import os
import sys

TYPE_CHECKING = False  # as in `kochab.cli.faces`
if TYPE_CHECKING:
    import _socket
    from collections.abc import Sequence

MAGIC = b"kochab-worker-1\n"
WRITTEN, OTHER_VERSION, DONE = b"w", b"v", b"d"
"""What a worker says: something was written; it has another version; done, followed by the exit code as four bytes."""
CONNECT_S = 5.0
"""For the worker to take the request: it forks at once, however busy the commands before are."""
SAME = ("HOME", "LANG", "LANGUAGE", "TZ", "LD_LIBRARY_PATH", "LD_PRELOAD")
SAME_PREFIXES = ("KOCHAB_", "XDG_", "LC_", "PYTHON", "OMP_", "OPENBLAS_", "MKL_")
LARGEST_PRIME = 2**32 - 5
"""Of those below 2**32: the remainder after dividing by it names the socket."""
OWN = ("OPENBLAS_NUM_THREADS",)
"""What a process of ours sets for itself."""


class Place:
    """Socket path of this user's worker, and its version, installation and environment variables, as bytes."""

    __slots__ = ("identity", "path")

    def __init__(self, path: str, identity: bytes) -> None:
        self.path, self.identity = path, identity

    def __eq__(self, other: object) -> bool:
        """Whether both have the same socket and the same identity."""
        return isinstance(other, Place) and (self.path, self.identity) == (other.path, other.identity)

    def __hash__(self) -> int:
        """The same for equal places."""
        return hash((self.path, self.identity))


def place() -> Place:
    """The socket for this installation and these variables."""
    package = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    kept = sorted(
        f"{k}={v}" for k, v in os.environ.items() if k in SAME or (k.startswith(SAME_PREFIXES) and k not in OWN)
    )
    world = os.fsencode("\n".join((package, sys.executable or "", *kept)))
    # What carries a version is not in the name: a newer Kochab finds the older one's worker, and ends it.
    number = int.from_bytes(world, "big") % LARGEST_PRIME
    return Place(os.path.join(folder(), f"{number:08x}.sock"), _version().encode() + b"\n" + world)


def folder() -> str:
    """Where sockets lie: the user's runtime folder, which a restart empties, else the user's state."""
    base = os.environ.get("KOCHAB_CONFIG") or os.environ.get("XDG_RUNTIME_DIR")
    if base:
        return os.path.join(base, "kochab-worker")
    base = os.environ.get("XDG_STATE_HOME") or os.path.join(os.path.expanduser("~"), ".local", "state")
    return os.path.join(base, "kochab", "worker")


def _version() -> str:
    """The version, and when it was put here: an installation renewed under the same number is another one."""
    from kochab import core

    return f"{core.__version__} {os.stat(core.__file__).st_mtime_ns}"


def connected(path: str) -> "_socket.socket | None":
    """The connection to our own worker; None when there is none, or what is there may be another user's."""
    try:
        inside, around = os.lstat(path), os.stat(os.path.dirname(path))
    except (OSError, ValueError):
        return None
    import _socket
    import stat

    private = stat.S_ISSOCK(inside.st_mode) and not around.st_mode & 0o077
    if not private or inside.st_uid != os.geteuid() or around.st_uid != os.geteuid():
        return None
    connection = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)
    connection.settimeout(CONNECT_S)
    try:
        connection.connect(path)
        if peer(connection)[1] == os.geteuid():
            return connection
    except OSError:  # whoever listened there has ended
        pass
    connection.close()
    return None


def peer(connection: "_socket.socket") -> tuple[int, int]:
    """Process and user at the other end, as the system tells them.

    Where it does not (macOS), they are 0 and this process's own user: the folder alone guards.
    """
    import _socket

    if not hasattr(_socket, "SO_PEERCRED"):
        return 0, os.geteuid()
    credentials = connection.getsockopt(_socket.SOL_SOCKET, _socket.SO_PEERCRED, 12)
    return int.from_bytes(credentials[:4], sys.byteorder), int.from_bytes(credentials[4:8], sys.byteorder)


def hand_over(arguments: "Sequence[str]") -> int | None:
    """The exit code of a command that the worker has done; None when it is to be done here."""
    if sys.platform == "win32":  # no fork, and no streams through a socket
        return None
    where = place()
    connection = connected(where.path)
    if connection is None:
        return None
    try:
        try:
            _send_request(connection, where.identity, arguments)
        except OSError:
            return None
        return _awaited(connection)
    finally:
        connection.close()


def _send_request(connection: "_socket.socket", identity: bytes, arguments: "Sequence[str]") -> None:
    """Send the command with its streams, folder, variables and limits; OSError when that cannot be."""
    import _socket
    import resource

    here = os.open(".", os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))
    try:
        umask = os.umask(0o077)
        os.umask(umask)
        limits = [resource.getrlimit(number)[0] for number in limit_numbers()]
        head = [str(umask), str(os.nice(0)), *map(str, limits), str(len(arguments))]
        variables = [f"{name}={value}" for name, value in os.environ.items()]
        body = b"\0".join([identity, *(os.fsencode(text) for text in (*head, *arguments, *variables))])
        # OSError where one of the three is closed, which a child would have to imitate.
        numbers = b"".join(number.to_bytes(4, sys.byteorder) for number in (0, 1, 2, here))
        streams = (_socket.SOL_SOCKET, _socket.SCM_RIGHTS, numbers)
        connection.sendmsg([MAGIC + len(body).to_bytes(4, "big")], [streams])
        connection.sendall(body)
    finally:
        os.close(here)


def limit_numbers() -> list[int]:
    """The limits that a shell may have set (``ulimit``), in the order in which they are sent."""
    import resource

    names = ("RLIMIT_AS", "RLIMIT_CORE", "RLIMIT_CPU", "RLIMIT_DATA", "RLIMIT_FSIZE", "RLIMIT_NOFILE", "RLIMIT_STACK")
    return [getattr(resource, name) for name in names]


def _awaited(connection: "_socket.socket") -> int | None:
    """The exit code; signals that would end the command are passed on meanwhile."""
    relayed = 0

    def relay(number: int, frame: object) -> None:
        nonlocal relayed
        relayed = number
        try:  # noqa: SIM105  # `suppress` is for those who have loaded contextlib
            connection.send(bytes([number]))
        except OSError:  # it is just ending
            pass

    asked = [_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP]
    before = {n: _signal.signal(n, relay) for n in asked if _signal.getsignal(n) != _signal.SIG_IGN}
    connection.settimeout(None)
    written = False
    try:
        while answer := connection.recv(1):
            if answer == WRITTEN:
                written = True
            elif answer == OTHER_VERSION:
                _restart()
                return None
            elif answer == DONE:
                return int.from_bytes(connection.recv(4), "big")
    except OSError:
        pass
    finally:
        for number, handler in before.items():
            _signal.signal(number, handler)
    if relayed:  # the command ended as the signal has it, and so do we
        os.kill(os.getpid(), relayed)
        return 128 + relayed
    if not written:  # killed before it had begun to answer
        return None
    print("kochab: The worker was ended from outside in mid-command.", file=sys.stderr)
    return 2


def worker_command() -> list[str]:
    """The command line that starts a worker of this installation."""
    frozen = getattr(sys, "frozen", False)
    return [sys.executable, *([] if frozen else ["-m", "kochab"]), "serve"]


def _restart() -> None:
    """Start a worker of our own version, for the next command; the old one has ended itself."""
    import subprocess
    from contextlib import suppress

    nothing = subprocess.DEVNULL
    with suppress(OSError):
        subprocess.Popen(worker_command(), stdin=nothing, stdout=nothing, stderr=nothing, start_new_session=True)
