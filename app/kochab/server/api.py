"""A JSON API on this computer: solve, detect, identify and look up, one list or many; and where the mount points.

``kochab serve --api``. What it answers is what ``kochab COMMAND --json`` prints; ``/openapi.json`` describes it, for
clients that are made from that. Every request but that one needs the token, as ``Authorization: Bearer TOKEN``. It
reads nothing but what is sent, writes nothing that stays, and moves nothing. Work is done one after the other.

It stands on :mod:`kochab.server.http_server` as nova's API does, and needs nothing that is not installed anyway.
"""

import json
import logging
import re
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from hmac import compare_digest
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kochab.core import __version__
from kochab.core.errors import KochabError, UsageError
from kochab.core.progress import run as drive
from kochab.core.values import frozen
from kochab.folders import data_folder
from kochab.parsing.text_input import TextError, parse_json, read_text
from kochab.server.http_server import Request, Response
from kochab.workflows.answers import answer_of, detections_json, found_json
from kochab.workflows.solution_json import Json, to_line

if TYPE_CHECKING:
    from kochab.core.frame import Detections
    from kochab.solver import SolveOptions

TIMEOUT_S, LONGEST_S = 30.0, 600.0
MOST_STARS, MOST_PX = 100_000, 1_000_000
Place = tuple[float, float, float]


@frozen
class _Refused(Exception):  # noqa: N818 - an answer, not an error
    status: HTTPStatus
    sentence: str


class Api:
    """Answers to whoever has ``token``; ``mount`` is what says where the mount points, None where there is none."""

    def __init__(self, token: str, mount: Callable[[], Json] | None = None) -> None:
        self._token, self._mount = token, mount
        self._working = threading.Lock()
        self._routes: dict[tuple[str, str], Callable[[Request], Response]] = {
            ("GET", "/openapi.json"): lambda _: Response(schema()),
            ("GET", "/version"): lambda _: _json({"name": "Kochab", "version": __version__}),
            ("POST", "/solve"): self._solve,
            ("POST", "/detect"): self._detect,
            ("POST", "/identify"): self._identify,
            ("POST", "/identify/batch"): self._batch,
            ("GET", "/objects"): self._objects,
            ("GET", "/mount"): self._position,
        }

    def answer(self, request: Request) -> Response:
        """The answer to any request; a sentence under ``error`` where there is none."""
        known = [method for method, path in self._routes if path == request.path]
        try:
            if not known:
                raise _Refused(HTTPStatus.NOT_FOUND, f"There is no {request.path[:60]}; see /openapi.json.")
            if request.path != "/openapi.json" and not self._is_allowed(request):
                raise _Refused(HTTPStatus.UNAUTHORIZED, "Send the token: Authorization: Bearer TOKEN.")
            if request.method not in known:
                words = {"error": f"{request.path} takes {', '.join(known)}."}
                return Response(to_line(words).encode("ascii"), status=HTTPStatus.METHOD_NOT_ALLOWED, allow=known[0])
            return self._routes[request.method, request.path](request)
        except _Refused as refused:
            return _json({"error": refused.sentence}, refused.status)
        except KochabError as error:
            return _json({"error": str(error)}, HTTPStatus.UNPROCESSABLE_ENTITY)

    def _is_allowed(self, request: Request) -> bool:
        kind, _, token = request.authorization.partition(" ")
        return kind.lower() == "bearer" and compare_digest(token.strip().encode(), self._token.encode())

    # -- Images ------------------------------------------------------------------------------------

    def _solve(self, request: Request) -> Response:
        from kochab.workflows.solve_frame import solve_file

        options, bound = _options(request.query)
        with _kept(request) as (path, name), self._working:
            solved = drive(solve_file(path, options))
            return _json(drive(answer_of(name, solved, options, bound)).outcome)

    def _detect(self, request: Request) -> Response:
        from kochab.detection import DETECTORS
        from kochab.frames import read_frame

        detector = request.query.get("detector", "auto")
        DETECTORS.check(detector)
        with _kept(request) as (path, name), self._working:
            frame = read_frame(path)
            found = detections_json(DETECTORS.make(detector).detect(frame))
        return _json({"file": name, **found, "warnings": list(frame.warnings)})

    # -- Lists of stars ----------------------------------------------------------------------------

    def _identify(self, request: Request) -> Response:
        asked = _parsed(request.body, "The body")
        with self._working:
            return _json(_identified(asked))

    def _batch(self, request: Request) -> Response:
        """A line of JSON a list, answered by a line each, in order, as soon as it is done."""
        if not request.body.strip():
            raise UsageError("Send a list of stars a line, each as JSON.")

        def answers() -> Iterator[bytes]:
            for number, line in enumerate(request.body.splitlines(), 1):
                if not line.strip():
                    continue
                try:
                    asked = _parsed(line, f"Line {number}")
                    with self._working:
                        found = _identified(asked)
                except KochabError as error:
                    found = {"error": str(error)}
                except Exception:
                    logging.getLogger(__name__).exception("a line of a batch failed")
                    found = {"error": "A fault in Kochab; the journal has the details."}
                yield (to_line({"line": number, **found}) + "\n").encode("ascii")

        return Response(b"", "application/x-ndjson", lines=answers())

    # -- What needs no frame -----------------------------------------------------------------------

    def _objects(self, request: Request) -> Response:
        from datetime import UTC, datetime

        from kochab.frames.hints import aware_utc
        from kochab.sky.finder import find

        name, time = request.query.get("name", ""), request.query.get("time")
        at = datetime.now(UTC) if time is None else aware_utc(time)
        if not name.strip():
            raise UsageError("Name an object: /objects?name=M42.")
        if at is None:
            raise UsageError("time is no time; give it as 2026-11-24T21:30.")
        with self._working:
            return _json(found_json(name, drive(find(name, at))))

    def _position(self, request: Request) -> Response:
        if self._mount is None:
            raise _Refused(HTTPStatus.NOT_FOUND, "No mount: start kochab serve --api with --mount PORT.")
        found = self._mount()
        if "error" in found:
            raise _Refused(HTTPStatus.BAD_GATEWAY, str(found["error"]))
        return _json(found)


class _kept:  # noqa: N801 - used as a function
    """The image that was sent, as a file for as long as it is read; what it is called."""

    def __init__(self, request: Request) -> None:
        name = request.file[0] if request.file else request.query.get("name", "image")
        self._content = request.file[1] if request.file else request.body
        if not self._content:
            raise UsageError("Send the image's file as the body.")
        self._name = name.replace("\\", "/").rpartition("/")[2][:200].strip(".") or "image"

    def __enter__(self) -> tuple[Path, str]:
        self._folder = tempfile.TemporaryDirectory(prefix="kochab-api-")
        path = Path(self._folder.name, re.sub(r"[^\w.-]", "_", self._name)[-80:])
        path.write_bytes(self._content)
        return path, self._name

    def __exit__(self, *error: object) -> None:
        self._folder.cleanup()


def _identified(asked: Json) -> Json:
    from kochab.solver.pipeline import solve_detections

    stars = _stars(asked)
    options, bound = _options(asked)
    result = drive(solve_detections(stars, options))
    name = str(asked.get("name", "stars"))[:200]
    return drive(answer_of(name, result, options, bound)).outcome


def _stars(asked: Json) -> "Detections":
    import numpy as np

    from kochab.core.frame import Detections

    width, height = (_number(asked, name, 2, MOST_PX) for name in ("width", "height"))
    rows = asked.get("stars")
    if width is None or height is None or not isinstance(rows, list) or not 1 <= len(rows) <= MOST_STARS:
        raise UsageError(f"A list needs width, height and 1 to {MOST_STARS} stars, each [x, y] or [x, y, flux].")
    try:
        table = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        table = np.empty((0, 0))
    if table.ndim != 2 or table.shape[1] not in (2, 3) or not np.isfinite(table).all():
        raise UsageError("Each star is [x, y] or [x, y, flux], finite numbers, all alike.")
    return Detections.from_list(table[:, :2], int(width), int(height), table[:, 2] if table.shape[1] == 3 else None)


def _options(given: Mapping[str, Any]) -> tuple["SolveOptions", Place | None]:
    """How to solve, and what bounds the answer; UsageError for what is no number, no method, no detector."""
    from kochab.core.frame import Hint
    from kochab.detection import DETECTORS
    from kochab.identification import IDENTIFIERS
    from kochab.solver import SolveOptions

    method, detector = str(given.get("method", "patterns")), str(given.get("detector", "auto"))
    IDENTIFIERS.check(method)
    DETECTORS.check(detector)
    fov, scale = _number(given, "fov", 1e-6, 359.0), _number(given, "scale", 1e-6, 36000.0)
    ra, dec, radius = _number(given, "ra", -360.0, 720.0), _number(given, "dec", -90.0, 90.0), None
    radius = _number(given, "radius", 1e-6, 180.0)
    if len({value is None for value in (ra, dec, radius)}) > 1:
        raise UsageError("ra, dec and radius belong together.")
    near = None if ra is None or dec is None or radius is None else (ra % 360.0, dec, radius)
    hint = Hint(
        scale_arcsec_px=None if scale is None else (scale / 1.1, scale * 1.1), centre_deg=near, source="command line"
    )
    limit = _number(given, "timeout", 0.01, LONGEST_S) or TIMEOUT_S
    strict = given.get("strict") in (True, "true", "1")
    options = SolveOptions(
        method=method, detector=detector, hint=hint if hint.helps else None, fov_deg=fov, timeout_s=limit
    )
    return options, near if strict else None


def _number(given: Mapping[str, Any], name: str, low: float, high: float) -> float | None:
    value = given.get(name)
    if value is None:
        return None
    try:
        number = float("nan") if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if not low <= number <= high:
        raise UsageError(f"{name} is not a number from {low:g} to {high:g}.")
    return number


def _parsed(text: bytes, what: str) -> Json:
    try:
        value = parse_json(text)
    except (TextError, UnicodeDecodeError) as error:
        raise UsageError(f"{what} is not JSON: {error}") from None
    if not isinstance(value, dict):
        raise UsageError(f"{what} is not a JSON object.")
    return value


def _json(value: Json, status: HTTPStatus = HTTPStatus.OK) -> Response:
    return Response(to_line(value).encode("ascii"), status=status)


def schema() -> bytes:
    """The description of this API, OpenAPI 3.1."""
    text = parse_json(read_text(data_folder("resources") / "openapi.json"))
    text["info"]["version"] = __version__
    return json.dumps(text).encode("ascii")
