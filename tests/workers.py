"""Processes for pytest-xdist that are forked from one that has imported the tests.

Each process of its own imports numpy, astropy, Qt, the program and 400 modules of tests: 4 to 5 s of processor, twelve
times. Forked after one has done so, each has 1.2 s left, for its own collecting; what none of them writes is shared.

pytest-xdist starts its processes by execnet, which starts a Python and talks to it by its standard input and output.
What it starts here is this file: it hands those to the process that forks, and waits for the end of the fork. Linux only:
elsewhere a fork of a process that has loaded Qt is not safe, or there is none.
"""

import contextlib
import gc
import importlib
import os
import selectors
import signal
import socket
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path


@contextlib.contextmanager
def forking(paths: list[str]) -> Iterator[str]:
    """A process that has imported the tests in ``paths``, and what execnet is to start in place of a Python."""
    with tempfile.TemporaryDirectory(prefix="kochab-workers-") as folder, socket.socket(socket.AF_UNIX) as listener:
        listener.bind(f"{folder}/line")
        listener.listen(64)
        command = [sys.executable, "-m", "tests.workers", "fork", str(listener.fileno()), *paths]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, pass_fds=[listener.fileno()]
        ) as process:
            yield f"{sys.executable} -S -I {Path(__file__)} ask {folder}/line"
            process.communicate()  # it ends as its standard input does


def ask(address: str) -> int:
    """Hand standard input, output and error over, and wait for the fork's end; its exit code."""
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(address)
        socket.send_fds(line, [b"fork"], [0, 1, 2])
        return int.from_bytes(line.recv(1) or b"\1", "big")


def fork(listening: int, paths: list[str]) -> bool:
    """Import the tests, then fork for whoever asks, until standard input ends; true in a fork."""
    import pytest

    pytest.main(["--collect-only", "-p", "no:cacheprovider", *paths])
    if "kochab.window.application" in sys.modules:  # its windows name what a frame shows: 4.8 s for each process
        from kochab.core.progress import run
        from kochab.sky.completion import completion
        from kochab.sky.finder import finder
        from kochab.window.atlas.sky_reading import read_bodies, read_sky

        finder()
        completion()
        run(read_sky())
        run(read_bodies(datetime.now(UTC), None))  # each chart shows those of tonight
        with warnings.catch_warnings(), contextlib.suppress(ImportError):
            warnings.simplefilter("ignore")  # it warns of where its library is
            importlib.import_module("sdl2")  # runs system programs to find its library
    if "astropy.coordinates" in sys.modules:  # the first transformation reads where the pole was each day: 2 s
        from astropy.utils import iers

        iers.earth_orientation_table.get()
    gc.freeze()
    interrupted = signal.signal(signal.SIGINT, signal.SIG_IGN)  # whom Ctrl-C means is pytest
    running: list[tuple[int, int, socket.socket]] = []
    with selectors.DefaultSelector() as ready, socket.socket(fileno=listening) as listener:
        ready.register(listener, selectors.EVENT_READ)
        ready.register(0, selectors.EVENT_READ)
        while True:
            for key, _ in ready.select():
                if key.fd == 0:
                    return False
                if key.fileobj is not listener:
                    if key.data in running:  # both of its ends may be seen at once
                        running.remove(key.data)
                        _end(ready, *key.data)
                    continue
                line, _ = listener.accept()
                _, given, _, _ = socket.recv_fds(line, 8, 3)
                if not (pid := os.fork()):
                    for here, there in zip(given, (0, 1, 2), strict=True):
                        os.dup2(here, there)
                        os.close(here)
                    line.close()
                    signal.signal(signal.SIGINT, interrupted)
                    return True
                for one in given:
                    os.close(one)
                ended = os.pidfd_open(pid)
                running.append((pid, ended, line))
                for either in (line, ended):  # the test process ends, or who asked for it was killed
                    ready.register(either, selectors.EVENT_READ, running[-1])


def _end(ready: selectors.BaseSelector, pid: int, ended: int, line: socket.socket) -> None:
    """Tell who asked for this process how it ended; end it where nobody listens any more."""
    os.kill(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    with contextlib.suppress(OSError):
        line.send(bytes([os.waitstatus_to_exitcode(status) % 256]))
    for either in (line, ended):
        ready.unregister(either)
    os.close(ended)
    line.close()


if __name__ == "__main__":
    if sys.argv[1] == "ask":
        sys.exit(ask(sys.argv[2]))
    if fork(int(sys.argv[2]), sys.argv[3:]):
        sys.stdin = open(0, closefd=False)  # noqa: SIM115
        exec(eval(sys.stdin.readline()), {"__name__": "__main__"})  # as execnet has a Python begin
