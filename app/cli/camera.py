"""``kochab camera list`` and ``kochab camera take``: which cameras there are, and one frame."""

import argparse
import os
from pathlib import Path
from time import monotonic
from typing import Any

from app.cli.choices import number_above_zero
from app.cli.live import add_settings, settings_of
from app.cli.output import Json, tell_failure, to_line
from app.core.errors import DeviceError, KochabError, NoAnswerError, UsageError
from app.core.frame import Frame

FITS = (".fits", ".fit", ".fts")


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``camera`` and its actions to the command line."""
    parser = subparsers.add_parser("camera", help="list cameras, take one frame")
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="sources, what they need, and their cameras")
    listing.add_argument("--source", metavar="NAME", help="only this kind")
    take = actions.add_parser("take", help="one frame into a FITS file")
    take.add_argument("--source", required=True, metavar="NAME", help="kind of camera")
    take.add_argument("--output", "-o", required=True, metavar="FITS", help="the .fits to write")
    add_settings(take)
    take.add_argument(
        "--wait",
        type=number_above_zero,
        default=60.0,
        metavar="S",
        help="longest, besides exposing (default: %(default)g)",
    )
    for action in (listing, take):
        action.add_argument(
            "--address", default="", metavar="WHERE", help="folder, host:port/camera or device"
        )
        action.add_argument("--json", action="store_true", help="one JSON object a line")
        action.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do what was asked: 0 done, 1 the camera failed, 2 the file cannot be written."""
    if args.action == "list":
        return list_cameras(args.source, args.address, args.json)
    try:
        return _take(args)
    except UsageError:
        raise
    except KochabError as error:
        tell_failure(error, args.json)
        return 1 if isinstance(error, DeviceError) else 2


def list_cameras(source: str | None, address: str, as_json: bool) -> int:
    """Print every kind of camera, or one, with what can be opened now."""
    from app.cameras import SOURCES, source_kind

    if source is not None:
        source_kind(source)
    for name in SOURCES if source is None else (source,):
        told = _told(name, address)
        print(to_line(told) if as_json else _text(told), flush=True)
    return 0


def _told(name: str, address: str) -> Json:
    from app.cameras import list_devices, missing

    told: Json = {"source": name, "missing": missing(name), "cameras": []}
    if told["missing"] is None:
        try:
            told["cameras"] = [
                {"address": d.address, "description": d.description}
                for d in list_devices(name, address)
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
    from app.cameras import open_camera
    from app.frames.fits_write import write_fits

    target = Path(args.output)
    if target.suffix.lower() not in FITS:
        raise UsageError(f"--output {target}: the frame is written as FITS, name it .fits.")
    if not target.parent.is_dir():  # told before the exposure, not after
        raise KochabError(f"{target} cannot be written: there is no folder {target.parent}.")
    if not os.access(target.parent, os.W_OK):
        raise KochabError(f"{target} cannot be written: the folder may not be written to.")
    camera = open_camera(args.source, args.address, settings_of(args))
    try:
        frame = None
        deadline = monotonic() + args.wait + (args.exposure or 0.0)
        while frame is None and monotonic() < deadline:
            frame = camera.next_frame(0.2)
    finally:
        camera.close()
    if frame is None:
        raise NoAnswerError(f"No frame came from {args.address or args.source} in time.")
    try:
        write_fits(frame, target)
    except OSError as error:
        raise KochabError(f"{args.output} cannot be written: {error.strerror}.") from None
    told = _frame_json(frame, args.output)
    print(to_line(told) if args.json else f"{told['file']}: {told['width']} x {told['height']} px")
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
