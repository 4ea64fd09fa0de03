"""``kochab identify STARS.csv...``: where lists of star positions point."""

import argparse
from dataclasses import dataclass
from functools import partial
from typing import Any

from app.cli.batch import run_batch
from app.cli.choices import add_choices, options_of
from app.cli.files import named
from app.cli.output import Json, as_json
from app.cli.written import write_wcs_beside
from app.core.progress import Task
from app.core.solution import Solution
from app.solve.contradicted import with_doubts
from app.solve.options import SolveOptions
from app.workflows.star_list import solve_star_list


@dataclass(frozen=True, slots=True)
class Wish:
    """One list, the size of the frame it came from, and whether a WCS is wanted."""

    file: str
    width: int
    height: int
    wcs: bool = False


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``identify`` to the command line."""
    parser = subparsers.add_parser(
        "identify",
        help="the same from lists of star positions",
        description=(
            "A list holds x,y or x,y,flux a line, in pixels, x right, y down, (0, 0) the centre "
            "of the first pixel; without flux the brightest comes first."
        ),
    )
    parser.add_argument("files", nargs="+", metavar="STARS.csv", help="lists of stars")
    parser.add_argument("--width", type=_pixels, required=True, metavar="W", help="frame, px")
    parser.add_argument("--height", type=_pixels, required=True, metavar="H", help="frame, px")
    add_choices(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Identify every list, print as they are done."""
    wishes = [Wish(file, args.width, args.height, args.wcs) for file in named(args.files)]
    work = partial(identify_one, options=options_of(args))
    return run_batch(work, wishes, args.json, args.workers)


def identify_one(wish: Wish, options: SolveOptions) -> Task[Json]:
    """The outcome of one list."""
    result = yield from solve_star_list(wish.file, wish.width, wish.height, options)
    outcome = as_json(wish.file, with_doubts(result, options))
    if wish.wcs and isinstance(result, Solution):
        outcome["failures"] = write_wcs_beside(wish.file, result)
    return outcome


def _pixels(text: str) -> int:
    if not text.isdigit() or not 2 <= int(text) <= 1_000_000:
        raise argparse.ArgumentTypeError(f"{text} is not a size in pixels")
    return int(text)
