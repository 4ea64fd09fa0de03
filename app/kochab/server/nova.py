"""nova.astrometry.net's web API on this computer, for programs that are bound to it.

``kochab serve --nova``; a program needs the address and the key changed, and nothing else. Facts: the API's page at
nova.astrometry.net and the sources of its ``net/api.py``. The key stands for the account; whoever has none gets no
session. The numbers of submissions and jobs are random: they are what their answers are read with, as there. KStars
and other programs keep them in 32 bits with a sign, so there are 31, and a wrong one costs time. Nothing is fetched
from elsewhere, kept for longer than this process, or public.
"""

import json
import re
import secrets
import tempfile
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import field
from datetime import UTC, datetime
from hashlib import sha1
from hmac import compare_digest
from html import escape
from http import HTTPStatus
from pathlib import Path
from queue import Full, Queue
from typing import Any

import numpy as np

from kochab.core.errors import FrameError, KochabError, UsageError
from kochab.core.frame import Detections, Frame, Hint
from kochab.core.progress import run as drive
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import mutable
from kochab.folders import data_folder
from kochab.parsing.text_input import TextError, parse_json
from kochab.server.http_server import Request, Response
from kochab.text.translation import tr
from kochab.workflows import astrometry_tables
from kochab.workflows.other_solvers import arcsec_px, parity, scale_between, up_deg, within_scale

Json = dict[str, Any]
SOLVING, SUCCESS, FAILURE = "solving", "success", "failure"
TIMEOUT_S = 60.0
MOST_JOBS, MOST_WAITING, MOST_KEPT_BYTES, MOST_SESSIONS = 200, 50, 4_000_000_000, 1000
LARGEST_LIST = 100_000
TABLES = (("X_IMAGE", "Y_IMAGE", "MAG_AUTO"), ("X", "Y", "FLUX"), ("X", "Y", ""))
"""Columns of a table of stars: SExtractor's, which StellarSolver sends, and astrometry.net's."""
WRONG_NUMBER_S = 0.1
"""What a number that no job has costs, one after the other: to find one of 200 jobs so takes days."""
ENDING = re.compile(r"(\.[A-Za-z0-9]{1,8}){0,1}(\.(?:fz|gz|bz2))?$")


@mutable(eq=False)
class Job:
    """One submission and what became of it."""

    number: int
    name: str
    settings: Json
    path: Path | None
    size_bytes: int = 0
    status: str = SOLVING
    started: datetime | None = None
    finished: datetime | None = None
    solution: Solution | None = None
    detections: Detections | None = None
    reason: str = ""
    made: dict[str, bytes] = field(default_factory=dict)


class Nova:
    """The API: takes submissions under ``key``, solves them one after the other in a thread of its own.

    With ``any_key`` it takes those under another key too, of programs that have one built in.
    """

    def __init__(self, key: str, any_key: bool = False) -> None:
        self._key, self._any_key = key, any_key
        self._folder = tempfile.TemporaryDirectory(prefix="kochab-nova-")
        self._jobs: OrderedDict[int, Job] = OrderedDict()
        self._sessions: OrderedDict[str, None] = OrderedDict()
        self._waiting: Queue[Job | None] = Queue(MOST_WAITING)
        self._lock, self._drawing, self._guessed = threading.Lock(), threading.Lock(), threading.Lock()
        self._thread = threading.Thread(target=self._work, name="kochab-nova", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take no more, and remove what was uploaded."""
        with suppress(Full):
            self._waiting.put_nowait(None)
        self._folder.cleanup()

    def answer(self, request: Request) -> Response:
        """The answer to any request."""
        parts = request.path.strip("/").split("/")
        if parts[0] == "api":
            return self._api(request, parts[1:])
        if len(parts) == 2 and parts[0] in (*FILES, "joblog"):
            return self._file(parts[0], parts[1])
        if len(parts) == 1 and compare_digest(parts[0].encode(), self._key.encode()):
            return Response(page(self._session()), "text/html; charset=utf-8")
        return _missing()

    # -- What programs ask -------------------------------------------------------------------------

    def _api(self, request: Request, parts: list[str]) -> Response:
        match parts:
            case ["login" | "upload" | "url_upload" as what]:
                try:
                    return _json(self._posted(what, request))
                except (UsageError, KochabError) as error:
                    return _json({"status": "error", "errormessage": str(error)})
            case ["submissions", number] if job := self._job(number):
                return _json(_submission(job))
            case ["jobs", number, *rest] if (job := self._job(number)) and "/".join(rest) in ANSWERS:
                return _json(ANSWERS["/".join(rest)](job))
        return _missing()

    def _posted(self, what: str, request: Request) -> Json:
        try:
            asked = parse_json(request.form.get("request-json", ""))
        except TextError:
            asked = None
        if not isinstance(asked, dict):
            raise UsageError("no json")
        if what == "login":
            if not self._any_key and not compare_digest(str(asked.get("apikey")).encode(), self._key.encode()):
                raise UsageError("bad apikey")
            return {"status": "success", "message": "authenticated user: local", "session": self._session()}
        if str(asked.get("session")) not in self._sessions:
            raise UsageError("no session: log in first")
        if "url" in asked:  # astroquery sends its lists of stars to url_upload, without one
            raise UsageError("Kochab fetches nothing from elsewhere: upload the file.")
        return self._submitted(asked, request.file)

    def _session(self) -> str:
        session = secrets.token_hex(16)
        with self._lock:
            self._sessions[session] = None
            while len(self._sessions) > MOST_SESSIONS:
                self._sessions.popitem(last=False)
        return session

    def _submitted(self, asked: Json, file: tuple[str, bytes] | None) -> Json:
        number = secrets.randbelow(2**31 - 1) + 1
        name, content = file or ("list of stars", b"")
        job = Job(number, name.replace("\\", "/").rpartition("/")[2][:200], asked, None, len(content))
        bounds_of(job, 1000)  # a wrong one is told now
        if file is None:
            star_list(asked)
        else:
            ending = ENDING.search(job.name)
            job.path = Path(self._folder.name, f"{number}{ending[0] if ending else ''}")
            job.path.write_bytes(content)
        with self._lock:
            if self._waiting.full():
                raise UsageError("Too many submissions are waiting.")
            self._jobs[number] = job
            self._waiting.put_nowait(job)
            self._forget()
        return {"status": "success", "subid": number, "hash": sha1(content, usedforsecurity=False).hexdigest()}

    def _forget(self) -> None:
        """Let the oldest finished jobs go where there are too many, or too large ones."""
        for number, job in list(self._jobs.items()):
            many = len(self._jobs) > MOST_JOBS or sum(j.size_bytes for j in self._jobs.values()) > MOST_KEPT_BYTES
            if many and job.finished is not None:
                del self._jobs[number]
                if job.path is not None:
                    job.path.unlink(missing_ok=True)

    def _job(self, number: str) -> Job | None:
        job = self._jobs.get(int(number)) if number.isdecimal() and len(number) < 20 else None
        if job is None:
            with self._guessed:
                time.sleep(WRONG_NUMBER_S)
        return job

    def _file(self, what: str, number: str) -> Response:
        job = self._job(number)
        if job is not None and what == "joblog" and job.finished is not None:
            return Response(_log(job), "text/plain; charset=utf-8")
        if job is None or job.solution is None or what == "joblog":
            return _missing()
        kind, ending, make = FILES[what]
        with self._drawing:  # one at a time: they take memory
            try:
                content = job.made.get(what) or make(job, Path(self._folder.name))
            except (KochabError, OSError) as error:
                return Response(f"{error}\n".encode(), "text/plain; charset=utf-8", HTTPStatus.NOT_FOUND)
        if len(content) < 5_000_000:
            job.made[what] = content
        return Response(content, kind, name="" if kind.startswith("image") else f"{what}_{job.number}{ending}")

    # -- Solving -----------------------------------------------------------------------------------

    def _work(self) -> None:
        while (job := self._waiting.get()) is not None:
            job.started = datetime.now(UTC)
            try:
                result = solve(job)
                job.solution = result if isinstance(result, Solution) else None
                job.reason = f"{result.reason}: {result.advice}" if isinstance(result, NoSolution) else ""
            except KochabError as error:
                job.reason = str(error)
            except Exception:
                import logging

                logging.getLogger(__name__).exception("submission failed")
                job.reason = "A fault in Kochab; the journal has the details."
            # The status first: whoever sees that it has ended may ask for it at once.
            job.status = SUCCESS if job.solution is not None else FAILURE
            job.finished = datetime.now(UTC)


def solve(job: Job) -> Solution | NoSolution:
    """Solve one submission within its bounds; KochabError when it cannot be read."""
    from kochab.frames import reading
    from kochab.solver import SolveOptions
    from kochab.solver.pipeline import examine_frame, solve_detections, within_radius

    frame: Frame | None = None
    if job.path is None:
        job.detections = star_list(job.settings)
    else:
        try:  # not kept but read again when it is drawn: hundreds of megabytes
            frame = drive(reading(job.path, TIMEOUT_S))
        except FrameError:
            job.detections = _table(job.path, job.settings)
            if job.detections is None:
                raise
    if frame is None:
        assert job.detections is not None
        hint, scale, centre = bounds_of(job, job.detections.width)
        result = drive(solve_detections(job.detections, SolveOptions(timeout_s=TIMEOUT_S, hint=hint)))
    else:
        hint, scale, centre = bounds_of(job, frame.width)
        examined = drive(examine_frame(frame, SolveOptions(timeout_s=TIMEOUT_S, hint=hint)))
        job.detections, result = examined.detections, examined.result
    return within_radius(within_scale(result, scale), centre)


def _number(settings: Mapping[str, Any], name: str, low: float, high: float) -> float | None:
    value = settings.get(name)
    if value is None or value == "":
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not low <= number <= high:
        raise UsageError(f"{name} is not a number from {low:g} to {high:g}.")
    return number


def bounds_of(
    job: Job, width: int
) -> tuple[Hint | None, tuple[float, float] | None, tuple[float, float, float] | None]:
    """The hint, the pixel scale and the place that a submission allows; UsageError for what is no number."""
    given = job.settings
    to_scale = arcsec_px(str(given.get("scale_units") or "degwidth"))
    low, high = (_number(given, name, 1e-9, 1e9) for name in ("scale_lower", "scale_upper"))
    if given.get("scale_type") == "ev" and (middle := _number(given, "scale_est", 1e-9, 1e9)) is not None:
        play = (_number(given, "scale_err", 0.0, 100.0) or 10.0) / 100.0
        low, high = middle * (1.0 - min(play, 0.999)), middle * (1.0 + play)
    scale = scale_between(low, high, to_scale, width)
    ra, dec = _number(given, "center_ra", -360.0, 720.0), _number(given, "center_dec", -90.0, 90.0)
    radius, centre = _number(given, "radius", 1e-6, 180.0), None
    if ra is not None and dec is not None:
        centre = (ra % 360.0, dec, radius or 180.0)
    hint = Hint(scale_arcsec_px=scale, centre_deg=centre, source="command line")
    return hint if hint.helps else None, scale, centre if radius is not None else None


def _table(path: Path, settings: Mapping[str, Any]) -> Detections | None:
    """The stars of a table that was uploaded in place of an image; None where the file is none."""
    size = (_number(settings, "image_width", 2, 1e6), _number(settings, "image_height", 2, 1e6))
    given = None if size[0] is None or size[1] is None else (int(size[0]), int(size[1]))
    for columns in TABLES:
        with suppress(UsageError):
            return astrometry_tables.read_list(str(path), columns, given, ascending=columns[2] == "MAG_AUTO")
    return None


def star_list(settings: Mapping[str, Any]) -> Detections:
    """The stars of a submission without a file: ``x``, ``y`` from 1, the brightest first; UsageError."""
    width, height = (_number(settings, name, 2, 1e6) for name in ("image_width", "image_height"))
    try:
        table = np.array([settings["x"], settings["y"]], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        raise UsageError("no file, and no lists of numbers x and y") from None
    if width is None or height is None or table.ndim != 2 or not 1 <= table.shape[1] <= LARGEST_LIST:
        raise UsageError("a list of stars needs x, y, image_width and image_height")
    if not np.isfinite(table).all():
        raise UsageError("x and y must be finite numbers")
    return Detections.from_list(table.T - 1.0, int(width), int(height))


# -- Answers, as the API's page has them -------------------------------------------------------


def _submission(job: Job) -> Json:
    return {
        "user": 1,
        "processing_started": str(job.started),
        "processing_finished": str(job.finished),
        "user_images": [job.number],
        "jobs": [job.number],
        "job_calibrations": [[job.number, job.number]] if job.status == SUCCESS else [],
        **({"error_message": job.reason} if job.reason else {}),
    }


def _calibration(job: Job) -> Json:
    if job.solution is None:
        return {"error": f"no calibration data available for job {job.number}"}
    s = job.solution
    ra, dec = s.ra_dec_deg
    return {
        "ra": ra,
        "dec": dec,
        "radius": float(np.degrees(s.radius_rad)),
        "pixscale": s.camera.scale_arcsec_px,
        "orientation": up_deg(s),
        "parity": float(parity(s)),
        "width_arcsec": 3600.0 * s.camera.fov_deg[0],
        "height_arcsec": 3600.0 * s.camera.fov_deg[1],
    }


def _objects(job: Job) -> list[str]:
    from kochab.workflows.frame_objects import deep_sky_of

    return [] if job.solution is None else [one.name for one in deep_sky_of(job.solution)[0]]


def _annotations(job: Job) -> list[Json]:
    """Objects with their radius, px, and named stars; pixels count from 1 as theirs do."""
    from kochab.workflows.frame_objects import deep_sky_of

    if job.solution is None:
        return []
    scale, found = job.solution.camera.scale_arcsec_px, []
    for one in deep_sky_of(job.solution)[0]:
        if np.isfinite([one.x, one.y]).all():
            size = one.size_arcmin[0] if np.isfinite(one.size_arcmin[0]) else 0.0
            kind = "ic" if one.name.startswith("IC ") else "ngc"
            names, radius = list(dict.fromkeys([one.name, *one.names])), 30.0 * size / scale
            found.append({"type": kind, "names": names, "pixelx": one.x + 1, "pixely": one.y + 1, "radius": radius})
    stars = (star for star in job.solution.named if star.name)
    bright = [{"type": "bright", "names": [s.name], "pixelx": s.x + 1, "pixely": s.y + 1, "radius": 0.0} for s in stars]
    return found + bright


def _info(job: Job) -> Json:
    objects = _objects(job)
    fields = {"objects_in_field": objects, "machine_tags": objects, "tags": objects}
    own = {"status": job.status, "original_filename": job.name}
    if job.solution is None:
        return {**fields, **own}
    # Theirs, and what the page shows: their orientation is of an image whose first row is below.
    rotation = {"kochab_rotation_deg": job.solution.roll_deg}
    return {**fields, **own, "calibration": _calibration(job) | rotation}


ANSWERS: dict[str, Callable[[Job], Json]] = {
    "": lambda job: {"status": job.status, **({"reason": job.reason} if job.reason else {})},
    "info": _info,
    "calibration": _calibration,
    "tags": lambda job: {"tags": _objects(job)},
    "machine_tags": lambda job: {"tags": _objects(job)},
    "objects_in_field": lambda job: {"objects_in_field": _objects(job)},
    "annotations": lambda job: {"annotations": _annotations(job)},
}


def _log(job: Job) -> bytes:
    """What a log of theirs ends with: the lines that ``solve-field`` prints, or why there is no solution."""
    lines = [f"Field: {job.name}"]
    if job.solution is None:
        return "\n".join([*lines, "Did not solve (or no WCS file was written).", job.reason, ""]).encode()
    found = _calibration(job)
    return "\n".join(
        [
            *lines,
            f"Field 1: solved with {len(job.solution.stars)} stars, pixel scale {found['pixscale']:.6g} arcsec/pix.",
            f"Field center: (RA,Dec) = ({found['ra']:.6f}, {found['dec']:.6f}) deg.",
            f"Field rotation angle: up is {found['orientation']:.6g} degrees E of N",
            "",
        ]
    ).encode()


# -- Files -------------------------------------------------------------------------------------


def _solution(job: Job) -> Solution:
    assert job.solution is not None
    return job.solution


def _frame(job: Job) -> Frame:
    from kochab.frames import reading

    if job.path is None:
        raise UsageError("A list of stars has no image.")
    return drive(reading(job.path, TIMEOUT_S))


def _wcs(job: Job, folder: Path) -> bytes:
    from kochab.frames.wcs import wcs_text

    # Cards of 80 letters, as FITS has them; the file beside a frame ends each with a line's end.
    return wcs_text(_solution(job)).replace("\n", " ").encode("ascii")


def _new_fits(job: Job, folder: Path) -> bytes:
    from kochab.frames.wcs import write_with_solution

    target = folder / f"{job.number}.new"
    try:
        write_with_solution(lambda: _frame(job), _solution(job), job.path, target)
        return target.read_bytes()
    finally:
        target.unlink(missing_ok=True)


def _picture(job: Job, folder: Path) -> bytes:
    from kochab.workflows.annotated_image import annotate

    target = folder / f"{job.number}-annotated.jpg"
    try:
        annotate(_frame(job), _solution(job), target)
        return target.read_bytes()
    finally:
        target.unlink(missing_ok=True)


def _detections(job: Job) -> Detections:
    assert job.detections is not None
    return job.detections


FILES: dict[str, tuple[str, str, Callable[[Job, Path], bytes]]] = {
    "wcs_file": ("application/fits", ".fits", _wcs),
    "new_fits_file": ("application/fits", ".fits", _new_fits),
    "rdls_file": ("application/fits", ".fits", lambda job, _: astrometry_tables.rdls(_solution(job))),
    "axy_file": ("application/fits", ".fits", lambda job, _: astrometry_tables.axy(_detections(job), True, {})),
    "corr_file": ("application/fits", ".fits", lambda job, _: astrometry_tables.corr(_solution(job), _detections(job))),
    "annotated_display": ("image/jpeg", ".jpg", _picture),
    "annotated_full": ("image/jpeg", ".jpg", _picture),
}
"""By the first part of the address: content type, ending, and what makes it."""


def page(session: str) -> bytes:
    """The page to drop pictures on, in the person's language."""
    texts = {
        "language": tr("en", "the language's code, as a web page gives it"),
        "title": tr("Plate solve an image"),
        "drop": tr("Drop images here, or choose them."),
        "stays": tr("They stay on the computer that Kochab runs on."),
        "solving": tr("Solving…"),
        "failed": tr("No solution"),
        "lost": tr("No connection to Kochab."),
        "centre": tr("Centre"),
        "field": tr("Field of view"),
        "rotation": tr("Rotation"),
        "objects": tr("In the frame"),
        "annotated": tr("Annotated image"),
        "session": session,
    }
    text = (data_folder("resources") / "solve_page.html").read_text(encoding="utf-8")
    for name, value in texts.items():
        text = text.replace(f"{{{name}}}", escape(value))
    return text.encode("utf-8")


def _json(value: Json) -> Response:
    return Response(json.dumps(value).encode("ascii"))


def _missing() -> Response:
    return Response(b"not found\n", "text/plain", HTTPStatus.NOT_FOUND)
