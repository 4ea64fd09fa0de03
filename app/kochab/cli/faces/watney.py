"""Watney's ``watney-solve``, as StellarSolver (KStars) and scripts call it.

``kochab watney-solve nearby|blind -i FILE ...``, or Kochab called by that name.

Facts: Watney's wiki, and what StellarSolver 2.4 sends and reads (``externalextractorsolver.cpp``): the JSON's keys, and
that ``flipped`` is a plane of positive determinant. ``--search-radius`` around ``--ra`` and ``--dec`` is a bound;
``--field-radius``, ``--min-radius`` and ``--max-radius`` steer Watney's own search and are left alone, as is the rest
of it. Exit code: 0 solved or not, 1 when the file or the options cannot be used.
"""

import json
import math
import sys
from collections.abc import Sequence

from kochab.cli.batch import attempt, write_wcs_to
from kochab.cli.faces.getopt_options import getopt_options
from kochab.cli.output import radec, with_progress
from kochab.cli.process import say
from kochab.core.errors import UsageError
from kochab.core.frame import Hint
from kochab.core.progress import Task
from kochab.core.solution import NoSolution, Solution
from kochab.parsing.angles import parse_dec_deg, parse_positive, parse_ra_deg
from kochab.workflows.other_solvers import parity, up_deg
from kochab.workflows.solution_json import Json

DONE, UNUSABLE, TIMEOUT_S = 0, 1, 60.0
SHORT = {
    **{"i": "image", "o": "out", "w": "wcs", "r": "ra", "d": "dec", "s": "search-radius", "f": "field-radius"},
    **{"m": "manual", "h": "use-fits-headers", "p": "use-parallelism"},
}
FLAGS = {"manual", "use-fits-headers", "extended", "benchmark", "help"}
VALUED = {"image", "out", "out-format", "wcs", "ra", "dec", "search-radius", "xyls", "xyls-imagesize"}
IGNORED = {
    *("field-radius", "field-radius-range", "field-radius-steps", "min-radius", "max-radius", "use-config", "sampling"),
    *("max-stars", "lower-density-offset", "higher-density-offset", "limit-threads", "log-file", "use-parallelism"),
    *("east-first", "west-first", "north-first", "south-first", "log-stdout"),
}


def run(arguments: Sequence[str]) -> int:
    """Solve one file and say or write what Watney does."""
    words = [*arguments]
    if words[:1] not in (["nearby"], ["blind"]):
        say("Say how to solve: watney-solve nearby or blind, then -i FILE.")
        return UNUSABLE
    try:
        options = _options(words[1:])
        radius = parse_positive(options.get("search-radius", "180"), "--search-radius", 180.0)
        place = None
        if words[0] == "nearby" and "ra" in options and "dec" in options:
            place = (parse_ra_deg(options["ra"]), parse_dec_deg(options["dec"]), radius)
        file = options.get("xyls") or options.get("image")
        if not file:
            raise UsageError("Name the image: -i FILE.")
    except UsageError as error:
        say(str(error))
        return UNUSABLE
    outcome = attempt(file, lambda: with_progress(file, _answered(file, options, place)))
    if "error" in outcome:
        say(outcome["error"])
        return UNUSABLE
    for sentence in outcome.pop("failures"):
        say(sentence)
    return _told(outcome, options)


def _options(words: list[str]) -> dict[str, str]:
    options, left = getopt_options(words, FLAGS, VALUED | IGNORED, SHORT)
    if left:
        raise UsageError(f"{left[0]} belongs to no option.")
    if options.get("out-format", "json") not in ("json", "tsv"):
        raise UsageError(f"--out-format {options['out-format']} is none of json, tsv.")
    return options


def _answered(file: str, options: dict[str, str], place: tuple[float, float, float] | None) -> Task[Json]:
    from kochab.frames import reading
    from kochab.frames.outputs import refuse_input
    from kochab.solver import SolveOptions
    from kochab.solver.pipeline import examine_frame, solve_detections, within_radius
    from kochab.workflows.astrometry_tables import read_list

    for name in ("out", "wcs"):
        if name in options:
            refuse_input(options[name], [file])
    hint = Hint(centre_deg=place, source="command line") if place else None
    solve = SolveOptions(hint=hint, timeout_s=TIMEOUT_S, use_header="manual" not in options)
    if "xyls" in options:
        stars = read_list(file, ("X_IMAGE", "Y_IMAGE", "MAG_AUTO"), _size(options), ascending=True)
        result = yield from solve_detections(stars, solve)
    else:
        frame = yield from reading(file, TIMEOUT_S)
        result = (yield from examine_frame(frame, solve)).result
    result = within_radius(result, place)
    if isinstance(result, NoSolution):
        return {"success": False, "failures": [f"{result.reason}: {result.advice}"]}
    return {**_fields(result), "failures": write_wcs_to(options["wcs"], result) if "wcs" in options else []}


def _size(options: dict[str, str]) -> tuple[int, int] | None:
    width, _, height = options.get("xyls-imagesize", "").partition("x")
    return (int(width), int(height)) if width.isdecimal() and height.isdecimal() else None


def _fields(solution: Solution) -> Json:
    ra, dec = solution.ra_dec_deg
    hms, dms = radec(ra, dec).split()
    return {
        "success": True,
        "ra": ra,
        "dec": dec,
        "ra_hms": hms.translate(str.maketrans("hm", "  ", "s")),
        "dec_dms": dms.translate(str.maketrans("d'", "  ", '"')),
        "fieldRadius": math.degrees(solution.radius_rad),
        "orientation": up_deg(solution),
        "pixScale": solution.camera.scale_arcsec_px,
        "parity": "flipped" if parity(solution) > 0 else "normal",
        "starsDetected": solution.detections,
        "starsUsed": len(solution.stars),
        "timeSpent": solution.elapsed_ms.get("total", 0.0) / 1e3,
    }


def _told(outcome: Json, options: dict[str, str]) -> int:
    """Print the answer, or write it to the file that was named."""
    from kochab.frames.atomic_file import write_atomically

    if options.get("out-format") == "tsv":
        text = "".join(f"{name}\t{value}\n" for name, value in outcome.items())
    else:
        text = json.dumps(outcome, indent=2) + "\n"
    if "out" not in options:
        sys.stdout.write(text)
        return DONE
    try:
        write_atomically(options["out"], text)
    except OSError as error:
        say(f"{options['out']} cannot be written: {error.strerror or error}.")
        return UNUSABLE
    return DONE
