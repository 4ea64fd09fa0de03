"""Opening the mount that the arguments mean, behind its guard."""

import argparse
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from app.cli.mount import epoch_of
from app.cli.output import ProgressLine
from app.core.errors import NoAnswerError, PortError, UsageError
from app.core.progress import run as drive

if TYPE_CHECKING:
    from app.mounts.guard import Guard
    from app.mounts.limits import Limits


def guarded_mount(
    args: argparse.Namespace, limits: "Limits | None" = None, stop_first: bool = False
) -> "Guard":
    """The mount of ``--port`` and ``--driver``, either of which may be left to be found."""
    from app.mounts import DRIVERS, open_mount
    from app.mounts.guard import Guard
    from app.mounts.limits import Limits

    if args.driver is not None and args.driver not in DRIVERS:
        raise UsageError(f"There is no mount driver {args.driver!r}: use {', '.join(DRIVERS)}.")
    args.port = args.port or _only_port()
    if args.driver is None:
        args.driver, args.baud = _found(args.port, args.baud)
    opened = partial(open_mount, args.driver, args.port, args.baud, epoch_of(args), args.site)
    limits = replace(limits or Limits(), crosses_meridian=args.fork)
    again = partial(opened, stop_first=True)
    return Guard((again if stop_first else opened)(), args.site, limits, reopen=again)


def _only_port() -> str:
    from app.mounts.ports import list_ports

    ports = [port.port for port in list_ports()]
    if len(ports) == 1:
        return ports[0]
    if not ports:
        raise PortError("There is no serial port: plug in the mount's cable, or give --port.")
    raise UsageError(f"There are {len(ports)} ports, give one with --port: {', '.join(ports)}.")


def _found(port: str, baud: int | None) -> tuple[str, int | None]:
    from app.mounts.probe import probe_port

    line = ProgressLine("probing")
    diagnosis = drive(probe_port(port), line)
    line.clear()
    if not diagnosis.found:
        raise NoAnswerError(diagnosis.advice)
    return diagnosis.driver, baud or diagnosis.baud or None
