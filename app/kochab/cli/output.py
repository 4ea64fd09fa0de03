"""What the command line prints: a line of JSON, a card for people, progress and failures."""

import logging
import math
import sys
from collections.abc import Callable, Iterator
from time import perf_counter
from typing import Any, TypeVar

from kochab.cli.process import say
from kochab.core.errors import DeviceError, KochabError, UsageError, printable
from kochab.core.progress import Progress, Task, run
from kochab.workflows.solution_json import Json, to_line

T = TypeVar("T")
logger = logging.getLogger(__name__)


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
    from kochab.text.angle_text import AngleStyle, dec_text, ra_text

    style = AngleStyle.SEXAGESIMAL
    parts = (text(value, style).replace(" ", "") for text, value in ((ra_text, ra_deg), (dec_text, dec_deg)))
    return " ".join(parts).translate(str.maketrans("°′″−–", "d'\"--"))


SOON_S = 2.0


class ProgressLine:
    """Progress on stderr: a line that rewrites itself on a terminal, else one line after `SOON_S`."""

    def __init__(self, label: str) -> None:
        self._label = printable(label)
        self._terminal = sys.stderr.isatty()
        self._start = perf_counter()
        self._shown = False

    def __call__(self, progress: Progress) -> None:
        """Show one step."""
        text = f"{self._label}: {progress.stage} {printable(progress.detail)}".rstrip()
        if self._terminal:
            sys.stderr.write(f"\r\x1b[K{text[:100]}")
            sys.stderr.flush()
            self._shown = True
        elif not self._shown and perf_counter() - self._start > SOON_S:
            self._shown = True
            print(f"{text} ...", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Leave the terminal as it was."""
        if self._terminal and self._shown:
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
