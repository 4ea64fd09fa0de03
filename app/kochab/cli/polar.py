"""``kochab polar FRAME FRAME ...``: how far the mount's axis is from the pole."""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from kochab.cli.batch import with_file_name
from kochab.cli.options import add_options, between, named, scale_range, valued
from kochab.cli.output import with_progress
from kochab.cli.process import say
from kochab.core.errors import FrameError, UsageError
from kochab.core.frame import Hint
from kochab.core.solution import NoSolution
from kochab.core.values import frozen
from kochab.frames.outputs import refuse_overwriting
from kochab.polar.drift import Drift
from kochab.polar.error import (
    Imaging,
    Knob,
    PolarError,
    altitude_in_words,
    azimuth_in_words,
    finer_in_words,
    good_enough,
    split_in_words,
    total_in_words,
)
from kochab.polar.measure import Measurement, NoAxis, PolarFinding, PolarFindingKind
from kochab.polar.plan import creep_to_show_arcsec, more_turn_deg, plan_second
from kochab.polar.pole import Pole, name_of
from kochab.polar.report import History, write_report
from kochab.sky.horizon import Refraction
from kochab.solver import SolveOptions
from kochab.workflows.polar.measure import optics_of
from kochab.workflows.polar.solutions import (
    FilesRequest,
    axis_of,
    changed_ns,
    guide_logs_of,
    is_complete,
    remember_axis,
    solutions_of,
    unsolved_of,
)
from kochab.workflows.polar.sources import SolvedFile, last_night
from kochab.workflows.solution_json import Json

MANY = 5
IN_DOUBT = 3  # the exit code of an axis that rests on what nothing bears out
LOOK_S = 5.0  # between two looks at files that grow
SAID_BY = {
    PolarFindingKind.CLOCK: "--utc-offset",
    PolarFindingKind.LONGITUDE_SIGN: "--site",
    PolarFindingKind.GUIDED: "--guided no",
    PolarFindingKind.DEC_SIGN: "--dec-sign",
}


@frozen
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
        " A frame without a solution is left out where more others, two at least, have one."
        " Exit code: 0 measured, 1 a frame has no solution, there is no axis or the measurement is spoilt (don't turn a"
        " bolt by it), 2 unusable input, 3 measured in doubt: of two frames alone, or a --site or --utc-offset that the"
        " frames' headers do not bear out would move the axis if it were wrong.",
    )
    parser.add_argument(
        "files",
        nargs="*",
        metavar="FRAME",
        help="two frames or more, any order; solved ones too: .wcs, .json, solutions.jsonl; or a guide log;"
        " without files: the last measurement at this site",
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
    ahead = "UTC offset of the frame times, hours (default: 0, or the zone in EXIF)"
    parser.add_argument("--utc-offset", **valued("HOURS", ahead, between(-14.0, 14.0, "h")))
    guided = "whether a guider held frames of one place (default: judged from the drift)"
    parser.add_argument("--guided", choices=["yes", "no"], help=guided)
    sign = (
        "north pulses of the guide log move the mount north (+) or south (-), where the log doesn't say it, as ASIAIR's"
        " (default: both answers)"
    )
    parser.add_argument("--dec-sign", choices=["+", "-"], help=sign)
    growing = "measure again whenever a file has grown, as a guide log does, until the axis is known to 30 arcsec"
    parser.add_argument("--follow", action="store_true", help=growing)
    add_options(parser, "--fov", help="width of the frames in degrees")
    parser.add_argument(
        "--imaging", **valued("MM,UM,S", "whether the error is good enough for this focal length, pixel and exposure")
    )
    add_options(parser, "--timeout")
    parser.add_argument("--report", metavar="HTML", help="write a report, and its numbers as .json beside it")
    add_options(parser, "--overwrite")
    parser.set_defaults(run=run, scale=None, equipment="")


def run(args: argparse.Namespace) -> int:
    """Measure the axis; with ``--follow`` again whenever a file has grown, until both bolts are known."""
    while True:
        before = _changes(args.files)  # first: what comes while it measures is measured next
        code, result = _measure(argparse.Namespace(**vars(args)))
        if not args.follow or not args.files or is_complete(result):
            return code
        while _changes(args.files) == before:
            time.sleep(LOOK_S)


def _changes(files: Sequence[str]) -> list[int]:
    return [changed_ns(path) for path in named(files)]


def _measure(args: argparse.Namespace) -> tuple[int, Measurement | Drift | None]:
    """Solve the frames, measure the axis, say it; the exit code, and the axis if there is one."""
    args.files, args.check = named(args.files), named(args.check)
    if not args.files and not args.check and args.site is not None:
        return _last(args), None
    paths = [*args.files, *args.check]
    logs = guide_logs_of(args.files)
    args.files = [path for path in args.files if path not in logs]
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
    files = [f for f in tried if isinstance(f, SolvedFile)]
    sweeps = [sweep for found, sweep in each for one in found if isinstance(one, SolvedFile)]
    unsolved = {id(file): _unusable(file) for file in unsolved_of(files, sweeps)}
    if bad := [one for each in tried if isinstance(one := unsolved.get(id(each), each), UnusableFrame)]:
        sentence = " ".join(with_file_name(one.path, one.reason) for one in bad)
        return _fail(sentence, args.json, max(one.code for one in bad), bad), None
    # None leaves it to how the drift in RA and Dec looks.
    guided = None if args.guided is None else args.guided == "yes"
    refraction = Refraction(args.pressure, args.temperature)
    dec_sign = {None: 0, "+": 1, "-": -1}[args.dec_sign]
    request = FilesRequest(args.site, Pole(args.pole), refraction, args.utc_offset, guided, dec_sign, args.equipment)
    try:
        axis = axis_of(files, [sweep for found, sweep in each for _ in found], logs, request)
    except (FrameError, UsageError) as error:
        return _fail(str(error), args.json, 2), None
    result = axis.result
    if isinstance(result, NoAxis):
        return _fail(result.sentence, args.json, 1, kind=result.kind), None
    if isinstance(result, Drift) and args.report is not None:
        raise UsageError("There is no report of a drift: leave --report out.")
    result = replace(result, findings=tuple(_with_option(finding) for finding in result.findings))
    doubts = _by_frame(axis.warnings)
    if args.json:
        of_it = (
            drift_as_json(result, doubts, imaging) if isinstance(result, Drift) else as_json(result, doubts, imaging)
        )
        print(json.dumps(of_it | {"last_night": axis.last and asdict(axis.last)}), flush=True)
    else:
        text = drift_as_text(result, doubts, imaging) if isinstance(result, Drift) else as_text(result, doubts, imaging)
        print(text + (f"\n  last      {axis.last}" if axis.last else ""), flush=True)
    try:
        remember_axis(result, request.profile)
    except OSError as error:
        say(f"Can't keep this for another night: {error.strerror or error}.")
    if args.report is not None:
        history = History()
        history.measured(result)
        write_report(args.report, history)
    return _code(result), result


def _code(result: Measurement | Drift) -> int:
    """What the program ends with, an axis in hand."""
    return IN_DOUBT if result.unsettled else int(result.spoilt)


def _last(args: argparse.Namespace) -> int:
    """What was measured last at the site: where the axis of a tripod on the same marks stands, more or less."""
    last = last_night(args.site, args.equipment)
    if last is None:
        return _fail("Nothing was measured there yet. Polar alignment needs two frames or more.", args.json, 2)
    print(json.dumps({"last_night": asdict(last)}) if args.json else last.guess)
    return 0


def _by_frame(warnings: Sequence[tuple[str, str]]) -> list[str]:
    """What reading the frames warned of, each with its frame; of many frames once."""
    names: dict[str, list[str]] = {}
    for name, warning in warnings:
        names.setdefault(warning, []).append(name)
    few = [f"{name}: {text}" for name, text in warnings if len(names[text]) < MANY]
    return few + [f"{of[0]} and {len(of) - 1} more: {text}" for text, of in names.items() if len(of) >= MANY]


def _with_option(finding: PolarFinding) -> PolarFinding:
    """A finding that asks for something, with the option that says it."""
    option = SAID_BY.get(finding.kind)
    return replace(finding, text=f"{finding.text} ({option})") if option else finding


def drift_as_json(drift: Drift, doubts: Sequence[str] = (), imaging: Imaging | None = None) -> Json:
    """The same form for an axis by drift; ``minutes_more`` is null where hours don't help."""
    error = drift.error
    long, short, angle = error.with_systematics.ellipse_arcsec()
    return {
        **_error_json(error),
        "at_least_arcsec": drift.at_least_arcsec,
        "ellipse_arcsec": [long, short],
        "ellipse_from_azimuth_deg": float(np.degrees(angle)),
        "pole": str(drift.settings.pole),
        "drift_minutes": drift.minutes,
        "minutes_more": drift.minutes_more,
        "guided": any(s.held for s in drift.stretches),
        "either": drift.otherwise
        and [{"dec_sign": s} | _error_json(e) for s, e in (("+", error), ("-", drift.otherwise))],
        "frames": sum(len(s.attitudes) for s in drift.stretches),
        "spoilt": drift.spoilt,
        "unsettled": drift.unsettled,
        "good_enough": good_enough(error, imaging) if imaging and drift.known and not drift.spoilt else None,
        **_findings_json(drift.findings, doubts),
    }


def drift_as_text(drift: Drift, doubts: Sequence[str] = (), imaging: Imaging | None = None) -> str:
    """A card for people: what to know of it first, bolts only where the drift tells them."""
    error = drift.error
    spoils = " ".join(finding.text for finding in drift.findings if finding.spoils)
    lines = [f"Unusable: don't adjust. {spoils}"] if spoils else []
    lines += [f"Note: {finding.text}" for finding in drift.findings if not finding.spoils]
    head = f"{drift.words} from the {name_of(drift.settings.pole, drift.settings.site)}"
    lines.append(head[0].upper() + head[1:])
    if not drift.spoilt:
        for knob, words in ((Knob.ALTITUDE, altitude_in_words), (Knob.AZIMUTH, azimuth_in_words)):
            lines.append(f"{knob!s:9} {words(error) if drift.tells(knob) else drift.unknown(knob)}")
    places = f" of {len(drift.stretches)} places" if len(drift.stretches) > 1 else ""
    frames = sum(len(s.attitudes) for s in drift.stretches)
    lines += [f"drift     {drift.minutes:.0f} min{places}, {frames} points", f"uncertainty {split_in_words(error)}"]
    if drift.better:
        lines.append(f"better    {drift.better}")
    if imaging and drift.known and not drift.spoilt:
        lines.append(f"good enough: {good_enough(error, imaging)}")
    return "\n  ".join(lines + [f"note      {doubt}" for doubt in doubts])


def as_json(m: Measurement, doubts: Sequence[str] = (), imaging: Imaging | None = None) -> Json:
    """The stable JSON form of a measurement; ``doubts`` are what reading the files warned of."""
    error = m.error
    return {
        **_error_json(error),
        "noise_total_arcsec": error.sigma_total_arcsec,
        "flexure_total_arcsec": error.flexure_along_arcsec,
        "unseen_total_arcsec": error.flexure_along_arcsec,  # as 0.1.0 called it, until 0.3.0
        "droop_arcsec": m.droop.arcsec if len(m.results) > 1 else None,
        "sigma_droop_arcsec": m.droop.sigma_arcsec,
        "pole": str(m.settings.pole),
        "turn_deg": m.turn_deg,
        "frames": len(m.attitudes),
        "chi2": m.fit.chi2,
        "degrees_of_freedom": m.fit.freedom,
        "spoilt": m.spoilt,
        "unsettled": m.unsettled,
        "checked": m.checked,
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
        "flexure_arcsec": list(error.flexure_arcsec),
        "unseen_arcsec": list(error.flexure_arcsec),  # as 0.1.0 called it, until 0.3.0
        "sigma_total_arcsec": error.with_systematics.sigma_total_arcsec,
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
        *(bolts if m.checked and not m.spoilt else []),
        f"measured  {len(m.attitudes)} frames{sweeps} over {m.turn_deg:.1f} deg of turn,"
        f" {m.rho_deg:.0f} deg from the axis{chi2}",
        f"uncertainty {split_in_words(error)}",
    ]
    if error.below_uncertainty and not m.spoilt:
        lines.append(f"stop      {finer_in_words(error)}")
    if imaging and not m.spoilt:
        lines.append(f"good enough: {good_enough(error, imaging)}")
    if not m.checked and not m.spoilt:
        lines.append("bolts     not yet: a third frame first")
    if not m.spoilt:
        lines += _better(m)
    notes = [*(finding.text for finding in m.findings if not finding.spoils), *doubts]
    if m.spoilt:
        lines = [
            "Unusable: don't adjust. " + " ".join(finding.text for finding in m.findings if finding.spoils),
            *lines,
        ]
    return "\n  ".join(lines + [f"note      {note}" for note in notes])


def _better(m: Measurement) -> list[str]:
    """How the axis could be known better: by a longer turn, by a second sweep."""
    lines, optics = [], optics_of(m.attitudes[0])
    if more := more_turn_deg(optics, m.rho_deg, m.fit.turns_rad, 30.0):
        lines.append(f"better    rotate RA {more:.0f}° more for an uncertainty of 30″")
    if creep := creep_to_show_arcsec(m):
        lines.append(f"better    turn RA back to the start, one more frame: checks for slip (±{creep:.0f}″ assumed)")
    if len(m.results) == 1 and (second := plan_second(m, optics, len(m.attitudes))):
        lines.append(
            f"better    sweep again at declination {second.declination_deg:+.0f}° (--check) for an"
            f" uncertainty of {second.foreseen_arcsec:.0f}″, flexure included"
        )
    return lines


def _solve(path: str, options: SolveOptions) -> Sequence[SolvedFile | UnusableFrame]:
    try:
        return with_progress(path, solutions_of(path, options))
    except FrameError as error:
        return [UnusableFrame(path, str(error), 2)]


def _unusable(file: SolvedFile) -> UnusableFrame:
    assert isinstance(file.result, NoSolution), "it was chosen for that"
    return UnusableFrame(file.path, f"no solution: {file.result.reason}. {file.result.advice}".rstrip(), 1)


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
        for sentence_text in [with_file_name(one.path, one.reason) for one in bad] or [sentence]:
            say(sentence_text)
    return code
