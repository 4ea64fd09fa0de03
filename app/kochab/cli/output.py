"""What a solve prints: one JSON object a line, or a card for people."""

import json
import logging
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeVar

from kochab.cli.process import say
from kochab.core.errors import DeviceError, KochabError, UsageError, printable
from kochab.core.progress import Progress, Task, run

if TYPE_CHECKING:  # it loads numpy, which --help has no need of
    from kochab.core.solution import NoSolution, Solution
    from kochab.sky.frame_bodies import FrameBodies

Json = dict[str, Any]
T = TypeVar("T")
logger = logging.getLogger(__name__)


def as_json(file: str, result: "Solution | NoSolution") -> Json:
    """The stable JSON form of a solution, or of why there is none."""
    from kochab.core.solution import Solution

    return _solved(file, result) if isinstance(result, Solution) else _unsolved(file, result)


def to_line(value: Json) -> str:
    """One line of strictly valid JSON in ASCII, so that no encoding on its way can spoil it.

    What is not a finite number becomes null.
    """
    return json.dumps(_finite(value), allow_nan=False)


def tell(fields: Json, text: str, as_json: bool) -> None:
    """One line of JSON for a program, or the text for a person."""
    print(to_line(fields) if as_json else text, flush=True)


def tell_failure(error: KochabError, as_json: bool) -> None:
    """``{"error": ...}`` for a program, or a sentence on standard error; all of it to the journal."""
    logger.debug("told: %s", error, exc_info=error)
    if as_json:
        print(to_line({"error": str(error)}), flush=True)
    else:
        say(str(error))


def reporting_failures(run: Callable[[Any], int], code: int = 2) -> Callable[[Any], int]:
    """``run`` whose failure is ``{"error": ...}`` or a sentence on stderr, and exit 1 for a device, else ``code``."""

    def reporting(args: Any) -> int:
        try:
            return run(args)
        except UsageError:
            raise
        except KochabError as error:
            tell_failure(error, args.json)
            return 1 if isinstance(error, DeviceError) else code

    return reporting


def _solved(file: str, s: "Solution") -> Json:
    ra, dec = s.ra_dec_deg
    camera, attitude, axis = s.camera, s.centre_attitude, s.attitude
    terms = ("focal_px", "cx", "cy", "k1", "k2", "p1", "p2")
    return {
        "file": file,
        "solved": True,
        "ra_deg": ra,
        "dec_deg": dec,
        "roll_deg": s.roll_deg,
        "mirrored": camera.mirrored,
        "fov_deg": list(camera.fov_deg),
        "scale_arcsec_px": camera.scale_arcsec_px,
        "camera": {name: float(getattr(camera, name)) for name in terms},
        "matches": len(s.stars),
        "detections": s.detections,
        "rms_px": s.rms_px,
        "rms_arcsec": s.rms_arcsec,
        "sigma_arcsec": list(attitude.sigma_arcsec),
        "log10_false_alarm": s.log10_false_alarm,
        "method": s.method,
        "quaternion": list(attitude.quaternion),
        "dcm": attitude.matrix.tolist(),
        "euler_deg": list(attitude.euler_deg),
        "optical_axis": {
            "ra_deg": axis.ra_dec_deg[0],
            "dec_deg": axis.ra_dec_deg[1],
            "roll_deg": axis.roll_deg,
            "x_px": camera.cx,
            "y_px": camera.cy,
        },
        "stars": [asdict(star) for star in s.stars],
        "warnings": list(s.warnings),
        "elapsed_ms": dict(s.elapsed_ms),
    }


def _unsolved(file: str, n: "NoSolution") -> Json:
    return {"file": file, "solved": False, **asdict(n), "reason": str(n.reason), "warnings": list(n.warnings)}


def bodies_json(found: "FrameBodies") -> Json:
    """The bodies of the Solar System in a frame, and the bright detections that are in no catalogue."""
    bodies = [{**asdict(b.body), "x": b.x, "y": b.y, "seen": b.seen} for b in found.bodies]
    for body in bodies:
        if not body["trail"]:
            del body["trail"]
    return {"bodies": bodies, "not_in_catalogue": [asdict(source) for source in found.unknown]}


def card(outcome: Json) -> str:
    """The same for people, a few lines."""
    lines = _solved_lines(outcome) if outcome["solved"] else _unsolved_lines(outcome)
    lines += [f"note     {text}" for text in outcome["warnings"]]
    return "\n  ".join(map(printable, [outcome["file"], *lines]))


def _solved_lines(o: Json) -> list[str]:
    w, h = o["fov_deg"]
    sx, sy, sr = o["sigma_arcsec"]
    named = [s["name"] for s in sorted(o["stars"], key=lambda s: s["mag"]) if s["name"]]
    lines = [
        f"centre   {radec(o['ra_deg'], o['dec_deg'])}   ({o['ra_deg']:.5f}, {o['dec_deg']:+.5f} deg, J2000)",
        f"rotation {o['roll_deg']:.3f} deg east of north" + ", mirrored" * o["mirrored"],
        f"field    {w:.3f} x {h:.3f} deg, {o['scale_arcsec_px']:.4g} arcsec/px",
        f"error    1 sigma {sx:.2f}, {sy:.2f} arcsec, rotation {sr:.1f} arcsec",
        f"matched  {o['matches']} of {o['detections']} stars, RMS {o['rms_px']:.2f} px"
        f" ({o['rms_arcsec']:.2f} arcsec); chance match 1 in 10^{-o['log10_false_alarm']:.0f}",
        f"method   {o['method']}, {o['elapsed_ms'].get('total', math.nan):.0f} ms",
    ]
    lines += [f"stars    {', '.join(named[:8])}"] if named else []
    return [*lines, *body_lines(o)]


def body_lines(o: Json) -> Iterator[str]:
    """A line a body of the Solar System, and a bright detection without a name."""
    for b in o.get("bodies", ())[:12]:
        bright = f", magnitude {b['magnitude']:.1f}" if math.isfinite(b["magnitude"]) else ""
        yield f"body     {b['name']}{bright}, at {b['x']:.0f}, {b['y']:.0f} px{_doubt(b)}"
    for u in o.get("not_in_catalogue", ())[:12]:
        place = f"{radec(u['ra_deg'], u['dec_deg'])} +-{u['sigma_arcsec']:.1f} arcsec, at {u['x']:.0f}, {u['y']:.0f} px"
        yield f"unknown  not in the catalogue: magnitude {u['mag']:.1f} +-{u['sigma_mag']:.1f}, {place}"


def _doubt(body: Json) -> str:
    sigma = body["sigma_arcsec"]
    return (f" +-{sigma:.0f} arcsec" if sigma >= 30 else "") + (
        "" if body["seen"] or "trail" in body else ", not detected"
    )


def _unsolved_lines(o: Json) -> list[str]:
    lines = [f"no solution: {o['reason']} ({o['detections']} stars detected)", o["advice"]]
    if o["measured"]:
        numbers = (f"{k.replace('_', ' ')} {v:.4g}" for k, v in o["measured"].items())
        lines.append("measured " + ", ".join(numbers))
    return lines + ([f"tried    {o['tried']}"] if o["tried"] else [])


def radec(ra_deg: float, dec_deg: float) -> str:
    """Both as 05h35m17.30s -05d23'28.0", in ASCII: not every terminal's encoding has ° and ′."""
    from kochab.core.angle_text import AngleStyle, dec_text, ra_text

    style = AngleStyle.SEXAGESIMAL
    parts = (text(value, style).replace(" ", "") for text, value in ((ra_text, ra_deg), (dec_text, dec_deg)))
    return " ".join(parts).translate(str.maketrans("°′″−–", "d'\"--"))


def _finite(value: Any) -> Any:
    """``value`` with every number that JSON cannot hold replaced by None."""
    if isinstance(value, Mapping):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


SOON_S = 2.0


class ProgressLine:
    """Progress on stderr: a line that rewrites itself on a terminal, else one line after `SOON_S`."""

    def __init__(self, label: str) -> None:
        self._label = printable(label)
        self._terminal = sys.stderr.isatty()
        self._start = perf_counter()
        self._said = False

    def __call__(self, progress: Progress) -> None:
        """Show one step."""
        text = f"{self._label}: {progress.stage} {printable(progress.detail)}".rstrip()
        if self._terminal:
            sys.stderr.write(f"\r\x1b[K{text[:100]}")
            sys.stderr.flush()
            self._said = True
        elif not self._said and perf_counter() - self._start > SOON_S:
            self._said = True
            print(f"{text} ...", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Leave the terminal as it was."""
        if self._terminal and self._said:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


def with_progress(label: str, task: Task[T]) -> T:
    """The result of a task, its progress shown on standard error meanwhile."""
    line = ProgressLine(label)
    try:
        return run(task, line)
    finally:
        line.clear()
        task.close()
