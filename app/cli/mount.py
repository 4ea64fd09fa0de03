"""``kochab mount ACTION``: a telescope mount on a serial line or a network address."""

import argparse
import math
from collections.abc import Callable
from importlib import import_module
from typing import Any

from app.cli.output import tell_failure
from app.core.errors import KochabError, UsageError
from app.core.hint import Site
from app.core.mount import Epoch

ACTIONS: dict[str, tuple[str, str]] = {
    "list": ("app.cli.mount_ports", "the serial ports, and what may be on them"),
    "probe": ("app.cli.mount_ports", "find the mount by questions only, or say what to do"),
    "position": ("app.cli.mount_ask", "where the mount says it points, and how it is"),
    "sync": ("app.cli.mount_correct", "tell the mount where it points"),
    "goto": ("app.cli.mount_correct", "slew to coordinates or to a name"),
    "stop": ("app.cli.mount_ask", "stop every motion, now"),
    "centre": ("app.cli.mount_centre", "go there, solve, correct, until it is in the middle"),
    "recover": ("app.cli.mount_recover", "tell a lost mount where it is, with nobody there"),
    "disagree": ("app.cli.mount_disagree", "name the cause when mount and sky disagree"),
}
"""Action -> the module with its ``add_parser(actions, name, help)`` and ``run(args) -> int``."""


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add the ``mount`` command and its actions."""
    parser = subparsers.add_parser(
        "mount",
        help="a telescope mount over its serial line",
        description="Every motion passes the guard. Exit code: 0 done, 1 it could not be, 2 usage.",
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, (module, text) in ACTIONS.items():
        import_module(module).add_parser(actions, name, text)


def add_line_options(parser: argparse.ArgumentParser, run: Callable[[Any], int]) -> None:
    """Add what every action that talks to a mount needs; ``run`` is wrapped by :func:`told`."""
    parser.add_argument("--port", metavar="P", help="/dev/ttyUSB0, COM3 or socket://HOST:PORT")
    parser.add_argument(
        "--driver", metavar="NAME", help="the mount's language; found when left out"
    )
    parser.add_argument("--baud", type=_baud, metavar="N", help="when it is not the usual one")
    parser.add_argument("--epoch", choices=["J2000", "date"], help="of the mount's own coordinates")
    parser.add_argument(
        "--site", type=site, metavar="LAT,LON[,H]", help="degrees, east positive, metres"
    )
    parser.add_argument(
        "--fork", action="store_true", help="a fork or wedge: crosses the meridian without a flip"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    parser.set_defaults(run=told(run))


def told(run: Callable[[Any], int]) -> Callable[[Any], int]:
    """``run`` whose failure is ``{"error": ...}`` or a sentence on stderr, and exit 1."""

    def telling(args: Any) -> int:
        try:
            return run(args)
        except UsageError:
            raise
        except KochabError as error:
            tell_failure(error, args.json)
            return 1

    return telling


def epoch_of(args: argparse.Namespace) -> Epoch | None:
    """The epoch asked for; None is the driver's own."""
    return {None: None, "J2000": Epoch.J2000, "date": Epoch.DATE}[args.epoch]


def site(text: str) -> Site:
    """``LAT,LON[,H]`` in degrees and metres."""
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(math.isfinite(n) for n in numbers):
        raise argparse.ArgumentTypeError(f"{text} is not LAT,LON[,HEIGHT] in degrees and metres")
    if abs(numbers[0]) > 90.0 or abs(numbers[1]) > 360.0:
        raise argparse.ArgumentTypeError(f"{text} is no place on the Earth")
    longitude = (numbers[1] + 180.0) % 360.0 - 180.0
    return Site(numbers[0], longitude, numbers[2] if len(numbers) == 3 else 0.0)


def _baud(text: str) -> int:
    if not text.isdigit() or not 300 <= int(text) <= 4000000:
        raise argparse.ArgumentTypeError(f"{text} is not a baud rate")
    return int(text)
