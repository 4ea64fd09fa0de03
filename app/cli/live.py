"""``kochab live``: a camera runs, and every frame's pointing is printed until Ctrl-C."""

import argparse
import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

from app.cli.choices import (
    add_detector,
    add_search,
    number,
    number_above_zero,
    options_of,
    whole_number,
)
from app.cli.live_output import finite_json, live_json, live_line, replay_json, replay_line
from app.cli.output import tell_failure, to_line
from app.core.capture import CaptureSettings
from app.core.errors import DeviceError, KochabError, UsageError
from app.core.progress import Progress
from app.solve.options import SolveOptions
from app.solve.track import Tracker, TrackOptions
from app.workflows.live_engine import ProfiledTracker
from app.workflows.live_record import Recorder, recorded
from app.workflows.live_session import options_json
from app.workflows.live_solve import WARNING, Engine, live_solve
from app.workflows.live_update import LiveUpdate

SOLVE_TIMEOUT_S = 10.0
"""A frame that takes longer is given up: there is a newer one by then."""


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``live`` to the command line."""
    parser = subparsers.add_parser(
        "live",
        help="solve a camera's frames as they come",
        description="Runs until Ctrl-C. Exit code: 0 a frame was solved, 1 none was or the camera"
        " failed, 2 unusable arguments; with --replay 1 when an answer differs.",
    )
    parser.add_argument(
        "--source", metavar="NAME", help="kind of camera, see --list (default: folder)"
    )
    parser.add_argument(
        "--address", default="", metavar="WHERE", help="folder, host:port/camera or device"
    )
    add_settings(parser)
    parser.add_argument("--frames", type=_frames, metavar="N", help="end after so many")
    parser.add_argument(
        "--reconnect", action="store_true", help="wait for a camera that was lost to come back"
    )
    parser.add_argument("--record", metavar="DIR", help="write frames and solutions there")
    parser.add_argument(
        "--profile", metavar="NAME", help="camera and lens: what is learned of them is kept"
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--replay", metavar="DIR", help="solve a recorded session again")
    what.add_argument("--list", action="store_true", help="list sources and their cameras")
    parser.add_argument("--json", action="store_true", help="one JSON object a line a frame")
    add_search(parser)
    add_detector(parser)
    parser.set_defaults(run=run, timeout=SOLVE_TIMEOUT_S)


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add what can be set on a camera."""
    parser.add_argument("--exposure", type=number_above_zero, metavar="S", help="seconds")
    parser.add_argument("--gain", type=number, metavar="G", help="in the camera's own units")
    parser.add_argument("--binning", type=whole_number, metavar="N", help="pixels a side")


def settings_of(args: argparse.Namespace) -> CaptureSettings:
    """What the arguments set on the camera."""
    return CaptureSettings(args.exposure, args.gain, args.binning)


def _frames(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a count of frames")
    return int(text)


def run(args: argparse.Namespace) -> int:
    """List, replay or solve a stream."""
    if args.list:
        from app.cli.camera import list_cameras

        return list_cameras(args.source, args.address, args.json)
    work: Callable[[argparse.Namespace], int] = _replay if args.replay else _live
    try:
        return work(args)
    except UsageError:
        raise
    except KochabError as error:
        tell_failure(error, args.json)
        return 1 if isinstance(error, DeviceError) else 2


def _live(args: argparse.Namespace) -> int:
    from app.cameras import open_camera
    from app.workflows.live_capture import Capture

    options = options_of(args, args.detector)
    settings = settings_of(args)
    source = args.source or "folder"
    if source == "folder" and not args.address:
        raise UsageError("Say which folder your capture program writes into: --address DIR.")
    capture = Capture(lambda: open_camera(source, args.address, settings), args.reconnect)
    engine = _engine(options, args.profile)
    live = live_solve(capture, engine, args.frames)
    if args.record:
        about = {
            "source": source,
            "address": args.address,
            "settings": asdict(settings),
            "solve": options_json(options),
        }
        live = recorded(live, Recorder(Path(args.record), finite_json, about))
    solved = looked_at = 0
    with closing(live):
        try:
            for step in live:
                if isinstance(step, LiveUpdate):
                    looked_at += 1
                    solved += step.track.solution is not None
                    _print(step, args.json)
                else:
                    _warn(step)
        except KeyboardInterrupt:
            pass  # how a person ends it
    print(f"kochab: {solved} of {looked_at} frames solved.", file=sys.stderr)
    if isinstance(engine, ProfiledTracker):
        _keep(engine)
    return 0 if solved else 1


def _print(update: LiveUpdate, as_json: bool) -> None:
    print(to_line(live_json(update)) if as_json else live_line(update), flush=True)
    if not as_json:
        for sentence in update.warnings:
            print(f"kochab: {sentence}", file=sys.stderr)


def _warn(step: Progress) -> None:
    if step.stage == WARNING:
        print(f"kochab: {step.detail}", file=sys.stderr)


def _replay(args: argparse.Namespace) -> int:
    from app.workflows.live_replay import Replayed, recorded_options, replay

    if args.record:
        raise UsageError("--replay and --record cannot be used together.")
    folder = Path(args.replay)
    same = True
    with closing(replay(folder, _engine(recorded_options(folder)))) as steps:
        for step in steps:
            if isinstance(step, Replayed):
                same = same and step.agrees and step.intact
                line = to_line(replay_json(step)) if args.json else replay_line(step)
                print(line, flush=True)
    return 0 if same else 1


def _engine(options: SolveOptions, profile: str | None = None) -> Engine:
    track = TrackOptions(solve=options)
    return ProfiledTracker(profile, track) if profile else Tracker(options=track)


def _keep(engine: ProfiledTracker) -> None:
    profile = engine.profile
    if profile is None or engine.keep() is None:
        return
    focal, sigma = profile.camera.focal_px, profile.sigma["focal_px"]
    print(
        f"kochab: {engine.name}: focal length {focal:.2f} px, sigma {sigma:.2f} px,"
        f" from {profile.frames} frames; kept.",
        file=sys.stderr,
    )
