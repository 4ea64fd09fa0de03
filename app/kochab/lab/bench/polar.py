"""``kochab bench polar``: axes measured and aligned on the practice rig, against its truth.

Every run draws a site (latitude -60 to 70 deg), a night, a boresight anywhere above 25 deg, a
misalignment of 1 arcmin to 5 deg (evenly in its logarithm) in any direction, tracking on or off, a
camera rolled at will, bolts with backlash and threads of unknown pitch and sense. Solves have errors of
2 arcsec across the field and 20 arcsec in roll, and the air moves each frame by 0.7 arcsec.

* ``measure``: five frames over 60 deg of turn, and the measured against the true axis.
* ``align``: a whole alignment. A person follows the tutor, with 5 % and a degree of error in every
  turn of a bolt, and first points to the one of 40 places, drawn from the whole sky, where the planner foresees the
  surest axis. A move is a bolt turned one way; going on with it after a look at the screen is the same move.
* ``worn``: mounts as amateurs own them, scored against two claims: the ellipse of the frames' own
  noise, and the one with what was not seen.
* ``gives way``: see :mod:`kochab.lab.bench.polar_moved`.
* ``guide log``: see :mod:`kochab.lab.bench.polar_guided`.
* ``hands``: see :mod:`kochab.lab.bench.polar_hands`.
* ``evening``: see :mod:`kochab.lab.bench.polar_faults`.
* ``rendered``: see :mod:`kochab.lab.bench.polar_frames`; the others make up attitudes.

The worn mounts have

* periodic error of 7 arcsec peak to peak (what Software Bisque promises of a Paramount) to 160 (a
  small travel mount, astro.zalmstra.nl/archives/279), evenly in the logarithm;
* backlash of both gears of 10 to 120 arcsec, about the 60 measured at a Sky-Watcher AZ-GTi
  (az-autoguideport.fun); backlash of the bolts to 3 arcmin, each dragging the other by 3 %;
* a swing of 10 to 40 arcsec after every turn, dying within a second;
* a tube that sinks by 30 arcsec (one sigma) between zenith and horizon: a guide scope on a 9 inch
  Schmidt-Cassegrain wandered by 32 arcsec in 85 minutes (astronomy.mdodd.com/flexure.html);
* every other flexure: a turn of the camera linear in gravity's pull on it, 10 arcsec (one sigma) in
  each of the nine elements.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from kochab.core.progress import run as run_task
from kochab.lab.bench import ALL_ROWS, BenchResult, Goal, Only, Report, Row, column, reported, summary, timed
from kochab.lab.bench.polar_faults import fault_rows
from kochab.lab.bench.polar_frames import frames_rows
from kochab.lab.bench.polar_guided import guided_rows
from kochab.lab.bench.polar_hands import hands_rows
from kochab.lab.bench.polar_moved import moved_rows
from kochab.lab.bench.polar_rig import ALIGN, RigSky, follow, make_rig, point_for_sweep, point_where_best
from kochab.polar.error import CHI2_68, CHI2_95, PolarError
from kochab.simulate.mechanics.axis import GearErrors
from kochab.simulate.mechanics.geometry import BoltErrors
from kochab.simulate.rig import PracticeRig
from kochab.workflows.polar.align import AlignOptions
from kochab.workflows.polar.measure import Sweep, measure_axis, second_sweep

SEED = 20260
FULL, QUICK = 500, 50
MEASURE = Sweep(turn_deg=60.0, frames=5)
WORN_FULL, WORN_QUICK = (200, 40), (20, 4)  # sweeps, alignments
TUBE_ARCSEC, REST_ARCSEC = 30.0, 10.0
PERIODIC_ARCSEC = (3.5, 80.0)  # amplitude
PLAY_ARCSEC = (10.0, 120.0)


def worn_rig(rng: np.random.Generator) -> RigSky:
    """A rig of the usual bench, its mount with backlash, periodic error and flexure."""
    sky = make_rig(rng)
    mount = sky.rig.config.mount
    mount = replace(
        mount,
        build=replace(mount.build, flexure_arcsec=float(abs(rng.normal()) * TUBE_ARCSEC)),
        hour_gear=_gear(rng),
        dec_gear=_gear(rng),
        bolts=BoltErrors(tuple(rng.uniform(0.0, 3.0, 2)), tuple(rng.normal(0.0, 0.03, 2))),
    )
    sky.rig = PracticeRig(replace(sky.rig.config, mount=mount))
    sky.rest_arcsec = rng.normal(0.0, REST_ARCSEC, (3, 3))
    return sky


def _gear(rng: np.random.Generator) -> GearErrors:
    low, high = np.log(PERIODIC_ARCSEC)
    return GearErrors(
        backlash_deg=float(rng.uniform(*PLAY_ARCSEC)) / 3600.0,
        periodic_arcsec=float(np.exp(rng.uniform(low, high))),
        worm_phase_deg=float(rng.uniform(0.0, 360.0)),
        rate_error=float(rng.normal(0.0, 5e-4)),
        wobble_arcsec=float(rng.uniform(10.0, 40.0)),
    )


def measure_worn(seed: Sequence[int]) -> tuple[Row, Row]:
    """One sweep of a worn mount, and the same with a second one."""
    sky = point_for_sweep(worn_rig(np.random.default_rng([*seed])))
    first = run_task(measure_axis(sky, sky, sky.settings, MEASURE))
    one = _judged(sky, first.measurement.error)
    both = run_task(second_sweep(sky, sky, first, MEASURE))
    return one, _judged(sky, both.measurement.error)


def measure_once(seed: int) -> Row:
    """One sweep on a rig of its own: how far off, and where in its own ellipse."""
    sky = point_for_sweep(make_rig(np.random.default_rng([SEED, 1, seed])))
    found, seconds = timed(lambda: run_task(measure_axis(sky, sky, sky.settings, MEASURE)))
    error, truth = found.measurement.error, sky.rig.truth().axis_error()
    axes = (
        (error.altitude_arcsec, truth.altitude_arcsec, error.sigma_arcsec[0]),
        (error.azimuth_arcsec, truth.azimuth_arcsec, error.sigma_azimuth_arcsec),
    )
    return _judged(sky, error) | {
        # where five sigmas tell the error from zero
        "signs_right": all(stated * true > 0.0 for stated, true, sigma in axes if abs(true) > 5.0 * sigma),
        "turn_deg": found.measurement.turn_deg,
        "cpu_ms": 1e3 * seconds,
    }


def align_once(seed: int) -> Row:
    """One whole alignment by a person with the tutor: how far off the pole it really ends."""
    return _aligned(make_rig(np.random.default_rng([SEED, 2, seed])), ALIGN)


def _aligned(sky: RigSky, options: AlignOptions) -> Row:
    point_where_best(sky)
    before = sky.true_total_arcsec()
    done, seconds = timed(lambda: follow(sky, options))
    ends = {"before_arcsec": before, "off_arcsec": sky.true_total_arcsec(), "cpu_ms": 1e3 * seconds}
    return _judged(sky, done.last.error) | ends | {"moves": done.moves, "rounds": done.rounds}


def _judged(sky: RigSky, error: PolarError) -> dict[str, Any]:
    """How far a measured axis is from the true one, and whether each of its ellipses holds that."""
    row: dict[str, Any] = {"hidden_arcmin": sky.hidden_total_arcmin, "off_arcsec": sky.missed_arcsec(error)}
    for name, claim in (("noise", error), ("whole", error.with_systematics)):
        distance2 = claim.distance2(sky.truth())
        row[f"{name}_arcsec"] = claim.uncertainty_arcsec
        row |= {f"{name}_68": distance2 <= CHI2_68, f"{name}_95": distance2 <= CHI2_95}
    return row


def run(quick: bool, report: Report, only: Only = ALL_ROWS) -> BenchResult:
    """Measure and align on many rigs; one row a band of misalignment, the goals over all."""
    rows: list[Row] = []
    goals: list[Goal] = []
    for part in (_measured, _aligned_rows, _worn, moved_rows, guided_rows, hands_rows, fault_rows, frames_rows):
        found, of_these = part(quick, report, only)
        rows, goals = [*rows, *found], [*goals, *of_these]
    return BenchResult("polar", rows, goals)


def _measured(quick: bool, report: Report, only: Only) -> tuple[list[Row], list[Goal]]:
    if not only("measure"):
        return [], []
    runs = QUICK if quick else FULL
    report(f"{runs} sweeps of 60 deg ...")
    measured = [measure_once(seed) for seed in range(runs)]
    return [reported(row, report) for row in _rows(measured, "measure")], measure_goals(measured)


def _aligned_rows(quick: bool, report: Report, only: Only) -> tuple[list[Row], list[Goal]]:
    if not only("align"):
        return [], []
    runs = QUICK if quick else FULL
    report(f"{runs} whole alignments ...")
    aligned = [align_once(seed) for seed in range(runs)]
    return [reported(row, report) for row in _rows(aligned, "align")], align_goals(aligned)


def _worn(quick: bool, report: Report, only: Only) -> tuple[list[Row], list[Goal]]:
    (sweeps, alignments), rows = WORN_QUICK if quick else WORN_FULL, []
    if sweeping := [kind for kind in ("worn: one sweep", "worn: two sweeps") if only(kind)]:
        report(f"{sweeps} worn mounts, one sweep and two ...")
        one, two = zip(*[measure_worn((SEED, 3, k)) for k in range(sweeps)], strict=True)
        both = {"worn: one sweep": one, "worn: two sweeps": two}
        rows += [reported(_worn_row(kind, both[kind]), report) for kind in sweeping]
    for kind, second in (("worn: align", False), ("worn: align, two sweeps", True)):
        if only(kind):
            report(f"{alignments} whole alignments of worn mounts ...")
            rigs = (worn_rig(np.random.default_rng([SEED, 4, k])) for k in range(alignments))
            own = [_aligned(rig, replace(ALIGN, second_sweep=second)) for rig in rigs]
            rows.append(reported(_worn_row(kind, own), report))
    return rows, worn_goals(rows)


def _rows(runs: Sequence[Row], kind: str) -> list[Row]:
    """A row a band of misalignment."""
    rows: list[Row] = []
    for low, high in ((1.0, 10.0), (10.0, 60.0), (60.0, 301.0)):
        own = [r for r in runs if low <= r["hidden_arcmin"] < high]
        if not own:
            continue
        row = {"kind": kind, "hidden": f"{low:g}-{min(high, 300.0):g} arcmin"} | _errors(own)
        row |= summary(own, cpu_ms=("cpu_ms", np.median))
        if kind == "align":
            row |= summary(own, moves=("moves", np.mean), most_moves=("moves", np.max))
            row |= summary(own, over_5_moves=("moves", lambda moves: (moves > 5).sum()))
        rows.append(row)
    return rows


def _worn_row(kind: str, own: Sequence[Row]) -> Row:
    """How often the uncertainties of worn mounts hold."""
    row = {"kind": kind} | _errors(own) | summary(own, of_10_arcsec=("off_arcsec", partial(np.percentile, q=90)))
    row |= summary(own, whole_arcsec=("whole_arcsec", np.median))
    row |= summary(own, **{f"in_{n}": (n, np.mean) for n in ("noise_68", "noise_95", "whole_68", "whole_95")})
    return row | (summary(own, most_moves=("moves", np.max)) if "moves" in own[0] else {})


def _errors(own: Sequence[Row]) -> dict[str, Any]:
    """How far off the pole alignments really end; of a measurement, how far it is off the axis."""
    off = summary(own, runs=("off_arcsec", len), median_arcsec=("off_arcsec", np.median))
    return off | summary(own, worst_arcsec=("off_arcsec", np.max), predicted_arcsec=("noise_arcsec", np.median))


def measure_goals(measured: Sequence[Row]) -> list[Goal]:
    """What was asked for of one sweep."""
    error, wrong = float(np.median(column(measured, "off_arcsec"))), float((column(measured, "signs_right") == 0).sum())
    return [
        Goal.at_most('median error, 60 deg of turn, 2" solves: arcsec', error, 15.0),
        Goal.between("inside the 68 % ellipse", float(column(measured, "noise_68").mean()), 0.63, 0.73),
        Goal.between("inside the 95 % ellipse", float(column(measured, "noise_95").mean()), 0.92, 0.98),
        Goal.at_most("runs with a wrong sign", wrong, 0.0),
    ]


def align_goals(aligned: Sequence[Row]) -> list[Goal]:
    """What was asked for of a whole alignment."""
    ends = column(aligned, "off_arcsec")
    return [
        Goal.at_most("alignments ending at 30 arcsec or more", float((ends >= 30.0).sum()), 0.0),
        Goal.at_most("worst end of an alignment: arcsec", float(ends.max()), 30.0),
        Goal.at_most("most moves of the bolts", float(column(aligned, "moves").max()), 5.0),
    ]


def worn_goals(worn: Sequence[Row]) -> list[Goal]:
    """The wider ellipse holds the truth of worn mounts too."""
    what = "inside the 95 % ellipse, bending and all"
    return [Goal.at_least(f"{row['kind']}: {what}", row["in_whole_95"], 0.9) for row in worn]
