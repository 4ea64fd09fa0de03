"""The axis of files: frames, WCS headers (``.wcs``), JSON of ``kochab solve`` and ``live``, and guide logs."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from kochab.attitude.fit import refine
from kochab.core.attitude import ARCSEC, Attitude, cross_product, unit_vectors
from kochab.core.camera import PROJECTIONS, Camera
from kochab.core.errors import FrameError, KochabError, UsageError
from kochab.core.frame import Hint, Site
from kochab.core.progress import Task
from kochab.core.solution import Matches, NamedStar, NoSolution, Reason, Solution
from kochab.core.values import frozen
from kochab.frames.fits import parse_cards
from kochab.frames.hints import NO_ZONE, aware_utc, hint_from_keywords
from kochab.frames.readers import named_as_fits
from kochab.frames.samples import MAX_SIDE_PX
from kochab.frames.wcs import wcs_of
from kochab.parsing.text_input import TextError, decoded, parse_json, read_bytes
from kochab.polar.bolts import Pitches
from kochab.polar.drift import Drift, Stretch, either, measure_drift, stretches_of, tracked
from kochab.polar.measure import Measurement, MeasureSettings, NoAxis, measure
from kochab.polar.pole import Pole
from kochab.polar.rotations import best_rotation
from kochab.sky.horizon import STANDARD_REFRACTION, Refraction
from kochab.solver import SolveOptions
from kochab.text.translation import tr, tr_noop
from kochab.workflows.polar.guide_logs import guide_log, is_guide_log
from kochab.workflows.polar.site_and_clock import doubts_of, given_doubts
from kochab.workflows.polar.sources import (
    GIVE_SITE,
    PolarNight,
    SolvedFile,
    last_night,
    remember_night,
    sightings_of,
    site_of,
    solve_polar_file,
)

SIGMA_PX = 0.2  # what a WCS is believed across the frame; its roll to this over a quarter of the width
ASSUMED = tr_noop("Solved by another program: an error of {sigma} px is assumed.")
SOLVERS = re.compile(rb"PLTSOLVD= +T|astrometry\.net|ASTAP|PLATESOLVE|ImageSolver", re.IGNORECASE)
"""What solvers leave in a header (ASTAP and Kochab, astrometry.net, PlateSolve, PixInsight)."""
HEADER_BYTES = 288_000
GRID = (15, 11)
WORST_MAP_PX, WORST_STARS_PX = 3.0, 20.0  # of a header's map from its best camera; of stars from where they are put
LONGEST_NAME = 4096
FINEST_RAD_PX = 1e-9  # a pixel of 0.2 mas
ENOUGH_FRAMES = 10
SOLVED = (".wcs", ".json", ".jsonl")
"""Suffixes of files that hold solutions and no picture."""


def solved_before(path: str | Path) -> list[SolvedFile]:
    """What a ``.wcs`` or JSON file says, with time and site of the picture it belongs to.

    The picture is the one that the JSON names, or the one beside the ``.wcs`` with the same name; a header with
    DATE-OBS needs none.

    Raises FrameError when it holds no solution; one sentence.
    """
    path = Path(path)
    try:
        data = read_bytes(path)
    except TextError as error:
        raise FrameError("{error}", error=error) from None
    if path.suffix.lower() in (".json", ".jsonl"):
        streamed = path.suffix.lower() == ".jsonl"  # of a recorded live session, where some frame is always cloudy
        rows = enumerate(_rows(path, data), 1)
        return [_of_json(path, line, row) for line, row in rows if row["solved"] or not streamed]
    solution, hint = of_header(path, data)
    hint, zone = _beside(path) if hint.time_utc is None else (hint, ())
    return [SolvedFile(str(path), solution, hint.time_utc, hint.site, (tr(ASSUMED, sigma=SIGMA_PX), *zone))]


def or_as_its_header_says(file: SolvedFile) -> SolvedFile:
    """A FITS file that has no solution here with the one that another solver left in its header; others as they are.

    A WCS without a solver's mark may be no more than where a mount thought it looked, and counts for nothing.
    """
    if isinstance(file.result, Solution) or not named_as_fits(file.path, packed=False):
        return file
    try:
        with open(file.path, "rb") as stored:
            header = stored.read(HEADER_BYTES)
        solution, _ = of_header(Path(file.path), header)
    except (OSError, FrameError):
        return file
    mark = SOLVERS.search(header.split(b"END" + b" " * 77)[0])  # marks after END are of the image
    notes = tr("As its header says."), tr(ASSUMED, sigma=SIGMA_PX)
    return replace(file, result=solution, warnings=(*file.warnings, *notes)) if mark else file


def of_header(path: Path, data: bytes) -> tuple[Solution, Hint]:
    """The solution and the hints of a FITS header, cards or lines of text, with a celestial WCS.

    Raises FrameError when there is none.
    """
    text = data.decode("latin-1")
    cards = text.splitlines() if "\n" in text[:100] else [text[at : at + 80] for at in range(0, len(text), 80)]
    end = next((k for k, card in enumerate(cards) if card.rstrip() == "END"), len(cards))
    values = parse_cards(card[:80] for card in cards[:end]).values
    try:
        # astrometry.net's .wcs has no image (NAXIS 0) and says the frame's size as IMAGEW and IMAGEH.
        width, height = (_side(values, f"IMAGE{a}", f"NAXIS{n}") for a, n in (("W", 1), ("H", 2)))
        wcs = wcs_of(values)
        if wcs is None or min(width, height) < 2:
            raise FrameError("{path} has no WCS, or not the size of its frame (IMAGEW, IMAGEH).", path=path)
        solution = _of_map(lambda x, y: wcs.all_pix2world(x, y, 0), width, height)
    except (ValueError, ArithmeticError) as error:
        raise FrameError("{path} has no usable WCS ({why}).", path=path, why=type(error).__name__) from None
    hint, _ = hint_from_keywords(values, {}, (height, width))
    return solution, hint


def _side(values: Mapping[str, Any], *names: str) -> int:
    """The first of the keywords that is a number, as a side of a frame; 0 when there is none that a frame can have."""
    sides = (values.get(name) for name in names)
    side = next((value for value in sides if isinstance(value, int | float) and not isinstance(value, bool)), 0)
    return int(side) if 0 < side <= MAX_SIDE_PX else 0


def _of_map(sky_deg: Any, width: int, height: int) -> Solution:
    """The solution whose camera and attitude are nearest to a map from pixels to RA and Dec, degrees."""
    x, y = (np.linspace(0.0, side - 1.0, count) for side, count in zip((width, height), GRID, strict=True))
    pixels = np.stack([c.ravel() for c in np.meshgrid(x, y)], axis=-1)
    sky = unit_vectors(*sky_deg(*pixels.T))
    middle = np.array([width, height])[:, None] / 2.0 + [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    here, right, below = unit_vectors(*sky_deg(*middle))
    scale = float(np.sqrt(np.linalg.norm(cross_product(right - here, below - here))))
    if not (np.isfinite(sky).all() and FINEST_RAD_PX < scale < 1.0):
        raise ValueError("no map of the sky")
    mirrored, number = bool(cross_product(right - here, below - here) @ here < 0.0), np.arange(len(pixels))
    for lens in PROJECTIONS.values():
        camera = lens.centred(width, height, 1.0 / scale, mirrored)
        start = Attitude(best_rotation(sky, camera.unproject(pixels)))
        with np.errstate(all="ignore"):  # of a map that no camera has anything may come
            fit = refine(Matches(number, number, pixels, sky), camera, start)
            off_px = np.linalg.norm(fit.camera.project(sky @ fit.attitude.matrix.T) - pixels, axis=1)
        if np.median(off_px) < WORST_MAP_PX:
            break
    else:  # NaN too
        raise ValueError("no camera's map")
    sigma = SIGMA_PX * np.array([scale, scale, 4.0 / width])
    attitude = Attitude(fit.attitude.matrix, np.diag(sigma**2))
    return Solution(fit.camera, attitude, (), 0.0, 0.0, "WCS")


def _rows(path: Path, data: bytes) -> Iterator[Mapping[str, Any]]:
    try:
        rows = [parse_json(line) for line in decoded(data, path).splitlines() if line.strip()]
    except TextError:
        rows = []
    if not rows or not all(isinstance(row, dict) and isinstance(row.get("solved"), bool) for row in rows):
        raise FrameError("{path} is not what kochab solve --json prints, an object a line.", path=path)
    yield from rows


def _of_json(path: Path, line: int, row: Mapping[str, Any]) -> SolvedFile:
    """One line of ``kochab solve --json``, its attitude brought from the frame's middle to the optical axis."""
    try:
        name, time = str(row["file"])[:LONGEST_NAME], aware_utc(str(row.get("time_utc", "")))
        if not row["solved"]:
            reason = str(row["reason"])  # another version may know others
            known = Reason(reason) if reason in [*Reason] else Reason.NO_PATTERN_AGREED
            return SolvedFile(name, NoSolution(known, "", ""), None, None)
        with np.errstate(all="ignore"):  # a camera with any numbers may give anything
            solution = _solution(row)
            _refuse_impossible(solution)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
        raise FrameError("{path}: line {line} is not what kochab solve --json prints.", path=path, line=line) from None
    near = (Path(name), path.parent / name, path.parent / Path(name).name)
    picture = next((p for p in near if os.path.isfile(p)), None)  # not p.is_file(), which raises for some names
    hint, zone = _hint_of(picture) if picture and time is None else (Hint(time_utc=time), ())
    return SolvedFile(name, solution, hint.time_utc, hint.site, zone)


def _solution(row: Mapping[str, Any]) -> Solution:
    """The solution of a line; whatever it lacks raises."""
    camera = _camera(row)
    across, along, roll = (float(s) * ARCSEC for s in row["sigma_arcsec"])
    stars = tuple(map(_star, row["stars"]))
    numbers = float(row["rms_px"]), float(row["log10_false_alarm"])
    plain = Solution(camera, Attitude(np.eye(3)), stars, *numbers, str(row["method"]))
    # With the identity for an attitude, centre_attitude is the turn from the optical axis to the middle.
    matrix = plain.centre_attitude.matrix.T @ np.array(row["dcm"], dtype=np.float64).reshape(3, 3)
    return replace(plain, attitude=Attitude(matrix, np.diag(np.square([along, across, roll]))))


def _camera(row: Mapping[str, Any]) -> Camera:
    """The camera of a line; ValueError when it is none."""
    camera_numbers = {name: float(row["camera"][name]) for name in ("focal_px", "cx", "cy", "k1", "k2", "p1", "p2")}
    lens = PROJECTIONS[row["camera"].get("projection", Camera.projection)]
    fov_deg = np.array(row["fov_deg"], dtype=np.float64)
    if fov_deg.shape != (2,) or not (
        camera_numbers["focal_px"] > 0.0 and (fov_deg > 0.0).all() and (fov_deg < lens.widest_deg).all()
    ):
        raise ValueError("camera")
    aspect = float(row["camera"].get("aspect", 1.0))
    if not 0.1 < aspect < 10.0:
        raise ValueError("camera")
    sides = lens.sides_px(camera_numbers["focal_px"], fov_deg) * (aspect, 1.0)
    width, height = map(round, sides.tolist())
    if not 2 <= min(width, height) <= max(width, height) <= MAX_SIDE_PX:
        raise ValueError("fov_deg")
    return lens(width, height, **camera_numbers, mirrored=bool(row["mirrored"]), aspect=aspect)


def _star(given: Mapping[str, Any]) -> NamedStar:
    """A star of a line; a magnitude that is not known is null there."""
    x, y, ra, dec, off = (float(given[name]) for name in ("x", "y", "ra_deg", "dec_deg", "residual_px"))
    mag = float("nan") if given["mag"] is None else float(given["mag"])
    return NamedStar(x, y, str(given["id"]), str(given["name"]), mag, ra, dec, off)


def _refuse_impossible(solution: Solution) -> None:
    """ValueError when a matrix is no rotation, a sigma no error, or the stars are not where the pointing puts them."""
    matrix, covariance = solution.attitude.matrix, solution.attitude.covariance
    if not (np.abs(matrix @ matrix.T - np.eye(3)).max() < 1e-6 and np.linalg.det(matrix) > 0.0):
        raise ValueError("dcm")
    if covariance is None or not (np.diag(covariance) > 0.0).all() or not np.diag(covariance).max() < 1.0:
        raise ValueError("sigma_arcsec")
    off_px = np.linalg.norm(solution.pixels_of(solution.star_vectors) - solution.stars_px, axis=1)
    quality = solution.rms_px, solution.log10_false_alarm
    if not (np.isfinite(quality).all() and (off_px < WORST_STARS_PX).all()):  # NaN too
        raise ValueError("stars")


def _beside(path: Path) -> tuple[Hint, tuple[str, ...]]:
    """Of the picture with the same name as a ``.wcs``."""
    from kochab.frames import suffixes

    known = suffixes()
    pictures = (p for p in sorted(path.parent.glob(f"{path.stem}.*")) if p.suffix.lower() in known)
    return next((hint for p in pictures if (hint := _hint_of(p))[0].time_utc is not None), (Hint(), ()))


def _hint_of(picture: Path) -> tuple[Hint, tuple[str, ...]]:
    """When and where a picture was taken, and a warning where it does not say its time zone."""
    from kochab.frames import read_frame

    try:
        frame = read_frame(picture)
    except KochabError:
        return Hint(), ()
    return frame.hint, tuple(warning for warning in frame.warnings if warning == NO_ZONE)


# -- The axis of such files: by their turn, or by drift where nobody turned them -------------------------------


@frozen
class FilesRequest:
    """What a person says of files; None where the files say it, and ``guided`` where their drift shows it.

    ``dec_sign`` is 1 or -1 where north pulses of a guide log that does not say it move the mount north or south, 0
    where nobody knows. ``how`` is how to say where they were taken.
    """

    site: Site | None = None
    pole: Pole = Pole.REFRACTED
    refraction: Refraction = STANDARD_REFRACTION
    utc_offset_h: float | None = None
    guided: bool | None = None
    dec_sign: int = 0
    profile: str = ""
    how: str = GIVE_SITE


@frozen(eq=False)
class FilesAxis:
    """The axis, or why there is none; what reading the files warned of; what was measured there another night."""

    result: Measurement | Drift | NoAxis
    warnings: tuple[tuple[str, str], ...]
    last: PolarNight | None = None


def guide_logs_of(paths: Sequence[str]) -> list[str]:
    """Those that are guide logs; raises UsageError where all files together can't show an axis."""
    logs = [path for path in paths if is_guide_log(path)]
    frames = [path.lower() for path in paths if path not in logs]
    if len(frames) < 2 and not logs and not "".join(frames).endswith((".json", ".jsonl")):
        raise UsageError("Polar alignment needs two frames or more.")
    return logs


def solutions_of(path: str, options: SolveOptions) -> Task[list[SolvedFile]]:
    """What a file holds: solutions made before, or one frame, solved now or as its header says.

    Raises FrameError when it can't be read.
    """
    if Path(path).suffix.lower() in SOLVED:
        return solved_before(path)
    return [or_as_its_header_says((yield from solve_polar_file(path, options)))]


def unsolved_of(files: Sequence[SolvedFile], sweeps: Sequence[int]) -> list[SolvedFile]:
    """Those without a solution that can't be left out of their sweep: fewer than two others are solved, or than these.

    Clouds hide a frame or two of a sweep. Where they hide half of it, something else is wrong.
    """
    missed = []
    for number in set(sweeps):
        own = [file for file, sweep in zip(files, sweeps, strict=True) if sweep == number]
        unsolved = [file for file in own if isinstance(file.result, NoSolution)]
        solved = len(own) - len(unsolved)
        missed += unsolved if solved < max(2, min(len(unsolved) + 1, ENOUGH_FRAMES)) else []
    return missed


def axis_of(
    files: Sequence[SolvedFile], sweeps: Sequence[int], logs: Sequence[str], request: FilesRequest
) -> FilesAxis:
    """The axis of files and of guide logs; what has no solution is left out.

    Raises UsageError when frames have no time or site, FrameError when a log holds nothing that can be used.

    Parameters
    ----------
    files : Sequence[SolvedFile]
        What was solved, with times and sites.
    sweeps : Sequence[int]
        The sweep of each file, 0 or 1.
    logs : Sequence[str]
        Paths of guide logs.
    request : FilesRequest
        Site, clock, pole and what else a person said.
    """
    ahead, known = timedelta(hours=request.utc_offset_h or 0.0), request.utc_offset_h is not None
    sweeps = [sweep for file, sweep in zip(files, sweeps, strict=True) if isinstance(file.result, Solution)]
    warnings = [(f.path, tr("No solution, left out.")) for f in files if isinstance(f.result, NoSolution)]
    solved = [f for f in files if isinstance(f.result, Solution)]
    files = [replace(f, time_utc=f.time_utc and f.time_utc - ahead) for f in solved]
    warnings += [(f.path, w) for f in files for w in f.warnings if not (known and w == NO_ZONE)]
    site, sightings = site_of(files, request.site, request.how), sightings_of(files, sweeps)
    settings = MeasureSettings(site, request.pole, request.refraction)
    result: Measurement | Drift | NoAxis
    if logs or request.guided is not None or (tracked(sightings) and len(set(sweeps)) < 2):
        stretches = stretches_of(sightings, settings, request.guided)
        result, left_out = _drift_of(stretches, logs, settings, request.dec_sign)
        warnings += left_out
    else:
        result = measure(sightings, settings)
    named = tuple((Path(path).name, warning) for path, warning in warnings)
    if isinstance(result, NoAxis):
        return FilesAxis(result, named)
    doubts = doubts_of(files, result.error, site, request.site is not None, known)
    if sightings:
        doubts += given_doubts(files, result.error, site, request.utc_offset_h, request.site is not None)
    result = replace(result, findings=(*result.findings, *doubts))
    return FilesAxis(result, named, last_night(site, request.profile, result.time_utc))


OTHER_PIER = tr_noop("Only the runs with pier side {pier} count: nothing says what a flip did to the Dec pulses.")


def _drift_of(
    stretches: Sequence[Stretch], logs: Sequence[str], settings: MeasureSettings, dec_sign: int
) -> tuple[Drift | NoAxis, list[tuple[str, str]]]:
    """The axis by drift of frames and logs, both answers where Dec has no sign, and what is left out of it."""
    found: list[Drift | NoAxis] = []
    left_out: list[tuple[str, str]] = []
    for sign in (dec_sign,) if dec_sign else (1, -1):
        used, left_out = _one_pier([(log, s) for log in logs for s in guide_log(log, settings, sign)])
        found.append(
            measure_drift([*stretches, *(replace(s, sign_known=True) if dec_sign else s for s in used)], settings)
        )
        if all(s.sign_known for s in used):
            break
    north, south = found[0], found[-1]
    if len(found) == 2 and isinstance(north, Drift) and isinstance(south, Drift):
        return either(north, south), left_out
    return north, left_out


def _one_pier(runs: Sequence[tuple[str, Stretch]]) -> tuple[list[Stretch], list[tuple[str, str]]]:
    """Without the runs whose Dec has no sign and that are not on the pier's last side, and a warning of each log."""
    unsigned = [stretch for _, stretch in runs if not stretch.sign_known]
    last = unsigned[-1].pier if unsigned else ""
    left = {log for log, s in runs if not s.sign_known and s.pier != last}
    used = [s for _, s in runs if s.sign_known or s.pier == last]
    return used, [(log, tr(OTHER_PIER, pier=tr(last.lower()))) for log in sorted(left)]


def is_complete(result: Measurement | Drift | NoAxis | None) -> bool:
    """Whether files that grow need no more: their axis turned, or its drift is known to 30 arcsec."""
    return isinstance(result, Measurement) or (isinstance(result, Drift) and result.minutes_more == 0.0)


def changed_ns(path: str | Path) -> int:
    """When a file was last written, in ns; 0 when that cannot be read: opening the file says why."""
    try:
        return Path(path).stat().st_mtime_ns
    except OSError:
        return 0


def remember_axis(result: Measurement | Drift, profile: str, bolts: Pitches = (None, None)) -> None:
    """Keep an axis for another night, unless it is spoilt or half known; raises OSError when that can't be."""
    if not result.spoilt and (isinstance(result, Measurement) or result.known):
        remember_night(result.settings.site, profile, result.time_utc, result.error, bolts)
