"""``kochab -f FILE ...``: ASTAP's command line, so that capture programs can call Kochab instead.

Facts: the options and the ``.ini`` of ASTAP's manual, "command line". Options that steer ASTAP's
own search are read and left alone; what is believed of field and place is a hint here as well.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from app.cli.batch import attempt
from app.cli.output import Json, ProgressLine
from app.cli.streams import say
from app.core.errors import KochabError
from app.core.frame import Frame
from app.core.hint import Hint
from app.core.progress import Task
from app.core.solution import NoSolution, Solution

FLAGS = {"-wcs", "-update", "-annotate", "-log", "-debug", "-progress", "-sip", "-h", "-help"}
"""Options without a value; all others have one."""
TIMEOUT_S = 60.0


@dataclass(slots=True)
class Order:
    """What was asked, as ASTAP's letters: hours, degrees, and degrees from the south pole."""

    said: dict[str, str] = field(default_factory=dict)

    @property
    def file(self) -> str:
        """The frame."""
        return self.said["-f"]

    @property
    def base(self) -> str:
        """Where answers go, without an ending."""
        return self.said.get("-o") or str(Path(self.file).with_suffix(""))

    def number(self, name: str) -> float | None:
        """The value of an option, None when it was not given or is no number."""
        try:
            value = float(self.said[name])
        except (KeyError, ValueError):
            return None
        return value if math.isfinite(value) else None


def run(arguments: Sequence[str]) -> int:
    """Solve one file, write ``.ini`` and ``.wcs``: 0 solved, 1 not."""
    order = _order(arguments)
    if not Path(order.file).name:
        say("A file's name is empty.")
        return 1
    line = ProgressLine(order.file)
    try:
        outcome = attempt(_answered, order, line)
    finally:
        line.clear()
    failed = {"PLTSOLVD": "F", "ERROR": outcome.get("error", "")}
    told = failed if "error" in outcome else outcome
    told["CMDLINE"] = " ".join(("kochab", *arguments))
    try:
        _write_ini(order.base, told)
    except KochabError as error:
        told = {"ERROR": told.get("ERROR", str(error))}
    if "ERROR" in told:
        say(told["ERROR"])
        return 1
    print(f"Solved: {order.base}.ini")
    return 0


def _answered(order: Order) -> Task[Json]:
    """What the ``.ini`` says."""
    frame, result = yield from _solved(order)
    if isinstance(result, NoSolution):
        reason = f"{Path(order.file).name}: {result.reason}. {result.advice}"
        return {"PLTSOLVD": "F", "ERROR": reason, "WARNING": " ".join(result.warnings)}
    notes = (*_written(order, frame, result), *result.warnings)
    size = f"{frame.width} x {frame.height}"
    return {"PLTSOLVD": "T", **_cards(result), "DIMENSIONS": size, "WARNING": " ".join(notes)}


def _order(arguments: Sequence[str]) -> Order:
    order, words = Order(), list(arguments)
    while words:
        name = words.pop(0)
        order.said[name.lower()] = "" if name.lower() in FLAGS or not words else words.pop(0)
    return order


def _solved(order: Order) -> Task[tuple[Frame, Solution | NoSolution]]:
    from app.frames import read_frame
    from app.solve.contradicted import with_doubts
    from app.solve.options import SolveOptions
    from app.workflows.solve_frame import solve_open_frame

    frame = read_frame(order.file)
    hint = _hint(order, frame.height)
    options = SolveOptions(hint=hint if hint.helps else None, timeout_s=TIMEOUT_S)
    solved = yield from solve_open_frame(frame, options)
    return frame, with_doubts(solved.result, options)


def _hint(order: Order, height: int) -> Hint:
    """``-fov`` is the frame's height in degrees, 0 for not known."""
    scale = centre = None
    fov, ra, spd = (order.number(name) for name in ("-fov", "-ra", "-spd"))
    if fov is not None and 0.001 <= fov <= 170.0:
        middle = 3600.0 * math.degrees(2.0 * math.tan(math.radians(fov) / 2.0) / height)
        scale = (middle / 1.15, middle * 1.15)
    if ra is not None and spd is not None and 0.0 <= spd <= 180.0:
        radius = order.number("-r") or 180.0
        centre = (ra * 15.0 % 360.0, spd - 90.0, min(max(radius, 0.1), 180.0))
    return Hint(scale_arcsec_px=scale, centre_deg=centre, source="command line")


def _written(order: Order, frame: Frame, solution: Solution) -> list[str]:
    """Write what stands beside the ``.ini``; sentences about what could not be written."""
    from app.cli.written import write_picture, write_wcs_to
    from app.solve.wcs import write_solved_copy

    notes = write_wcs_to(f"{order.base}.wcs", solution)
    if "-annotate" in order.said:
        notes += write_picture(f"{order.base}_annotated.jpg", frame, solution)
    if "-update" in order.said:
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
    side = math.copysign(1.0, a * d - b * c)
    told = {
        "CRPIX1": (width + 1) / 2.0, "CRPIX2": (height + 1) / 2.0, "CRVAL1": ra, "CRVAL2": dec,
        "CDELT1": side * math.hypot(a, c), "CDELT2": math.hypot(b, d),
        "CROTA1": math.degrees(math.atan2(side * c, side * a)),
        "CROTA2": math.degrees(math.atan2(-b, d)),
        "CD1_1": a, "CD1_2": b, "CD2_1": c, "CD2_2": d,
    }  # fmt: skip
    return {name: f"{value:.14E}" for name, value in told.items()}


def _cd_at_centre(solution: Solution) -> tuple[tuple[float, float], tuple[float, float]]:
    """Degrees of (east, north) a pixel of (x, y), by a step of a pixel each way."""
    camera = solution.camera
    ra, dec = np.radians(solution.ra_dec_deg)
    east = np.array([-np.sin(ra), np.cos(ra), 0.0])
    north = np.array([-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)])
    middle = np.array([camera.width - 1.0, camera.height - 1.0]) / 2.0
    steps = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    rays = camera.unproject(middle + steps) @ solution.attitude.matrix
    ahead = rays @ np.cross(east, north)
    plane = np.degrees(np.stack([rays @ east, rays @ north]) / ahead)
    x, y = (plane[:, 1] - plane[:, 0]) / 2.0, (plane[:, 3] - plane[:, 2]) / 2.0
    return (float(x[0]), float(y[0])), (float(x[1]), float(y[1]))


def _write_ini(base: str, facts: dict[str, str]) -> None:
    from app.frames.whole_file import write_whole

    lines = (f"{name}={' '.join(value.split())}\n" for name, value in facts.items() if value)
    try:
        write_whole(f"{base}.ini", "".join(lines))
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise KochabError(f"{base}.ini cannot be written: {why}.") from None
