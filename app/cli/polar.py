"""``kochab polar FRAME FRAME ...``: how far the mount's axis is from the pole."""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.cli.choices import field_deg, number_above_zero
from app.cli.files import named
from app.cli.output import Json, ProgressLine
from app.core.errors import FrameError, UsageError
from app.core.hint import Site
from app.core.progress import run as run_task
from app.core.solution import NoSolution
from app.polar.findings import Kind
from app.polar.history import History
from app.polar.horizon import Air
from app.polar.measure import Measurement, NoAxis, Settings, measure
from app.polar.plan import more_turn_deg
from app.polar.poles import Pole, name_of
from app.polar.second import plan_second
from app.polar.words import altitude_in_words, azimuth_in_words, split_in_words, total_in_words
from app.solve.options import SolveOptions
from app.workflows.polar_measure import optics_of
from app.workflows.polar_sources import SolvedFile, sightings_of, site_of, solve_polar_file


@dataclass(frozen=True, slots=True)
class Bad:
    """A file that cannot be used: ``code`` is what the program ends with for it."""

    path: str
    reason: str
    code: int

    @property
    def told(self) -> str:
        """One sentence that names the file."""
        known = self.path in self.reason or Path(self.path).name in self.reason
        return self.reason if known else f"{self.path}: {self.reason}"


SPOILT = {Kind.FAR, Kind.SITE_OR_TIME, Kind.DEC_MOVED, Kind.CAMERA_TURNED, Kind.DISAGREE}
"""What must be put right first: nothing is better after it."""


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``polar`` to the command line."""
    parser = subparsers.add_parser(
        "polar",
        help="how far a mount's axis is from the pole, from two frames or more",
        description="Frames between which the mount turned about its RA axis only, by hand or by"
        " motor, anywhere in the sky, tracking or not; 30 degrees or more from the first to the"
        " last. What is told after ± is one sigma of all that may be wrong: the frames' own errors,"
        " and how the tube may bend, which a second sweep alone (--check) shows. Exit code: 0"
        " measured, 1 a frame has no solution or no axis can be had, 2 unusable input.",
    )
    parser.add_argument("files", nargs="+", metavar="FRAME", help="two frames or more, any order")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--site", type=_site, metavar="LAT,LON[,H]",
        help="degrees, east positive, metres; else from the frames",
    )  # fmt: skip
    parser.add_argument(
        "--pole", choices=[str(p) for p in Pole], default=str(Pole.REFRACTED),
        help="where the axis should point (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--check", nargs="+", default=[], metavar="FRAME",
        help="two frames or more of a second sweep at another declination, the bolts left alone:"
        " they show how the tube bends",
    )  # fmt: skip
    parser.add_argument(
        "--pressure", type=_pressure, metavar="HPA",
        help="of the air; 0 is without refraction (default: usual at the site's height)",
    )  # fmt: skip
    parser.add_argument(
        "--temperature", type=_temperature, default=10.0, metavar="C",
        help="of the air, degrees Celsius (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--fov", type=field_deg, metavar="DEG", help="the frames' width in degrees, about"
    )
    parser.add_argument(
        "--timeout", type=number_above_zero, default=30.0, metavar="S",
        help="limit a frame (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument("--report", metavar="HTML", help="write a page to keep")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Solve the frames, measure the axis, say it."""
    args.files, args.check = named(args.files), named(args.check)
    paths = [*args.files, *args.check]
    if len(args.files) < 2:
        raise UsageError("Polar alignment needs two frames or more.")
    if len(args.check) == 1:
        raise UsageError("A second sweep (--check) needs two frames or more as well.")
    options = SolveOptions(fov_deg=args.fov, timeout_s=args.timeout)
    tried = [_solve(path, options) for path in paths]
    if bad := [one for one in tried if isinstance(one, Bad)]:
        code = max(one.code for one in bad)
        return _fail(" ".join(one.told for one in bad), args.json, code, bad)
    files = [one for one in tried if isinstance(one, SolvedFile)]
    sweeps = [0] * len(args.files) + [1] * len(args.check)
    try:
        site, sightings = site_of(files, args.site), sightings_of(files, sweeps)
    except UsageError as error:
        return _fail(str(error), args.json, 2)
    air = Air(args.pressure, args.temperature)
    result = measure(sightings, Settings(site, Pole(args.pole), air))
    if isinstance(result, NoAxis):
        reason = f"{result.reason[0].upper()}{result.reason[1:]}. {result.advice}"
        return _fail(reason, args.json, 1)
    doubts = [f"{Path(file.path).name}: {told}" for file in files for told in file.warnings]
    print(json.dumps(as_json(result, doubts)) if args.json else as_text(result, doubts))
    if args.report is not None:
        _write_report(args.report, result)
    return 0


def as_json(m: Measurement, doubts: Sequence[str] = ()) -> Json:
    """The stable JSON form of a measurement; ``doubts`` are what reading the files warned of."""
    error = m.error
    return {
        "altitude_error_arcsec": error.altitude_arcsec,
        "azimuth_error_arcsec": error.azimuth_arcsec,
        "azimuth_error_on_sky_arcsec": error.azimuth_on_sky_arcsec,
        "total_arcsec": error.total_arcsec,
        "sigma_arcsec": list(error.sigma_arcsec),
        "unseen_arcsec": list(error.unseen_arcsec),
        "sigma_total_arcsec": error.whole.sigma_total_arcsec,
        "noise_total_arcsec": error.sigma_total_arcsec,
        "unseen_total_arcsec": error.unseen_along_arcsec,
        "droop_arcsec": m.droop.arcsec if len(m.looks) > 1 else None,
        "sigma_droop_arcsec": m.droop.sigma_arcsec,
        "pole": str(m.settings.pole),
        "turn_deg": m.turn_deg,
        "frames": len(m.attitudes),
        "chi2": m.fit.chi2,
        "degrees_of_freedom": m.fit.freedom,
        "warnings": [*(finding.text for finding in m.findings), *doubts],
    }


def as_text(m: Measurement, doubts: Sequence[str] = ()) -> str:
    """A card for people."""
    error = m.error
    sweeps = f" of {len(m.looks)} sweeps" if len(m.looks) > 1 else ""
    lines = [
        f"{total_in_words(error)} from the {name_of(m.settings.pole, m.settings.site)}",
        f"altitude  {altitude_in_words(error)}",
        f"azimuth   {azimuth_in_words(error)}",
        f"measured  {len(m.attitudes)} frames{sweeps} over {m.turn_deg:.1f} deg of turn,"
        f" {m.rho_deg:.0f} deg from the axis" + _chi2(m),
    ]
    lines.append(f"doubt     {split_in_words(error)}")
    if error.below_uncertainty:
        lines.append("stop      the error is smaller than its uncertainty")
    if not SPOILT & {finding.kind for finding in m.findings}:
        lines += _better(m)
    notes = [*(finding.text for finding in m.findings), *doubts]
    return "\n  ".join(lines + [f"note      {note}" for note in notes])


def _better(m: Measurement) -> list[str]:
    """How the axis could be known better: by a longer turn, by a second sweep."""
    lines, optics = [], optics_of(m.attitudes[0])
    if more := more_turn_deg(optics, m.rho_deg, m.fit.turns_rad, 30.0):
        lines.append(f'better    turn {more:.0f} deg more to know the axis to 30"')
    if len(m.looks) == 1 and (second := plan_second(m, optics, len(m.attitudes))):
        lines.append(
            f"better    a second sweep (--check) at declination {second.declination_deg:+.0f} deg:"
            f' then the axis is known to {second.foreseen_arcsec:.0f}", bending and all'
        )
    return lines


def _chi2(m: Measurement) -> str:
    if m.fit.freedom <= 0:
        return ""
    return f"; chi-square {m.fit.chi2:.1f} of {m.fit.freedom} expected"


def _solve(path: str, options: SolveOptions) -> "SolvedFile | Bad":
    line = ProgressLine(path)
    try:
        file = run_task(solve_polar_file(path, options), line)
    except FrameError as error:
        return Bad(path, str(error), 2)
    finally:
        line.clear()
    if isinstance(file.result, NoSolution):
        return Bad(path, f"no solution: {file.result.reason}. {file.result.advice}", 1)
    return file


def _fail(sentence: str, as_json: bool, code: int, bad: Sequence[Bad] = ()) -> int:
    """Say why there is no measurement, and of which files; one document in JSON."""
    if as_json:
        files = [{"file": one.path, "error": one.reason} for one in bad]
        print(json.dumps({"error": sentence} | ({"files": files} if bad else {})))
    else:
        for told in [one.told for one in bad] or [sentence]:
            print(f"kochab: {told}", file=sys.stderr)
    return code


def _write_report(path: str, m: Measurement) -> None:
    from app.polar.report import write_report

    history = History()
    history.measured(m)
    write_report(path, history)


def _pressure(text: str) -> float:
    return _within(text, 0.0, 1100.0, "hPa")


def _temperature(text: str) -> float:
    return _within(text, -90.0, 60.0, "deg C")


def _within(text: str, low: float, high: float, unit: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not low <= number <= high:
        raise argparse.ArgumentTypeError(f"{text} is not between {low:g} and {high:g} {unit}")
    return number


def _site(text: str) -> Site:
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not (
        -90.0 <= numbers[0] <= 90.0 and -180.0 <= numbers[1] <= 360.0
        and -500.0 <= sum(numbers[2:]) <= 9000.0
    ):  # fmt: skip
        raise argparse.ArgumentTypeError(f"{text} is not LAT,LON or LAT,LON,HEIGHT")
    return Site(*numbers)
