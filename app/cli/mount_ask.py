"""``kochab mount position`` and ``kochab mount stop``."""

import argparse
from typing import TYPE_CHECKING, Any

from app.cli.mount import add_line_options
from app.cli.mount_line import guarded_mount
from app.cli.output import Json, dms, hms, to_line
from app.core.errors import PortError

if TYPE_CHECKING:
    from app.mounts.guard import Guard


ELSEWHERE = (
    "A Kochab that holds it stops the mount by Esc in its window, or by Ctrl-C; in need, cut the"
    " mount's power."
)


def add_parser(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``position`` or ``stop``."""
    parser = actions.add_parser(name, help=text)
    add_line_options(parser, _position if name == "position" else _stop)


def _position(args: argparse.Namespace) -> int:
    with guarded_mount(args) as guard:
        told = {**where(args, guard), **_state(guard), "epoch_doubt": guard.epoch_doubt()}
    if args.json:
        print(to_line(told))
        return 0
    print(told["name"])
    print(f"  {hms(told['ra_deg'])} {dms(told['dec_deg'])}  (J2000)")
    print(f"  its own: {told['mount_ra_deg']:.4f} {told['mount_dec_deg']:+.4f} {told['epoch']}")
    if told["epoch_doubt"]:
        print(f"  {told['epoch_doubt']}")
    for key, value in told["state"].items():
        if value is not None:
            print(f"  {key.replace('_', ' ')}: {value}")
    for ability, reason in told["lacks"].items():
        print(f"  no {ability}: {reason}")
    return 0


def _stop(args: argparse.Namespace) -> int:
    try:
        with guarded_mount(args, stop_first=True) as guard:
            guard.stop()
    except PortError as error:
        raise PortError(f"{error} {ELSEWHERE}") from error
    print(to_line({"stopped": True}) if args.json else "The mount was told to stop.")
    return 0


def where(args: argparse.Namespace, guard: "Guard") -> Json:
    """The mount's position as JSON: ICRS degrees, and its own."""
    from app.mounts.epoch import from_mount_epoch

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


def _state(guard: "Guard") -> Json:
    state = guard.state()
    told = {
        "slewing": state.slewing,
        "parked": state.parked,
        "aligned": state.aligned,
        "tracking": state.tracking,
        "pier_side": None if state.pier_side is None else str(state.pier_side),
    }
    return {"state": told, "lacks": {str(k): v for k, v in guard.lacks.items()}}
