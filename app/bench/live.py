"""``kochab bench live``: a stream of frames tracked, its speed, its memory and its truth.

Frames are rendered before anything is timed. Wall times are of one frame after another; the
processor time beside them does not depend on what else the machine does. The rows "in the window"
are of the real window in a process of its own (:mod:`app.bench.live_window`), which shows the same
frames as they come from a camera; :func:`run_with` takes any other function that draws.
"""

from collections.abc import Callable, Mapping
from typing import Any

from app.bench.live_slew import average_rows, slew
from app.bench.live_speed import Draw, measure, paced, soak
from app.bench.live_stream import SIZES, make_ring
from app.bench.live_window import window_row
from app.bench.report import BenchResult, Goal

Row = dict[str, Any]
SEED = 20260301
CALM_DEG = 0.1  # a swing that can be followed though a busy machine misses a frame
TWO_HOURS = 72_000  # frames at ten a second


def run(quick: bool, report: Callable[[str], None]) -> BenchResult:
    """The engine alone, then the window."""
    return run_with(None, quick, report)


def run_with(draw: Draw | None, quick: bool, report: Callable[[str], None]) -> BenchResult:
    """With ``draw`` called on every frame, in the same thread."""
    rows: dict[str, Row] = {}
    for name, size in SIZES.items():
        report(f"{name}: rendering, then tracking ...")
        ring = make_ring(*size, count=9 if quick else 31)
        rows[name] = measure(ring, 100 if quick else 1000, draw).row(f"{name} tracked")
        if draw is None:
            report(f"{name}: the same in the window ...")
            calm = make_ring(*size, count=9 if quick else 16, swing_deg=CALM_DEG)
            rows[f"{name} window"] = window_row(calm, name, 5.0 if quick else 20.0)
            del calm
            if name == "1.2 MP":
                report(f"{name}: a colour camera in the window ...")
                calm = make_ring(*size, count=9, swing_deg=CALM_DEG, bayer="RGGB")
                rows["colour"] = window_row(calm, f"{name} in colour", 5.0 if quick else 20.0)
                del calm
        if name == "1.2 MP":
            report("10 frames a second in real time ...")
            rows["paced"] = paced(ring, 5.0 if quick else 30.0, 10.0)
        del ring
    report(f"seed {SEED}: a mount follows a commanded path ...")
    slews = slew(SEED, 10.0 if quick else 30.0, report)
    report("averages ...")
    averages = average_rows(64 if quick else 512, SEED)
    count = 3000 if quick else TWO_HOURS
    report(f"{count} frames of one stream ...")
    rows["soak"] = soak(count, report)
    return BenchResult(
        "live", [*rows.values(), *slews, *averages], goals(rows, slews, averages, draw is not None)
    )


def goals(
    rows: Mapping[str, Row], slews: list[Row], averages: list[Row], drawn: bool
) -> list[Goal]:
    """What the issue asks for; what only the window can show is left unmeasured without it."""
    speed, memory = rows["1.2 MP"], rows["soak"]
    hours = memory["frames"] / 36_000
    followed = [row for row in slews if "deg/s" in row["what"]]
    window = rows.get("1.2 MP window", {"drawn_s": speed["frames_s"]} if drawn else {})
    ratio = max((r["pointing_rms_arcsec"] / r["predicted_arcsec"] for r in averages), default=None)
    return [
        Goal.at_least("1.2 MP tracked, frames a second", speed["frames_s"], 30),
        Goal.at_least("1.2 MP, share of frames tracked", speed["tracked"], 0.99),
        Goal.at_most("1.2 MP, 95 % of answers within ms", speed["p95_ms"], 60),
        Goal.at_least("1.2 MP with the window drawing, frames a second", window.get("drawn_s"), 30),
        Goal.at_least("1.2 MP in the window, tracked a second", window.get("tracked_s"), 30),
        Goal.at_most("1.2 MP, 95 % of overlays on the screen within ms", window.get("p95_ms"), 60),
        Goal.at_most("cores at 10 frames a second, 1.2 MP", rows["paced"]["cores"], 1),
        Goal.at_most("memory growth, MB", memory["growth_mb"], 20),
        Goal.at_least("hours of stream for that", hours if hours >= 1.0 else None, 2),
        Goal.at_least("slews, share of frames tracked", min(r["tracked"] for r in followed), 0.8),
        Goal.at_most("averages: noise left over noise predicted, largest", ratio, 1.5),
    ]  # fmt: skip
