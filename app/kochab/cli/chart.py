"""``kochab chart``: a finder chart about an object, or a solved frame with the sky over it, as a PDF to print."""

import argparse
import os
from datetime import UTC, datetime
from typing import Any

from kochab.cli.options import add_options
from kochab.cli.output import tell
from kochab.core.errors import UsageError
from kochab.core.progress import run as finish


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add ``chart`` to the main parser."""
    parser = subparsers.add_parser(
        "chart",
        description="WHAT is a name, a catalogue number or coordinates for a finder chart, or an image, which is solved"
        " and printed with the sky over it. Exit code: 0 written, 1 not found or not solved.",
    )
    parser.add_argument("what", metavar="WHAT")
    parser.add_argument("pdf", metavar="PDF", help="file to write")
    parser.add_argument("--paper", choices=("a4", "letter"), default="a4", help="default: a4")
    parser.add_argument(
        "--field", type=float, metavar="DEG", help="width of a finder chart (default: suits the object)"
    )
    add_options(parser, "--overwrite", "--site", "--json")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the sheet and say where; 1 when there is nothing to draw."""
    if not args.pdf.lower().endswith(".pdf"):
        raise UsageError(f"{args.pdf}: the chart is a .pdf.")
    if os.path.exists(args.pdf) and os.path.exists(args.what) and os.path.samefile(args.pdf, args.what):
        raise UsageError(f"{args.pdf} is the image itself: name another file.")
    if os.path.exists(args.pdf) and not args.overwrite:
        raise UsageError(f"{args.pdf} already exists: --overwrite replaces it.")
    is_image = os.path.isfile(args.what)
    made = _image(args) if is_image else _finder(args)
    outcome: dict[str, Any] = {"what": args.what, "pdf": args.pdf if made == "" else None, "reason": made or None}
    tell(outcome, made or f"{args.pdf}: {args.what}, {args.paper}", args.json)
    return int(made != "")


def _finder(args: argparse.Namespace) -> str:
    """Write a finder chart; why not, where nothing is called so."""
    from kochab.frames.atomic_file import write_atomically
    from kochab.sky.elements import kept_elements
    from kochab.sky.finder import NotFound, find
    from kochab.workflows.printed_sheet import finder_chart

    found = finish(find(args.what, datetime.now(UTC), args.site, kept_elements()))
    if isinstance(found, NotFound):
        return found.sentence
    write_atomically(args.pdf, finder_chart(found, args.paper, args.field))
    return ""


def _image(args: argparse.Namespace) -> str:
    """Solve the frame and write its sheet; why not, where it has no solution."""
    from kochab.core.solution import Solution
    from kochab.workflows.printed_sheet import write_sheet
    from kochab.workflows.solve_frame import solve_file

    solved = finish(solve_file(args.what))
    if not isinstance(solved.result, Solution):
        return solved.result.reason
    write_sheet(solved.frame, solved.result, args.pdf, args.paper)
    return ""
