"""``kochab live`` and ``kochab camera``: a camera's frames, solved as they come, listed or taken."""

import argparse
import json
import os
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from time import monotonic
from typing import Any

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
from kochab.cli.output import radec, reporting_failures, tell
from kochab.cli.process import say
from kochab.core.errors import DeviceError, KochabError, NoAnswerError, UsageError, printable
from kochab.core.frame import Frame
from kochab.core.solution import Solution
from kochab.text.angle_text import age_text
from kochab.workflows.live.session import SESSION, Recorder, Replayed, options_json, recorded
from kochab.workflows.live.solve import WARNING, ProfiledTracker, live_solve
from kochab.workflows.live.update import Drift, GoodPointing, LiveUpdate
from kochab.workflows.solution_json import Json, as_json, to_line

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
    add_options(parser, "--json", *SEARCH, "--detector")
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


def _print(update: LiveUpdate, in_json: bool) -> None:
    tell(live_json(update), live_line(update), in_json)
    if not in_json:
        for sentence in update.warnings:
            say(sentence)


def _replay(args: argparse.Namespace) -> int:
    from kochab.workflows.live.session import recorded_options, replay

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


# What is printed: one JSON object a frame, or one line a frame for people.


def live_json(update: LiveUpdate) -> Json:
    """The JSON of ``solve`` for this frame, its age, and how the stream is doing."""
    track, shot = update.track, update.shot
    now_s = update.done_s
    return {
        **as_json(shot.frame.path or f"frame {shot.number}", update.result),
        "frame": shot.number,
        "time_utc": track.time_utc.isoformat(),
        "exposure_s": shot.frame.hint.exposure_s,
        "age_s": round(update.age_s(now_s), 3),
        "latency_ms": round(update.latency_ms, 3),
        "mode": track.mode,
        "solved_hz": _rounded(update.solved_hz),
        "frames_hz": _rounded(update.frames_hz),
        "dropped": update.dropped,
        "drift_arcsec_min": _drift(update.drift),
        "rates_deg_s": _listed(track.rates_deg_s),
        "rates_sigma_deg_s": _listed(track.rates_sigma_deg_s),
        "filtered": _filtered(update),
        "last_good": _good(update.last_good, now_s),
        "warnings": list(update.warnings),
    }


def finite_json(update: LiveUpdate) -> Json:
    """The same with every number JSON cannot hold replaced by None, for a recording."""
    value: Json = json.loads(to_line(live_json(update)))
    return value


def replay_json(replayed: Replayed) -> Json:
    """The frame solved again, and how that compares with what was recorded."""
    return {
        **live_json(replayed.update),
        "frame_file": replayed.line["frame_file"],
        "intact": replayed.intact,
        "agrees": replayed.agrees,
        "apart_arcsec": replayed.apart_arcsec,
    }


def live_line(update: LiveUpdate) -> str:
    """One line: where it points and how old that is, or why not and what was known before."""
    result = update.result
    head = f"{update.shot.number:6d}  {age_text(update.age_s(update.done_s)):>8}"
    if isinstance(result, Solution):
        text = f"{head}  {radec(*result.ra_dec_deg)}  roll {result.roll_deg:8.3f}"
        text += f"  {len(result.stars):3d} stars  {update.mode:8}  {update.latency_ms:6.0f} ms"
        if drift := update.drift:
            text += f"  drift RA {drift.ra_arcsec_min:+.1f} Dec {drift.dec_arcsec_min:+.1f} arcsec/min"
        return text
    text = f"{head}  no solution: {result.reason}. {result.advice}"
    good = update.last_good
    if good is not None:
        age = age_text(good.age_s(update.done_s))
        text += f" (old, {age}: {radec(*good.solution.ra_dec_deg)})"
    return text


def replay_line(replayed: Replayed) -> str:
    """One line a frame: the same or not."""
    name = replayed.line["frame_file"]
    verdict = "same solution" if replayed.agrees else "DIFFERENT SOLUTION"
    apart = replayed.apart_arcsec
    where = "" if apart is None else f", {apart:.3f} arcsec apart"
    return f"{name}  {verdict}{where}" + ("" if replayed.intact else "; THE FILE WAS CHANGED")


def _drift(drift: Drift | None) -> Json | None:
    if drift is None:
        return None
    return {
        "ra": drift.ra_arcsec_min,
        "dec": drift.dec_arcsec_min,
        "sigma": [drift.ra_sigma, drift.dec_sigma],
        "span_s": drift.span_s,
        "frames": drift.frames,
    }


def _filtered(update: LiveUpdate) -> Json | None:
    """The pointing of the frame's middle after all frames so far."""
    centre = update.track.filtered_centre
    if centre is None:
        return None
    ra, dec, roll = centre.euler_deg
    return {"ra_deg": ra, "dec_deg": dec, "roll_deg": roll, "sigma_arcsec": list(centre.sigma_arcsec)}


def _good(good: GoodPointing | None, now_s: float) -> Json | None:
    if good is None:
        return None
    ra, dec = good.solution.ra_dec_deg
    return {
        "frame": good.number,
        "age_s": round(good.age_s(now_s), 3),
        "ra_deg": ra,
        "dec_deg": dec,
        "roll_deg": good.solution.roll_deg,
    }


def _listed(values: Any) -> list[float] | None:
    return None if values is None else [float(v) for v in values]


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


# ``kochab camera list`` and ``kochab camera take``: which cameras there are, and one frame.


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
        add_options(action, "--address", "--json")
        action.set_defaults(run=reporting_failures(do))


def _list(args: argparse.Namespace) -> int:
    """Print every kind of camera, or one, with what can be opened now."""
    from kochab.gear.cameras import SOURCES

    if args.source is not None:
        SOURCES.check(args.source)
    for name in SOURCES.loaded() if args.source is None else (args.source,):
        facts = _device_facts(name, args.address)
        tell(facts, _text(facts), args.json)
    return 0


def _device_facts(name: str, address: str) -> Json:
    from kochab.gear.cameras import list_devices, missing

    facts: Json = {"source": name, "missing": missing(name), "cameras": []}
    if facts["missing"] is None:
        try:
            facts["cameras"] = [
                {"address": d.address, "description": d.description} for d in list_devices(name, address)
            ]
        except DeviceError as error:
            facts["error"] = str(error)
    return facts


def _text(facts: Json) -> str:
    lines = [facts["source"]]
    lines += [f"  {c['address']}  {c['description']}" for c in facts["cameras"]]
    problem = facts["missing"] or facts.get("error")
    if problem or not facts["cameras"]:
        lines.append(f"  {problem or 'none found; see --address'}")
    return "\n".join(lines)


def _take(args: argparse.Namespace) -> int:
    from kochab.frames.fits_write import write_fits
    from kochab.frames.outputs import refuse_input, refuse_overwriting
    from kochab.frames.readers import named_as_fits
    from kochab.gear.cameras import open_camera

    if not args.source:
        raise UsageError("Choose a camera: --source NAME, or --profile NAME.")
    target = Path(args.output)
    if not named_as_fits(target, packed=False):
        raise UsageError(f"--output {target}: the frame is written as FITS, name it .fits.")
    if not target.parent.is_dir():  # told before the exposure, not after
        raise KochabError(f"{target} cannot be written: there is no folder {target.parent}.")
    if not os.access(target.parent, os.W_OK):
        raise KochabError(f"{target} cannot be written: no permission to write to its folder.")
    with closing(open_camera(args.source, args.address, capture_settings(args))) as camera:
        refuse_overwriting([target], overwrite=args.overwrite)
        deadline = monotonic() + args.wait + (args.exposure or 0.0)
        late, frame = False, camera.next_frame(0.2)
        while frame is None and not late:
            late = monotonic() >= deadline  # asked once more after it: a busy computer may have slept over a frame
            frame = camera.next_frame(0.2)
    if frame is None:
        raise NoAnswerError(f"No frame came from {args.address or args.source} in time.")
    refuse_input(target, [frame.path] if frame.path else [])
    try:
        write_fits(frame, target)
    except OSError as error:
        raise KochabError(f"{args.output} cannot be written: {error.strerror}.") from None
    facts = _frame_json(frame, args.output)
    tell(facts, f"{printable(facts['file'])}: {facts['width']} x {facts['height']} px", args.json)
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
