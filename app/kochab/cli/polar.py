"""``kochab polar FRAME FRAME ...``: how far the mount's axis is from the pole."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from kochab.cli.batch import about
from kochab.cli.options import add_options, between, named, scale_range, valued
from kochab.cli.output import Json, with_progress
from kochab.cli.process import say
from kochab.core.errors import FrameError, UsageError
from kochab.core.frame import Hint, Site
from kochab.core.solution import NoSolution
from kochab.frames.hints import NO_ZONE
from kochab.frames.outputs import refuse_overwriting
from kochab.polar.drift import Drift, measure_drift, stretches_of, tracked
from kochab.polar.error import (
    Imaging,
    Knob,
    PolarError,
    altitude_in_words,
    angle_in_words,
    azimuth_in_words,
    good_enough,
    split_in_words,
    total_in_words,
)
from kochab.polar.horizon import Pole, Refraction, name_of
from kochab.polar.measure import Measurement, MeasureSettings, NoAxis, PolarFinding, PolarFindingKind, measure
from kochab.polar.plan import more_turn_deg, plan_second
from kochab.polar.report import History, write_report
from kochab.polar.sighting import Sighting
from kochab.solver import SolveOptions
from kochab.workflows.polar.measure import optics_of
from kochab.workflows.polar.solutions import SOLVED, guide_log, is_guide_log, or_as_its_header_says, solved_before
from kochab.workflows.polar.sources import (
    SolvedFile,
    doubts_of,
    last_night,
    remember_night,
    sightings_of,
    site_of,
    solve_polar_file,
)

WORTH_ARCSEC, BACK_DEG = 10.0, 5.0  # creep below that needs no frame of its own, nor one back at the start another


@dataclass(frozen=True, slots=True)
class UnusableFrame:
    """A file that cannot be used: ``code`` is what the program ends with for it."""

    path: str
    reason: str
    code: int


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``polar`` to the command line."""
    parser = subparsers.add_parser(
        "polar",
        description="Take frames while rotating RA only, by hand or by motor, anywhere in the sky,"
        " 30 degrees or more from first to last; tracking may be on or off. The uncertainty (1 sigma)"
        " is measurement and possible flexure; only a second sweep (--check) measures flexure."
        " Frames of one place, tracked and never turned, or a PHD2 guide log give the axis by drift."
        " Exit code: 0 measured, 1 a frame has no solution, there is no axis or the measurement is spoilt (don't turn a"
        " bolt by it), 2 unusable input.",
    )
    parser.add_argument(
        "files",
        nargs="*",
        metavar="FRAME",
        help="two frames or more, any order; solved ones too: .wcs, .json, solutions.jsonl; or a guide log;"
        " none: what was measured last at the site",
    )
    add_options(parser, "--site", help="degrees, east positive, metres (default: from the frames)")
    add_options(parser, "--profile", "--json")
    parser.add_argument(
        "--pole",
        choices=[str(p) for p in Pole],
        default=str(Pole.REFRACTED),
        help="where the axis should point (default: %(default)s)",
    )
    parser.add_argument(
        "--check",
        nargs="+",
        default=[],
        metavar="FRAME",
        help="two frames or more of a second sweep at another declination, same adjustment: measures flexure",
    )
    pressure = "air pressure; 0 for no refraction (default: standard at the site's height)"
    parser.add_argument("--pressure", **valued("HPA", pressure, between(0.0, 1100.0, "hPa")))
    celsius = "air temperature, degrees Celsius (default: %(default)g)"
    parser.add_argument("--temperature", **valued("C", celsius, between(-90.0, 60.0, "deg C"), default=10.0))
    ahead = "how far the frames' clock is ahead of UTC (default: 0, or the zone in EXIF); 0 says that it was UTC"
    parser.add_argument("--utc-offset", **valued("HOURS", ahead, between(-14.0, 14.0, "h")))
    guided = "whether a guider held frames of one place (default: as their drift in RA and Dec looks)"
    parser.add_argument("--guided", choices=["yes", "no"], help=guided)
    add_options(parser, "--fov", help="width of the frames in degrees")
    parser.add_argument("--imaging", **valued("MM,UM,S", "good enough? for this focal length, pixel and exposure"))
    add_options(parser, "--timeout")
    parser.add_argument("--report", metavar="HTML", help="write a report, and its numbers as .json beside it")
    add_options(parser, "--overwrite")
    parser.set_defaults(run=run, scale=None)


def run(args: argparse.Namespace) -> int:
    """Solve the frames, measure the axis, say it."""
    args.files, args.check = named(args.files), named(args.check)
    if not args.files and not args.check and args.site is not None:
        return _last(args)
    paths = [*args.files, *args.check]
    logs = [path for path in args.files if is_guide_log(path)]
    args.files = [path for path in args.files if path not in logs]
    if len(args.files) < 2 and not logs and not "".join(args.files).lower().endswith((".json", ".jsonl")):
        raise UsageError("Polar alignment needs two frames or more.")
    if len(args.check) == 1:
        raise UsageError("A second sweep (--check) needs two frames or more as well.")
    if args.report is not None:
        page = Path(args.report)
        refuse_overwriting([page, page.with_suffix(".json")], paths, args.overwrite)
    imaging = Imaging.parse(args.imaging) if args.imaging else None
    scale = Hint(scale_arcsec_px=scale_range(args.scale), source="profile") if args.scale else None
    options = SolveOptions(hint=scale, fov_deg=args.fov, timeout_s=args.timeout)
    each = [(_solve(path, options), sweep) for sweep, names in enumerate((args.files, args.check)) for path in names]
    tried = [one for found, _ in each for one in found]
    if bad := [one for one in tried if isinstance(one, UnusableFrame)]:
        return _fail(" ".join(about(one.path, one.reason) for one in bad), args.json, max(one.code for one in bad), bad)
    ahead = timedelta(hours=args.utc_offset or 0.0)
    files = [replace(f, time_utc=f.time_utc and f.time_utc - ahead) for f in tried if isinstance(f, SolvedFile)]
    sweeps = [sweep for found, sweep in each for _ in found]
    try:
        site, sightings = site_of(files, args.site), sightings_of(files, sweeps)
    except UsageError as error:
        return _fail(str(error), args.json, 2)
    settings = MeasureSettings(site, Pole(args.pole), Refraction(args.pressure, args.temperature))
    if logs or args.guided or (tracked(sightings) and not args.check):
        return _drift(args, logs, (files, sightings), settings, imaging)
    result = measure(sightings, settings)
    if isinstance(result, NoAxis):
        return _fail(result.sentence, args.json, 1, kind=result.kind)
    result = replace(result, findings=(*result.findings, *_doubts(args, files, result.error, site)))
    last = last_night(site, args.profile or "", result.time_utc)
    known = {NO_ZONE} if args.utc_offset is not None else set()
    doubts = [f"{Path(file.path).name}: {told}" for file in files for told in file.warnings if told not in known]
    if args.json:
        print(json.dumps(as_json(result, doubts, imaging) | {"last_night": last and asdict(last)}))
    else:
        print(as_text(result, doubts, imaging) + (f"\n  last      {last}" if last else ""))
    if not result.spoilt:
        try:
            remember_night(site, args.profile or "", result.time_utc, result.error)
        except OSError as error:
            say(f"Can't keep this for another night: {error.strerror}.")
    if args.report is not None:
        history = History()
        history.measured(result)
        write_report(args.report, history)
    return int(result.spoilt)


def _last(args: argparse.Namespace) -> int:
    """What was measured last at the site: where the axis of a tripod on the same marks stands, more or less."""
    last = last_night(args.site, args.profile or "")
    if last is None:
        return _fail("Nothing was measured there yet. Polar alignment needs two frames or more.", args.json, 2)
    told = f"Last measured there, {last}. Tonight about the same, if the tripod stands on the same marks: measure."
    print(json.dumps({"last_night": asdict(last)}) if args.json else told)
    return 0


def _drift(
    args: argparse.Namespace,
    logs: Sequence[str],
    frames: tuple[Sequence[SolvedFile], Sequence[Sighting]],
    settings: MeasureSettings,
    imaging: Imaging | None,
) -> int:
    """The axis of frames that nobody turned, and of guide logs."""
    if args.report is not None:
        raise UsageError("There is no report of a drift: leave --report out.")
    try:
        guided = None if args.guided is None else args.guided == "yes"
        stretches = stretches_of(frames[1], settings, guided)
        stretches += [stretch for log in logs for stretch in guide_log(log, settings)]
    except FrameError as error:
        return _fail(str(error), args.json, 2)
    result = measure_drift(stretches, settings)
    if isinstance(result, NoAxis):
        return _fail(result.sentence, args.json, 1, kind=result.kind)
    result = replace(result, findings=(*result.findings, *_doubts(args, frames[0], result.error, settings.site)))
    print(json.dumps(drift_as_json(result, imaging)) if args.json else drift_as_text(result, imaging))
    return int(result.spoilt)


def _doubts(args: argparse.Namespace, files: Sequence[SolvedFile], error: PolarError, site: Site) -> list[PolarFinding]:
    return doubts_of(files, error, site, args.site is not None, args.utc_offset is not None)


def drift_as_json(drift: Drift, imaging: Imaging | None = None) -> Json:
    """The same form for an axis by drift; ``minutes_more`` is null where hours don't help."""
    error = drift.error
    long, short, angle = error.with_flexure.ellipse_arcsec()
    return {
        **_error_json(error),
        "at_least_arcsec": drift.at_least_arcsec,
        "ellipse_arcsec": [long, short],
        "ellipse_from_azimuth_deg": float(np.degrees(angle)),
        "pole": str(drift.settings.pole),
        "drift_minutes": drift.minutes,
        "minutes_more": drift.minutes_more,
        "guided": any(s.held for s in drift.stretches),
        "frames": sum(len(s.attitudes) for s in drift.stretches),
        "spoilt": drift.spoilt,
        "good_enough": good_enough(error, imaging) if imaging and drift.known and not drift.spoilt else None,
        **_findings_json(drift.findings),
    }


def drift_as_text(drift: Drift, imaging: Imaging | None = None) -> str:
    """A card for people: bolts only where the drift tells them."""
    error = drift.error
    head = total_in_words(error) if drift.known else f"At least {angle_in_words(drift.at_least_arcsec)}"
    lines = [f"{head} from the {name_of(drift.settings.pole, drift.settings.site)}"]
    if not drift.spoilt:
        for knob, words in ((Knob.ALTITUDE, altitude_in_words), (Knob.AZIMUTH, azimuth_in_words)):
            sigma = error.with_flexure.knob_sigma_arcsec(knob)
            lines.append(
                f"{knob!s:9} {words(error) if drift.tells(knob) else f'not known yet (± {angle_in_words(sigma)})'}"
            )
    places = f" of {len(drift.stretches)} places" if len(drift.stretches) > 1 else ""
    frames = sum(len(s.attitudes) for s in drift.stretches)
    lines += [f"drift     {drift.minutes:.0f} min{places}, {frames} points", f"of the ±  {split_in_words(error)}"]
    if drift.minutes_more:
        lines.append(f"better    {drift.minutes_more:.0f} min more on this place for an uncertainty of 30″")
    elif drift.minutes_more is None:
        lines.append("better    another place in the sky: this one won't tell it in hours")
    if imaging and drift.known and not drift.spoilt:
        lines.append(f"enough?   {good_enough(error, imaging)}")
    return "\n  ".join(lines + [f"note      {finding.text}" for finding in drift.findings])


def as_json(m: Measurement, doubts: Sequence[str] = (), imaging: Imaging | None = None) -> Json:
    """The stable JSON form of a measurement; ``doubts`` are what reading the files warned of."""
    error = m.error
    return {
        **_error_json(error),
        "noise_total_arcsec": error.sigma_total_arcsec,
        "unseen_total_arcsec": error.flexure_along_arcsec,
        "droop_arcsec": m.droop.arcsec if len(m.results) > 1 else None,
        "sigma_droop_arcsec": m.droop.sigma_arcsec,
        "pole": str(m.settings.pole),
        "turn_deg": m.turn_deg,
        "frames": len(m.attitudes),
        "chi2": m.fit.chi2,
        "degrees_of_freedom": m.fit.freedom,
        "spoilt": m.spoilt,
        "good_enough": good_enough(error, imaging) if imaging and not m.spoilt else None,
        **_findings_json(m.findings, doubts),
    }


def _error_json(error: PolarError) -> Json:
    return {
        "altitude_error_arcsec": error.altitude_arcsec,
        "azimuth_error_arcsec": error.azimuth_arcsec,
        "azimuth_error_on_sky_arcsec": error.azimuth_on_sky_arcsec,
        "total_arcsec": error.total_arcsec,
        "sigma_arcsec": list(error.sigma_arcsec),
        "unseen_arcsec": list(error.flexure_arcsec),
        "sigma_total_arcsec": error.with_flexure.sigma_total_arcsec,
    }


def _findings_json(findings: Sequence[PolarFinding], doubts: Sequence[str] = ()) -> Json:
    return {
        "findings": [{"code": f.kind.name.lower(), "spoils": f.spoils, "text": f.text} for f in findings],
        "warnings": [*(finding.text for finding in findings), *doubts],
    }


def as_text(m: Measurement, doubts: Sequence[str] = (), imaging: Imaging | None = None) -> str:
    """A card for people."""
    error = m.error
    sweeps = f" of {len(m.results)} sweeps" if len(m.results) > 1 else ""
    chi2 = f"; chi-square {m.fit.chi2:.1f} of {m.fit.freedom} expected" if m.fit.freedom > 0 else ""
    bolts = [f"altitude  {altitude_in_words(error)}", f"azimuth   {azimuth_in_words(error)}"]
    lines = [
        f"{total_in_words(error)} from the {name_of(m.settings.pole, m.settings.site)}",
        *([] if m.spoilt else bolts),
        f"measured  {len(m.attitudes)} frames{sweeps} over {m.turn_deg:.1f} deg of turn,"
        f" {m.rho_deg:.0f} deg from the axis{chi2}",
        f"of the ±  {split_in_words(error)}",
    ]
    if error.below_uncertainty and not m.spoilt:
        lines.append("stop      the error is within its uncertainty")
    if imaging and not m.spoilt:
        lines.append(f"enough?   {good_enough(error, imaging)}")
    if not m.spoilt:
        lines += _better(m)
    notes = [*(finding.text for finding in m.findings if not finding.spoils), *doubts]
    if m.spoilt:
        lines = [
            "Spoilt, don't turn a bolt. " + " ".join(finding.text for finding in m.findings if finding.spoils),
            *lines,
        ]
    return "\n  ".join(lines + [f"note      {note}" for note in notes])


def _better(m: Measurement) -> list[str]:
    """How the axis could be known better: by a longer turn, by a second sweep."""
    lines, optics, error = [], optics_of(m.attitudes[0]), m.error
    if more := more_turn_deg(optics, m.rho_deg, m.fit.turns_rad, 30.0):
        lines.append(f"better    rotate RA {more:.0f}° more for an uncertainty of 30″")
    away = abs(np.degrees(m.fit.turns_rad[-1] - m.fit.turns_rad[0])) > BACK_DEG
    if away and len(m.results) == 1 and error.creep_total_arcsec > max(error.uncertainty_arcsec, WORTH_ARCSEC):
        lines.append(
            f"better    one more frame, back at the start: shows creep (±{error.creep_total_arcsec:.0f}″ assumed)"
        )
    if len(m.results) == 1 and (second := plan_second(m, optics, len(m.attitudes))):
        lines.append(
            f"better    sweep again at declination {second.declination_deg:+.0f}° (--check) for an"
            f" uncertainty of {second.foreseen_arcsec:.0f}″, flexure included"
        )
    return lines


def _solve(path: str, options: SolveOptions) -> "list[SolvedFile | UnusableFrame]":
    try:
        if Path(path).suffix.lower() in SOLVED:
            files = solved_before(path)
        else:
            files = [or_as_its_header_says(with_progress(path, solve_polar_file(path, options)))]
    except FrameError as error:
        return [UnusableFrame(path, str(error), 2)]
    return [_usable(file) for file in files]


def _usable(file: SolvedFile) -> "SolvedFile | UnusableFrame":
    if isinstance(file.result, NoSolution):
        return UnusableFrame(file.path, f"no solution: {file.result.reason}. {file.result.advice}".rstrip(), 1)
    return file


def _fail(
    sentence: str, as_json: bool, code: int, bad: Sequence[UnusableFrame] = (), kind: PolarFindingKind | None = None
) -> int:
    """Say why there is no measurement, and of which files; one document in JSON, with a code where there is no axis."""
    if as_json:
        files = [{"file": one.path, "error": one.reason} for one in bad]
        print(
            json.dumps(
                {"error": sentence} | ({"files": files} if bad else {}) | ({"code": kind.name.lower()} if kind else {})
            )
        )
    else:
        for told in [about(one.path, one.reason) for one in bad] or [sentence]:
            say(told)
    return code
