"""``kochab mount disagree``: why the mount says another place than the sky."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from app.cli.mount import add_line_options
from app.cli.mount_ask import where
from app.cli.mount_frames import add_frames, eyes
from app.cli.mount_line import guarded_mount
from app.cli.output import Json, ProgressLine, to_line
from app.core.errors import NoAnswerError
from app.core.progress import run as drive
from app.core.solution import NoSolution

if TYPE_CHECKING:
    from app.solve.disagreement import Finding

SHOWN = 5
LIKELY = 0.01


def add_parser(actions: "argparse._SubParsersAction[Any]", name: str, text: str) -> None:
    """Add ``disagree``."""
    parser = actions.add_parser(
        name,
        help=text,
        description="Compares a solved frame with the mount's place, time and site. Nothing is "
        "changed. Exit code: 0 told, 1 no answer, 2 usage.",
    )
    add_line_options(parser, run)
    add_frames(parser)


def run(args: argparse.Namespace) -> int:
    """Solve, ask the mount, and name the cause."""
    from app.solve.disagreement import investigate
    from app.workflows.disagree import sighted

    line = ProgressLine("disagree")
    with eyes(args) as seeing, guarded_mount(args) as guard:
        try:
            solved = drive(seeing.solve_now(), line)
        finally:
            line.clear()
        if isinstance(solved, NoSolution):
            raise NoAnswerError(f"The frame has no solution, {solved.reason}: {solved.advice}")
        sighting = sighted(guard, solved, seeing.taken(), args.site or seeing.site())
        found = investigate([sighting])
        told = {**_json(found), **where(args, guard)}
    told["solved_ra_deg"], told["solved_dec_deg"] = solved.ra_dec_deg
    if args.json:
        print(to_line(told))
    else:
        _say(found)
    return 0


def _json(found: "Finding") -> Json:
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


def _say(found: "Finding") -> None:
    print(found.sentence)
    print(
        f"  from the mount's place to the sky's: {found.east_arcsec / 60.0:+.1f}' east, "
        f"{found.north_arcsec / 60.0:+.1f}' north"
    )
    for s in found.suspects[:SHOWN]:
        if s.score >= LIKELY:
            print(f"  {100.0 * s.score:3.0f} %  {s.name}: {s.evidence}")
