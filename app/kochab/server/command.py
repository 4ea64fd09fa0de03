"""``kochab serve``: the worker that makes other commands quick, and faces that other programs reach over HTTP."""

import argparse
import os
import re
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from kochab.core.errors import KochabError, UsageError
from kochab.folders import config_folder, data_folder
from kochab.parsing.text_input import parse_json, read_text
from kochab.server.hand_over import Place, connected, peer, place, worker_command
from kochab.server.http_server import LOOPBACK, Answer, HttpServer
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:
    from kochab.server.worker import Run

IDLE_MIN = 30.0
PORT, API_PORT = 8470, 8471
MOUNT_S = 30.0
"""For a mount to say where it points."""
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
        " It serves nobody but you, and ends when idle. Linux only. With --nova it serves the API of"
        " nova.astrometry.net instead, and a page to drop images on; with --api one of its own; with --ascom it lets"
        " Alpaca programs, Kochab's mount view first, use a mount's ASCOM driver (Windows).",
    )
    parser.add_argument(
        "--nova", action="store_true", help="serve nova.astrometry.net's API and a page, on this computer"
    )
    parser.add_argument(
        "--api", action="store_true", help="serve a JSON API on this computer; /openapi.json there describes it"
    )
    parser.add_argument(
        "--mount", metavar="PORT[,DRIVER]", help="with --api: the mount whose position it tells; it moves none"
    )
    parser.add_argument(
        "--ascom",
        nargs="*",
        metavar="DRIVER",
        help="serve ASCOM telescope drivers on this computer (Windows), as ASCOM.Simulator.Telescope; without a name:"
        " list them",
    )
    parser.add_argument(
        "--lan", action="store_true", help="with --nova or --api: to the local network too, unencrypted"
    )
    parser.add_argument(
        "--port", type=_port, metavar="N", help=f"of --nova (default: {PORT}), --api ({API_PORT}) or --ascom (11111)"
    )
    parser.add_argument(
        "--any-key", action="store_true", help="with --nova: take every key, of programs that have one built in"
    )
    parser.add_argument("--new-key", action="store_true", help="with --nova or --api: make a new key; the old one ends")
    parser.add_argument("--background", action="store_true", help="start it, wait until it is ready, and return")
    parser.add_argument("--stop", action="store_true", help="end the worker that runs; its commands finish")
    parser.add_argument(
        "--idle", type=_minutes, default=IDLE_MIN, metavar="MIN", help="end after so long idle (default: %(default)g)"
    )
    parser.set_defaults(run=run)


def _port(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"{text} is not a port from 1 to 65535")
    return int(text)


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
    if sum((args.nova, args.api, args.ascom is not None)) > 1:
        raise UsageError("Start --nova, --api and --ascom one each.")
    if args.ascom is not None:
        if args.lan:
            raise UsageError("--ascom is for this computer alone, not with --lan.")
        return _serve_ascom(args.ascom, args.port)
    if args.nova or args.api:
        if args.any_key and args.lan:
            raise UsageError("--any-key is for this computer alone, not with --lan.")
        serve = partial(_serve_nova, any_key=args.any_key) if args.nova else partial(_serve_api, mount=args.mount)
        return serve("" if args.lan else LOOPBACK[0], args.port, args.new_key)
    if not sys.platform.startswith("linux"):
        raise UsageError("There is no worker for this system yet: commands do their work themselves.")
    where = place()
    if args.stop:
        return _stop(where)
    if args.background:
        return _start(where, args.idle)
    return _serve(where, args.main, args.idle)


def _serve_nova(host: str, port: int | None, new_key: bool, any_key: bool = False) -> int:
    """Serve until a signal comes.

    Parameters
    ----------
    host : str
        Empty for the address on the local network.
    port : int or None
        None for the usual.
    new_key, any_key : bool
        Whether a new key is made, and whether others are taken too.
    """
    from kochab.server.nova import Nova

    key = _key("nova-key", new_key)
    nova = Nova(key, any_key)
    try:
        with _serving(nova.answer, host, port or PORT) as address:
            print(f"Address for programs, in place of https://nova.astrometry.net: {address}\nAPI key: {key}")
            print(f"Page to drop images on: {address}/{key}/\nCtrl-C ends it.", flush=True)
            _wait()
    finally:
        nova.close()
    return 0


def _serve_api(host: str, port: int | None, new_key: bool, mount: str | None = None) -> int:
    """The same for the JSON API.

    Parameters
    ----------
    host, port, new_key
        As there.
    mount : str or None
        PORT or PORT,DRIVER of the mount whose position it tells.
    """
    from kochab.server.api import Api

    token = _key("api-token", new_key)
    api = Api(token, None if mount is None else partial(_position, *mount.rpartition(",")[::2]))
    with _serving(api.answer, host, port or API_PORT) as address:
        print(f"Address: {address}\nToken, as Authorization: Bearer TOKEN: {token}")
        print(f"Description for clients: {address}/openapi.json\nCtrl-C ends it.", flush=True)
        _wait()
    return 0


def _serve_ascom(names: list[str], port: int | None) -> int:
    """The same for ASCOM drivers; without ``names`` those that are installed are listed, 1 where there are none."""
    if sys.platform != "win32":
        raise UsageError("ASCOM drivers run on Windows. Here a mount is reached directly, over INDI or Alpaca.")
    from kochab.server.ascom import PORT as ASCOM_PORT
    from kochab.server.ascom import AscomBridge, ComDriver, installed

    if not names:
        for name, title in (found := installed()):
            print(f"{name}  {title}")
        if not found:
            print("No ASCOM telescope driver is installed.", file=sys.stderr)
        return 0 if found else 1
    bridge = AscomBridge([ComDriver(name) for name in names])
    try:
        with _serving(bridge.answer, LOOPBACK[0], port or ASCOM_PORT) as address:
            for n, name in enumerate(names):
                print(f"{name}: as mount choose ASCOM Alpaca server, {address.removeprefix('http://')}/{n}")
            print("Ctrl-C ends it.", flush=True)
            _wait()
    finally:
        bridge.close()
    return 0


def _position(port: str, driver: str) -> Json:
    """What ``kochab mount position --json`` prints, in a process of its own: the mount is let go of at once."""
    if not port:  # no comma
        port, driver = driver, ""
    asked = [*worker_command()[:-1], "mount", "position", "--json", "--port", port]
    try:
        done = subprocess.run([*asked, *(["--driver", driver] if driver else [])], capture_output=True, timeout=MOUNT_S)
        found = parse_json(done.stdout.decode("utf-8", "replace") or "{}")
    except subprocess.TimeoutExpired:
        return {"error": "The mount does not answer."}
    except ValueError:
        found = None
    return found if isinstance(found, dict) and found else {"error": "The mount's position could not be read."}


@contextmanager
def _serving(answer: Answer, host: str, port: int) -> "Iterator[str]":
    """The address that is served meanwhile."""
    from kochab.server.phone_page import local_address

    server = HttpServer(answer, host or local_address(), port)
    try:
        yield "http://{}:{}".format(*server.address)
    finally:
        server.stop()


def _wait() -> None:
    """Wait for a signal, again and again: one that another thread receives would not end an endless wait."""
    over = threading.Event()
    while not over.wait(0.5):
        pass


def _key(name: str, new: bool) -> str:
    """The key of this user, the same every time, so that a program is set up once; only its owner may read it."""
    path = config_folder() / name
    if not new and path.is_file():
        key = read_text(path, "replace").strip()
        if re.fullmatch(r"[a-z0-9]{16,64}", key):
            return key
    key = secrets.token_hex(16)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
            file.write(key + "\n")
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror or error}.") from None
    return key


def _serve(where: Place, main: "Run", idle_min: float) -> int:
    from kochab.server.worker import Worker, warm

    if _process(where):
        raise UsageError("A worker runs already.")
    samples = data_folder("resources") / "samples"
    commands = [["solve", "--json", str(samples / name)] for name in SAMPLES]
    warm(main, commands)
    # It listens from here on: nobody waits for one that still loads.
    worker = Worker(where, main, 60.0 * idle_min, [commands[0], commands[-1]])
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
    first_line = started.stdout.readline()  # it speaks when it is ready, or ends
    if not first_line.startswith("The worker is ready"):
        raise KochabError(first_line.removeprefix("kochab: ").strip() or "The worker ended at once.")
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
    with closing(connection):
        return peer(connection)[0]
