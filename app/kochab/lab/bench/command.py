"""``kochab bench NAME``: measure, and compare with the goals."""

import argparse
import json
import sys
from typing import Any

from kochab.lab.bench import BENCHES, BY_ROWS, Only, load_bench, measure_rows


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``bench`` to the command line."""
    parser = subparsers.add_parser("bench", help="measure and compare with the goals")
    parser.add_argument("name", choices=sorted(BENCHES), help="what to measure")
    parser.add_argument("--quick", action="store_true", help="a small part, in about a minute")
    parser.add_argument("--only", nargs="+", metavar="ROW", help=f"{', '.join(BY_ROWS)}: rows so named")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the bench; 0 when it ran, whether or not the goals were met."""
    if args.only:
        result = measure_rows(args.name, args.quick, _report, Only(tuple(args.only)))
    else:
        result = load_bench(args.name)(args.quick, _report)
    print(json.dumps(result.as_json()) if args.json else result.as_text())
    return 0


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
