"""``kochab bench narrow``: fields below a degree whose place and scale are known.

Random fields of the shipped stars, each with its hint off by up to 0.7 of its radius: 1 degree, the scale good to a
tenth, or, of a known camera, to 0.3 %. A tenth of the detections is false. Then random points with the same hints, of
which none may be given a pointing.
"""

import time
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import numpy as np

from kochab.core.attitude import apart_deg
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run as drive
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.lab.bench import BenchResult, Goal, Report, summary
from kochab.simulate.random_fields import FieldPlan, RandomField, random_field, random_points
from kochab.sky import open_catalogue
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_detections

SEED = 20261126
FIELDS, QUICK_FIELDS = 600, 40
POINTS, QUICK_POINTS = 2000, 40
RADIUS_DEG = 1.0
TENTH, KNOWN = 1.1, 1.003
APART_PX = 30.0
"""Stars nearer to another are one, where three or four must do."""
WITHIN = 0.01
"""Of the field: so near the truth an answer is right."""
J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)


@frozen
class Case:
    """Fields of one size, those with so many stars, and how well the scale is known."""

    name: str
    fov_deg: float
    sureness: float
    stars: tuple[int, int]
    goal_percent: float


CASES = (
    Case("0.8 deg, 10 stars and more", 0.8, TENTH, (10, 10_000), 99.0),
    Case("0.5 deg, 7 stars and more", 0.5, TENTH, (7, 10_000), 99.0),
    Case("0.5 deg, known camera, 4 stars and more", 0.5, KNOWN, (4, 10_000), 95.0),
)


def run(quick: bool, report: Report) -> BenchResult:
    """Solve fields of each case and refuse points; print shares and processor times."""
    rows, goals = [], []
    for number, case in enumerate(CASES):
        kept = list(solved(case, QUICK_FIELDS if quick else FIELDS, np.random.default_rng(SEED + number)))
        rows.append(row(case.name, kept))
        goals.append(Goal.at_least(f"{case.name}, % found", rows[-1]["found_percent"], case.goal_percent))
        report(f"{case.name}: {rows[-1]['found_percent']:.1f} %")
    kept = list(refused(QUICK_POINTS if quick else POINTS, np.random.default_rng(SEED + len(CASES))))
    rows.append(row("random points", kept))
    wrong = sum(r["wrong"] for r in rows)
    median = max(r["median_cpu_ms"] for r in rows[: len(CASES)])
    goals.append(Goal.at_most("wrong answers", wrong, 0))
    goals.append(Goal.at_most("median, processor ms, worst case", median, 300.0))
    return BenchResult("narrow", rows, goals)


def solved(case: Case, count: int, rng: np.random.Generator) -> Iterator[dict[str, Any]]:
    """One fact sheet a field."""
    catalogue = open_catalogue()
    while count:
        field = random_field(catalogue, rng, FieldPlan(case.fov_deg, missing=0.0, spurious=0.1))
        if case.stars[0] <= field.stars <= case.stars[1] and (field.stars >= 7 or stand_apart(field.detections)):
            count -= 1
            hint = hint_of(*field.attitude.ra_dec_deg, field.camera.scale_arcsec_px, case.sureness, rng)
            yield asked(field.detections, hint, field)


def refused(count: int, rng: np.random.Generator) -> Iterator[dict[str, Any]]:
    """One fact sheet a list of points that are no stars."""
    for _ in range(count):
        points = random_points(rng, int(rng.integers(4, 61)))
        fov_deg, sureness = float(rng.uniform(0.3, 0.9)), float(rng.choice([TENTH, KNOWN]))
        place = float(rng.uniform(0, 360)), float(np.degrees(np.arcsin(rng.uniform(-1, 1))))
        yield asked(points, hint_of(*place, 3600.0 * fov_deg / points.width, sureness, rng), None)


def hint_of(ra: float, dec: float, scale: float, sureness: float, rng: np.random.Generator) -> Hint:
    """What a mount and a header say of a frame.

    Parameters
    ----------
    ra, dec : float
        Its middle, degrees, ICRS.
    scale : float
        Its scale, arcseconds a pixel.
    sureness : float
        The factor within which the scale is known.
    rng : np.random.Generator
        By how much the place is off.
    """
    off, turn = 0.7 * RADIUS_DEG * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
    north = float(np.clip(dec + off * np.cos(turn), -89.9, 89.9))
    east = float((ra + off * np.sin(turn) / np.cos(np.radians(north))) % 360.0)
    span = scale / sureness, scale * sureness
    return Hint(scale_arcsec_px=span, centre_deg=(east, north, RADIUS_DEG), time_utc=J2000)


def stand_apart(detections: Detections) -> bool:
    """Whether no two detections stand together."""
    gap = np.linalg.norm(detections.xy[:, None] - detections.xy[None], axis=2)
    np.fill_diagonal(gap, np.inf)
    return bool((gap > APART_PX).all())


def asked(detections: Detections, hint: Hint, field: RandomField | None) -> dict[str, Any]:
    """Whether an answer came, whether it is right, and what it cost."""
    started = time.process_time()
    result = drive(solve_detections(detections, SolveOptions(hint=hint, blind_after_hint=False)))
    cpu_ms = (time.process_time() - started) * 1e3
    solved = isinstance(result, Solution)
    right = (
        isinstance(result, Solution)
        and field is not None
        and apart_deg(result.ra_dec_deg, field.attitude.ra_dec_deg) < WITHIN * field.camera.fov_deg[0]
    )
    return {"found": right, "wrong": solved and not right, "cpu_ms": cpu_ms}


def row(name: str, kept: list[dict[str, Any]]) -> dict[str, Any]:
    """One line of the table."""
    return {"fields": name} | summary(
        kept,
        n=("found", len),
        found_percent=("found", lambda f: 100.0 * np.mean(f)),
        wrong=("wrong", np.sum),
        median_cpu_ms=("cpu_ms", np.median),
        slowest_cpu_ms=("cpu_ms", np.max),
    )
