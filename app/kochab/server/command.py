"""``kochab serve``: start, look for and stop the worker that makes other commands quick."""

import argparse
import os
import signal
import socket
import struct
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

from kochab.core.errors import KochabError, UsageError
from kochab.folders import data_folder
from kochab.server.hand_over import Place, connected, place, worker_command

if TYPE_CHECKING:
    from kochab.server.worker import Run

IDLE_MIN = 30.0
END_S = 10.0
"""How long ``--stop`` waits for the worker to end."""
SAMPLES = ("big-dipper.jpg", "milky-way.jpg", "orion.png", "pleiades.fits")
"""One of each format and width, so that what each of them needs is loaded."""


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``serve`` to the command line."""
    parser = subparsers.add_parser(
        "serve",
        description="A worker keeps what solving needs loaded. While one runs, solve, identify, detect, find, chart and"
        " kochab -f hand their work to it and answer as without it, sooner; --no-worker keeps a command from it."
        " It serves nobody but you, and ends when idle. Linux only.",
    )
    parser.add_argument("--background", action="store_true", help="start it, wait until it is ready, and return")
    parser.add_argument("--stop", action="store_true", help="end the worker that runs; its commands finish")
    parser.add_argument(
        "--idle", type=_minutes, default=IDLE_MIN, metavar="MIN", help="end after so long idle (default: %(default)g)"
    )
    parser.set_defaults(run=run)


def _minutes(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 60 * 24 * 366:
        raise argparse.ArgumentTypeError(f"{text} is not a number of minutes")
    return value


def run(args: argparse.Namespace) -> int:
    """Start, or with ``--stop`` end the worker; 1 when there is none to end."""
    if not sys.platform.startswith("linux"):
        raise UsageError("There is no worker for this system yet: commands do their work themselves.")
    where = place()
    if args.stop:
        return _stop(where)
    if args.background:
        return _start(where, args.idle)
    return _serve(where, args.main, args.idle)


def _serve(where: Place, main: "Run", idle_min: float) -> int:
    from kochab.server.worker import Worker, warm

    if _process(where):
        raise UsageError("A worker runs already.")
    samples = data_folder("resources") / "samples"
    warm(main, [["solve", "--json", str(samples / name)] for name in SAMPLES])
    worker = Worker(where, main, 60.0 * idle_min)  # listens from here on: nobody waits for one that still loads
    try:
        print("The worker is ready. Ctrl-C ends it.", flush=True)
        worker.serve()
    finally:
        worker.close()
    return 0


def _start(where: Place, idle_min: float) -> int:
    """Start a worker apart from this terminal, and wait until it answers."""
    if _process(where):
        print("A worker runs already.")
        return 0
    started = subprocess.Popen(
        [*worker_command(), "--idle", f"{idle_min:g}"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
        text=True,
    )
    assert started.stdout is not None
    said = started.stdout.readline()  # it speaks when it is ready, or ends
    if not said.startswith("The worker is ready"):
        raise KochabError(said.removeprefix("kochab: ").strip() or "The worker ended at once.")
    print(f"The worker is ready (process {started.pid}).")
    return 0


def _stop(where: Place) -> int:
    process = _process(where)
    if not process:
        print("No worker runs.")
        return 1
    os.kill(process, signal.SIGTERM)
    until = time.monotonic() + END_S
    while os.path.exists(where.path):
        if time.monotonic() > until:
            raise KochabError(f"The worker (process {process}) has not ended yet.")
        time.sleep(0.02)
    print("The worker has ended.")
    return 0


def _process(where: Place) -> int:
    """The number of the process that listens there, 0 for none."""
    connection = connected(where.path)
    if connection is None:
        return 0
    with connection:
        told = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
        return int(struct.unpack("3i", told)[0])
