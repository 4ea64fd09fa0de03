"""``kochab mount sync``, ``goto`` and ``centre``: a preview, and with ``--yes`` the motion."""

import argparse
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kochab.cli.mount import add_camera, add_line_options, guarded_mount, mount_frames, preview_lines
from kochab.cli.mount.status import where
from kochab.cli.options import between, whole
from kochab.cli.output import radec, tell, with_progress
from kochab.core.errors import UsageError
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:
    from kochab.gear.mounts.guard import Guard
    from kochab.pointing.pointing_model import PointingModel
    from kochab.workflows.centre_target import Centring
    from kochab.workflows.goto_target import Target


# -- A place on the sky from the command line: degrees, or any name the catalogue knows --------


def add_target(parser: argparse.ArgumentParser) -> None:
    """Add ``NAME``, ``--ra-deg`` and ``--dec-deg``."""
    parser.add_argument("name", nargs="*", metavar="NAME", help="a star, an object or a planet")
    parser.add_argument("--ra-deg", type=float, metavar="D", help="ICRS (J2000)")
    parser.add_argument("--dec-deg", type=float, metavar="D", help="ICRS (J2000)")


def target(args: argparse.Namespace) -> "Target":
    """What was asked for, proper motion applied to today."""
    from kochab.workflows.goto_target import named_target, target_at

    if args.name:
        if args.ra_deg is not None or args.dec_deg is not None:
            raise UsageError("Give either a name or --ra-deg and --dec-deg.")
        return named_target(" ".join(args.name), datetime.now(UTC), args.site)
    if args.ra_deg is None or args.dec_deg is None:
        raise UsageError("Give a target: --ra-deg D --dec-deg D, or a name.")
    place = target_at(args.ra_deg, args.dec_deg)
    return replace(place, name=radec(place.ra_deg, place.dec_deg))


def add_sync_or_goto(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``sync`` or ``goto``."""
    parser = actions.add_parser(name, help=text)
    add_target(parser)
    moves = ("yes", "no-site", "allow-flip", "trust-mount") if name == "goto" else ("yes", "no-site", "trust-mount")
    add_line_options(parser, run_sync_or_goto, moves)
    parser.set_defaults(arm=False)
    if name == "goto":
        parser.add_argument("--model", type=Path, metavar="FILE", help="aim by this file of `kochab mount model`")
    if name == "sync":
        parser.add_argument("--arm", "--armed", dest="arm", action="store_true", help="even beyond 20 deg")


def run_sync_or_goto(args: argparse.Namespace) -> int:
    """Preview; then, when asked and allowed, do it and tell where the mount is."""
    from kochab.workflows.goto_target import aimed
    from kochab.workflows.pointing_model import use_model

    wanted, model = target(args), _model(args)
    with guarded_mount(args) as guard:
        if model is not None:
            use_model(guard, model)
        there = aimed(guard, wanted)
        guard.allow_large_sync = args.arm
        preview = guard.preview_goto(*there) if args.action == "goto" else guard.preview_sync(*there, by_hand=True)
        if args.yes:
            if args.action == "goto":
                with_progress("goto", guard.slew(*there))
            else:
                guard.sync(*guard.to_mount(wanted.ra_deg, wanted.dec_deg), by_hand=True, confirmed=True)
        fields = {
            "action": args.action,
            "done": bool(args.yes),
            "target_ra_deg": wanted.ra_deg,
            "target_dec_deg": wanted.dec_deg,
            "preview": {**asdict(preview), "allowed": preview.allowed},
            **where(args, guard),
            "tracking_left_s": guard.tracking_left_s() if args.yes else None,
        }
    left_s = fields["tracking_left_s"]
    lines = [
        f"{args.action} to {radec(wanted.ra_deg, wanted.dec_deg)} (J2000)",
        f"  {preview.offset_deg:.3f} deg away: {preview.east_deg * 60:+.1f}' east,"
        f" {preview.north_deg * 60:+.1f}' north",
        *preview_lines(preview, args.yes),
        *([f"  done: {radec(fields['ra_deg'], fields['dec_deg'])} (J2000)"] if args.yes else []),
        *(
            [f"  it tracks on unwatched and reaches a limit within {left_s / 3600:g} h: stop it before"]
            if left_s
            else []
        ),
    ]
    tell(fields, "\n".join(lines), args.json)
    return 0


def _model(args: argparse.Namespace) -> "PointingModel | None":
    """The pointing model that a goto is given."""
    if args.action != "goto" or args.model is None:
        return None
    from kochab.pointing.pointing_model import fit_model
    from kochab.workflows.pointing_model import load_sightings

    return fit_model(load_sightings(args.model))


# -- ``kochab mount centre``: go there, look, correct, until the target is in the middle -------


def add_centre(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``centre``."""
    parser = actions.add_parser(
        name, help=text, description="Exit code: 0 centred (or, without --yes, previewed), 1 not, 2 usage."
    )
    add_target(parser)
    add_line_options(parser, run_centre, ("yes", "no-site", "allow-flip", "trust-mount"))
    add_camera(parser)
    parser.add_argument(
        "--tolerance", type=between(1.0, 36000.0, "arcsec"), default=60.0, metavar="ARCSEC", help="centred within (60)"
    )
    parser.add_argument("--tries", type=whole(1, 50), default=5, metavar="N", help="corrections at most (5)")
    parser.add_argument("--no-sync", action="store_true", help="correct by offset gotos only")


def run_centre(args: argparse.Namespace) -> int:
    """Preview, or do it and tell how it ended."""
    wanted = target(args)
    with mount_frames(args) as seeing, guarded_mount(args) as guard:
        if not args.yes:
            return _previewed(args, guard, wanted)
        from kochab.workflows.centre_target import centre_target

        task = centre_target(
            guard, seeing.solve_now, wanted, args.tolerance, args.tries, may_sync=not args.no_sync, confirmed=True
        )
        result = with_progress("centre", task)
        fields = {**_json(wanted, result), **where(args, guard)}
    if not result.centred and args.json:
        fields["error"] = result.sentence
    lines = [
        result.sentence,
        *(f"{left:.1f} arcsec off: {how}" for how, left in zip(result.corrections, result.errors_arcsec, strict=False)),
        *dict.fromkeys(note for note in result.notes if note != result.sentence),
    ]
    tell(fields, "\n  ".join(lines), args.json)
    return 0 if result.centred else 1


def _previewed(args: argparse.Namespace, guard: "Guard", target: "Target") -> int:
    preview = guard.preview_goto(*guard.to_mount(target.ra_deg, target.dec_deg))
    fields = {
        "action": "centre",
        "done": False,
        "target": asdict(target),
        "preview": {**asdict(preview), "allowed": preview.allowed},
    }
    first = f"centre {target.name}: the first slew would be {preview.offset_deg:.2f} deg"
    tell(fields, "\n".join([first, *preview_lines(preview)]), args.json)
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
