"""``kochab mount ACTION``: the actions, and the mount and the frames that they share."""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from kochab.cli.options import CAMERA, MOUNT, SEARCH, add_options, capture_settings, options_of
from kochab.cli.output import reporting_failures, with_progress
from kochab.core.errors import UsageError
from kochab.core.mount import Home
from kochab.gear.actions import ACTIONS, TRACK
from kochab.text.translation import tr, tr_noop

if TYPE_CHECKING:
    from kochab.gear.mounts.guard import Guard
    from kochab.gear.mounts.motion_plan import Preview
    from kochab.workflows.fresh_frame import SolvedFrames

COMMANDS: dict[str, tuple[str, str]] = {
    "list": ("status:add_ports_action", "list the serial ports and their likely mounts"),
    "probe": ("status:add_ports_action", "find the mount; nothing moves"),
    "position": ("status:add_status_action", "position and state of the mount"),
    "sync": ("pointing:add_sync_or_goto", ACTIONS["sync"].help),
    "goto": ("pointing:add_sync_or_goto", ACTIONS["goto"].help),
    "park": ("rest:add_rest", ACTIONS["park"].help),
    "unpark": ("rest:add_rest", ACTIONS["unpark"].help),
    "home": ("rest:add_rest", ACTIONS["home"].help),
    "flip": ("rest:add_rest", ACTIONS["flip"].help),
    "track": ("rest:add_rest", TRACK),
    "set-clock": ("rest:add_rest", ACTIONS["set clock"].help),
    "set-site": ("rest:add_rest", ACTIONS["set site"].help),
    "stop": ("status:add_status_action", ACTIONS["stop"].help),
    "centre": ("pointing:add_centre", ACTIONS["centre"].help),
    "recover": ("recover:add_recover", ACTIONS["recover"].help),
    "disagree": ("recover:add_disagree", ACTIONS["diagnose"].help),
    "model": ("model:add_model", ACTIONS["model"].help),
    "spiral": ("model:add_spiral", ACTIONS["spiral"].help),
}
"""Action -> the function of this package that adds its parser, called with (actions, name, help)."""


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add the ``mount`` command and its actions."""
    parser = subparsers.add_parser(
        "mount",
        description="Every motion is checked first: horizon limit, meridian, Sun."
        " Exit code: 0 done, 1 failed or refused, 2 usage.",
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, (place, text) in COMMANDS.items():
        module, _, function = place.partition(":")
        getattr(import_module(f"{__name__}.{module}"), function)(actions, name, text)


def add_line_options(parser: argparse.ArgumentParser, run: Callable[[Any], int], moves: tuple[str, ...] = ()) -> None:
    """Add what every action that talks to a mount needs; ``moves`` are its safety switches."""
    add_options(parser, *MOUNT, "--profile", "--json")
    parser.add_argument("--fork", action="store_true", help="fork or wedge: no meridian flip needed")
    parser.add_argument(
        "--home",
        type=Home,
        choices=list(Home),
        help="Sky-Watcher motor board: tube at the pole and counterweight down now, at "
        "power-on, or when EQMod set its counters",
    )
    parser.add_argument("--equatorial", action="store_true", help="AZ-GTi, Celestron fork or unknown board on a wedge")
    for name, text in SWITCHES.items():
        if name in moves:
            parser.add_argument(f"--{name}", action="store_true", help=text)
    parser.set_defaults(run=reporting_failures(run, 1), limits=None, **dict.fromkeys(FALSE, False))


SWITCHES = {
    "yes": "carry it out (default: preview only)",
    "no-site": "allow it without a site, so without a horizon limit",
    "allow-flip": "allow a meridian flip",
    "trust-mount": "use the mount's clock and site where they differ from this computer's",
}


FALSE = ("no_site", "allow_flip", "trust_mount")


@contextmanager
def guarded_mount(args: argparse.Namespace, stop_first: bool = False) -> Iterator["Guard"]:
    """The mount of ``--port`` and ``--driver``, until what moves has been stopped and seen to stand.

    A line that breaks in a motion is opened again to stop it; meanwhile nobody knows whether the mount moves.
    """
    from kochab.core.errors import LineLostError

    with _opened(args, stop_first) as guard:
        try:
            yield guard
        except LineLostError as error:
            if not (guard.emergency.moving or guard.emergency.unfinished):
                raise
            from kochab.gear.mounts.emergency_stop import MAY_STILL_MOVE

            print(f"{error} {tr(MAY_STILL_MOVE)} {tr(OPENS_AGAIN)}", file=sys.stderr, flush=True)
            guard.stop_on_new_line()
            restarted = f" {guard.policy.slew_block_reason}" if guard.policy.slew_block_reason else ""
            raise LineLostError(f"{error} {tr(STANDS_AGAIN)}{restarted}") from error


OPENS_AGAIN = tr_noop("Kochab opens the line again to stop it.")
STANDS_AGAIN = tr_noop("The line is back, and Kochab has stopped the mount: it stands.")


def _opened(args: argparse.Namespace, stop_first: bool) -> "Guard":
    """The mount of ``--port`` and ``--driver``, either of which may be left to be found."""
    from kochab.gear.mounts.motion_plan import Limits
    from kochab.gear.session import EPOCH_NAMES, MountSelection, complete, guarded

    epoch = None if args.epoch is None else EPOCH_NAMES[args.epoch]
    given = MountSelection(args.port or "", args.driver or "", args.baud, epoch, args.home, args.equatorial)
    selection = with_progress("probing", complete(given))
    args.port, args.driver = selection.port, selection.driver
    limits = args.limits or Limits()
    limits = replace(
        limits,
        allow_without_site=args.no_site,
        allow_flip=args.allow_flip or limits.allow_flip,
        crosses_meridian=args.fork or limits.crosses_meridian,
    )
    guard = guarded(selection, args.site, limits=limits, stop_first=stop_first)
    if args.trust_mount:
        guard.clock_and_site.trust()
    return guard


def preview_lines(preview: "Preview", done: bool = False) -> list[str]:
    """What speaks for and against a motion, and how to have it done."""
    hint = [NOTHING_SENT] if preview.allowed and not done else []
    return [f"  {line}" for line in (*preview.refusals, *preview.confirmations, *preview.warnings, *hint)]


NOTHING_SENT = "preview only; add --yes to carry it out"

# -- Where ``centre``, ``recover`` and ``disagree`` get their frames from: files, or a camera --

SOLVE_TIMEOUT_S = 30.0


def add_camera(parser: argparse.ArgumentParser, files: bool = False) -> None:
    """Add the options of a camera and of the solver, and ``--frames`` for ``files``."""
    if files:
        parser.add_argument("--frames", nargs="+", metavar="F", help="files or folders of frames taken just now")
    add_options(parser, *CAMERA)
    parser.add_argument("--folder", metavar="DIR", help="the same as --source folder --address DIR")
    add_options(parser, *SEARCH, "--detector")
    parser.set_defaults(timeout=SOLVE_TIMEOUT_S)


@contextmanager
def mount_frames(args: argparse.Namespace) -> Iterator["SolvedFrames"]:
    """What the arguments mean; a camera is opened, and given back at the end.

    Raises UsageError when neither frames nor a camera are given, or both.
    """
    from kochab.workflows.fresh_frame import CameraFrames, FileFrames

    with_files = "frames" in args
    files = args.frames if with_files else None
    if [files, args.source or None, args.folder].count(None) != 2:
        frames = "--frames F..., " if with_files else ""
        raise UsageError(f"Give the source of the frames: {frames}--folder DIR or --source NAME.")
    options = options_of(args, args.detector)
    if files is not None:
        yield FileFrames(files, options)
        return
    from kochab.gear.cameras import open_camera

    source, address = (args.source, args.address) if args.folder is None else ("folder", args.folder)
    with closing(open_camera(source, address, capture_settings(args))) as camera:
        yield CameraFrames(camera, options)
