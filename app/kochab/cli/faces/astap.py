"""ASTAP's command line, so that capture programs can call Kochab instead of it.

``kochab -f FILE ...``, or Kochab called by the name ``astap`` or ``astap_cli``.

Facts: the options, the ``.ini`` and the exit codes of ASTAP's manual, "command line", and what Debian's ``astap_cli``
does. 0 solved or measured, 1 no solution, 2 too few stars, 16 the frame cannot be read, 32 no star catalogue, 33 it is
damaged. Options that steer ASTAP's own search (`IGNORED`) are read and left alone; what is believed of the field is a
hint here as well. Tasks that Kochab does not do (`REFUSED`) are refused with a sentence, in the ``.ini`` too.

``-r`` is a bound, as it is for ASTAP, which looks no farther than that from where it starts: ``-ra`` and ``-spd``,
else the position in the file's header. An answer whose centre lies farther away is refused. Without ``-r`` (ASTAP's
own default is 180, the whole sky), with one that is not above zero, or without a start position, there is no bound.

``-fov`` is a bound within `FIELD_FACTOR`, beyond which an answer is refused. ASTAP warns from 5 % off, we from 27 %.
"""

import math
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import field
from pathlib import Path

from kochab.cli.batch import attempt
from kochab.cli.output import with_progress
from kochab.cli.process import say
from kochab.core.errors import CatalogueError, FrameError, KochabError, UsageError, printable
from kochab.core.frame import Frame, Hint
from kochab.core.progress import Task
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.core.values import mutable
from kochab.workflows.other_solvers import cd_at_centre
from kochab.workflows.solution_json import Json

SOLVED, NO_SOLUTION, FEW_STARS, UNREADABLE, NO_CATALOGUE, BAD_CATALOGUE = 0, 1, 2, 16, 32, 33
"""Exit codes."""
FLAGS = {"-wcs", "-update", "-annotate", "-log", "-debug", "-progress", "-h", "-help"}
"""Options without a value."""
IGNORED = {"-z", "-s", "-t", "-m", "-check", "-speed", "-d"}
"""Of ASTAP's own search, with a value: binning, stars, tolerance, star size, pattern filter, overlap, database."""
VALUED = {"-f", "-o", "-r", "-fov", "-ra", "-spd", "-analyse", "-extract"} | IGNORED
OPTIONAL = {"-sip"}
"""Options whose value may be left out: ``-sip n`` asks for a plane without distortion."""
REFUSED = ("-stack", "-sqm", "-tofits", "-focus", "-extract2", "-save")
"""How ASTAP's other tasks begin."""
DEFAULT_SNR = 30.0
"""Of ``-analyse`` and ``-extract`` without a number."""
TIMEOUT_S, PICTURE = 60.0, "_annotated.jpg"
TOO_FEW = (Reason.TOO_FEW_STARS, Reason.CLOUDED_OR_DARK)
CSV_HEAD = "x,y,hfd,snr,flux"
FIELD_FACTOR = 2.5
"""How far off ``-fov`` may be: binning not told to the caller makes 2, a reducer or a Barlow lens forgotten up to 2."""


@mutable
class AstapRequest:
    """What was asked, as ASTAP's letters: hours, degrees, and degrees from the south pole."""

    options: dict[str, str] = field(default_factory=dict)
    refused: str = ""

    @property
    def file(self) -> str:
        """The frame."""
        return self.options["-f"]

    @property
    def base(self) -> str:
        """Where answers go, without an ending: ASTAP takes one off the name it is given too."""
        return str(Path(self.options.get("-o") or self.file).with_suffix(""))

    def number(self, name: str) -> float | None:
        """The value of an option, None when it was not given or is no number."""
        try:
            value = float(self.options[name])
        except (KeyError, ValueError):
            return None
        return value if math.isfinite(value) else None


def run(arguments: Sequence[str]) -> int:
    """Solve or measure one file, write what ASTAP writes beside it, and return ASTAP's exit code."""
    order = _order(arguments)
    if not order.options.get("-f"):
        say("A file's name is empty." if "-f" in order.options else "Name the frame: -f FILE.")
        return UNREADABLE if "-f" in order.options else NO_SOLUTION
    try:
        if not Path(order.file).name:
            raise UsageError("A file's name is empty.")
        _spare(order, ".ini", *([".log"] if "-log" in order.options else []))
    except UsageError as error:
        say(str(error))
        return NO_SOLUTION
    log = [" ".join(("kochab", *arguments))]
    outcome, code = _outcome(order, log)
    if "MEASURED" in outcome:
        print(outcome["MEASURED"])
        return code
    ini_fields = {"PLTSOLVD": "F", "ERROR": outcome.get("error", "")} if "error" in outcome else outcome
    ini_fields["CMDLINE"] = " ".join(("kochab", *arguments))
    try:
        _write(order.base + ".ini", _ini_text(ini_fields))
        if "-log" in order.options:
            log += [ini_fields.get("ERROR") or "Solved.", *filter(None, [ini_fields.get("WARNING")])]
            _write(order.base + ".log", "".join(f"{time.strftime('%H:%M:%S')}  {line}\n" for line in log))
    except KochabError as error:
        code, ini_fields = code or NO_SOLUTION, {"ERROR": ini_fields.get("ERROR", str(error))}
    if "ERROR" in ini_fields:
        say(ini_fields["ERROR"])
        return code
    print(f"Solved: {printable(order.base)}.ini")
    return SOLVED


def _outcome(order: AstapRequest, log: list[str]) -> tuple[Json, int]:
    """What the ``.ini`` says, or what was measured; and the exit code."""
    code = NO_SOLUTION

    def work() -> Json:
        nonlocal code
        try:
            fields, code = with_progress(order.file, _answered(order, log))
        except FrameError:
            code = UNREADABLE
            raise
        except CatalogueError as error:
            code = NO_CATALOGUE if isinstance(error.__context__, FileNotFoundError) else BAD_CATALOGUE
            raise
        return fields

    return attempt(order.file, work), code


def _spare(order: AstapRequest, *endings: str) -> None:
    """Spare the frame, and what no solver wrote; ASTAP renews its own, a picture is never replaced."""
    from kochab.frames.outputs import is_solution_file, refuse_input

    for ending in endings:
        target = order.base + ending
        refuse_input(target, [order.file])
        of_solver = _is_log if ending == ".log" else is_solution_file
        if ending != PICTURE and Path(target).is_file() and not of_solver(target):
            raise UsageError(f"{target} exists and no solver wrote it: name another base with -o.")


def _is_log(path: str) -> bool:
    """Whether a file is a ``.log`` of ASTAP's kind: its first line is a command line with the time of day."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return re.match(r"\d\d:\d\d:\d\d  \S.* -f ", file.readline(10_000)) is not None
    except OSError:
        return False


def _answered(order: AstapRequest, log: list[str]) -> Task[tuple[Json, int]]:
    """What the ``.ini`` says, also of what is refused: one of an earlier frame must not stay; and the exit code."""
    from kochab.frames import reading

    if order.refused:
        raise UsageError(f"Kochab has no {order.refused}: it solves, measures (-analyse, -extract) and no more.")
    if "-analyse" in order.options or "-extract" in order.options:
        frame = yield from reading(order.file, TIMEOUT_S)
        return _measured(order, frame)
    _spare(order, ".wcs", *([PICTURE] if "-annotate" in order.options else []))
    frame = yield from reading(order.file, TIMEOUT_S)
    log.append(f"{frame.width} x {frame.height} pixels read.")
    result = yield from _solved(order, frame)
    log.append(f"{result.detections} stars detected.")
    if isinstance(result, NoSolution):
        reason = f"{Path(order.file).name}: {result.reason}. {result.advice}"
        fields = {"PLTSOLVD": "F", "ERROR": reason, "WARNING": " ".join(result.warnings)}
        return fields, FEW_STARS if result.reason in TOO_FEW else NO_SOLUTION
    notes = (*_written(order, frame, result), *result.warnings)
    size = f"{frame.width} x {frame.height}"
    return {"PLTSOLVD": "T", **_cards(result), "DIMENSIONS": size, "WARNING": " ".join(notes)}, SOLVED


def _measured(order: AstapRequest, frame: Frame) -> tuple[Json, int]:
    """``HFD_MEDIAN`` and ``STARS`` as ASTAP prints them; with ``-extract`` the stars in a ``.csv``."""
    from kochab.detection.half_flux import counts_16_bit, half_flux_stars, median_hfd_px
    from kochab.frames.readers import named_as_fits

    extract = "-extract" in order.options
    snr_min = order.number("-extract" if extract else "-analyse") or DEFAULT_SNR
    stars = half_flux_stars(counts_16_bit(frame), snr_min)
    median = median_hfd_px(stars)
    if extract:
        _spare(order, ".csv")
        # FITS counts from 1, and ASTAP counts a picture's rows from its lower edge.
        fits = named_as_fits(order.file)
        rows = [(s.x + 1.0, s.y + 1.0 if fits else frame.height - s.y, s.hfd_px, s.snr, s.flux) for s in stars]
        lines = [f"{x:.4f},{y:.4f},{hfd:.4f},{snr:.0f},{flux:.0f}" for x, y, hfd, snr, flux in sorted(rows, key=_row)]
        _write(order.base + ".csv", "\n".join((CSV_HEAD, *lines, "")))
    # On Windows ASTAP tells both numbers in the exit code, for programs that see no output.
    code = round(median * 100) * 1_000_000 + len(stars) if sys.platform == "win32" else SOLVED
    return {"MEASURED": f"HFD_MEDIAN={median:.1f}\nSTARS={len(stars)}"}, code


def _row(star: tuple[float, ...]) -> float:
    return star[1]


def _order(arguments: Sequence[str]) -> AstapRequest:
    """The options by name; a value is the next word unless that is another option of ASTAP's."""
    order, words = AstapRequest(), list(arguments)
    while words:
        name = words.pop(0).lower()
        if name in FLAGS:
            order.options[name] = ""
        elif name in VALUED or (name in OPTIONAL and words and words[0].lower() in ("y", "n")):
            # A file's name may begin with a dash, another option's value must not be one.
            none = not words or (name != "-f" and words[0].lower() in FLAGS | VALUED | OPTIONAL)
            order.options[name] = "" if none else words.pop(0)
        elif name in OPTIONAL:
            order.options[name] = ""
        else:
            order.refused = name if name.startswith(REFUSED) else order.refused
            while words and not words[0].startswith("-"):  # its values
                words.pop(0)
    return order


def _solved(order: AstapRequest, frame: Frame) -> Task[Solution | NoSolution]:
    from kochab.solver import SolveOptions
    from kochab.solver.pipeline import with_doubts, within_radius
    from kochab.workflows.solve_frame import solve_open_frame

    hint = _hint(order, frame.height)
    bent = order.options.get("-sip", "").lower() != "n"
    options = SolveOptions(hint=hint if hint.helps else None, timeout_s=TIMEOUT_S, distortion=bent)
    solved = yield from solve_open_frame(frame, options)
    result = within_radius(within_field(solved.result, hint.scale_arcsec_px), _bound(order, frame.hint))
    return with_doubts(result, options)


def within_field(
    result: Solution | NoSolution, scale: tuple[float, float] | None, given_by: str = "-fov"
) -> Solution | NoSolution:
    """``result``, or no solution when its pixel scale is not about the one given (arcsec/px, from and to)."""
    if scale is None or not isinstance(result, Solution):
        return result
    given, found = math.sqrt(scale[0] * scale[1]), result.camera.scale_arcsec_px
    if 1.0 / FIELD_FACTOR <= found / given <= FIELD_FACTOR:
        return result
    from kochab.solver.pipeline import refused

    scale_note = f" and {found:.4g} arcsec/px; {given_by} means {given:.4g}."
    return refused(result, Reason.ANOTHER_FIELD, scale_note, scale_arcsec_px=found)


def _bound(order: AstapRequest, header: Hint) -> tuple[float, float, float] | None:
    """RA, Dec and radius, degrees, that the answer must lie in; None when it may be anywhere."""
    place = _requested_place(order) or (header.centre_deg and header.centre_deg[:2])
    radius = _radius(order)
    return None if place is None or radius is None else (*place, radius)


def _requested_place(order: AstapRequest) -> tuple[float, float] | None:
    """``-ra`` in hours and ``-spd`` from the south pole, as RA and Dec in degrees."""
    ra, spd = order.number("-ra"), order.number("-spd")
    if ra is None or spd is None or not 0.0 <= spd <= 180.0:
        return None
    return ra * 15.0 % 360.0, spd - 90.0


def _radius(order: AstapRequest) -> float | None:
    """``-r`` in degrees when it is one."""
    radius = order.number("-r")
    return radius if radius is not None and radius > 0.0 else None


def _hint(order: AstapRequest, height: int) -> Hint:
    """``-fov`` is the frame's height in degrees, 0 for not known."""
    scale = centre = None
    fov, place = order.number("-fov"), _requested_place(order)
    if fov is not None and 0.001 <= fov <= 170.0:
        # The scale at the centre of a flat picture: its height spans 2 tan(fov / 2) focal lengths.
        middle = 3600.0 * math.degrees(2.0 * math.tan(math.radians(fov) / 2.0) / height)
        scale = (middle / 1.15, middle * 1.15)
    if place is not None:
        centre = (*place, min(max(_radius(order) or 180.0, 0.1), 180.0))
    return Hint(scale_arcsec_px=scale, centre_deg=centre, source="command line")


def _written(order: AstapRequest, frame: Frame, solution: Solution) -> list[str]:
    """Write what stands beside the ``.ini``; sentences about what could not be written."""
    from kochab.cli.batch import write_picture, write_wcs_to

    notes = write_wcs_to(f"{order.base}.wcs", solution)
    if "-annotate" in order.options:
        if Path(picture := order.base + PICTURE).exists():
            notes.append(f"{picture} exists already and was not replaced.")
        else:
            notes += write_picture(picture, frame, solution)
    if "-update" in order.options:
        try:
            notes += _update(order.file, frame, solution)
        except KochabError as error:
            notes.append(str(error))
    return notes


def _update(file: str, frame: Frame, solution: Solution) -> list[str]:
    """Write the solution into the FITS file, or a picture with it as FITS beside the picture; why not."""
    from kochab.frames.readers import named_as_fits
    from kochab.frames.wcs import write_with_solution

    target = file if named_as_fits(file) else str(Path(file).with_suffix(".fits"))
    if target != file and Path(target).exists():
        return [f"{target} exists already and was not replaced."]
    write_with_solution(lambda: frame, solution, file, target)
    return []


def _cards(solution: Solution) -> dict[str, str]:
    """The tangent plane at the middle of the frame, where ASTAP's readers expect it.

    Its turn and scale (``CROTA``, ``CDELT``) are by ASTAP's own formula, which its author gave to CCDciel
    (``new_to_old_WCS``): that of AIPS, but for a positive determinant turned the other way.
    """
    ra, dec = solution.ra_dec_deg
    width, height = solution.camera.width, solution.camera.height
    (a, b), (c, d) = cd_at_centre(solution)
    # y grows downwards: an unmirrored frame has a positive determinant, and the sign of CDELT1 tells it.
    side = math.copysign(1.0, a * d - b * c)
    keywords = {
        "CRPIX1": (width + 1) / 2.0,
        "CRPIX2": (height + 1) / 2.0,
        "CRVAL1": ra,
        "CRVAL2": dec,
        "CDELT1": side * math.hypot(a, c),
        "CDELT2": math.hypot(b, d),
        "CROTA1": math.degrees(math.atan2(side * b, d)),
        "CROTA2": math.degrees(math.atan2(-c, side * a)),  # less a quarter turn: atan2(side * a, c) - 90 deg
        "CD1_1": a,
        "CD1_2": b,
        "CD2_1": c,
        "CD2_2": d,
    }
    return {name: f"{value:.14E}" for name, value in keywords.items()}


def _ini_text(facts: dict[str, str]) -> str:
    # One line a fact: callers read the .ini by lines, and an advice may hold line ends.
    return "".join(f"{name}={' '.join(value.split())}\n" for name, value in facts.items() if value)


def _write(path: str, text: str) -> None:
    from kochab.frames.atomic_file import write_atomically

    try:
        write_atomically(path, text)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise KochabError(f"{path} cannot be written: {why}.") from None
