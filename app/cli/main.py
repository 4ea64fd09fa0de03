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
from app.cli import streams
from app.cli.signals import ended_by_signals
from app.core.errors import KochabError, UsageError

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
        start, _, left = message.partition("unrecognized arguments: ")
        if not start and left and not left.startswith("-"):
            message += ": name all files together, before the options or after them"
        self.exit(2, f"{self.prog}: {message[:1].upper()}{message[1:].rstrip('.')}.\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    streams.make_ready()
    try:
        code = _command(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # whoever read our output has left
        streams.give_up()
        return 141
    except OSError as error:  # standard output on a full disk, a folder that may not be read
        streams.give_up()
        streams.say(_plain(error))
        return 2
    return code


def _command(arguments: list[str]) -> int:
    """Run the command that ``arguments`` name, or say in one sentence why not."""
    if _is_astap(arguments):
        from app.cli.astap import run

        return run(arguments)
    try:
        _refuse_bare_files(arguments)
        args = build_parser(arguments).parse_args(_with_negative_lists(arguments))
        with ended_by_signals():
            code: int = args.run(args)
    except SystemExit as end:  # argparse: --help, --version, bad arguments
        return end.code if isinstance(end.code, int) else 2
    except KochabError as error:
        streams.say(str(error))
        return 2
    return code


def _is_astap(arguments: Sequence[str]) -> bool:
    """Whether these are ASTAP's arguments: ``-f``, among words of one dash."""
    return "-f" in arguments and re.match("-[a-z]", arguments[0]) is not None


def _refuse_bare_files(arguments: Sequence[str]) -> None:
    """Say which command is meant for files that were named without one."""
    first = arguments[0] if arguments else ""
    if first not in COMMANDS and not first.startswith("-") and os.path.isfile(first):
        raise UsageError(f"{first} is a file: kochab solve FILE... solves it.")


def _plain(error: OSError) -> str:
    """The system's own words; without a file's name they are about our output."""
    what = error.filename if isinstance(error.filename, str) else "The output"
    return f"{what} cannot be used: {error.strerror or error}."


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
        epilog="kochab COMMAND --help tells more about each command."
        " kochab -f FILE ... understands ASTAP's options, for programs that call it.",
    )
    parser.add_argument("--version", action="version", version=f"kochab {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, (module, text) in COMMANDS.items():
        if arguments and arguments[0] == name:
            import_module(module).add_parser(subparsers)
        else:
            subparsers.add_parser(name, help=text)
    return parser
