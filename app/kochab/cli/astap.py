"""``kochab -f FILE ...``: ASTAP's command line, so that capture programs can call Kochab instead.

Facts: the options and the ``.ini`` of ASTAP's manual, "command line". Options that steer ASTAP's
own search are read and left alone; what is believed of the field is a hint here as well.

``-r`` is a bound, as it is for ASTAP, which looks no farther than that from where it starts: ``-ra`` and ``-spd``,
else the position in the file's header. An answer whose centre lies farther away is refused. Without ``-r`` (ASTAP's
own default is 180, the whole sky), with one that is not above zero, or without a start position, there is no bound.

``-fov`` is a bound within `FIELD_FACTOR`, beyond which an answer is refused. ASTAP warns from 5 % off, we from 27 %.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kochab.cli.batch import attempt
from kochab.cli.output import with_progress
from kochab.cli.process import say
from kochab.core.attitude import east_north
from kochab.core.errors import KochabError, UsageError, printable
from kochab.core.frame import Frame, Hint
from kochab.core.progress import Task
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.workflows.solution_json import Json

FLAGS = {"-wcs", "-update", "-annotate", "-log", "-debug", "-progress", "-sip", "-h", "-help"}
"""Options without a value; all others have one."""
TIMEOUT_S, PICTURE = 60.0, "_annotated.jpg"
FIELD_FACTOR = 2.5
"""How far off ``-fov`` may be: binning not told to the caller makes 2, a reducer or a Barlow lens forgotten up to 2."""


@dataclass(slots=True)
class AstapRequest:
    """What was asked, as ASTAP's letters: hours, degrees, and degrees from the south pole."""

    options: dict[str, str] = field(default_factory=dict)

    @property
    def file(self) -> str:
        """The frame."""
        return self.options["-f"]

    @property
    def base(self) -> str:
        """Where answers go, without an ending."""
        return self.options.get("-o") or str(Path(self.file).with_suffix(""))

    def number(self, name: str) -> float | None:
        """The value of an option, None when it was not given or is no number."""
        try:
            value = float(self.options[name])
        except (KeyError, ValueError):
            return None
        return value if math.isfinite(value) else None


def run(arguments: Sequence[str]) -> int:
    """Solve one file, write ``.ini`` and ``.wcs``: 0 solved, 1 not."""
    order = _order(arguments)
    try:
        if not Path(order.file).name:
            raise UsageError("A file's name is empty.")
        _spare(order, ".ini")
    except UsageError as error:
        say(str(error))
        return 1
    outcome = attempt(order.file, lambda: with_progress(order.file, _answered(order)))
    ini_fields = {"PLTSOLVD": "F", "ERROR": outcome.get("error", "")} if "error" in outcome else outcome
    ini_fields["CMDLINE"] = " ".join(("kochab", *arguments))
    try:
        _write_ini(order.base, ini_fields)
    except KochabError as error:
        ini_fields = {"ERROR": ini_fields.get("ERROR", str(error))}
    if "ERROR" in ini_fields:
        say(ini_fields["ERROR"])
        return 1
    print(f"Solved: {printable(order.base)}.ini")
    return 0


def _spare(order: AstapRequest, *endings: str) -> None:
    """Spare the frame, and what no solver wrote; ASTAP renews its own, a picture is never replaced."""
    from kochab.frames.outputs import is_solution_file, refuse_input

    for ending in endings:
        target = order.base + ending
        refuse_input(target, [order.file])
        if ending != PICTURE and Path(target).is_file() and not is_solution_file(target):
            raise UsageError(f"{target} exists and no solver wrote it: name another base with -o.")


def _answered(order: AstapRequest) -> Task[Json]:
    """What the ``.ini`` says, also of what is refused: one of an earlier frame must not stay."""
    _spare(order, ".wcs", *([PICTURE] if "-annotate" in order.options else []))
    frame, result = yield from _solved(order)
    if isinstance(result, NoSolution):
        reason = f"{Path(order.file).name}: {result.reason}. {result.advice}"
        return {"PLTSOLVD": "F", "ERROR": reason, "WARNING": " ".join(result.warnings)}
    notes = (*_written(order, frame, result), *result.warnings)
    size = f"{frame.width} x {frame.height}"
    return {"PLTSOLVD": "T", **_cards(result), "DIMENSIONS": size, "WARNING": " ".join(notes)}


def _order(arguments: Sequence[str]) -> AstapRequest:
    order, words = AstapRequest(), list(arguments)
    while words:
        name = words.pop(0)
        # A word that is no flag takes the next one, whatever that begins with, but for the file's own.
        order.options[name.lower()] = "" if name.lower() in FLAGS or words[:1] in ([], ["-f"]) else words.pop(0)
    return order


def _solved(order: AstapRequest) -> Task[tuple[Frame, Solution | NoSolution]]:
    from kochab.frames import reading
    from kochab.solver import SolveOptions
    from kochab.solver.pipeline import with_doubts, within_radius
    from kochab.workflows.solve_frame import solve_open_frame

    frame = yield from reading(order.file, TIMEOUT_S)
    hint = _hint(order, frame.height)
    options = SolveOptions(hint=hint if hint.helps else None, timeout_s=TIMEOUT_S)
    solved = yield from solve_open_frame(frame, options)
    result = within_radius(within_field(solved.result, hint.scale_arcsec_px), _bound(order, frame.hint))
    return frame, with_doubts(result, options)


def within_field(result: Solution | NoSolution, scale: tuple[float, float] | None) -> Solution | NoSolution:
    """``result``, or no solution when its pixel scale is not about the one given (arcsec/px, from and to)."""
    if scale is None or not isinstance(result, Solution):
        return result
    given, found = math.sqrt(scale[0] * scale[1]), result.camera.scale_arcsec_px
    if 1.0 / FIELD_FACTOR <= found / given <= FIELD_FACTOR:
        return result
    from kochab.solver.pipeline import refused

    scale_note = f" and {found:.4g} arcsec/px; -fov means {given:.4g}."
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
    from kochab.frames.wcs import write_solved_copy

    notes = write_wcs_to(f"{order.base}.wcs", solution)
    if "-annotate" in order.options:
        if Path(picture := order.base + PICTURE).exists():
            notes.append(f"{picture} exists already and was not replaced.")
        else:
            notes += write_picture(picture, frame, solution)
    if "-update" in order.options:
        try:
            write_solved_copy(solution, order.file, order.file)
        except KochabError as error:
            notes.append(str(error))
    return notes


def _cards(solution: Solution) -> dict[str, str]:
    """The tangent plane at the middle of the frame, where ASTAP's readers expect it.

    Its turn and scale (``CROTA``, ``CDELT``) are in AIPS' convention.
    """
    ra, dec = solution.ra_dec_deg
    width, height = solution.camera.width, solution.camera.height
    (a, b), (c, d) = _cd_at_centre(solution)
    # y grows downwards: an unmirrored frame has a positive determinant, and the sign of CDELT1 tells it.
    side = math.copysign(1.0, a * d - b * c)
    keywords = {
        "CRPIX1": (width + 1) / 2.0,
        "CRPIX2": (height + 1) / 2.0,
        "CRVAL1": ra,
        "CRVAL2": dec,
        "CDELT1": side * math.hypot(a, c),
        "CDELT2": math.hypot(b, d),
        "CROTA1": math.degrees(math.atan2(side * c, side * a)),
        "CROTA2": math.degrees(math.atan2(-b, d)),
        "CD1_1": a,
        "CD1_2": b,
        "CD2_1": c,
        "CD2_2": d,
    }
    return {name: f"{value:.14E}" for name, value in keywords.items()}


def _cd_at_centre(solution: Solution) -> tuple[tuple[float, float], tuple[float, float]]:
    """Degrees of (east, north) a pixel of (x, y), by a step of a pixel each way."""
    camera = solution.camera
    east, north = east_north(solution.centre_vector)
    middle = np.array([camera.width - 1.0, camera.height - 1.0]) / 2.0
    # Differences over two pixels: the lens' distortion at the centre is in them, which a formula for TAN leaves out.
    steps = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    rays = camera.unproject(middle + steps) @ solution.attitude.matrix
    ahead = rays @ np.cross(east, north)
    plane = np.degrees(np.stack([rays @ east, rays @ north]) / ahead)
    x, y = (plane[:, 1] - plane[:, 0]) / 2.0, (plane[:, 3] - plane[:, 2]) / 2.0
    return (float(x[0]), float(y[0])), (float(x[1]), float(y[1]))


def _write_ini(base: str, facts: dict[str, str]) -> None:
    from kochab.frames.atomic_file import write_atomically as write_whole

    # One line a fact: callers read the .ini by lines, and an advice may hold line ends.
    lines = (f"{name}={' '.join(value.split())}\n" for name, value in facts.items() if value)
    try:
        write_whole(f"{base}.ini", "".join(lines))
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise KochabError(f"{base}.ini cannot be written: {why}.") from None
