"""``kochab mount list``, ``probe``, ``position`` and ``stop``."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from kochab.cli.mount import add_line_options, guarded_mount
from kochab.cli.options import add_options
from kochab.cli.output import radec, reporting_failures, tell, with_progress
from kochab.core.errors import LineLostError, NoAnswerError, NotStoppedError, PortError, RefusedError
from kochab.core.frame import Site
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:
    from kochab.gear.mounts.guard import Guard


NO_PORTS = "No serial ports: plug in the USB cable of the mount and switch it on."
ELSEWHERE = (
    "If another Kochab uses it, press Esc in its window or Ctrl-C in its terminal; in an emergency,"
    " cut the mount's power."
)


def add_status_action(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``position`` or ``stop``."""
    add_line_options(actions.add_parser(name, help=text), _position if name == "position" else _stop)


def _position(args: argparse.Namespace) -> int:
    with guarded_mount(args) as guard:
        lacks = {str(ability): reason for ability, reason in guard.lacks.items()}
        fields = {
            **where(args, guard),
            "state": asdict(guard.state()),
            "lacks": lacks,
            "epoch_doubt": guard.epoch_doubt(),
            "clock_doubt": guard.clock_doubt(),
            "needs_sync": guard.policy.slew_block_reason,
        }
    lines = [
        fields["name"],
        f"{radec(fields['ra_deg'], fields['dec_deg'])}  (J2000)",
        f"mount: {fields['mount_ra_deg']:.4f} {fields['mount_dec_deg']:+.4f} {fields['epoch']}",
        *filter(None, (fields["epoch_doubt"], fields["clock_doubt"], fields["needs_sync"])),
        *(f"{key.replace('_', ' ')}: {value}" for key, value in fields["state"].items() if value is not None),
        *(f"no {ability}: {reason}" for ability, reason in fields["lacks"].items()),
    ]
    tell(fields, "\n  ".join(lines), args.json)
    return 0


def _stop(args: argparse.Namespace) -> int:
    """Stop, and see whether it stands; a failure says in capitals that it may still move."""
    from kochab.gear.mounts.emergency_stop import MAY_STILL_MOVE

    args.equatorial = True  # whatever stands there is only asked whether it stands still
    args.site = args.site or Site(0.0, 0.0)  # which needs a place of a mount that knows none
    try:
        with guarded_mount(args, stop_first=True) as guard:
            guard.stop()
            seen = guard.emergency.confirm()
    # The port could not be opened, so no Stop was sent: whoever holds it has to stop the mount.
    except PortError as error:
        raise PortError(f"{error} {ELSEWHERE}") from error
    except (NoAnswerError, RefusedError, LineLostError) as error:
        raise NotStoppedError(f"{MAY_STILL_MOVE} {error}") from error
    tell({"stopped": True} | ({"seen": seen} if seen else {}), f"The mount has stopped. {seen}".rstrip(), args.json)
    return 0


def where(args: argparse.Namespace, guard: "Guard") -> Json:
    """The mount's position as JSON: ICRS degrees, and its own."""
    from kochab.gear.mounts.coordinates import from_mount_epoch

    here = guard.position()
    ra, dec = from_mount_epoch(here, guard.clock())
    return {
        "port": args.port,
        "driver": args.driver,
        "name": guard.identify(),
        "ra_deg": ra,
        "dec_deg": dec,
        "mount_ra_deg": here.ra_deg,
        "mount_dec_deg": here.dec_deg,
        "epoch": str(here.epoch),
    }


# -- ``kochab mount list`` and ``kochab mount probe`` ------------------------------------------


def add_ports_action(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``list`` or ``probe``."""
    parser = actions.add_parser(name, help=text)
    add_options(parser, "--json")
    if name == "probe":
        parser.add_argument("--port", action="append", metavar="P", help="only this one; may be repeated")
    parser.set_defaults(run=reporting_failures(_list if name == "list" else _probe, 1))


def _list(args: argparse.Namespace) -> int:
    from kochab.gear.mounts import DRIVERS
    from kochab.gear.mounts.probe import find_served, list_ports

    trouble = ""
    try:
        ports = list_ports()
    except PortError as error:  # what answers in the network is listed all the same
        ports, trouble = [], str(error)
    served = find_served()
    drivers = {name: driver.title for name, driver in DRIVERS.loaded().items()}
    lines = ["  ".join(x for x in (port.port, port.description, port.usb, port.hint) if x) for port in ports]
    lines += [f"{one.port}  {one.name}  ({one.driver})" for one in served]
    lines = [*lines, trouble] if trouble else lines or [NO_PORTS]
    lines.append("drivers: " + "; ".join(f"{name} ({title})" for name, title in drivers.items()))
    fields: Json = {
        "ports": [asdict(port) for port in ports],
        "servers": [asdict(one) for one in served],
        "drivers": drivers,
        **({"error": trouble} if trouble else {}),
    }
    tell(fields, "\n".join(lines), args.json)
    return 1 if trouble else 0


def _probe(args: argparse.Namespace) -> int:
    from kochab.gear.mounts.probe import find_served, list_ports, probe

    ports = args.port or [port.port for port in list_ports()]
    found = with_progress("probing", probe(ports)) + ([] if args.port else find_served())
    fields: Json = {"ports": [{**asdict(d), "found": d.found} for d in found]}
    lines = []
    for d in found:
        baud = f" --baud {d.baud}" if d.baud else ""
        words = f"{d.name}: --port {d.port} --driver {d.driver}{baud}" if d.found else ""
        lines.append(". ".join(x for x in (words, d.advice) if x))
    if not found:
        fields["error"] = NO_PORTS
        lines.append(NO_PORTS)
    tell(fields, "\n".join(lines), args.json)
    return 0 if any(d.found for d in found) else 1
