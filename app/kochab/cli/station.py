"""``kochab station``: a camera that stands still, such as an all-sky or meteor camera, calibrated by name."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kochab.cli.options import SEARCH, add_options, number, options_of, time_utc
from kochab.cli.output import ProgressLine, tell
from kochab.cli.process import say
from kochab.cli.solve import named_frames
from kochab.core.errors import KochabError, UsageError
from kochab.core.progress import run as finish
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:  # they load numpy, which --help has no need of
    from datetime import datetime

    from kochab.solver.fixed_camera import FixedCamera
    from kochab.workflows.station import Cloud, SkyCover


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``station`` and its actions."""
    parser = subparsers.add_parser(
        "station",
        description="An all-sky or meteor camera is calibrated once, from frames of clear nights, and kept by name."
        " Then each of its pixels has an azimuth and an altitude, and missing stars tell cloud. Exit code: 0 done,"
        " 1 not possible, 2 usage.",
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    calibrate = actions.add_parser("calibrate", help="calibrate a camera from frames of clear nights")
    calibrate.add_argument("name", metavar="NAME")
    calibrate.add_argument("frames", nargs="+", metavar="FRAME", help="frames, or folders of them")
    add_options(calibrate, "--site", *SEARCH, "--overwrite")
    altaz = actions.add_parser("altaz", help="azimuth and altitude of pixels")
    altaz.add_argument("name", metavar="NAME")
    altaz.add_argument("pixels", nargs="+", metavar="X,Y", help="0,0 is the centre of the first pixel")
    pixel = actions.add_parser("pixel", help="pixels of azimuths and altitudes")
    pixel.add_argument("name", metavar="NAME")
    pixel.add_argument("places", nargs="+", metavar="AZ,ALT", help="degrees; azimuth from north through east")
    cloud = actions.add_parser("cloud", help="cloud cover of frames, by missing stars")
    cloud.add_argument("name", metavar="NAME")
    cloud.add_argument("frames", nargs="+", metavar="FRAME", help="frames, or folders of them")
    cloud.add_argument("--annotate", metavar="PNG", help="save the frame with stars seen and missing; for one frame")
    add_options(cloud, "--overwrite")
    horizon = actions.add_parser("horizon", help="write the free horizon for kochab profile save --horizon")
    mask = actions.add_parser("mask", help="write which pixels are sky: white above trees and houses")
    for action, what in ((horizon, "FILE"), (mask, "PNG")):
        action.add_argument("name", metavar="NAME")
        action.add_argument("file", metavar=what, type=Path)
        add_options(action, "--overwrite")
    listing = actions.add_parser("list", help="all calibrated cameras")
    show = actions.add_parser("show", help="what is known of one")
    remove = actions.add_parser("remove", help="delete a calibration")
    for action in (show, remove):
        action.add_argument("name", metavar="NAME")
    about = "when the frame was taken, UTC, where its file does not say"
    for action, text in ((calibrate, about), (cloud, about), (altaz, "add RA and Dec at this time, UTC")):
        action.add_argument("--time", metavar="ISO", help=text)
    runs = {
        **{calibrate: _calibrate, altaz: _altaz, pixel: _pixel, cloud: _cloud, horizon: _horizon, mask: _mask},
        **{listing: _list, show: _show, remove: _remove},
    }
    for action, run in runs.items():
        add_options(action, "--json")
        action.set_defaults(run=run)


def _time(args: argparse.Namespace) -> "datetime | None":
    return None if args.time is None else time_utc(args.time)


def _frames(args: argparse.Namespace) -> list[str]:
    _, files = named_frames(args.frames)
    if args.time is not None and len(files) > 1:
        raise UsageError("--time is for one frame.")
    return files


def _pair(text: str, what: str) -> tuple[float, float]:
    try:
        first, second = (number(part) for part in text.split(","))
    except (ValueError, argparse.ArgumentTypeError):
        raise UsageError(f"{text} is not {what}.") from None
    return first, second


def _calibrate(args: argparse.Namespace) -> int:
    from kochab.solver.fixed_camera import fixed_camera_path, save_fixed_camera
    from kochab.workflows.station import calibrate

    files, time = _frames(args), _time(args)
    if fixed_camera_path(args.name).exists() and not args.overwrite:
        raise UsageError(f"{args.name} is calibrated already: --overwrite calibrates it anew.")
    line = ProgressLine("station")
    try:
        camera, left = finish(calibrate(args.name, files, args.site, options_of(args), time), line)
    finally:
        line.clear()
    for sentence in left:
        say(sentence)
    save_fixed_camera(camera)
    tell(camera_json(camera), text_of(camera), args.json)
    return 0


def _altaz(args: argparse.Namespace) -> int:
    import numpy as np

    from kochab.core.attitude import radec_deg
    from kochab.sky.horizon import Horizon
    from kochab.solver.fixed_camera import load_fixed_camera

    camera, time = load_fixed_camera(args.name), _time(args)
    pixels = np.array([_pair(text, "X,Y in pixels") for text in args.pixels])
    missing = 0
    for (x, y), azimuth, altitude, sigma in zip(pixels, *camera.altaz_deg(pixels), strict=True):
        seen = bool(np.isfinite(altitude))
        missing += not seen
        one: Json = {
            "x": x,
            "y": y,
            "azimuth_deg": azimuth if seen else None,
            "altitude_deg": altitude if seen else None,
        }
        one["sigma_deg"] = sigma if seen else None
        text = f"{x:g},{y:g}  " + ("outside the lens's circle" if not seen else f"az {azimuth:.3f}  alt {altitude:.3f}")
        if seen:
            text += f"  +-{sigma:.3f} deg"
        if seen and time is not None:
            ray = camera.directions(np.array([[x, y]]))
            one["ra_deg"], one["dec_deg"] = radec_deg(Horizon(camera.site, time).catalogue(ray)[0])
            text += f"  ra {one['ra_deg']:.3f}  dec {one['dec_deg']:+.3f}"
        tell(one, text, args.json)
    return int(missing > 0)


def _pixel(args: argparse.Namespace) -> int:
    import numpy as np

    from kochab.solver.fixed_camera import directions_of, load_fixed_camera

    camera = load_fixed_camera(args.name)
    places = np.array([_pair(text, "AZ,ALT in degrees") for text in args.places])
    missing = 0
    for (azimuth, altitude), (x, y) in zip(places, camera.pixels(directions_of(*places.T)), strict=True):
        seen = bool(np.isfinite(x))
        missing += not seen
        one = {"azimuth_deg": azimuth, "altitude_deg": altitude, "x": x if seen else None, "y": y if seen else None}
        tell(one, f"{azimuth:g},{altitude:g}  " + (f"{x:.2f},{y:.2f}" if seen else "outside the frame"), args.json)
    return int(missing > 0)


def _cloud(args: argparse.Namespace) -> int:
    from kochab.solver.fixed_camera import load_fixed_camera
    from kochab.workflows.station import sky_cover

    camera, files, time = load_fixed_camera(args.name), _frames(args), _time(args)
    if args.annotate:
        _refuse(args, Path(args.annotate), files)
        if len(files) > 1:
            raise UsageError("--annotate is for one frame.")
    line = ProgressLine("station")
    failed = 0
    for file in files:
        try:
            cover = finish(sky_cover(camera, file, time), line)
        except KochabError as error:
            failed += 1
            line.clear()
            tell({"file": file, "error": str(error)}, str(error), args.json)
            continue
        line.clear()
        tell(cover_json(cover), cover_text(cover), args.json)
        if args.annotate:
            _write_picture(camera, cover, Path(args.annotate))
    return int(failed > 0)


def _refuse(args: argparse.Namespace, target: Path, inputs: list[str]) -> None:
    from kochab.frames.outputs import refuse_overwriting

    if target.suffix.lower() != ".png" and args.action != "horizon":
        raise UsageError(f"{target}: the picture is a .png.")
    refuse_overwriting([target], inputs, args.overwrite)


def _write_picture(camera: "FixedCamera", cover: "SkyCover", target: Path) -> None:
    from kochab.frames import read_frame
    from kochab.frames.atomic_file import atomic_file
    from kochab.workflows.station import picture_of_cover

    with atomic_file(target) as part:
        picture_of_cover(read_frame(cover.file), camera, cover).save(part, "PNG")


def _horizon(args: argparse.Namespace) -> int:
    from kochab.frames.atomic_file import write_atomically
    from kochab.solver.fixed_camera import load_fixed_camera

    camera = load_fixed_camera(args.name)
    if camera.horizon_deg is None:
        raise UsageError(f"The frames that calibrated {args.name} show no clear sky to tell its horizon.")
    _refuse(args, args.file, [])
    rows = [f"{azimuth:.1f} {altitude:.1f}" for azimuth, altitude in camera.horizon_deg]
    write_atomically(args.file, "# azimuth altitude, degrees\n" + "\n".join(rows) + "\n")
    tell({"horizon": str(args.file)}, f"{args.file}: {len(rows)} azimuths", args.json)
    return 0


def _mask(args: argparse.Namespace) -> int:
    import numpy as np
    from PIL import Image

    from kochab.frames.atomic_file import atomic_file
    from kochab.solver.fixed_camera import load_fixed_camera

    camera = load_fixed_camera(args.name)
    _refuse(args, args.file, [])
    line = ProgressLine("station")
    try:
        sky = finish(camera.sky(), line) > 0.0
    finally:
        line.clear()
    with atomic_file(args.file) as part:
        Image.fromarray(np.where(sky, 255, 0).astype(np.uint8)).save(part, "PNG")
    share = float(sky.mean())
    tell({"mask": str(args.file), "sky": share}, f"{args.file}: {100.0 * share:.0f} % of the pixels are sky", args.json)
    return 0


def _list(args: argparse.Namespace) -> int:
    from kochab.solver.fixed_camera import fixed_cameras

    cameras = fixed_cameras()
    for camera in cameras:
        tell(camera_json(camera), f"{camera.name}   {camera.frames} frames, {camera.stars} stars", args.json)
    if not cameras and not args.json:
        print("No camera is calibrated yet: kochab station calibrate NAME FRAME... does it.")
    return 0


def _show(args: argparse.Namespace) -> int:
    from kochab.solver.fixed_camera import load_fixed_camera

    camera = load_fixed_camera(args.name)
    tell(camera_json(camera), text_of(camera), args.json)
    return 0


def _remove(args: argparse.Namespace) -> int:
    from kochab.solver.fixed_camera import fixed_camera_path

    path = fixed_camera_path(args.name)
    if not path.exists():
        raise UsageError(f"There is no calibration “{args.name}”.")
    path.unlink()
    tell({"removed": args.name}, f"removed {args.name}", args.json)
    return 0


def camera_json(camera: "FixedCamera") -> Json:
    """The JSON of a calibration."""
    from dataclasses import astuple

    azimuth, altitude, sigma = (float(value[0]) for value in camera.altaz_deg(camera.middle))
    return {
        "name": camera.name,
        "site": list(astuple(camera.site)),
        "azimuth_deg": azimuth,
        "altitude_deg": altitude,
        "sigma_deg": sigma,
        "projection": camera.camera.projection,
        "fov_deg": list(camera.camera.fov_deg),
        "rms_px": camera.rms_px,
        "model_px": camera.model_px,
        "stars": camera.stars,
        "frames": camera.frames,
        "limit_mag": camera.limit_mag,
        "seen": camera.seen,
        "horizon_deg": None if camera.horizon_deg is None else camera.horizon_deg.tolist(),
    }


def text_of(camera: "FixedCamera") -> str:
    """The same for a person."""
    o = camera_json(camera)
    w, h = o["fov_deg"]
    lines = [
        camera.name,
        f"middle   az {o['azimuth_deg']:.3f}  alt {o['altitude_deg']:.3f}  +-{o['sigma_deg']:.3f} deg",
        f"lens     {o['projection']}, {w:.1f} x {h:.1f} deg",
        f"fit      {o['stars']} stars of {o['frames']} frames, RMS {o['rms_px']:.2f} px",
    ]
    if camera.limit_mag is None or camera.horizon_deg is None or camera.seen is None:
        return "\n  ".join([*lines, "clear    unknown: too few stars were seen"])
    low, high = camera.horizon_deg[:, 1].min(), camera.horizon_deg[:, 1].max()
    lines.append(
        f"clear    stars to V {o['limit_mag']:.2f} at the zenith, {100.0 * camera.seen:.0f} % of the bright ones"
    )
    lines.append(f"free     above {low:.0f} to {high:.0f} deg")
    return "\n  ".join(lines)


def cover_json(cover: "SkyCover") -> Json:
    """The JSON of a frame's cloud cover."""

    def of(cloud: "Cloud") -> Json:
        return {"cloud": cloud.share, "sigma": cloud.sigma, "stars": cloud.stars}

    return {
        "file": cover.file,
        "time_utc": cover.time_utc.isoformat(),
        **of(cover.whole),
        "parts": {name: of(cloud) for name, cloud in cover.parts.items()},
    }


def cover_text(cover: "SkyCover") -> str:
    """The same for a person."""

    def of(cloud: "Cloud") -> str:
        if cloud.share is None or cloud.sigma is None:
            return "unknown"
        return f"{100.0 * cloud.share:.0f} +-{100.0 * cloud.sigma:.0f} %"

    parts = "  ".join(f"{name} {of(cloud)}" for name, cloud in cover.parts.items())
    return f"{cover.file}\n  cloud    {of(cover.whole)} ({cover.whole.stars} stars)\n  {parts}"
