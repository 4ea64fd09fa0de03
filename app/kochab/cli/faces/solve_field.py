"""astrometry.net's ``solve-field``, so that programs that call it can call Kochab instead.

``kochab solve-field FILE...``, or Kochab called by the name ``solve-field``.

Facts: the options and files of astrometry.net 0.93 (``solve-field --help``) and what Debian's does: exit code 0 with a
solution or without (``.solved`` tells), 255 where a file or the options cannot be used. Options that steer its own
search (`IGNORED`) are read and left alone; what Kochab does not do (`REFUSED`) is refused in words unless it is
``none``. ``--scale-low`` and ``--scale-high``, and ``--radius`` around ``--ra`` and ``--dec``, are bounds, as there.
The files are those of :mod:`kochab.workflows.astrometry_tables`, the ``.wcs`` is Kochab's.
"""

import math
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from kochab.cli.batch import attempt
from kochab.cli.faces.getopt_options import getopt_options
from kochab.cli.output import with_progress
from kochab.cli.process import say
from kochab.core import __version__
from kochab.core.errors import KochabError, UsageError, printable
from kochab.core.frame import Detections, Frame, Hint
from kochab.core.progress import Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import mutable
from kochab.workflows.other_solvers import arcsec_px, parity, scale_between, up_deg, within_scale
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:
    from kochab.solver import SolveOptions

DONE, UNUSABLE = 0, 255
TIMEOUT_S = 60.0
SHORT = {
    **{"h": "help", "v": "verbose", "D": "dir", "o": "out", "b": "backend-config", "f": "files-on-stdin"},
    **{"p": "no-plots", "G": "use-wget", "O": "overwrite", "K": "continue", "J": "skip-solved", "N": "new-fits"},
    **{"Z": "kmz", "i": "scamp", "n": "scamp-config", "U": "index-xyls", "7": "no-delete-temp", "L": "scale-low"},
    **{"H": "scale-high", "u": "scale-units", "8": "parity", "c": "code-tolerance", "E": "pixel-error"},
    **{"q": "quad-size-min", "Q": "quad-size-max", "3": "ra", "4": "dec", "5": "radius", "d": "depth"},
    **{"l": "cpulimit", "r": "resort", "6": "extension", "z": "downsample", "9": "no-remove-lines", "C": "cancel"},
    **{"S": "solved", "I": "solved-in", "M": "match", "R": "rdls", "j": "scamp-ref", "B": "corr", "W": "wcs"},
    **{"P": "pnm", "k": "keep-xylist", "A": "dont-augment", "V": "verify", "y": "no-verify", "g": "guess-scale"},
    **{"T": "no-tweak", "t": "tweak-order", "m": "temp-dir", "F": "fields", "w": "width", "e": "height"},
    **{"X": "x-column", "Y": "y-column", "s": "sort-column", "a": "sort-ascending"},
}
FLAGS = {
    *("help", "version", "overwrite", "continue", "skip-solved", "files-on-stdin", "no-tweak", "temp-axy"),
    *("sort-ascending", "crpix-center", "verbose", "no-plots", "use-wget", "fits-image", "batch", "timestamp"),
    *("no-delete-temp", "resort", "invert", "no-background-subtraction", "no-remove-lines", "no-verify-uniformize"),
    *("no-verify-dedup", "no-verify", "guess-scale", "no-fits2fits", "use-source-extractor"),
    *("just-augment", "dont-augment", "tag-all"),
}
OUTPUTS = {
    **{"axy": ".axy", "solved": ".solved", "wcs": ".wcs", "new-fits": ".new", "corr": ".corr", "rdls": ".rdls"},
    **{"index-xyls": "-indx.xyls", "match": ".match"},
}
"""What is written, with the ending where no name is given."""
REFUSED = {
    **{"kmz": "KMZ files", "scamp": "files for SCAMP", "scamp-ref": "files for SCAMP", "pnm": "PNM copies"},
    **{"scamp-config": "files for SCAMP", "verify": "verifying of a WCS file", "predistort": "given distortion"},
    **{"just-augment": "lists without solving", "tag": "columns of an index"},
    **{"dont-augment": "lists without solving", "tag-all": "columns of an index", "invert": "inverted images"},
    **{"fields": "lists of several fields", "extension": "choice of a FITS extension", "xscale": "oblong pixels"},
    **{"solved-in": "lists of solved fields"},
}
KEPT = "keep-xylist"
"""The list of stars, written again under the name that is given."""
VALUED = {
    *(*OUTPUTS, KEPT),
    *(set(REFUSED) - FLAGS),
    *("dir", "out", "scale-low", "scale-high", "scale-units", "ra", "dec", "radius", "objs", "cpulimit", "cancel"),
    *("width", "height", "x-column", "y-column", "sort-column"),
}
IGNORED = {
    *("backend-config", "config", "plot-scale", "plot-bg", "parity", "code-tolerance", "pixel-error", "depth"),
    *("quad-size-min", "quad-size-max", "odds-to-tune-up", "odds-to-solve", "odds-to-reject", "downsample", "sigma"),
    *("odds-to-stop-looking", "source-extractor-config", "source-extractor-path", "nsigma", "uniformize"),
    *("sort-rdls", "verify-ext", "crpix-x", "crpix-y", "tweak-order", "temp-dir"),
}
"""Of astrometry.net's own search and tools, with a value."""


@mutable
class SolveFieldRequest:
    """What was asked: options by their long names, and the files."""

    options: dict[str, str] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)

    def number(self, name: str, low: float, high: float) -> float | None:
        """The value of an option, None when it was not given; UsageError when it is no such number."""
        text = self.options.get(name)
        if text is None:
            return None
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise UsageError(f"--{name} {text} is not a number from {low:g} to {high:g}.")
        return value

    @property
    def size(self) -> tuple[int, int] | None:
        """Of the frame that a list of stars is from, px."""
        width, height = (self.number(name, 1, 1e6) for name in ("width", "height"))
        return None if width is None or height is None else (int(width), int(height))

    def outputs(self, file: str) -> dict[str, str]:
        """Where each file is written, "" for nowhere."""
        name = self.options.get("out") or Path(file.removesuffix(".gz").removesuffix(".bz2")).stem
        base = os.path.join(self.options.get("dir") or os.path.dirname(file), name)
        found = {}
        for option, ending in OUTPUTS.items():
            given = self.options.get(option, base + ending).replace("%s", base)
            kept = "continue" in self.options and os.path.exists(given)
            unwanted = given == "none" or (option == "axy" and ("temp-axy" in self.options or given == file))
            found[option] = "" if unwanted or kept else given
        given = self.options.get(KEPT, "none").replace("%s", base)
        found[KEPT] = "" if given in ("none", file) else given
        return found


def run(arguments: Sequence[str]) -> int:
    """Solve the files one after the other; 255 when one or the options cannot be used, else 0."""
    try:
        order = _order(arguments)
        if "version" in order.options:
            print(f"Kochab {__version__}, as solve-field")
            return DONE
        if "help" in order.options or not order.files:
            print(_help() if "help" in order.options else "No files to solve: solve-field [options] FILE...")
            return DONE
        hint, bounds = _hint(order)
        _refuse(order)
    except UsageError as error:
        say(str(error))
        return UNUSABLE
    return max(_one(order, file, hint, bounds) for file in order.files)


def _order(arguments: Sequence[str]) -> SolveFieldRequest:
    options, files = getopt_options(arguments, FLAGS, {*VALUED, *IGNORED}, SHORT)
    if "files-on-stdin" in options:
        files += [line.rstrip("\n") for line in sys.stdin if line.strip()]
    return SolveFieldRequest(options, files)


def _help() -> str:
    used = ", ".join(f"--{name}" for name in sorted((VALUED | FLAGS) - set(REFUSED)))
    return (
        "Kochab in place of astrometry.net's solve-field: solve-field [options] FILE...\nUnderstood: "
        f"{used}.\nRead and left alone: {', '.join(f'--{name}' for name in sorted(IGNORED))}."
    )


def _refuse(order: SolveFieldRequest) -> None:
    """UsageError for what Kochab does not do, and for one name for the outputs of several files."""
    for name, what in REFUSED.items():
        if order.options.get(name, "none") != "none":
            raise UsageError(f"Kochab has no {what} (--{name}).")
    if len(order.files) > 1:
        for name in ("out", KEPT, *OUTPUTS):
            if (given := order.options.get(name, "none")) != "none" and "%s" not in given:
                raise UsageError(f"--{name} {given} is one name for {len(order.files)} files: put %s into it.")


Bounds = Callable[[Solution | NoSolution], Solution | NoSolution]


def _hint(order: SolveFieldRequest) -> tuple[Callable[[int], Hint | None], Bounds]:
    """The hint for a frame so wide, and what refuses a solution beyond the bounds that were given."""
    from kochab.parsing.angles import parse_dec_deg, parse_ra_deg
    from kochab.solver.pipeline import within_radius

    low, high = (order.number(name, 1e-9, 1e9) for name in ("scale-low", "scale-high"))
    radius = order.number("radius", 1e-6, 180.0)
    place = None
    if "ra" in order.options and "dec" in order.options:
        place = (parse_ra_deg(order.options["ra"]), parse_dec_deg(order.options["dec"]))
    to_scale = arcsec_px(order.options.get("scale-units", "degwidth"))
    if low is not None and high is not None and low > high:
        raise UsageError("--scale-low is more than --scale-high.")

    def scale_of(width: int) -> tuple[float, float] | None:
        return scale_between(low, high, to_scale, width)

    def hint(width: int) -> Hint | None:
        centre = None if place is None else (*place, radius or 180.0)
        return Hint(scale_arcsec_px=scale_of(width), centre_deg=centre, source="command line")

    def bounded(result: Solution | NoSolution) -> Solution | NoSolution:
        within = within_radius(result, None if place is None or radius is None else (*place, radius))
        return within_scale(within, scale_of(within.camera.width) if isinstance(within, Solution) else None)

    return hint, bounded


def _one(order: SolveFieldRequest, file: str, hint: Callable[[int], Hint | None], bounds: Bounds) -> int:
    """Solve one file, write what lies beside it, and say what solve-field says."""
    from kochab.frames.outputs import refuse_input

    outputs = order.outputs(file)
    if "skip-solved" in order.options and os.path.isfile(outputs["solved"]):
        print(f"Field: {printable(file)}\nSkipped: it is solved, as {printable(outputs['solved'])} says.")
        return DONE
    there = [path for path in outputs.values() if path and os.path.isfile(path)]
    if there and "overwrite" not in order.options:
        print(f"Output file exists: {printable(there[0])}.\nUse the --overwrite flag to overwrite existing files.")
        return DONE
    code = DONE

    def work() -> Json:
        for path in filter(None, outputs.values()):
            refuse_input(path, [file])
        if "overwrite" in order.options:
            for path in there:  # what tells of an earlier frame must not stay
                os.unlink(path)
        return with_progress(file, _cancelled(order, _answered(order, file, outputs, hint, bounds)))

    outcome = attempt(file, work)
    if "error" in outcome:
        say(outcome["error"])
        return UNUSABLE
    print(outcome["said"], flush=True)
    for sentence in outcome["failures"]:
        say(sentence)
        code = UNUSABLE
    return code


def _cancelled(order: SolveFieldRequest, task: Task[Json]) -> Task[Json]:
    """The same task; a file that appears (``--cancel``) ends it."""
    file = order.options.get("cancel")
    try:
        while True:
            if file and os.path.exists(file):
                raise UsageError("Cancelled.")
            try:
                progress = next(task)
            except StopIteration as end:
                outcome: Json = end.value
                return outcome
            yield progress
    finally:
        task.close()


def _answered(
    order: SolveFieldRequest, file: str, outputs: dict[str, str], hint_for: Callable[[int], Hint | None], bounds: Bounds
) -> Task[Json]:
    from kochab.frames import reading
    from kochab.solver import SolveOptions
    from kochab.solver.pipeline import examine_frame, solve_detections
    from kochab.workflows import astrometry_tables as files

    limit = order.number("cpulimit", 0.01, 1e7) or TIMEOUT_S
    most = order.number("objs", 4, 1e6)
    frame: Frame | None = None
    options = SolveOptions(timeout_s=limit, distortion="no-tweak" not in order.options, use_header=False)
    if most is not None:
        options = replace(options, max_stars=int(most))
    if files.is_list(file) or order.size is not None:
        named = (order.options.get("x-column", "X"), order.options.get("y-column", "Y"))
        columns = (*named, order.options.get("sort-column", ""))
        detections = files.read_list(file, columns, order.size, "sort-ascending" in order.options)
        result = yield from solve_detections(detections, _with_hint(options, hint_for(detections.width)))
    else:
        frame = yield from reading(file, limit)
        examined = yield from examine_frame(frame, _with_hint(options, hint_for(frame.width)))
        detections, result = examined.detections, examined.result
    result = bounds(result)
    lines = [f"Field: {printable(file)}"]
    if isinstance(result, NoSolution):
        failures = _written(_lists(outputs, detections, None, file))
        lines += ["Did not solve (or no WCS file was written).", f"{result.reason}: {result.advice}"]
        return {"said": "\n".join(lines), "failures": failures}
    failures = _written(_lists(outputs, detections, result, file)) + _with_wcs(order, outputs, file, frame, result)
    if outputs["solved"]:
        failures += _written([(outputs["solved"], b"\x01")])
    return {"said": "\n".join([*lines, *_told(result)]), "failures": failures}


def _with_hint(options: "SolveOptions", hint: Hint | None) -> "SolveOptions":
    return replace(options, hint=hint if hint is not None and hint.helps else None)


def _lists(
    outputs: dict[str, str], detections: Detections, solution: Solution | None, file: str
) -> Iterable[tuple[str, bytes]]:
    from kochab.workflows import astrometry_tables as files

    keys = {"ANSOLVED": "solved", "ANMATCH": "match", "ANRDLS": "rdls", "ANWCS": "wcs", "ANCORR": "corr"}
    names = {key: os.path.basename(outputs[name]) for key, name in keys.items()}
    yield outputs["axy"], files.axy(detections, solution is not None, names) if outputs["axy"] else b""
    yield outputs[KEPT], files.axy(detections, False, {}) if outputs[KEPT] else b""
    if solution is not None:
        yield outputs["rdls"], files.rdls(solution)
        yield outputs["index-xyls"], files.index_xyls(solution)
        yield outputs["corr"], files.corr(solution, detections)
        yield outputs["match"], files.match(solution, detections, file)


def _written(files: Iterable[tuple[str, bytes]]) -> list[str]:
    """Write each; sentences about those that cannot be."""
    from kochab.frames.atomic_file import write_atomically

    failures = []
    for path, content in files:
        try:
            if path:
                write_atomically(path, content)
        except OSError as error:
            failures.append(f"{path} cannot be written: {error.strerror or error}.")
    return failures


def _with_wcs(
    order: SolveFieldRequest, outputs: dict[str, str], file: str, frame: Frame | None, solution: Solution
) -> list[str]:
    """Write the ``.wcs``, and the frame with it as FITS; what failed."""
    from kochab.cli.batch import write_wcs_to
    from kochab.frames.wcs import write_with_solution

    failures = write_wcs_to(outputs["wcs"], solution) if outputs["wcs"] else []
    target = outputs["new-fits"]
    if target and frame is not None:
        try:
            write_with_solution(lambda: frame, solution, file, target)
        except KochabError as error:
            failures.append(str(error))
    camera = solution.camera
    off = max(abs(camera.cx - (camera.width - 1) / 2.0), abs(camera.cy - (camera.height - 1) / 2.0))
    if "crpix-center" in order.options and off > 0.5:
        say(f"The WCS keeps its reference point at the lens' axis, {off:.0f} px off the frame's centre.")
    return failures


def _told(solution: Solution) -> list[str]:
    """The lines that callers read: centre, size, turn and parity."""
    from kochab.cli.output import radec

    ra, dec = solution.ra_dec_deg
    hours, degrees = radec(ra, dec).split()
    hms, dms = (text.translate(str.maketrans("hmd'", "::::", 's"')) for text in (hours, degrees))
    scale = solution.camera.scale_arcsec_px
    sizes = [3600.0 * side_deg for side_deg in solution.camera.fov_deg]
    unit, per = next(
        (unit, per)
        for unit, per in (("degrees", 3600.0), ("arcminutes", 60.0), ("arcseconds", 1.0))
        if min(sizes) >= per or per == 1.0
    )
    return [
        f"Field 1: solved with {len(solution.stars)} stars, log-odds"
        f" {-solution.log10_false_alarm * math.log(10.0):.1f}, pixel scale {scale:.6g} arcsec/pix.",
        f"Field center: (RA,Dec) = ({ra:.6f}, {dec:.6f}) deg.",
        f"Field center: (RA H:M:S, Dec D:M:S) = ({hms}, {dms}).",
        f"Field size: {sizes[0] / per:.6g} x {sizes[1] / per:.6g} {unit}",
        f"Field rotation angle: up is {up_deg(solution):.6g} degrees E of N",
        f"Field parity: {'neg' if parity(solution) > 0 else 'pos'}",
    ]
