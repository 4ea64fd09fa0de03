"""A place on the sky from the command line: degrees, or any name the catalogue knows."""

import argparse

from app.core.errors import UsageError


def add_target(parser: argparse.ArgumentParser) -> None:
    """Add ``NAME``, ``--ra-deg`` and ``--dec-deg``."""
    parser.add_argument("name", nargs="*", metavar="NAME", help="star, Messier, NGC or HIP")
    parser.add_argument("--ra-deg", type=float, metavar="D", help="ICRS (J2000)")
    parser.add_argument("--dec-deg", type=float, metavar="D", help="ICRS (J2000)")


def target_deg(args: argparse.Namespace) -> tuple[float, float]:
    """ICRS degrees of what was asked for, proper motion applied to today."""
    if args.name:
        if args.ra_deg is not None or args.dec_deg is not None:
            raise UsageError("Give either a name or --ra-deg and --dec-deg.")
        return _named(" ".join(args.name))
    if args.ra_deg is None or args.dec_deg is None:
        raise UsageError("Say where: --ra-deg D --dec-deg D, or a name.")
    if not -360.0 <= args.ra_deg <= 360.0 or not -90.0 <= args.dec_deg <= 90.0:
        raise UsageError("--ra-deg and --dec-deg are no place on the sky.")
    return args.ra_deg % 360.0, args.dec_deg


def _named(name: str) -> tuple[float, float]:
    from datetime import UTC, datetime

    from app.workflows.goto_target import named_target

    found = named_target(name, datetime.now(UTC))
    return found.ra_deg, found.dec_deg
