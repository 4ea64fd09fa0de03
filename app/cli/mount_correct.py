"""``kochab mount sync`` and ``kochab mount goto``: a preview, and with ``--yes`` the deed."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from app.cli.mount import add_line_options
from app.cli.mount_ask import where
from app.cli.mount_line import guarded_mount
from app.cli.mount_target import add_target, target_deg
from app.cli.output import ProgressLine, dms, hms, to_line
from app.core.progress import run as drive

if TYPE_CHECKING:
    from app.mounts.limits import Limits
    from app.mounts.preview import Preview


def add_parser(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``sync`` or ``goto``."""
    parser = actions.add_parser(name, help=text)
    add_target(parser)
    add_line_options(parser, run)
    parser.add_argument("--yes", action="store_true", help="do it; without it only a preview")
    parser.add_argument("--no-site", action="store_true", help="do without a watch on the horizon")
    if name == "goto":
        parser.add_argument("--allow-flip", action="store_true", help="across the meridian")
    else:
        parser.add_argument(
            "--arm", "--armed", dest="arm", action="store_true", help="even beyond 20 deg"
        )


def run(args: argparse.Namespace) -> int:
    """Preview; then, when asked and allowed, do it and tell where the mount is."""
    ra, dec = target_deg(args)
    line = ProgressLine(args.action)
    with guarded_mount(args, _limits(args)) as guard:
        there = guard.to_mount(ra, dec)
        guard.armed = bool(getattr(args, "arm", False))
        if args.action == "goto":
            preview = guard.preview_goto(*there)
        else:
            preview = guard.preview_sync(*there, by_hand=True)
        if args.yes:
            if args.action == "goto":
                drive(guard.slew_icrs(ra, dec), line)
                line.clear()
            else:
                guard.sync_icrs(ra, dec, by_hand=True, confirmed=True)
        told = {
            "action": args.action,
            "done": bool(args.yes),
            "target_ra_deg": ra,
            "target_dec_deg": dec,
            "preview": {**asdict(preview), "allowed": preview.allowed},
            **where(args, guard),
        }
    if args.json:
        print(to_line(told))
    else:
        _say(told, preview)
    return 0


def _limits(args: argparse.Namespace) -> "Limits":
    from app.mounts.limits import Limits

    return Limits(
        allow_without_site=args.no_site, allow_flip=bool(getattr(args, "allow_flip", False))
    )


def _say(told: dict[str, Any], preview: "Preview") -> None:
    print(f"{told['action']} to {hms(told['target_ra_deg'])} {dms(told['target_dec_deg'])} (J2000)")
    print(
        f"  {preview.offset_deg:.3f} deg away: {preview.east_deg * 60:+.1f}' east, "
        f"{preview.north_deg * 60:+.1f}' north"
    )
    for sentence in (*preview.refusals, *preview.confirmations, *preview.warnings):
        print(f"  {sentence}")
    if told["done"]:
        print(f"  done: {hms(told['ra_deg'])} {dms(told['dec_deg'])} (J2000)")
    elif preview.allowed:
        print("  nothing was sent; repeat with --yes to do it")
