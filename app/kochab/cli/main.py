"""``kochab COMMAND ...``: finds the command, runs it, and turns every end into an exit code.

0 done, 1 a frame has no solution, 2 unusable arguments or input, 130 interrupted.
"""

import argparse
import errno
import os
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from kochab.cli import process
from kochab.cli.faces import FACES, face_of
from kochab.cli.process import ended_by_signals
from kochab.cli.warm import NO_WORKER
from kochab.core import __version__
from kochab.core.errors import KochabError, UsageError

COMMANDS: dict[str, tuple[str, str]] = {
    "solve": ("kochab.cli.solve:add_parser", "plate solve frames"),
    "identify": ("kochab.cli.solve:add_identify_parser", "plate solve lists of star positions"),
    "detect": ("kochab.cli.solve:add_detect_parser", "find the stars of a frame"),
    "find": ("kochab.cli.find:add_parser", "where a star, an object or a body is"),
    "chart": ("kochab.cli.chart:add_parser", "a finder chart or an annotated image to print, as PDF"),
    "catalog": ("kochab.cli.catalog:add_parser", "star catalogues: info, list, use, build, import, coverage"),
    "live": ("kochab.cli.live:add_parser", "plate solve a camera's frames as they arrive"),
    "camera": ("kochab.cli.live:add_camera_parser", "list cameras, take a frame"),
    "profile": ("kochab.cli.profile:add_parser", "equipment profiles: list, show, save, remove"),
    "practice": ("kochab.cli.practice:add_parser", "a simulated telescope to practise on"),
    "mount": ("kochab.cli.mount:add_parser", "a telescope mount: probe, sync, goto, stop, centre, recover, disagree"),
    "polar": ("kochab.cli.polar:add_parser", "polar alignment error, from two frames or more"),
    "night": ("kochab.cli.night:add_parser", "what a folder of frames says of the night: a page and a table"),
    "station": (
        "kochab.cli.station:add_parser",
        "a camera that stands still: azimuth and altitude of its pixels, cloud",
    ),
    "archive": ("kochab.cli.archive:add_parser", "frames by the million as one Parquet table, on Dask"),
    "telescope": ("kochab.cli.telescope:add_parser", "a telescope for SkySafari, Stellarium, KStars"),
    "serve": ("kochab.server.command:add_parser", "a worker that makes solve and others quick"),
    "bench": ("kochab.lab.bench.command:add_parser", "measure and compare with the goals"),
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
    process.make_ready()
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        arguments = [argument for argument in arguments if argument != NO_WORKER]
        code = _of_face(face, arguments) if (face := face_of(arguments)) else _command(arguments)
        # A full disk or a closed pipe shows only when the buffer is written: here, not at the interpreter's end.
        sys.stdout.flush()
    except KeyboardInterrupt:
        return 130
    except OSError as error:  # standard output on a full disk, a folder that may not be read
        process.give_up()
        if _reader_left(error):
            return 141
        process.say(_plain(error))
        return 2
    except Exception as error:  # our own mistake: its traceback goes to the journal
        process.say(process.fault(error))
        return 2
    return code


def _of_face(face: str, arguments: list[str]) -> int:
    """Answer as the program called ``face`` does."""
    module, _, function = FACES[face].partition(":")
    code: int = getattr(import_module(module), function)(arguments[arguments[0] == face :])
    return code


def _command(arguments: list[str]) -> int:
    """Run the command that ``arguments`` name, or say in one sentence why not."""
    # Taken out here so that it works anywhere in the line; argparse would want it before the command.
    if "--debug" in arguments:
        arguments = [argument for argument in arguments if argument != "--debug"]
        process.show_journal()
    try:
        _refuse_bare_files(arguments)
        args = build_parser(arguments).parse_args(_with_negative_lists(arguments))
        # args.profile is the name given; use_profile() replaces it by the name of the camera calibration.
        if getattr(args, "profile", None) is not None:
            from kochab.cli.profile import use_profile

            use_profile(args)
        args.main = main  # for a command that does others (serve)
        with ended_by_signals():
            code: int = args.run(args)
    except SystemExit as end:  # argparse: --help, --version, bad arguments
        return end.code if isinstance(end.code, int) else 2
    except KochabError as error:
        process.say(str(error))
        return 2
    return code


def _refuse_bare_files(arguments: Sequence[str]) -> None:
    """Say which command is meant for files that were named without one."""
    first = arguments[0] if arguments else ""
    if first not in COMMANDS and not first.startswith("-") and os.path.isfile(first):
        raise UsageError(f"{first} is a file: kochab solve FILE... solves it.")


def _reader_left(error: OSError) -> bool:
    """Whether whoever read our output has ended; Windows calls a write into such a pipe an invalid argument."""
    of_windows = sys.platform == "win32" and error.errno == errno.EINVAL and error.filename is None
    return of_windows or isinstance(error, BrokenPipeError)


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
        description="Plate solving, polar alignment and mounts. Without a command the window opens.",
        epilog="kochab COMMAND --help describes a command."
        " kochab -f FILE ... takes ASTAP's options, for programs that call ASTAP."
        " kochab --language de opens the window in German, where it has it.",
    )
    parser.add_argument("--version", action="version", version=f"kochab {__version__}")
    parser.add_argument(
        "--debug", action="store_true", help="show the journal on standard error; works with any command"
    )
    parser.add_argument(NO_WORKER, action="store_true", help="do the work here though kochab serve runs")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    if arguments and arguments[0] in COMMANDS:
        module, _, function = COMMANDS[arguments[0]][0].partition(":")
        getattr(import_module(module), function)(subparsers)
    else:  # what they do appears in --help, and costs no import
        for name, (_, text) in COMMANDS.items():
            subparsers.add_parser(name, help=text)
    return parser
