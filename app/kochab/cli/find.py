"""``kochab find``: what a star, an object, a body or a position that a person types is, and where."""

import argparse
import math
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from kochab.cli.options import add_options, time_utc
from kochab.cli.output import radec, tell
from kochab.core.errors import printable
from kochab.core.progress import run as finish
from kochab.workflows.answers import found_json

if TYPE_CHECKING:
    from kochab.sky.finder import Found, NotFound


LONGEST = 5  # words of a name that was typed without quotes


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add ``find`` to the main parser."""
    parser = subparsers.add_parser(
        "find",
        description="Each TEXT is a name, a catalogue number or coordinates: 'M 42', 'alf Ori', Halley,"
        " 'Sharpless 155', '5h35m17s -5d23m'. Exit code: 0 all found, 1 one was not.",
    )
    parser.add_argument("texts", nargs="+", metavar="TEXT")
    parser.add_argument(
        "--time", metavar="ISO", help="UTC for bodies of the Solar System and the zenith (default: now)"
    )
    add_options(parser, "--site", "--json")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print a line a query; 1 when one is not found."""
    from kochab.sky.elements import kept_elements
    from kochab.sky.finder import NotFound, find, finder

    at = datetime.now(UTC) if args.time is None else time_utc(args.time)
    more, texts = kept_elements(), args.texts
    # "kochab find Omega Centauri" without quotes is one name in several words.
    if 1 < len(texts) <= LONGEST and finder().still(" ".join(texts), whole=True) is not None:
        texts = [" ".join(texts)]
    found = [finish(find(text, at, args.site, more)) for text in texts]
    for text, one in zip(texts, found, strict=True):
        tell(found_json(text, one), as_text(text, one), args.json)
    return int(any(isinstance(one, NotFound) for one in found))


def as_text(query: str, found: "Found | NotFound") -> str:
    """For a person: what it is, where, how bright and how large."""
    from kochab.sky.finder import NotFound
    from kochab.sky.kinds import kind_in_words

    if isinstance(found, NotFound):
        return printable(found.sentence)
    facts = [kind_in_words(found.kind), radec(found.ra_deg, found.dec_deg), found.constellation]
    if math.isfinite(found.magnitude):
        facts.append(f"{found.band or 'mag'} {found.magnitude:.1f}")
    if found.size_arcmin:
        facts.append(" x ".join(f"{side:.3g}" for side in dict.fromkeys(found.size_arcmin)) + " arcmin")
    others = f"\n  or {', '.join(found.alternatives)}" if found.alternatives else ""
    taken = "" if found.sure else f"{query} taken for "
    return f"{taken}{found.name}: {', '.join(filter(None, facts))}{others}"
