"""``kochab mount list`` and ``kochab mount probe``."""

import argparse
from dataclasses import asdict
from typing import Any

from app.cli.output import ProgressLine, to_line
from app.core.progress import run as drive


def add_parser(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``list`` or ``probe``."""
    from app.cli.mount import told

    parser = actions.add_parser(name, help=text)
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    if name == "probe":
        parser.add_argument(
            "--port", action="append", metavar="P", help="only this one; may be repeated"
        )
    parser.set_defaults(run=told(_list if name == "list" else _probe))


def _list(args: argparse.Namespace) -> int:
    from app.mounts import DRIVERS, driver_class
    from app.mounts.ports import list_ports

    ports = list_ports()
    drivers = {name: driver_class(name).title for name in DRIVERS}
    if args.json:
        print(to_line({"ports": [asdict(port) for port in ports], "drivers": drivers}))
        return 0
    if not ports:
        print("No serial ports: plug in the USB cable of the mount and switch it on.")
    for port in ports:
        print("  ".join(x for x in (port.port, port.description, port.usb, port.hint) if x))
    print("drivers: " + "; ".join(f"{name} ({title})" for name, title in drivers.items()))
    return 0


def _probe(args: argparse.Namespace) -> int:
    from app.mounts.ports import list_ports
    from app.mounts.probe import probe

    ports = args.port or [port.port for port in list_ports()]
    line = ProgressLine("probing")
    found = drive(probe(ports), line)
    line.clear()
    advice = "" if ports else "No serial ports: plug in the USB cable and switch the mount on."
    if args.json:
        rows = [{**asdict(d), "found": d.found} for d in found]
        print(to_line({"ports": rows, **({"error": advice} if advice else {})}))
    else:
        for d in found:
            baud = f" --baud {d.baud}" if d.baud else ""
            words = f"{d.name}: --port {d.port} --driver {d.driver}{baud}" if d.found else ""
            print(". ".join(x for x in (words, d.advice) if x))
        if advice:
            print(advice)
    return 0 if any(d.found for d in found) else 1
