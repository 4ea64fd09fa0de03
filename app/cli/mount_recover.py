"""``kochab mount recover``: a lost mount is told where it is; nobody need be there."""

import argparse
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from app.cli.mount import add_line_options
from app.cli.mount_ask import where
from app.cli.mount_frames import add_frames, eyes
from app.cli.mount_line import guarded_mount
from app.cli.output import Json, ProgressLine, dms, hms, to_line
from app.core.hint import Site
from app.core.mount import Ability
from app.core.progress import run as drive

if TYPE_CHECKING:
    from app.mounts.guard import Guard
    from app.workflows.recover_mount import Recovery


def add_parser(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``recover``."""
    parser = actions.add_parser(
        name,
        help=text,
        description="Solves without any hint of the place and syncs the mount within the guard; "
        "nothing moves. With nobody there, as from a script or a timer, it is done at once; at a "
        "terminal it is only previewed until --yes is given, as a sync is. Exit code: 0 the mount "
        "knows where it is (or it was previewed), 1 not, 2 usage.",
    )
    add_line_options(parser, run)
    add_frames(parser)
    parser.add_argument(
        "--yes",
        action="store_true",
        help="do it, also beyond 5 deg, and with a frame not of this minute",
    )
    parser.add_argument("--arm", action="store_true", help="also beyond 20 deg")
    parser.add_argument("--dry-run", action="store_true", help="look and tell, change nothing")
    parser.add_argument("--no-site", action="store_true", help="do without a watch on the horizon")


def run(args: argparse.Namespace) -> int:
    """Recover, and tell what was done."""
    from app.mounts.limits import Limits
    from app.workflows.recover_mount import recover_mount

    line = ProgressLine("recover")
    asked = not (args.yes or args.arm or args.dry_run) and somebody_there()
    limits = Limits(allow_without_site=args.no_site)
    with eyes(args) as seeing, guarded_mount(args, limits) as guard:
        notes: list[str] = []

        def site_known() -> None:
            if guard.site is None and not args.no_site:
                guard.site, told = _site(seeing.site(), guard)
                notes.extend(told)

        def solve_now() -> Any:
            found = yield from seeing.solve_now()
            site_known()
            return found

        try:
            task = recover_mount(
                guard, solve_now, confirmed=args.yes, armed=args.arm,
                only_look=args.dry_run or asked, taken=seeing.taken,
            )  # fmt: skip
            done = drive(task, line)
        finally:
            line.clear()
        told = {**_json(done, seeing.used(), notes), **where(args, guard)}
        asked = asked and done.preview.allowed and Ability.SYNC not in guard.lacks
    if args.json:
        print(to_line(told))
    else:
        _say(told)
        if asked:
            print("  nothing was sent; repeat with --yes to do it")
    return 0


def somebody_there() -> bool:
    """Whether a person can read a preview and repeat the command: not a timer, not a script."""
    return sys.stdin is not None and sys.stdin.isatty()


def _site(from_frame: Site | None, guard: "Guard") -> tuple[Site | None, list[str]]:
    """The frame's own site, or else the mount's; and what is to be said of it."""
    if from_frame is not None:
        return from_frame, ["The site is the one in the frame's header."]
    own = guard.beliefs().site
    if own is not None:
        return own, ["The site is the mount's own, which may be wrong: give --site."]
    return None, []


def _json(done: "Recovery", frames: list[str], notes: list[str]) -> Json:
    s = done.solution
    return {
        "action": "recover",
        "recovered": done.synced,
        "solved_ra_deg": done.sky_deg[0],
        "solved_dec_deg": done.sky_deg[1],
        "roll_deg": s.roll_deg,
        "before_ra_deg": done.before_deg[0],
        "before_dec_deg": done.before_deg[1],
        "after_ra_deg": done.after_deg[0],
        "after_dec_deg": done.after_deg[1],
        "offset_deg": done.preview.offset_deg,
        "east_deg": done.preview.east_deg,
        "north_deg": done.preview.north_deg,
        "evidence": asdict(done.evidence),
        "matches": len(s.stars),
        "frames": frames,
        "refusals": list(done.preview.refusals),
        "confirmations": list(done.preview.confirmations),
        "warnings": [*notes, *done.warnings],
    }


def _say(told: Json) -> None:
    print(
        f"The telescope points at {hms(told['solved_ra_deg'])} {dms(told['solved_dec_deg'])} "
        f"(J2000), {told['offset_deg']:.3f} deg from where the mount thought."
    )
    done = "The mount was told so and says it now." if told["recovered"] else "Nothing was changed."
    print(f"  {done}")
    asking = () if told["recovered"] else told["confirmations"]
    for sentence in (*told["refusals"], *asking, *told["warnings"]):
        print(f"  {sentence}")
