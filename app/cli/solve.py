"""``kochab solve FILE...``: where frames point."""

import argparse
import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from app.cli.batch import run_batch
from app.cli.choices import add_choices, add_detector, options_of
from app.cli.files import named
from app.cli.output import Json, as_json
from app.cli.written import write_picture, write_wcs_beside
from app.core.errors import UsageError
from app.core.progress import Task
from app.core.solution import Solution
from app.frames.formats import SUFFIXES
from app.solve.contradicted import with_doubts
from app.solve.options import SolveOptions
from app.workflows.solve_frame import SolvedFrame, solve_file

PICTURES = frozenset(SUFFIXES) - {".gz"}
"""What ``solve`` takes from a folder; a file named by itself is always tried."""
WRITTEN = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True, slots=True)
class Wish:
    """One file and what is to be written from it."""

    file: str
    wcs: bool = False
    annotate: str | None = None


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``solve`` to the command line."""
    parser = subparsers.add_parser(
        "solve",
        help="name the stars of frames and say where they point",
        description="Exit code: 0 all solved, 1 one has no solution, 2 unusable input.",
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="frames, or folders of them")
    add_choices(parser)
    add_detector(parser)
    parser.add_argument(
        "--annotate", metavar="PNG", help="write a .png or .jpg with the stars named (or a folder)"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Solve every file, print as they are done."""
    wishes = _wishes(args)
    options = options_of(args, args.detector)
    return run_batch(partial(solve_one, options=options), wishes, args.json, args.workers)


def solve_one(wish: Wish, options: SolveOptions) -> Task[Json]:
    """The outcome of one file, and what was asked to be written from it."""
    if Path(wish.file).is_dir():
        raise UsageError(_why_no_pictures(wish.file))
    solved = yield from solve_file(wish.file, options)
    outcome = as_json(wish.file, with_doubts(solved.result, options, solved.frame.hint))
    if isinstance(solved.result, Solution):
        failures = _write(wish, solved, solved.result)
        if failures:
            outcome["failures"] = failures
    return outcome


def _wishes(args: argparse.Namespace) -> list[Wish]:
    files = [name for given in named(args.files) for name in _expand(given)]
    target = None if args.annotate is None else Path(args.annotate)
    if target is None:
        return [Wish(file, args.wcs) for file in files]
    if not target.is_dir() and target.suffix.lower() not in WRITTEN:
        raise UsageError(f"--annotate {target}: the picture is a .png or a .jpg.")
    if target.is_dir():
        return [Wish(f, args.wcs, str(target / f"{Path(f).name}.png")) for f in files]
    if len(files) > 1:
        raise UsageError(f"--annotate {target} names one picture for {len(files)} frames.")
    return [Wish(file, args.wcs, str(target)) for file in files]


def _expand(given: str) -> list[str]:
    path = Path(given)
    if not path.is_dir():
        return [given]
    try:
        found = sorted(str(p) for p in path.iterdir() if p.suffix.lower() in PICTURES)
    except OSError:
        return [given]  # told in its turn, like a file that cannot be read
    return found or [given]


def _why_no_pictures(folder: str) -> str:
    try:
        os.listdir(folder)
    except OSError as error:
        return f"{folder} cannot be read: {error.strerror}."
    return f"{folder} is a folder without pictures."


def _write(wish: Wish, solved: SolvedFrame, solution: Solution) -> list[str]:
    """Write what was asked; sentences about what could not be written."""
    failures = write_wcs_beside(wish.file, solution) if wish.wcs else []
    if wish.annotate is not None:
        failures += write_picture(wish.annotate, solved.frame, solution)
    return failures
