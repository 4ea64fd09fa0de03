"""``kochab live`` and ``kochab camera``: a camera's frames, solved as they come, listed or taken."""

import argparse
import os
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from time import monotonic
from typing import Any

from kochab.cli.live_output import finite_json, live_json, live_line, replay_json, replay_line
from kochab.cli.options import (
    CAMERA_SETTINGS,
    SEARCH,
    add_options,
    capture_settings,
    number_above_zero,
    options_of,
    valued,
    whole,
)
from kochab.cli.output import Json, reporting_failures, tell
from kochab.cli.process import say
from kochab.core.errors import DeviceError, KochabError, NoAnswerError, UsageError, printable
from kochab.core.frame import Frame
from kochab.workflows.live.session import SESSION, Recorder, options_json, recorded
from kochab.workflows.live.solve import WARNING, ProfiledTracker, live_solve
from kochab.workflows.live.update import LiveUpdate

SOLVE_TIMEOUT_S = 10.0  # a frame that takes longer is given up: there is a newer one by then


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``live`` to the command line."""
    parser = subparsers.add_parser(
        "live",
        description="Runs until Ctrl-C. Exit code: 0 a frame was solved, 1 none was or the camera"
        " failed, 2 unusable arguments; with --replay 1 when a solution differs.",
    )
    add_options(parser, "--source", help="kind of camera, see --list (default: folder)")
    add_options(parser, "--address", *CAMERA_SETTINGS)
    parser.add_argument("--frames", type=whole(1, what="count of frames"), metavar="N", help="stop after N frames")
    parser.add_argument("--reconnect", action="store_true", help="reconnect automatically")
    parser.add_argument("--record", metavar="DIR", help="record frames and solutions there")
    add_options(parser, "--profile", help="equipment profile, see kochab profile; also saves the camera calibration")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--replay", metavar="DIR", help="solve a recorded session again")
    what.add_argument("--list", action="store_true", help="list sources and their cameras")
    parser.add_argument("--json", action="store_true", help="one line of JSON per frame")
    add_options(parser, *SEARCH, "--detector")
    parser.set_defaults(run=reporting_failures(run), timeout=SOLVE_TIMEOUT_S)


def run(args: argparse.Namespace) -> int:
    """List, replay or solve a stream."""
    if args.list:
        return _list(args)
    return _replay(args) if args.replay else _live(args)


def _live(args: argparse.Namespace) -> int:
    from kochab.gear.cameras import open_camera
    from kochab.workflows.live.capture import Capture

    options = options_of(args, args.detector)
    settings = capture_settings(args)
    source = args.source or "folder"
    if source == "folder" and not args.address:
        raise UsageError("Give the folder your capture program saves to: --address DIR.")
    capture = Capture(lambda: open_camera(source, args.address, settings), args.reconnect)
    engine = ProfiledTracker(args.profile or "", options)
    live = live_solve(capture, engine, args.frames)
    if args.record:
        if source == "folder":
            _refuse_watched(Path(args.record), Path(args.address))
        camera = {"source": source, "address": args.address, "settings": asdict(settings)}
        live = recorded(live, Recorder(Path(args.record), finite_json, camera | {"solve": options_json(options)}))
    solved = looked_at = 0
    with closing(live):
        try:
            for step in live:
                if isinstance(step, LiveUpdate):
                    looked_at += 1
                    solved += step.track.solution is not None
                    _print(step, args.json)
                elif step.stage == WARNING:
                    say(step.detail)
        except KeyboardInterrupt:
            pass  # how a person ends it
    say(f"{solved} of {looked_at} frames solved.")
    profile = engine.profile
    if engine.keep() is not None and profile is not None:
        focal, sigma = profile.camera.focal_px, profile.sigma["focal_px"]
        say(f"{engine.name}: focal length {focal:.2f} px, sigma {sigma:.2f} px, from {profile.frames} frames; saved.")
    return 0 if solved else 1


def _refuse_watched(record: Path, watched: Path) -> None:
    """A recording into the watched folder would be read again, and would mix with its frames."""
    if (record / SESSION).exists():
        return  # the recorder says so
    if record.resolve().is_relative_to(watched.resolve()):
        raise UsageError(f"--record {record} is inside the watched folder; choose another.")


def _print(update: LiveUpdate, as_json: bool) -> None:
    tell(live_json(update), live_line(update), as_json)
    if not as_json:
        for sentence in update.warnings:
            say(sentence)


def _replay(args: argparse.Namespace) -> int:
    from kochab.workflows.live.session import Replayed, recorded_options, replay

    if args.record:
        raise UsageError("--replay and --record cannot be used together.")
    folder = Path(args.replay)
    same = True
    engine = ProfiledTracker(options=recorded_options(folder))
    with closing(replay(folder, engine)) as steps:
        for step in steps:
            if isinstance(step, Replayed):
                same = same and step.agrees and step.intact
                tell(replay_json(step), replay_line(step), args.json)
    return 0 if same else 1


# ``kochab camera list`` and ``kochab camera take``: which cameras there are, and one frame.

FITS = (".fits", ".fit", ".fts")


def add_camera_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``camera`` and its actions to the command line."""
    parser = subparsers.add_parser("camera")
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="kinds of cameras, what they need, and the cameras found")
    listing.add_argument("--source", metavar="NAME", help="only this kind")
    take = actions.add_parser("take", help="take a frame and write it as FITS")
    take.add_argument("--source", metavar="NAME", help="kind of camera")
    take.add_argument("--output", "-o", required=True, metavar="FITS", help="the .fits to write")
    add_options(take, "--profile", "--overwrite", *CAMERA_SETTINGS)
    limit = "time limit after the exposure, seconds (default: %(default)g)"
    take.add_argument("--wait", **valued("S", limit, number_above_zero, default=60.0))
    for action, do in ((listing, _list), (take, _take)):
        add_options(action, "--address")
        action.add_argument("--json", action="store_true", help="one JSON object a line")
        action.set_defaults(run=reporting_failures(do))


def _list(args: argparse.Namespace) -> int:
    """Print every kind of camera, or one, with what can be opened now."""
    from kochab.gear.cameras import SOURCES

    if args.source is not None:
        SOURCES.check(args.source)
    for name in SOURCES.loaded() if args.source is None else (args.source,):
        told = _told(name, args.address)
        tell(told, _text(told), args.json)
    return 0


def _told(name: str, address: str) -> Json:
    from kochab.gear.cameras import list_devices, missing

    told: Json = {"source": name, "missing": missing(name), "cameras": []}
    if told["missing"] is None:
        try:
            told["cameras"] = [
                {"address": d.address, "description": d.description} for d in list_devices(name, address)
            ]
        except DeviceError as error:
            told["error"] = str(error)
    return told


def _text(told: Json) -> str:
    lines = [told["source"]]
    lines += [f"  {c['address']}  {c['description']}" for c in told["cameras"]]
    said = told["missing"] or told.get("error")
    if said or not told["cameras"]:
        lines.append(f"  {said or 'none found; see --address'}")
    return "\n".join(lines)


def _take(args: argparse.Namespace) -> int:
    from kochab.frames.fits_write import write_fits
    from kochab.frames.outputs import refuse_input, refuse_overwriting
    from kochab.gear.cameras import open_camera

    if not args.source:
        raise UsageError("Choose a camera: --source NAME, or --profile NAME.")
    target = Path(args.output)
    if target.suffix.lower() not in FITS:
        raise UsageError(f"--output {target}: the frame is written as FITS, name it .fits.")
    if not target.parent.is_dir():  # told before the exposure, not after
        raise KochabError(f"{target} cannot be written: there is no folder {target.parent}.")
    if not os.access(target.parent, os.W_OK):
        raise KochabError(f"{target} cannot be written: no permission to write to its folder.")
    with closing(open_camera(args.source, args.address, capture_settings(args))) as camera:
        refuse_overwriting([target], overwrite=args.overwrite)
        frame = None
        deadline = monotonic() + args.wait + (args.exposure or 0.0)
        while frame is None and monotonic() < deadline:
            frame = camera.next_frame(0.2)
    if frame is None:
        raise NoAnswerError(f"No frame came from {args.address or args.source} in time.")
    refuse_input(target, [frame.path] if frame.path else [])
    try:
        write_fits(frame, target)
    except OSError as error:
        raise KochabError(f"{args.output} cannot be written: {error.strerror}.") from None
    told = _frame_json(frame, args.output)
    tell(told, f"{printable(told['file'])}: {told['width']} x {told['height']} px", args.json)
    return 0


def _frame_json(frame: Frame, file: str) -> Json:
    hint = frame.hint
    return {
        "file": file,
        "width": frame.width,
        "height": frame.height,
        "bayer": frame.bayer,
        "exposure_s": hint.exposure_s,
        "time_utc": hint.time_utc and hint.time_utc.isoformat(),
        "camera": hint.camera,
        "warnings": list(frame.warnings),
    }
