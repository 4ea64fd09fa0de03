"""Narrow fields: blind with the shipped patterns, with those made once, and where place and scale are told.

A field counts where the catalogue has ten stars in it, or seven where place and scale are told: a tenth of them is
missing, and as many more are none. What is told is up to half a field and 5 % wrong.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from kochab.core.attitude import apart_deg
from kochab.core.frame import Hint
from kochab.core.progress import run as drive
from kochab.core.solution import NoSolution
from kochab.identification.index import shipped
from kochab.identification.index_build import make_fine
from kochab.identification.patterns import Patterns
from kochab.lab.bench import ALL_ROWS, Only, Report
from kochab.simulate.random_fields import FieldPlan, RandomField, random_field
from kochab.sky import open_catalogue
from kochab.solver import UNKNOWN_YEAR, SolveOptions
from kochab.solver.pipeline import solve_detections

SEED = 20261128
FIELDS_DEG = (0.5, 0.65, 0.8, 1.0, 1.4, 2.0)
COUNT, QUICK_COUNT = 100, 4
BLIND_STARS, TOLD_STARS = 10, 7
SHIPPED, MADE, TOLD = "blind, shipped patterns", "blind", "place and scale told"


def narrow_fields(quick: bool, report: Report, only: Only = ALL_ROWS) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """What was done, and a fact sheet for each field, of every width and way that is wanted."""
    if not quick and any(only(f"{field_deg:g} deg, {MADE}") for field_deg in FIELDS_DEG):  # long, once on a machine
        drive(make_fine(), lambda p: report(f"patterns for small fields: {p.detail}"))
    count = QUICK_COUNT if quick else COUNT
    for field_deg in FIELDS_DEG:
        for way, fewest in ((SHIPPED, BLIND_STARS), (MADE, BLIND_STARS), (TOLD, TOLD_STARS)):
            if (way == MADE and quick) or not only(f"{field_deg:g} deg, {way}"):
                continue
            rng = np.random.default_rng([SEED, round(100 * field_deg)])
            fields = _rich_fields(field_deg, fewest, count, rng)
            yield f"{field_deg:g} deg, {way}", [_sheet(field, way, rng) for field in fields]


def _rich_fields(field_deg: float, fewest: int, count: int, rng: np.random.Generator) -> list[RandomField]:
    catalogue, kept = open_catalogue(), list[RandomField]()
    while len(kept) < count:
        field = random_field(catalogue, rng, FieldPlan(field_deg, missing=0.1, spurious=0.1))
        if field.stars >= fewest:
            kept.append(field)
    return kept


def _sheet(field: RandomField, way: str, rng: np.random.Generator) -> dict[str, Any]:
    width_deg = field.camera.fov_deg[0]
    started = time.process_time()
    if way == SHIPPED:
        answer = drive(Patterns(shipped()).identify(field.detections, None, UNKNOWN_YEAR))
        place = None if isinstance(answer, NoSolution) else answer.attitude.ra_dec_deg
    else:
        hint = _told(field, width_deg, rng) if way == TOLD else None
        solved = drive(solve_detections(field.detections, SolveOptions(hint=hint)))
        place = None if isinstance(solved, NoSolution) else solved.ra_dec_deg
    found = place is not None and apart_deg(place, field.attitude.ra_dec_deg) < 0.01 * width_deg
    return {"found": found, "wrong": place is not None and not found, "cpu_s": time.process_time() - started}


def _told(field: RandomField, width_deg: float, rng: np.random.Generator) -> Hint:
    """A place within half a field of the truth, and the scale to 5 %."""
    (ra, dec), off = field.attitude.ra_dec_deg, rng.uniform(-0.35, 0.35, 2) * width_deg
    place = (ra + off[0] / max(np.cos(np.radians(dec)), 0.01)) % 360.0, float(np.clip(dec + off[1], -90.0, 90.0))
    scale = field.camera.scale_arcsec_px * rng.uniform(0.96, 1.04)
    return Hint(scale_arcsec_px=(0.95 * scale, 1.05 * scale), centre_deg=(*place, width_deg))
