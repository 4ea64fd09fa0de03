"""``kochab bench mount``: a lost telescope is centred, over real lines that go wrong.

Every run is another night: a practice telescope with a misaligned axis, cone error, backlash,
periodic error, flexure and a shaking tube points 3 deg from where it believes.
It is sent to a target over one of six drivers, a pseudo-terminal and the device's simulated far end,
and corrected by what frames show. In every other run the line is bad. Then each is stopped, and falls mute.
In a checkout the detective, random evenings, conformance and killed programs are measured too, on every driver.
"""

import contextlib
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, field
from itertools import product
from typing import Any

import numpy as np

from kochab.core.attitude import apart_deg
from kochab.core.errors import DeviceError, LineLostError
from kochab.core.progress import Progress
from kochab.core.progress import run as drive
from kochab.core.values import mutable
from kochab.lab.bench import ALL_ROWS, BenchResult, Goal, Only, Report, mount_stops, reported, summary
from kochab.lab.bench.mount_rig import MountRig, mount_rig, unguarded
from kochab.simulate.responders import RESPONDERS
from kochab.workflows.centre_target import Centring, centre_target

RUNS, QUICK_RUNS = 200, 20
GOAL_ARCSEC, TOLERANCE_ARCSEC = 10.0, 8.5  # a solve's own error and the drift since fit between
MOST_CORRECTIONS = 3
RENDERED_EVERY = 10
UNPLUGGED_EVERY, REFUSED_EVERY = 5, 3  # of the runs with faults
AT_ONCE = 4
AGAIN = 3  # how often somebody begins anew after the line was lost or the mount fell silent


@mutable
class CentringRun:
    """One run's outcome; ``error_arcsec`` is the truth in the middle of the last exposure."""

    seed: int
    driver: str
    faulty: bool
    rendered: bool
    end: str = ""
    error_arcsec: float = float("nan")
    corrections: int = 0
    again: int = 0
    faults: int = 0
    strays: list[str] = field(default_factory=list)
    still: bool = True
    seconds: float = 0.0
    night_s: float = 0.0
    trouble: str = ""

    @property
    def good(self) -> bool:
        """Whether it ended as wished."""
        return self.error_arcsec <= GOAL_ARCSEC and self.corrections <= MOST_CORRECTIONS


def run(quick: bool, report: Report, only: Only = ALL_ROWS) -> BenchResult:
    """Centre 200 times (``quick``: 20); rows are named ``centring: DRIVER``, ``stop: DRIVER``, ``evenings: DRIVER``."""
    names = list(RESPONDERS)
    planned = [
        CentringRun(k, names[k // 2 % len(names)], k % 2 == 1, k % RENDERED_EVERY < 2)
        for k in range(QUICK_RUNS if quick else RUNS)
    ]
    planned = [one for one in planned if only(f"centring: {one.driver}")]
    runs = _centred(planned, report) if planned else []
    rows = _rows(runs, names)
    report("  stopping and muting each")
    stops = mount_stops.rows([name for name in names if only(f"stop: {name}")])
    for row in rows + stops:
        reported(row, report)
    stops += mount_stops.elsewhere(quick, report, only)
    goals = [*(_goals(runs) if runs else []), *mount_stops.goals(stops)]
    return BenchResult("mount", rows + stops, [goal for goal in goals if goal.value is not None or not only.names])


def _centred(planned: list[CentringRun], report: Report) -> list[CentringRun]:
    _do(planned[0])  # what is read once, before several do it at the same time
    runs = planned[:1]
    with ThreadPoolExecutor(AT_ONCE) as pool:  # lines are mostly waited for
        for one in pool.map(_do, planned[1:]):
            runs.append(one)
            if not one.good or one.strays or len(runs) % 20 == 0:
                report(_line(one))
    return runs


def _do(one: CentringRun) -> CentringRun:
    begun = time.perf_counter()
    with mount_rig(one.seed, one.driver, one.rendered) as rig:
        _centre(rig, one)
    one.seconds = time.perf_counter() - begun
    return one


def _centre(rig: MountRig, one: CentringRun) -> None:
    if one.faulty:
        rig.spoil(refusal=one.seed // 2 % REFUSED_EVERY == 0)
        if one.seed // 2 % UNPLUGGED_EVERY == 0:
            rig.unplug_in = 3 + one.seed % 17  # during the first slew or a correction
    while (result := _once(rig, one)) is None and one.again < AGAIN:
        one.again += 1
    one.faults = sum(rig.faults.happened.values())
    one.end = "given up" if result is None else str(result.end)
    rig.faults.none()
    one.strays = unguarded(rig.watched.orders, rig.guard)
    one.still = not rig.rig.mount.slewing
    one.night_s = rig.rig.clock.now_unix() - rig.rig.start_unix
    if result is not None and result.solution is not None:
        truth = rig.rig.truth(rig.exposed_unix).ra_dec_deg
        one.error_arcsec = apart_deg(truth, (rig.target.ra_deg, rig.target.dec_deg)) * 3600.0


def _once(rig: MountRig, one: CentringRun) -> Centring | None:
    """One centring; None when the line or the mount failed, and is as good as new again."""
    before, left = one.corrections, max(1, MOST_CORRECTIONS - one.corrections)
    task = centre_target(rig.guard, rig.solve_now, rig.target, TOLERANCE_ARCSEC, left, confirmed=True, wait=rig.wait)

    def count(progress: Progress) -> None:
        one.corrections += progress.stage == "corrected"

    try:
        result = drive(task, count)
    except DeviceError as error:
        one.trouble = str(error)
        if isinstance(error, LineLostError):
            _replug(rig)
        return None
    one.trouble = "" if result.centred else " ".join([result.sentence, *result.notes])
    return result if result.centred or one.corrections - before >= left else None


def _replug(rig: MountRig) -> None:
    """Somebody puts the cable back; the guard stops the mount before anything else."""
    for _ in range(AGAIN):
        rig.line.plug()
        with contextlib.suppress(DeviceError):
            rig.guard.reconnect()
            return


def _rows(runs: list[CentringRun], names: list[str]) -> list[dict[str, Any]]:
    rows = []
    for name, faulty in product(names, (False, True)):
        some = [
            {**asdict(r), "good": r.good, "strays": len(r.strays)}
            for r in runs
            if r.driver == name and r.faulty is faulty
        ]
        if some:
            row = {"driver": name, "line": "faults" if faulty else "good"} | summary(some, runs=("seed", len))
            row |= summary(some, rendered=("rendered", np.sum), centred=("good", np.sum))
            row |= summary(some, median_arcsec=("error_arcsec", np.median), worst_arcsec=("error_arcsec", np.max))
            row |= summary(some, corrections=("corrections", np.mean), most=("corrections", np.max))
            row |= summary(some, faults=("faults", np.sum), begun_again=("again", np.sum), strays=("strays", np.sum))
            rows.append(row | summary(some, night_s=("night_s", np.mean), s_a_run=("seconds", np.mean)))
    return rows


def _goals(runs: list[CentringRun]) -> list[Goal]:
    count = len(runs)
    centred = f"runs centred within 10 arcsec in at most 3 corrections, of {count}"
    faulty = sum(r.faults > 0 for r in runs)
    return [
        Goal.at_least(centred, sum(r.good for r in runs), count),
        Goal.at_least("share of the runs with faults that happened", faulty / count, 0.45),
        Goal.at_most("motions outside the guard", sum(len(r.strays) for r in runs), 0),
        Goal.at_most("mounts left slewing", sum(not r.still for r in runs), 0),
    ]


def _line(one: CentringRun) -> str:
    kind = f"{'faults' if one.faulty else 'good line'}{', rendered' if one.rendered else ''}"
    mark = "" if one.good else "  NOT GOOD"
    return (
        f"  {one.seed}: {one.driver} ({kind}) {one.end}, {one.error_arcsec:.1f} arcsec after "
        f"{one.corrections}, {one.seconds:.1f} s{mark} {one.trouble} {'; '.join(one.strays[:3])}"
    )
