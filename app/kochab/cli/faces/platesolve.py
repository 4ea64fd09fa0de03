"""PlateSolve2's and PlateSolve3's command lines, as N.I.N.A., CCDciel and SGP call them.

``kochab platesolve2 RA,DEC,WIDTH,HEIGHT,REGIONS,FILE,WAIT`` writes a file of the frame's name with the ending ``.apm``,
``kochab platesolve3 FILE [RA DEC WIDTH HEIGHT]`` one with ``_PS3.txt``; all angles are radians. Or Kochab called by one
of those names.

Facts: PlaneWave publishes neither form. They are those of N.I.N.A. (``Platesolve2Solver.cs``, ``Platesolve3Solver.cs``,
which quotes PlaneWave) and CCDciel (``cu_astrometry_engine.pas``: what the angle and the third field of ``.apm`` mean,
and that its third line has twenty letters when solved). Neither original was run. Where they start is a hint here, and
so are PlateSolve2's regions; the width is a bound, as ``-fov`` is for :mod:`kochab.cli.faces.astap`. PlateSolve2's
wait, for which its window stays, is read and left alone. Exit code: 0 when a result was written, solved or not, else 1.
"""

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from kochab.cli.batch import attempt
from kochab.cli.output import with_progress
from kochab.cli.process import say
from kochab.core.errors import UsageError
from kochab.core.frame import Hint
from kochab.core.progress import Task
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.workflows.solution_json import Json

WRITTEN, NOT_WRITTEN, TIMEOUT_S = 0, 1, 60.0
SOLVED_2 = "Valid plate solution"
"""CCDciel counts its letters."""
LEAST_RADIUS_DEG = 5.0


@frozen
class PlateRequest:
    """A frame, where it may point and how wide it is, degrees; None where that is not known."""

    file: str
    place: tuple[float, float, float] | None
    width_deg: float | None


def run_2(arguments: Sequence[str]) -> int:
    """Solve one file and write its ``.apm``."""
    # One word of commas; a blank in the file's name parts it, as N.I.N.A. sends it without quotes.
    fields = " ".join(arguments).split(",")
    if len(fields) < 7:
        say("Give RA,DEC,WIDTH,HEIGHT,REGIONS,FILE,WAIT, with angles in radians.")
        return NOT_WRITTEN
    file = ",".join(fields[5:-1])
    return _run(file, str(Path(file).with_suffix(".apm")), lambda: _request(file, fields[:4], fields[4]), _apm)


def run_3(arguments: Sequence[str]) -> int:
    """Solve one file and write its ``_PS3.txt``."""
    if len(arguments) not in (1, 5):
        say("Give FILE, or FILE RA DEC WIDTH HEIGHT, with angles in radians.")
        return NOT_WRITTEN
    file, *numbers = arguments
    target = f"{Path(file).with_suffix('')}_PS3.txt"
    return _run(file, target, lambda: _request(file, numbers or ["0"] * 4), _ps3)


def _run(
    file: str, target: str, request: Callable[[], PlateRequest], text: Callable[[Solution | NoSolution | str], str]
) -> int:
    """Solve, write ``text`` of the result to ``target``, and say why there is none."""
    from kochab.frames.atomic_file import write_atomically
    from kochab.frames.outputs import refuse_input

    def work() -> Json:
        if not Path(file).name:
            raise UsageError("A file's name is empty.")
        return {"result": with_progress(file, _solved(request()))}

    try:
        refuse_input(target, [file])
        if Path(target).is_file() and not _is_result(target):
            raise UsageError(f"{target} exists and no solver wrote it: move it away.")
    except UsageError as error:
        say(str(error))
        return NOT_WRITTEN
    outcome = attempt(file, work)
    result = outcome.get("result") or str(outcome["error"])
    if not isinstance(result, Solution):
        say(f"{result.reason}. {result.advice}" if isinstance(result, NoSolution) else result)
    try:
        write_atomically(target, text(result))
    except OSError as error:
        say(f"{target} cannot be written: {error.strerror or error}.")
        return NOT_WRITTEN
    return WRITTEN


def _is_result(path: str) -> bool:
    """Whether a file is one that PlateSolve writes: a verdict, or three numbers of which the last is whole."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return re.match(r"(?i)true$|false$|[-+\d.,eE]+,\d+$|$", file.readline(1000).strip()) is not None
    except OSError:
        return False


def _request(file: str, numbers: Sequence[str], regions: str = "1") -> PlateRequest:
    """UsageError when a number is none. RA and Dec that are both zero mean that nobody knows (N.I.N.A.)."""
    try:
        ra, dec, width, height = (math.degrees(float(number)) for number in numbers)
        count = max(int(float(regions)), 1)
    except (ValueError, OverflowError):
        raise UsageError(f"{','.join([*numbers, regions])[:80]}: one of these is not a number.") from None
    if not all(map(math.isfinite, (ra, dec, width, height))) or abs(dec) > 90.0:
        raise UsageError(f"RA {ra:g}, Dec {dec:g} degrees is no place on the sky.")
    if (ra, dec) == (0.0, 0.0):
        return PlateRequest(file, None, width if 0.0 < width < 180.0 else None)
    # The regions lie around the first in a square.
    reach = max(width, height, 0.0) * (math.sqrt(count) + 1.0) / 2.0
    place = (ra, dec, min(max(reach, LEAST_RADIUS_DEG), 180.0))
    return PlateRequest(file, place, width if 0.0 < width < 180.0 else None)


def _solved(request: PlateRequest) -> Task[Solution | NoSolution]:
    from kochab.cli.faces.astap import within_field
    from kochab.frames import reading
    from kochab.solver import SolveOptions
    from kochab.workflows.solve_frame import solve_open_frame

    frame = yield from reading(request.file, TIMEOUT_S)
    scale = None
    if request.width_deg is not None:
        middle = 3600.0 * math.degrees(2.0 * math.tan(math.radians(request.width_deg) / 2.0) / frame.width)
        scale = (middle / 1.15, middle * 1.15)
    hint = Hint(scale_arcsec_px=scale, centre_deg=request.place, source="command line")
    options = SolveOptions(hint=hint if hint.helps else None, timeout_s=TIMEOUT_S)
    solved = yield from solve_open_frame(frame, options)
    return within_field(solved.result, scale, "the width given")


def _apm(result: Solution | NoSolution | str) -> str:
    """RA, Dec and 1; scale, angle, y to x, skew and stars; a verdict."""
    from kochab.workflows.other_solvers import parity

    if not isinstance(result, Solution):
        return "0,0,0\n0,0,0,0,0\nNo solution\n"
    ra, dec = map(math.radians, result.ra_dec_deg)
    # A frame that is not mirrored has y to x below zero, and the angle counts the other way.
    up, side = _up_deg(result), -parity(result)
    angle = (180.0 - up if side > 0 else -up) % 360.0
    scale = result.camera.scale_arcsec_px
    stars = len(result.stars)
    return f"{ra:.9f},{dec:.9f},1\n{scale:.6f},{angle:.4f},{side * 1.0:.4f},0.0000,{stars}\n{SOLVED_2}\n"


def _ps3(result: Solution | NoSolution | str) -> str:
    """Verdict; RA, Dec; px a radian, angle; method; the plane's turn with its sign changed; origin; figures."""
    from kochab.workflows.other_solvers import cd_at_centre

    if not isinstance(result, Solution):
        return "False\n"
    ra, dec = map(math.radians, result.ra_dec_deg)
    camera = result.camera
    scale = math.radians(camera.scale_arcsec_px / 3600.0)
    turn = ",".join(f"{-math.radians(value) / scale:.6f}" for row in cd_at_centre(result) for value in row)
    lines = [
        "True",
        f"{ra:.9f},{dec:.9f}",
        f"{1.0 / scale:.4f},{_up_deg(result) % 360.0:.4f}",
        "Kochab",
        f"{turn},0,0,0,0",
        f"{(camera.width - 1) / 2.0:.1f},{(camera.height - 1) / 2.0:.1f}",
        f"0,{result.rms_px:.4f},0,{result.detections},{len(result.stars)}",
    ]
    return "\n".join((*lines, ""))


def _up_deg(solution: Solution) -> float:
    """Position angle of up (towards the first row), degrees east of north."""
    from kochab.workflows.other_solvers import cd_at_centre

    (_, east), (_, north) = cd_at_centre(solution)
    return math.degrees(math.atan2(-east, -north))
