"""``kochab mount park``, ``unpark``, ``home``, ``flip``, ``track``, ``set-clock``, ``set-site``: a preview first."""

import argparse
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from kochab.cli.mount import NOTHING_SENT, add_line_options, guarded_mount, preview_lines
from kochab.cli.mount.status import where
from kochab.cli.output import tell, with_progress
from kochab.core.errors import NoAnswerError, RefusedError
from kochab.core.mount import Ability, TrackingRate
from kochab.workflows.solution_json import Json

ABILITIES = {
    "park": Ability.PARK,
    "unpark": Ability.UNPARK,
    "home": Ability.HOME,
    "flip": Ability.GOTO,
    "set-clock": Ability.SET_CLOCK,
    "set-site": Ability.SET_SITE,
}


def add_rest(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add one of them."""
    parser = actions.add_parser(name, help=text)
    if name == "track":
        parser.add_argument("rate", type=TrackingRate, choices=list(TrackingRate), help="what the mount follows")
    add_line_options(parser, run_rest, ("yes", "no-site"))


def run_rest(args: argparse.Namespace) -> int:
    """Preview; then, when asked, do it and tell how the mount is."""
    from kochab.workflows.goto_target import flip_mount

    travels = args.action in ("park", "home")
    ability = args.rate.ability if args.action == "track" else ABILITIES[args.action]
    title = f"track {args.rate}" if args.action == "track" else args.action
    lines = [title]
    with guarded_mount(args) as guard:
        if ability in guard.lacks:
            raise RefusedError(guard.lacks[ability])
        fields: Json = {"action": args.action, "done": bool(args.yes), **where(args, guard)}
        if args.action == "track":
            fields["rate"] = str(args.rate)
        if travels:
            preview = guard.preview_rest(args.action)
            fields["preview"] = {**asdict(preview), "allowed": preview.allowed}
            lines += preview_lines(preview, args.yes)
        elif not args.yes:
            lines.append(f"  {NOTHING_SENT}")
        if args.yes:
            if travels:
                with_progress(args.action, guard.rest(args.action))
            elif args.action == "flip":
                lines.append(f"  {with_progress('flip', flip_mount(guard))}")
            elif args.action == "track":
                guard.track(args.rate)
            else:
                {"unpark": guard.unpark, "set-clock": guard.set_clock, "set-site": guard.set_site}[args.action]()
            lines.append("  done")
        if args.action.startswith("set-"):
            # Asked again: setting the clock may have ended the doubt, or begun one until the next sync.
            guard.clock_doubt()
            fields["clock_doubt"] = guard.policy.clock_conflict or guard.policy.slew_block_reason
            lines += filter(None, [fields["clock_doubt"]])
        with suppress(NoAnswerError):  # an Autostar that has parked is silent
            fields |= where(args, guard)
        fields["state"] = asdict(guard.state())
    tell(fields, "\n".join(lines), args.json)
    return 0
