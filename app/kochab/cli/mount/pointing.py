"""``kochab mount sync``, ``goto`` and ``centre``: a preview, and with ``--yes`` the motion."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from kochab.cli.mount import add_camera, add_line_options, guarded_mount, mount_frames, preview_lines
from kochab.cli.mount.status import where
from kochab.cli.options import between
from kochab.cli.output import Json, radec, to_line, with_progress
from kochab.core.errors import UsageError

if TYPE_CHECKING:
    from kochab.gear.mounts.guard import Guard
    from kochab.gear.mounts.motion_plan import Preview
    from kochab.workflows.centre_target import Centring
    from kochab.workflows.goto_target import Target


# -- A place on the sky from the command line: degrees, or any name the catalogue knows --------


def add_target(parser: argparse.ArgumentParser) -> None:
    """Add ``NAME``, ``--ra-deg`` and ``--dec-deg``."""
    parser.add_argument("name", nargs="*", metavar="NAME", help="star, Messier, NGC or HIP")
    parser.add_argument("--ra-deg", type=float, metavar="D", help="ICRS (J2000)")
    parser.add_argument("--dec-deg", type=float, metavar="D", help="ICRS (J2000)")


def target_deg(args: argparse.Namespace) -> tuple[float, float]:
    """ICRS degrees of what was asked for, proper motion applied to today."""
    if args.name:
        if args.ra_deg is not None or args.dec_deg is not None:
            raise UsageError("Give either a name or --ra-deg and --dec-deg.")
        from datetime import UTC, datetime

        from kochab.workflows.goto_target import named_target

        found = named_target(" ".join(args.name), datetime.now(UTC))
        return found.ra_deg, found.dec_deg
    if args.ra_deg is None or args.dec_deg is None:
        raise UsageError("Give a target: --ra-deg D --dec-deg D, or a name.")
    if not -360.0 <= args.ra_deg <= 360.0 or not -90.0 <= args.dec_deg <= 90.0:
        raise UsageError("--ra-deg and --dec-deg are not a valid position.")
    return args.ra_deg % 360.0, args.dec_deg


def add_sync_or_goto(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``sync`` or ``goto``."""
    parser = actions.add_parser(name, help=text)
    add_target(parser)
    moves = ("yes", "no-site", "allow-flip") if name == "goto" else ("yes", "no-site")
    add_line_options(parser, run_sync_or_goto, moves)
    parser.set_defaults(arm=False)
    if name == "sync":
        parser.add_argument("--arm", "--armed", dest="arm", action="store_true", help="even beyond 20 deg")


def run_sync_or_goto(args: argparse.Namespace) -> int:
    """Preview; then, when asked and allowed, do it and tell where the mount is."""
    ra, dec = target_deg(args)
    with guarded_mount(args) as guard:
        there = guard.to_mount(ra, dec)
        guard.armed = args.arm
        preview = guard.preview_goto(*there) if args.action == "goto" else guard.preview_sync(*there, by_hand=True)
        if args.yes:
            if args.action == "goto":
                with_progress("goto", guard.slew(*there))
            else:
                guard.sync(*guard.to_mount(ra, dec), by_hand=True, confirmed=True)
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


def _say(told: dict[str, Any], preview: "Preview") -> None:
    print(f"{told['action']} to {radec(told['target_ra_deg'], told['target_dec_deg'])} (J2000)")
    print(
        f"  {preview.offset_deg:.3f} deg away: {preview.east_deg * 60:+.1f}' east, {preview.north_deg * 60:+.1f}' north"
    )
    print(*preview_lines(preview, told["done"]), sep="\n")
    if told["done"]:
        print(f"  done: {radec(told['ra_deg'], told['dec_deg'])} (J2000)")


# -- ``kochab mount centre``: go there, look, correct, until the target is in the middle -------


def add_centre(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``centre``."""
    parser = actions.add_parser(
        name, help=text, description="Exit code: 0 centred (or, without --yes, previewed), 1 not, 2 usage."
    )
    add_target(parser)
    add_line_options(parser, run_centre, ("yes", "no-site", "allow-flip"))
    add_camera(parser)
    parser.add_argument(
        "--tolerance", type=between(1.0, 36000.0, "arcsec"), default=60.0, metavar="ARCSEC", help="centred within (60)"
    )
    parser.add_argument("--tries", type=_tries, default=5, metavar="N", help="corrections at most (5)")
    parser.add_argument("--no-sync", action="store_true", help="correct by offset gotos only")


def run_centre(args: argparse.Namespace) -> int:
    """Preview, or do it and tell how it ended."""
    from kochab.workflows.goto_target import Target

    ra, dec = target_deg(args)
    target = Target(" ".join(args.name) or radec(ra, dec), ra, dec)
    with mount_frames(args) as seeing, guarded_mount(args) as guard:
        if not args.yes:
            return _previewed(args, guard, target)
        from kochab.workflows.centre_target import centre_target

        task = centre_target(
            guard, seeing.solve_now, target, args.tolerance, args.tries, may_sync=not args.no_sync, confirmed=True
        )
        result = with_progress("centre", task)
        told = {**_json(target, result), **where(args, guard)}
    if not result.centred and args.json:
        told["error"] = result.sentence
    if args.json:
        print(to_line(told))
    else:
        _say_centring(result)
    return 0 if result.centred else 1


def _previewed(args: argparse.Namespace, guard: "Guard", target: "Target") -> int:
    preview = guard.preview_goto(*guard.to_mount(target.ra_deg, target.dec_deg))
    if args.json:
        told = {"action": "centre", "done": False, "target": asdict(target)}
        print(to_line({**told, "preview": {**asdict(preview), "allowed": preview.allowed}}))
        return 0
    print(f"centre {target.name}: the first slew would be {preview.offset_deg:.2f} deg")
    print(*preview_lines(preview), sep="\n")
    return 0


def _json(target: "Target", result: "Centring") -> Json:
    solved = result.solution
    return {
        "action": "centre",
        "done": True,
        "centred": result.centred,
        "end": str(result.end),
        "sentence": result.sentence,
        "target": asdict(target),
        "errors_arcsec": list(result.errors_arcsec),
        "corrections": list(result.corrections),
        "synced": result.synced,
        "notes": list(result.notes),
        "solved_ra_deg": None if solved is None else solved.ra_dec_deg[0],
        "solved_dec_deg": None if solved is None else solved.ra_dec_deg[1],
    }


def _say_centring(result: "Centring") -> None:
    print(result.sentence)
    for way, before in zip(result.corrections, result.errors_arcsec, strict=False):
        print(f"  {before:.1f} arcsec off: {way}")
    for note in dict.fromkeys(note for note in result.notes if note != result.sentence):
        print(f"  {note}")


def _tries(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 50:
        raise argparse.ArgumentTypeError(f"{text} is not a count from 1 to 50")
    return int(text)
