"""``kochab bench detect``: speed, completeness, purity and centroids on rendered fields.

All detectors see the same frames in the same run, one after the other in turns, so that whatever
else the machine does falls on all alike. Medians over the turns of wall and of processor time are
shown; the goals take processor time, which other programs disturb less and which for a detector
of one thread is the wall time of an idle machine. The Cramer-Rao bound is derived in
:func:`app.bench.detect_score.expected`.
"""

import time
import tracemalloc
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.bench.detect_rivals import Finder, finders
from app.bench.detect_score import Truth, expected, score
from app.bench.report import BenchResult, Goal
from app.core.frame import Frame
from app.simulate.stars import Sensor, Sky, StarImage, render

SIZES = {1: (1224, 816), 6: (3000, 2000), 24: (6000, 4000), 61: (9576, 6388)}  # MP: px
SLOW = ("DAOStarFinder",)  # timed once a field


@dataclass(frozen=True, slots=True)
class Field:
    """One rendered field: its size, number of stars, their FWHM, how often it is timed."""

    megapixels: int
    stars: int
    fwhm_px: float
    turns: int = 3
    seed: int = 1


JUDGED = Field(24, 500, 3.0, turns=9)  # the field whose milliseconds the goals are about
QUICK = (Field(1, 50, 3.0), Field(6, 500, 2.0), JUDGED)
FULL = (
    Field(1, 50, 2.0), Field(1, 50, 5.0), Field(6, 500, 2.0), Field(6, 500, 3.0),
    Field(6, 500, 5.0), Field(24, 50, 3.0), Field(24, 500, 2.0), JUDGED, Field(24, 500, 5.0),
    Field(24, 5000, 3.0), Field(61, 500, 3.0), Field(61, 5000, 4.0),
)  # fmt: skip


def run(quick: bool, report: Callable[[str], None]) -> BenchResult:
    """Measure every detector that is here on every field."""
    found = finders()
    rows: list[Mapping[str, Any]] = []
    for field in QUICK if quick else FULL:
        report(f"{field.megapixels} MP, {field.stars} stars, FWHM {field.fwhm_px:g} px ...")
        frame, truth = make_field(field)
        rows += measure_field(field, frame, truth, found)
    return BenchResult("detect", rows, goals(rows))


def make_field(field: Field) -> tuple[Frame, Truth]:
    """A frame with a gradient and 30 hot pixels a megapixel, and what is in it.

    Fluxes follow N(>F) ~ F^-0.9 from half the flux that gives SNR 10, so that about half of all
    stars are above SNR 10 and the brightest clip.
    """
    width, height = SIZES[field.megapixels]
    rng = np.random.default_rng(field.seed)
    sky, sensor = Sky(400.0, (80.0, 60.0), hot_per_mp=30.0), Sensor()
    xy = rng.uniform(8.0, [width - 9.0, height - 9.0], (field.stars, 2))
    sigma = field.fwhm_px / 2.3548
    faintest = 5.0 * np.sqrt((sky.level_e + sensor.read_noise_e**2) * 4 * np.pi * sigma**2)
    flux = np.minimum(faintest * rng.uniform(0.0, 1.0, field.stars) ** (-1 / 0.9), 3e6)
    frame = render(width, height, xy, flux, StarImage(field.fwhm_px), sky, sensor, field.seed)
    return frame, expected(xy, flux, field.fwhm_px, sky, sensor, (width, height))


def measure_field(
    field: Field, frame: Frame, truth: Truth, found: Mapping[str, Finder]
) -> list[dict[str, Any]]:
    """One row a detector, and one for reading every pixel once (``np.max``)."""
    wall: dict[str, list[float]] = {name: [] for name in ("np.max", *found)}
    cpu: dict[str, list[float]] = {name: [] for name in wall}
    for turn in range(field.turns):
        for name in wall:
            if name in SLOW and turn:
                continue
            started, worked = time.perf_counter(), time.process_time()
            if name == "np.max":
                frame.pixels.max()
            else:
                found[name](frame, field.fwhm_px)
            wall[name].append(time.perf_counter() - started)
            cpu[name].append(time.process_time() - worked)
    rows = []
    for name in wall:
        row: dict[str, Any] = {
            "mp": field.megapixels, "stars": field.stars, "fwhm_px": field.fwhm_px,
            "detector": name, "wall_ms": 1e3 * float(np.median(wall[name])),
            "cpu_ms": 1e3 * float(np.median(cpu[name])),
        }  # fmt: skip
        if name in found:
            xy, extra = _with_memory(found[name], frame, field.fwhm_px)
            row |= {"found": len(xy)} | score(xy, truth) | {"memory": extra}
        rows.append(row)
    return rows


def _with_memory(find: Finder, frame: Frame, fwhm_px: float) -> tuple[np.ndarray[Any, Any], float]:
    """Places, and the peak of what Python and numpy allocated as a fraction of the frame.

    In a new thread, so that memory kept from the turns before is counted again.
    """
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    try:
        with ThreadPoolExecutor(1) as fresh:
            xy = fresh.submit(find, frame, fwhm_px).result()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return xy, (peak - before) / frame.pixels.nbytes


def goals(rows: list[Mapping[str, Any]]) -> list[Goal]:
    """The numbers that were asked for; the worst of all fields where quality is concerned."""
    ours = [row for row in rows if row["detector"] == "kochab"]
    judged = {
        row["detector"]: row for row in rows
        if (row["mp"], row["stars"], row["fwhm_px"])
        == (JUDGED.megapixels, JUDGED.stars, JUDGED.fwhm_px)
    }  # fmt: skip
    ms = judged["kochab"]["cpu_ms"]

    def times(name: str) -> float | None:
        return judged[name]["cpu_ms"] / ms if name in judged else None

    return [
        Goal.at_most("24 MP, 500 stars: ms", ms, 25.0),
        Goal.at_least("24 MP: times faster than sep", times("sep"), 10.0),
        Goal.at_least("24 MP: times faster than DAOStarFinder", times("DAOStarFinder"), 80.0),
        Goal.at_least("completeness at SNR 10, worst", min(r["completeness"] for r in ours), 0.99),
        Goal.at_least("purity, worst", min(r["purity"] for r in ours), 0.97),
        Goal.at_most("centroid RMS / bound, worst", max(r["rms_over_bound"] for r in ours), 1.1),
        Goal.at_most("24 MP: extra memory / frame", judged["kochab"]["memory"], 0.3),
    ]
