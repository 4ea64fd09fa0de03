"""``kochab bench polar``: axes measured and aligned on the practice rig, against its truth.

Every run draws a site (latitude -60 to 70 deg), a night, a boresight anywhere above 25 deg, a
misalignment of 1 arcmin to 5 deg (evenly in its logarithm) in any direction, tracking on or off, a
camera rolled at will, bolts with play and threads of unknown pitch and sense. Solves have errors of
2 arcsec across the field and 20 arcsec in roll, and the air moves each frame by 0.7 arcsec.

* ``measure``: five frames over 60 deg of turn, and the measured against the true axis.
* ``align``: a whole alignment. A person follows the tutor, with 5 % and a degree of error in every
  turn of a bolt, and first points to the one of 40 places, drawn from the whole sky, where the
  planner foresees the surest axis. A move is a bolt turned one way; going on with it after a look
  at the screen is the same move.
* ``worn``: mounts as amateurs own them, see :mod:`app.bench.polar_worn`.
"""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from app.bench.polar_person import follow, somewhere_good, somewhere_wide
from app.bench.polar_rig import RigSky, make_rig
from app.bench.polar_worn import rows_and_goals
from app.bench.report import BenchResult, Goal
from app.core.progress import run as run_task
from app.polar.error import CHI2_68, CHI2_95
from app.sky import open_catalogue
from app.workflows.polar_measure import Sweep, measure_axis

SEED = 20260
FULL, QUICK = 500, 50
MEASURE = Sweep(turn_deg=60.0, frames=5)
WORN_FULL, WORN_QUICK = (200, 40), (20, 4)  # sweeps, alignments

Row = Mapping[str, Any]


def run(quick: bool, report: Callable[[str], None]) -> BenchResult:
    """Measure and align on many rigs; one row a band of misalignment, the goals over all."""
    runs = QUICK if quick else FULL
    report(f"{runs} sweeps of 60 deg ...")
    measured = _many(measure_once, runs)
    report(f"{runs} whole alignments ...")
    aligned = _many(align_once, runs)
    worn, honest = rows_and_goals(SEED, *(WORN_QUICK if quick else WORN_FULL), MEASURE, report)
    rows = [*_rows(measured, "measure"), *_rows(aligned, "align"), *worn]
    return BenchResult("polar", rows, [*goals(measured, aligned), *honest])


def _many(once: Callable[[int], Row], runs: int) -> list[Row]:
    return [once(seed) for seed in range(runs)]


def measure_once(seed: int) -> Row:
    """One sweep on a rig of its own: how far off, and where in its own ellipse."""
    sky = somewhere_wide(make_rig(np.random.default_rng([SEED, 1, seed]), open_catalogue()))
    started = time.process_time()
    found = run_task(measure_axis(sky, sky, sky.settings, MEASURE))
    error = found.measurement.error
    distance2 = error.distance2(sky.truth())
    return _about(sky) | {
        "error_arcsec": sky.missed_arcsec(error),
        "predicted_arcsec": error.uncertainty_arcsec,
        "inside_68": distance2 <= CHI2_68,
        "inside_95": distance2 <= CHI2_95,
        "signs_right": _signs_right(sky, error.altitude_arcsec, error.azimuth_arcsec,
                                    error.sigma_arcsec[0], error.sigma_azimuth_arcsec),
        "turn_deg": found.measurement.turn_deg,
        "cpu_ms": 1e3 * (time.process_time() - started),
    }  # fmt: skip


def align_once(seed: int) -> Row:
    """One whole alignment by a person with the tutor: how far off the pole it really ends."""
    sky = make_rig(np.random.default_rng([SEED, 2, seed]), open_catalogue())
    somewhere_good(sky, sky.settings)
    started = time.process_time()
    before = sky.true_total_arcsec()
    done = follow(sky)
    return _about(sky) | {
        "before_arcsec": before,
        "error_arcsec": sky.true_total_arcsec(),
        "predicted_arcsec": done.last.error.uncertainty_arcsec,
        "said_good": done.good,
        "moves": done.moves,
        "rounds": done.rounds,
        "frames": sky.sights,
        "cpu_ms": 1e3 * (time.process_time() - started),
    }


def _about(sky: RigSky) -> dict[str, Any]:
    hidden = sky.hidden
    return {
        "latitude_deg": sky.rig.config.site.latitude_deg,
        "tracking": sky.rig.config.tracking,
        "hidden_arcmin": sky.hidden_total_arcmin,
        "hour_deg": hidden.hour_deg,
        "dec_deg": hidden.dec_deg,
    }


def _signs_right(
    sky: RigSky, altitude: float, azimuth: float, sigma_altitude: float, sigma_azimuth: float
) -> bool:
    """Whether both signs agree with the truth, where five sigmas tell them from zero."""
    truth = sky.rig.truth().axis_error()
    pairs = (
        (altitude, truth.altitude_arcsec, sigma_altitude),
        (azimuth, truth.azimuth_arcsec, sigma_azimuth),
    )
    return all(
        math.copysign(1.0, said) == math.copysign(1.0, true)
        for said, true, sigma in pairs
        if abs(true) > 5.0 * sigma
    )


def _rows(runs: list[Row], kind: str) -> list[dict[str, Any]]:
    bands = ((1.0, 10.0), (10.0, 60.0), (60.0, 301.0))
    rows = []
    for low, high in bands:
        own = [r for r in runs if low <= r["hidden_arcmin"] < high]
        if not own:
            continue
        errors = [r["error_arcsec"] for r in own]
        row: dict[str, Any] = {
            "kind": kind, "hidden": f"{low:g}-{min(high, 300.0):g} arcmin", "runs": len(own),
            "median_arcsec": float(np.median(errors)), "worst_arcsec": max(errors),
            "predicted_arcsec": float(np.median([r["predicted_arcsec"] for r in own])),
            "cpu_ms": float(np.median([r["cpu_ms"] for r in own])),
        }  # fmt: skip
        if kind == "align":
            row["moves"] = float(np.mean([r["moves"] for r in own]))
            row["most_moves"] = max(r["moves"] for r in own)
            row["over_5_moves"] = sum(r["moves"] > 5 for r in own)
        rows.append(row)
    return rows


def goals(measured: list[Row], aligned: list[Row]) -> list[Goal]:
    """What was asked for, from these runs alone."""
    error = float(np.median([r["error_arcsec"] for r in measured]))
    in68, in95 = (
        float(np.mean([r[name] for r in measured])) for name in ("inside_68", "inside_95")
    )
    wrong = sum(not r["signs_right"] for r in measured)
    worst = max(r["error_arcsec"] for r in aligned)
    missed = sum(r["error_arcsec"] >= 30.0 for r in aligned)
    return [
        Goal.at_most('median error, 60 deg of turn, 2" solves: arcsec', error, 15.0),
        _between("inside the 68 % ellipse", in68, 0.63, 0.73),
        _between("inside the 95 % ellipse", in95, 0.92, 0.98),
        Goal.at_most("runs with a wrong sign", float(wrong), 0.0),
        Goal.at_most("alignments ending at 30 arcsec or more", float(missed), 0.0),
        Goal.at_most("worst end of an alignment: arcsec", worst, 30.0),
        Goal.at_most("most moves of the bolts", float(max(r["moves"] for r in aligned)), 5.0),
    ]


def _between(name: str, value: float, low: float, high: float) -> Goal:
    return Goal(name, value, f"{low:g} to {high:g}", low <= value <= high)
