"""``kochab mount recover`` and ``disagree``: when mount and sky do not agree."""

import argparse
import sys
from dataclasses import asdict
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kochab.cli.mount import NOTHING_SENT, add_camera, add_line_options, guarded_mount, mount_frames
from kochab.cli.mount.status import where
from kochab.cli.output import radec, tell, with_progress
from kochab.core.errors import NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import Ability
from kochab.core.solution import NoSolution
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:
    from kochab.gear.mounts.guard import Guard
    from kochab.pointing.disagreement import Disagreement
    from kochab.workflows.recover_mount import Recovery


def add_recover(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``recover``."""
    parser = actions.add_parser(
        name,
        help=text,
        description="Solves blind and syncs the mount; nothing moves. Only frames taken after the "
        "start count. A script or a timer syncs at once; at a terminal it is a preview until you "
        "add --yes. Exit code: 0 synced (or previewed), 1 not, 2 usage.",
    )
    add_line_options(parser, run_recover, ("no-site", "trust-mount"))
    add_camera(parser, files=True)
    parser.add_argument(
        "--yes",
        action="store_true",
        help="do it, even beyond 5 deg or with an older frame: the telescope has not moved",
    )
    parser.add_argument("--arm", action="store_true", help="even beyond 20 deg")
    parser.add_argument("--dry-run", action="store_true", help="solve and report, change nothing")


def run_recover(args: argparse.Namespace) -> int:
    """Recover, and tell what was done."""
    from kochab.workflows.recover_mount import recover_mount

    there = sys.stdin is not None and sys.stdin.isatty()  # who reads a preview and repeats: no timer, no script
    asked = there and not (args.yes or args.arm or args.dry_run)
    with mount_frames(args) as seeing, guarded_mount(args) as guard:
        notes: list[str] = []

        def solve_now() -> Any:
            found = yield from seeing.solve_now()
            if guard.site is None and not args.no_site:  # the frame may tell it
                guard.site, site_notes = _site(seeing.site, guard)
                notes.extend(site_notes)
            return found

        choices = {"confirmed": args.yes, "allow_large_sync": args.arm, "only_look": args.dry_run or asked}
        task = recover_mount(guard, solve_now, taken=lambda: seeing.time_utc, **choices)
        done = with_progress("recover", task)
        fields = {**_json(done, seeing.used, notes), **where(args, guard)}
        asked = asked and done.preview.allowed and Ability.SYNC not in guard.lacks
    tell(fields, "\n  ".join([*_lines(fields), *([NOTHING_SENT] if asked else [])]), args.json)
    return 0


def _site(from_frame: Site | None, guard: "Guard") -> tuple[Site | None, list[str]]:
    """The frame's own site, or else the mount's; and what is to be said of it."""
    if from_frame is not None:
        return from_frame, ["The site is the one in the frame's header."]
    own = guard.site_report().site
    if own is not None:
        return own, ["The site is the one set in the mount, which may be wrong: give --site."]
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


def _lines(fields: Json) -> list[str]:
    asking = () if fields["recovered"] else fields["confirmations"]
    return [
        f"The telescope points at {radec(fields['solved_ra_deg'], fields['solved_dec_deg'])} "
        f"(J2000); the mount was off by {fields['offset_deg']:.3f} deg.",
        "Synced, and read back from the mount." if fields["recovered"] else "Nothing was changed.",
        *(*fields["refusals"], *asking, *fields["warnings"]),
    ]


# -- ``kochab mount disagree``: why the mount says another place than the sky ------------------

SHOWN = 5
LIKELY = 0.01
TONIGHT = timedelta(hours=12)


def add_disagree(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``disagree``."""
    parser = actions.add_parser(
        name,
        help=text,
        description="Compares a solved frame with the mount's position, time and site; changes "
        "nothing. Exit code: 0 done, 1 failed, 2 usage.",
    )
    add_line_options(parser, run_disagree)
    add_camera(parser, files=True)
    parser.add_argument(
        "--sightings",
        type=Path,
        metavar="FILE",
        help="keep this sighting in FILE and judge all of tonight in it; no sync between",
    )


def run_disagree(args: argparse.Namespace) -> int:
    """Solve, ask the mount, and name the cause."""
    from kochab.pointing.disagreement import investigate
    from kochab.workflows.pointing_model import load_sightings, save_sightings
    from kochab.workflows.recover_mount import sighted

    with mount_frames(args) as seeing, guarded_mount(args) as guard:
        solved = with_progress("disagree", seeing.solve_now())
        if isinstance(solved, NoSolution):
            raise NoAnswerError(f"The frame has no solution, {solved.reason}: {solved.advice}")
        sighting = sighted(guard, solved, seeing.time_utc if args.frames else None, args.site or seeing.site)
        seen = [sighting]
        if args.sightings is not None:
            kept = load_sightings(args.sightings)
            seen = [s for s in kept if abs(sighting.time_utc - s.time_utc) < TONIGHT] + seen
            save_sightings(args.sightings, [*kept, sighting])
        found = investigate(seen)
        fields = {**_cause_json(found), "sightings": len(seen), **where(args, guard)}
    fields["solved_ra_deg"], fields["solved_dec_deg"] = solved.ra_dec_deg
    lines = [
        found.sentence,
        f"from the mount's position to the sky: {found.east_arcsec / 60.0:+.1f}' east, "
        f"{found.north_arcsec / 60.0:+.1f}' north",
        *(f"{100.0 * s.score:3.0f} %  {s.name}: {s.evidence}" for s in found.suspects[:SHOWN] if s.score >= LIKELY),
    ]
    tell(fields, "\n  ".join(lines), args.json)
    return 0


def _cause_json(found: "Disagreement") -> Json:
    return {
        "action": "disagree",
        "agrees": found.agrees,
        "cause": found.cause or None,
        "sentence": found.sentence,
        "offset_arcsec": found.offset_arcsec,
        "east_arcsec": found.east_arcsec,
        "north_arcsec": found.north_arcsec,
        "suspects": [asdict(s) for s in found.suspects[:SHOWN]],
    }
