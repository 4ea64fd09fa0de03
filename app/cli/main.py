"""``kochab COMMAND ...``: finds the command, runs it, and turns every end into an exit code.

0 done, 1 a frame has no solution, 2 unusable arguments or input, 130 interrupted.
"""

import argparse
import os
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from app import __version__
from app.core.errors import KochabError

COMMANDS: dict[str, tuple[str, str]] = {
    "solve": ("app.cli.solve", "name the stars of frames and say where they point"),
    "identify": ("app.cli.identify", "the same from lists of star positions"),
    "detect": ("app.cli.detect", "find the stars of a frame"),
    "catalog": ("app.cli.catalog", "about the star catalogue: info, build, import, coverage"),
    "live": ("app.cli.live", "solve a camera's frames as they come"),
    "camera": ("app.cli.camera", "list cameras, take one frame"),
    "practice": ("app.cli.practice", "a simulated telescope to practise on"),
    "mount": (
        "app.cli.mount",
        "a telescope mount: probe, sync, goto, stop, centre, recover, disagree",
    ),
    "polar": ("app.cli.polar", "how far a mount's axis is from the pole, from two frames or more"),
    "bench": ("app.cli.bench", "measure and compare with the goals"),
}


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one sentence."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the arguments and exit 2."""
        self.exit(2, f"{self.prog}: {message[:1].upper()}{message[1:].rstrip('.')}.\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        args = build_parser(arguments).parse_args(_with_negative_lists(arguments))
        code: int = args.run(args)
        sys.stdout.flush()
    except SystemExit as end:  # argparse: --help, --version, bad arguments
        return end.code if isinstance(end.code, int) else 2
    except KochabError as error:
        print(f"kochab: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Whoever read our output has left; nothing may be written at exit either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 141
    return code


def _with_negative_lists(arguments: Sequence[str]) -> list[str]:
    """``--near -10,40,5`` as ``--near=-10,40,5``: argparse takes such a list for an option."""
    joined: list[str] = []
    for argument in arguments:
        if re.match(r"-[\d.]+,", argument) and joined and re.fullmatch(r"--[a-z-]+", joined[-1]):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def build_parser(arguments: Sequence[str]) -> Parser:
    """The parser for ``arguments``: only the command they name is imported."""
    parser = Parser(
        prog="kochab",
        description="Where your camera points. Without a command the window opens.",
        epilog="kochab COMMAND --help tells more about each command.",
    )
    parser.add_argument("--version", action="version", version=f"kochab {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, (module, text) in COMMANDS.items():
        if arguments and arguments[0] == name:
            import_module(module).add_parser(subparsers)
        else:
            subparsers.add_parser(name, help=text)
    return parser
