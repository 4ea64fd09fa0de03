"""Worn mounts in ``kochab bench polar``: what play, gears and bending do to a polar alignment.

As large as amateurs find at their own mounts:

* periodic error of 7 arcsec peak to peak (what Software Bisque promises of a Paramount) to 160 (a
  small travel mount, astro.zalmstra.nl/archives/279), evenly in the logarithm;
* play of both gears 10 to 120 arcsec, about the 60 measured at a Sky-Watcher AZ-GTi
  (az-autoguideport.fun); play of the bolts to 3 arcmin, each dragging the other by 3 %;
* a swing of 10 to 40 arcsec after every turn, dying within a second;
* a tube that sinks by 30 arcsec (one sigma) between zenith and horizon: a guide scope on a 9 inch
  Schmidt-Cassegrain wandered by 32 arcsec in 85 minutes (astronomy.mdodd.com/flexure.html);
* everything else that gives way: a turn of the camera linear in gravity's pull on it, 10 arcsec
  (one sigma) in each of the nine elements.

Two claims are scored: the ellipse of the frames' own noise, and the one with what was not seen.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from app.bench.polar_person import align_options, follow, somewhere_good, somewhere_wide
from app.bench.polar_rig import RigSky, make_rig
from app.bench.report import Goal
from app.core.progress import run as run_task
from app.polar.error import CHI2_68, CHI2_95, PolarError
from app.simulate.mechanics.axis import AxisWear
from app.simulate.mechanics.bolts import BoltWear
from app.simulate.rig import PracticeRig
from app.sky import open_catalogue
from app.workflows.polar_measure import Sweep, measure_axis
from app.workflows.polar_second import second_sweep

Row = Mapping[str, Any]
TUBE_ARCSEC, REST_ARCSEC = 30.0, 10.0
PERIODIC_ARCSEC = (3.5, 80.0)  # amplitude
PLAY_ARCSEC = (10.0, 120.0)


def worn(rng: np.random.Generator) -> RigSky:
    """A rig of the usual bench, its mount worn."""
    catalogue = open_catalogue()
    sky = make_rig(rng, catalogue)
    mount = sky.rig.config.mount
    mount = replace(
        mount,
        build=replace(mount.build, flexure_arcsec=float(abs(rng.normal()) * TUBE_ARCSEC)),
        hour_wear=_gear(rng),
        dec_wear=_gear(rng),
        bolts=BoltWear(tuple(rng.uniform(0.0, 3.0, 2)), tuple(rng.normal(0.0, 0.03, 2))),
    )
    sky.rig = PracticeRig(replace(sky.rig.config, mount=mount), catalogue)
    sky.rest_arcsec = rng.normal(0.0, REST_ARCSEC, (3, 3))
    return sky


def _gear(rng: np.random.Generator) -> AxisWear:
    low, high = np.log(PERIODIC_ARCSEC)
    return AxisWear(
        backlash_deg=float(rng.uniform(*PLAY_ARCSEC)) / 3600.0,
        periodic_arcsec=float(np.exp(rng.uniform(low, high))),
        worm_phase_deg=float(rng.uniform(0.0, 360.0)),
        rate_error=float(rng.normal(0.0, 5e-4)),
        wobble_arcsec=float(rng.uniform(10.0, 40.0)),
    )


def measure_worn(seed: Sequence[int], sweep: Sweep) -> tuple[Row, Row]:
    """One sweep of a worn mount, and the same with a second one."""
    sky = somewhere_wide(worn(np.random.default_rng([*seed])))
    first = run_task(measure_axis(sky, sky, sky.settings, sweep))
    one = _row(sky, first.measurement.error)
    both = run_task(second_sweep(sky, sky, first, sweep))
    return one, _row(sky, both.measurement.error)


def align_worn(seed: Sequence[int], second: bool) -> Row:
    """A whole alignment of a worn mount; ``second``: with a second sweep before it is good."""
    sky = worn(np.random.default_rng([*seed]))
    somewhere_good(sky, sky.settings)
    done = follow(sky, align_options(second))
    ends = {"ends_arcsec": sky.true_total_arcsec(), "moves": done.moves}
    return {**_row(sky, done.last.error), **ends}


def _row(sky: RigSky, error: PolarError) -> Row:
    truth = sky.truth()
    noise, whole = error.distance2(truth), error.whole.distance2(truth)
    return {
        "error_arcsec": sky.missed_arcsec(error),
        "noise_arcsec": error.uncertainty_arcsec,
        "whole_arcsec": error.whole.uncertainty_arcsec,
        "noise_68": noise <= CHI2_68,
        "noise_95": noise <= CHI2_95,
        "whole_68": whole <= CHI2_68,
        "whole_95": whole <= CHI2_95,
    }


def rows_and_goals(
    seed: int, sweeps: int, alignments: int, sweep: Sweep, report: Callable[[str], None]
) -> tuple[list[dict[str, Any]], list[Goal]]:
    """The rows of the worn group, and how honest its claims were."""
    report(f"{sweeps} worn mounts, one sweep and two ...")
    measured = [measure_worn((seed, 3, k), sweep) for k in range(sweeps)]
    report(f"{alignments} whole alignments of worn mounts, twice ...")
    groups = {
        "worn: one sweep": [one for one, _ in measured],
        "worn: two sweeps": [two for _, two in measured],
        "worn: align": [align_worn((seed, 4, k), False) for k in range(alignments)],
        "worn: align, two sweeps": [align_worn((seed, 4, k), True) for k in range(alignments)],
    }
    rows = [_summary(kind, own) for kind, own in groups.items()]
    goals = []
    for name, own in groups.items():
        inside = float(np.mean([r["whole_95"] for r in own]))
        goals.append(
            Goal.at_least(f"{name}: inside the 95 % ellipse, bending and all", inside, 0.9)
        )
    return rows, goals


def _summary(kind: str, own: Sequence[Row]) -> dict[str, Any]:
    ends = [r["ends_arcsec"] for r in own if "ends_arcsec" in r] or [r["error_arcsec"] for r in own]
    return {
        "kind": kind, "runs": len(own), "median_arcsec": float(np.median(ends)),
        "of_10_arcsec": float(np.percentile(ends, 90)), "worst_arcsec": max(ends),
        "predicted_arcsec": float(np.median([r["noise_arcsec"] for r in own])),
        "whole_arcsec": float(np.median([r["whole_arcsec"] for r in own])),
    } | {
        f"in_{name}": float(np.mean([r[name] for r in own]))
        for name in ("noise_68", "noise_95", "whole_68", "whole_95")
    } | ({"most_moves": max(r["moves"] for r in own)} if "moves" in own[0] else {})  # fmt: skip
