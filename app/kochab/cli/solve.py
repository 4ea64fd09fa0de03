"""``kochab solve``, ``identify`` and ``detect``: where frames and star lists point, and their stars."""

import argparse
import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kochab.cli.batch import refuse_wcs_over, run_batch, write_objects, write_picture, write_wcs_to
from kochab.cli.options import BATCH, Place, add_options, bound_of, detector_settings_of, named, options_of, whole
from kochab.core.errors import KochabError, UsageError
from kochab.core.progress import Task
from kochab.core.values import frozen
from kochab.workflows.answers import LISTED, answer_of, detections_json
from kochab.workflows.solution_json import Json

if TYPE_CHECKING:  # they load numpy, which --help has no need of
    from kochab.core.frame import Detections, Site
    from kochab.core.solution import NoSolution, Solution
    from kochab.sky.layer import Layers
    from kochab.sky.solar_system import Moving
    from kochab.solver import SolveOptions

TABLES = (".csv", ".reg", ".ssc")
ALIASES = (".jpeg", ".tiff")  # of endings that are told
WRITTEN = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".pdf", ".svg")
PIXELS = (2, 1_000_000, "size in pixels")


@frozen
class SolveRequest:
    """One file and what is to be written from it; ``list_size`` is the frame's, px, of a list of stars.

    ``objects`` is the file that the frame's objects go to, "" for all of them in the JSON, None for the best known.
    """

    file: str
    wcs: str | None = None
    annotate: str | None = None
    objects: str | None = None
    list_size: tuple[int, int] | None = None


def add_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``solve`` to the command line."""
    parser = subparsers.add_parser(
        "solve", description="Exit code: 0 all solved, 1 one has no solution, 2 unusable input."
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="frames, or folders of them")
    add_options(parser, *BATCH, "--detector", "--site", "--frame")
    parser.add_argument(
        "--annotate",
        metavar="PNG",
        help="save the frame with the sky over it: .png, .jpg, .tif, .pdf, .svg, or a folder",
    )
    parser.add_argument(
        "--layers",
        default="",
        metavar="NAMES",
        help="extra layers for --annotate, comma-separated; no-NAME hides one: altaz,ecliptic,no-grid",
    )
    parser.add_argument(
        "--objects",
        nargs="?",
        const="",
        metavar="FILE",
        help="write what is in the frame: .csv, .reg for DS9, .ssc for Stellarium; without FILE, list more than"
        " the 200 best known objects in the JSON",
    )
    help_text = (
        "bodies to look for in dated frames: MPC lines, SBDB's JSON or CSV, satellites' TLE or OMM; may be repeated"
    )
    parser.add_argument("--elements", action="append", default=[], metavar="FILE", type=Path, help=help_text)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Solve every file, print as they are done."""
    layers = layers_of(args.layers) if args.layers else None
    solve = partial(solve_one, site=args.site, layers=layers, number=args.frame)
    return _solve(args, _requests(args), args.detector, tuple(args.elements), solve)


def _solve(
    args: argparse.Namespace,
    requests: list[SolveRequest],
    detector: str = "auto",
    elements: tuple[Path, ...] = (),
    solve: Callable[..., Task[Json]] | None = None,
) -> int:
    if elements:
        tables_of(elements)  # a file that cannot be read is told before anything is solved
    _refuse_overwriting(requests, args.overwrite)
    if args.workers > 1 and len(requests) > 1:
        _load()
    work = partial(solve or solve_one, options=options_of(args, detector), bound=bound_of(args), elements=elements)
    return run_batch(work, requests, args.json, args.workers)


def _load() -> None:
    """Load what every frame needs, for processes that are forked from this one."""
    from kochab.sky import open_catalogue

    open_catalogue()


def layers_of(text: str) -> "Layers":
    """The usual layers with those that are named, and without those named "no-grid"; UsageError for another name."""
    from kochab.sky.layer import MARKS, Layers
    from kochab.workflows.annotated_image import USUAL

    wanted = [name.strip() for name in text.split(",")]
    if wrong := [name for name in wanted if name.removeprefix("no-") not in MARKS]:
        raise UsageError(f"--layers: there is no layer {wrong[0]!r}; there are {', '.join(MARKS)}.")
    return Layers(USUAL.on | {name.removeprefix("no-"): not name.startswith("no-") for name in wanted})


@cache
def tables_of(elements: tuple[Path, ...]) -> "list[Moving]":
    """The bodies of the user's files of elements."""
    if not elements:
        return []
    from kochab.sky.elements import read_elements

    return [read_elements(path) for path in elements]


def solve_one(
    request: SolveRequest,
    options: "SolveOptions",
    bound: Place | None = None,
    elements: tuple[Path, ...] = (),
    site: "Site | None" = None,
    layers: "Layers | None" = None,
    number: int | None = None,
) -> Task[Json]:
    """The outcome of one file, and what was asked to be written from it.

    Parameters
    ----------
    request : SolveRequest
        The file, and what to write from it.
    options : SolveOptions
        How the frame is solved.
    bound : Place or None
        RA, Dec and radius, degrees, beyond which a solution is refused; None for the whole sky.
    elements : tuple[Path, ...]
        Files of orbital elements whose bodies are looked for beside the shipped ones.
    site : Site or None
        Where the frame was taken; None to take it from the header.
    layers : Layers or None
        What ``--annotate`` draws; None for the usual.
    number : int or None
        The frame of a video, counted from 1; None for the first.
    """
    from kochab.sky.object_index import MOST
    from kochab.workflows.solve_frame import SolvedFrame, solve_file, solve_star_list

    more, most = tables_of(elements), LISTED if request.objects is None else MOST
    found: SolvedFrame | Solution | NoSolution
    if request.list_size is not None:
        found = yield from solve_star_list(request.file, *request.list_size, options)
    elif Path(request.file).is_dir():
        raise UsageError(_why_no_pictures(request.file))
    else:
        found = yield from solve_file(request.file, options, number)
    answer = yield from answer_of(request.file, found, options, bound, more, site, most)
    if answer.solution is None:
        return answer.outcome
    failures = [] if request.wcs is None else write_wcs_to(request.wcs, answer.solution)
    if isinstance(found, SolvedFrame) and (request.annotate or request.objects):
        frame, hint = found.frame, answer.hint
        dated = replace(frame, hint=replace(hint, site=site or hint.site or frame.hint.site)) if hint else frame
        if request.annotate:
            found_px = found.detections.xy
            failures += write_picture(request.annotate, dated, answer.solution, more, layers, found_px)
        if request.objects:
            failures += write_objects(request.objects, dated, answer.solution, answer.objects)
    return {**answer.outcome, "failures": failures} if failures else answer.outcome


def _requests(args: argparse.Namespace) -> list[SolveRequest]:
    files = [name for given in named(args.files) for name in frames_in(given)]
    pictures = _targets(args.annotate, files, "--annotate", WRITTEN, "image")
    tables = _targets(args.objects, files, "--objects", TABLES, "list")
    return [
        SolveRequest(file, _wcs_of(args, file), picture, table)
        for file, picture, table in zip(files, pictures, tables, strict=True)
    ]


def _targets(given: str | None, files: list[str], option: str, endings: Sequence[str], what: str) -> list[str | None]:
    """What is written from each file, where ``given`` is one file's name or a folder; UsageError."""
    if not given:  # not asked for, or for the JSON alone
        return [given] * len(files)
    target = Path(given)
    if target.is_dir():
        return [str(target / f"{Path(file).name}{endings[0]}") for file in files]
    if target.suffix.lower() not in endings:
        *most, last = (ending for ending in endings if ending not in ALIASES)
        raise UsageError(f"{option} {target}: the {what} is a {', '.join(most)} or {last}.")
    if len(files) > 1:
        raise UsageError(f"{option} {target} is one {what} for {len(files)} frames: name a folder.")
    return [given]


def _wcs_of(args: argparse.Namespace, file: str) -> str | None:
    """The ``.wcs`` that is asked for beside ``file``, None without."""
    if args.name_wcs:
        # astrometry.net's name: m42.fits.gz gives m42.wcs.
        return str(Path(file.removesuffix(".gz").removesuffix(".bz2")).with_suffix(".wcs"))
    return f"{file}.wcs" if args.wcs else None


def _refuse_overwriting(requests: list[SolveRequest], overwrite: bool) -> None:
    inputs = [request.file for request in requests]
    headers = _refuse_shared([(w.wcs, w.file) for w in requests if w.wcs], "WCS", "solve them with --wcs")
    after = "solve them one after the other into different folders"
    pictures = _refuse_shared([(w.annotate, w.file) for w in requests if w.annotate], "image", after)
    pictures |= _refuse_shared([(w.objects, w.file) for w in requests if w.objects], "list", after)
    if headers:
        refuse_wcs_over(headers, inputs, overwrite)
    if pictures:
        from kochab.frames.outputs import refuse_overwriting

        refuse_overwriting(pictures, inputs, overwrite)


def _refuse_shared(outputs: list[tuple[str, str]], what: str, advice: str) -> dict[str, str]:
    """The files by what is written from them; UsageError when one output is of two files."""
    found: dict[str, str] = {}
    for target, file in outputs:
        if found.setdefault(target, file) != file:
            raise UsageError(f"{target} would be the {what} of both {found[target]} and {file}: {advice}.")
    return found


def frames_in(given: str) -> list[str]:
    """The frames of a folder by name; what is no folder, or has none, stays as it is."""
    path = Path(given)
    if not path.is_dir():
        return [given]
    from kochab.frames import frames_of

    try:
        return [*map(str, frames_of(path))] or [given]
    except OSError:
        return [given]  # told in its turn, like a file that cannot be read


def named_frames(names: list[str]) -> tuple[list[str], list[str]]:
    """What was given, and the frames in it; UsageError for a folder without any and for what does not exist."""
    given = named(names)
    files = [file for one in given for file in frames_in(one)]
    for file in files:
        if Path(file).is_dir():
            raise UsageError(f"{file} is a folder without frames.")
        if not Path(file).exists():
            raise UsageError(f"{file} does not exist.")
    return given, files


def _why_no_pictures(folder: str) -> str:
    try:
        os.listdir(folder)
    except OSError as error:
        return f"{folder} cannot be read: {error.strerror}."
    return f"{folder} is a folder without frames."


# -- ``kochab identify STARS.csv...``: where lists of star positions point ---------------------


def add_identify_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``identify`` to the command line."""
    parser = subparsers.add_parser(
        "identify",
        description=(
            "A list holds x,y or x,y,flux a line, in pixels, x right, y down, (0, 0) the centre "
            "of the first pixel; without flux the brightest comes first."
        ),
    )
    parser.add_argument("files", nargs="+", metavar="STARS.csv", help="lists of stars")
    parser.add_argument("--width", type=whole(*PIXELS), required=True, metavar="W", help="frame, px")
    parser.add_argument("--height", type=whole(*PIXELS), required=True, metavar="H", help="frame, px")
    add_options(parser, *BATCH)
    parser.set_defaults(run=run_identify)


def run_identify(args: argparse.Namespace) -> int:
    """Identify every list, print as they are done."""
    size = (args.width, args.height)
    return _solve(args, [SolveRequest(file, _wcs_of(args, file), list_size=size) for file in named(args.files)])


# -- ``kochab detect FILE``: the stars of a frame, without naming them -------------------------


def add_detect_parser(subparsers: "argparse._SubParsersAction[Any]") -> None:
    """Add ``detect`` to the command line."""
    parser = subparsers.add_parser(
        "detect",
        description="Positions are in pixels, x right, y down, (0, 0) the centre of the first pixel;"
        " angles in degrees from x towards y. Exit code: 0 done, with stars or without, 2 unusable input.",
    )
    parser.add_argument("file", metavar="FILE", help="a frame of the night sky")
    add_options(parser, "--detector", "--methods", "--json", "--frame")
    add_options(parser, "--set", help="an option of the detector; may be repeated")
    parser.set_defaults(run=run_detect)


def run_detect(args: argparse.Namespace) -> int:
    """Print the detections; 2 when the file cannot be read."""
    from kochab.detection import DETECTORS
    from kochab.frames import read_frame

    DETECTORS.check(args.detector)
    options = detector_settings_of(args.settings, args.detector)
    try:
        started = time.perf_counter()
        frame = read_frame(args.file, number=args.frame)
        read = time.perf_counter()
        detections = DETECTORS.make(args.detector, **options).detect(frame)
        done = time.perf_counter()
    except KochabError as error:
        if not args.json:
            raise
        print(json.dumps({"file": args.file, "error": str(error)}))
        return 2
    if args.json:
        elapsed = {"read": 1e3 * (read - started), "detect": 1e3 * (done - read)}
        fields = {**detections_json(detections), "warnings": list(frame.warnings), "elapsed_ms": elapsed}
        print(json.dumps({"file": args.file, **fields}))
    else:
        print("\n".join([detections_text(detections), *(f"note: {text}" for text in frame.warnings)]))
    return 0


def detections_text(detections: "Detections") -> str:
    """A table with a line of totals."""
    lines = [
        f"{len(detections)} stars in {detections.width} x {detections.height}, "
        f"background {detections.background:.5g}, noise {detections.noise:.4g}",
        f"{'x':>9} {'y':>9} {'flux':>11} {'SNR':>8} {'FWHM':>6} {'long':>5} {'angle':>6}",
    ]
    for star in detections_json(detections)["stars"]:
        marks = " saturated" * star["saturated"] + " blended" * star["blended"]
        lines.append(
            f"{star['x']:9.2f} {star['y']:9.2f} {star['flux'] or 0:11.5g} {star['snr'] or 0:8.1f} "
            f"{star['fwhm_px'] or 0:6.2f} {star['elongation'] or 0:5.2f} {star['angle_deg'] or 0:6.1f}{marks}"
        )
    return "\n".join(lines)
