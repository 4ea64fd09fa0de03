"""Where ``centre``, ``recover`` and ``disagree`` get their frames from: files, or a camera."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from app.cli.choices import (
    add_detector,
    add_search,
    number,
    number_above_zero,
    options_of,
    whole_number,
)
from app.core.capture import CaptureSettings
from app.core.errors import UsageError
from app.core.hint import Site

if TYPE_CHECKING:
    from app.core.capture import CameraSource
    from app.workflows.fresh_frame import SolveNow

SOLVE_TIMEOUT_S = 30.0


@dataclass(slots=True)
class Eyes:
    """What solves frames; of the last one, when it was taken and where, if it says so."""

    solve_now: "SolveNow"
    taken: Callable[[], datetime | None]
    site: Callable[[], Site | None]
    used: Callable[[], list[str]]


def add_camera(parser: argparse.ArgumentParser) -> None:
    """Add the options of a camera and of the solver."""
    parser.add_argument("--source", metavar="NAME", help="kind of camera: folder, indi, alpaca, …")
    parser.add_argument(
        "--address", default="", metavar="WHERE", help="folder, host:port/camera or device"
    )
    parser.add_argument("--folder", metavar="DIR", help="the same as --source folder --address DIR")
    parser.add_argument("--exposure", type=number_above_zero, metavar="S", help="seconds")
    parser.add_argument("--gain", type=number, metavar="G", help="in the camera's own units")
    parser.add_argument("--binning", type=whole_number, metavar="N", help="pixels a side")
    add_search(parser)
    add_detector(parser)
    parser.set_defaults(timeout=SOLVE_TIMEOUT_S)


def add_frames(parser: argparse.ArgumentParser) -> None:
    """Add ``--frames`` beside the camera."""
    parser.add_argument(
        "--frames", nargs="+", metavar="F", help="files or folders of frames taken just now"
    )
    add_camera(parser)


@contextmanager
def eyes(args: argparse.Namespace) -> Iterator[Eyes]:
    """What the arguments mean; a camera is opened, and given back at the end.

    Raises
    ------
    UsageError
        Neither frames nor a camera, or both.

    """
    files = getattr(args, "frames", None)
    chosen = [files is not None, args.source is not None, args.folder is not None]
    if sum(chosen) != 1:
        frames = "--frames F..., " if hasattr(args, "frames") else ""
        raise UsageError(f"Say where frames come from: {frames}--folder DIR or --source NAME.")
    options = options_of(args, args.detector)
    if files is not None:
        from app.workflows.recover_frames import FileFrames

        found = FileFrames(files, options)
        yield Eyes(
            found.solve_now, lambda: found.time_utc, lambda: found.site, lambda: list(found.used)
        )
        return
    camera = _camera(args)
    try:
        from app.workflows.fresh_frame import solver_of

        yield Eyes(solver_of(camera, options), lambda: None, lambda: None, list)
    finally:
        camera.close()


def _camera(args: argparse.Namespace) -> "CameraSource":
    from app.cameras import open_camera

    settings = CaptureSettings(args.exposure, args.gain, args.binning)
    if args.folder is not None:
        return open_camera("folder", args.folder, settings)
    return open_camera(args.source, args.address, settings)
