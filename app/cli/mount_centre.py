"""``kochab mount centre``: go there, look, correct, until the target is in the middle."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from app.cli.mount import add_line_options
from app.cli.mount_ask import where
from app.cli.mount_frames import add_camera, eyes
from app.cli.mount_line import guarded_mount
from app.cli.mount_target import add_target, target_deg
from app.cli.output import Json, ProgressLine, dms, hms, to_line
from app.core.progress import run as drive

if TYPE_CHECKING:
    from app.mounts.guard import Guard
    from app.mounts.limits import Limits
    from app.workflows.centre_target import Centring
    from app.workflows.goto_target import Target


def add_parser(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``centre``."""
    parser = actions.add_parser(
        name,
        help=text,
        description="Exit code: 0 centred (or, without --yes, previewed), 1 not, 2 usage.",
    )
    add_target(parser)
    add_line_options(parser, run)
    add_camera(parser)
    parser.add_argument(
        "--tolerance", type=_tolerance, default=60.0, metavar="ARCSEC", help="how near (60)"
    )
    parser.add_argument("--tries", type=_tries, default=5, metavar="N", help="corrections (5)")
    parser.add_argument("--no-sync", action="store_true", help="correct by offset gotos alone")
    parser.add_argument("--no-site", action="store_true", help="do without a watch on the horizon")
    parser.add_argument("--allow-flip", action="store_true", help="across the meridian")
    parser.add_argument("--yes", action="store_true", help="do it; without it only a preview")


def run(args: argparse.Namespace) -> int:
    """Preview, or do it and tell how it ended."""
    from app.workflows.goto_target import Target

    ra, dec = target_deg(args)
    target = Target(" ".join(args.name) or f"{hms(ra)} {dms(dec)}", ra, dec)
    with eyes(args) as seeing, guarded_mount(args, _limits(args)) as guard:
        if not args.yes:
            return _previewed(args, guard, target)
        from app.workflows.centre_target import centre_target

        line = ProgressLine("centre")
        task = centre_target(
            guard, seeing.solve_now, target, args.tolerance, args.tries,
            may_sync=not args.no_sync, confirmed=True,
        )  # fmt: skip
        try:
            result = drive(task, line)
        finally:
            line.clear()
            task.close()
        told = {**_json(target, result), **where(args, guard)}
    if not result.centred and args.json:
        told["error"] = result.sentence
    if args.json:
        print(to_line(told))
    else:
        _say(result)
    return 0 if result.centred else 1


def _previewed(args: argparse.Namespace, guard: "Guard", target: "Target") -> int:
    preview = guard.preview_goto(*guard.to_mount(target.ra_deg, target.dec_deg))
    if args.json:
        told = {"action": "centre", "done": False, "target": asdict(target)}
        print(to_line({**told, "preview": {**asdict(preview), "allowed": preview.allowed}}))
        return 0
    print(f"centre {target.name}: the first slew would be {preview.offset_deg:.2f} deg")
    for sentence in (*preview.refusals, *preview.confirmations, *preview.warnings):
        print(f"  {sentence}")
    if preview.allowed:
        print("  nothing was sent; repeat with --yes to do it")
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


def _say(result: "Centring") -> None:
    print(result.sentence)
    for way, before in zip(result.corrections, result.errors_arcsec, strict=False):
        print(f"  {before:.1f} arcsec off: {way}")
    for note in dict.fromkeys(note for note in result.notes if note != result.sentence):
        print(f"  {note}")


def _limits(args: argparse.Namespace) -> "Limits":
    from app.mounts.limits import Limits

    return Limits(allow_without_site=args.no_site, allow_flip=args.allow_flip)


def _tolerance(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 1.0 <= value <= 36000.0:
        raise argparse.ArgumentTypeError(f"{text} is not a tolerance from 1 to 36000 arcsec")
    return value


def _tries(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 50:
        raise argparse.ArgumentTypeError(f"{text} is not a count from 1 to 50")
    return int(text)
