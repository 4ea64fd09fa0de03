"""What ``kochab bench mount`` measures in a checkout only, a row of JSON a line: ``python -m tests.gear.mounts.measured``.

The simulators of most makes, INDI's and Alpaca's servers, and the random evenings are not shipped.
"""

import argparse
import json
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, redirect_stdout, suppress
from pathlib import Path
from time import monotonic, sleep

import pytest

from kochab.core.errors import DeviceError
from kochab.gear.mounts.guard import Guard
from kochab.lab.bench import ALL_ROWS, Only, mount_stops
from tests.boards import measured as boards
from tests.gear.mounts import indi_sequences
from tests.gear.mounts.bench import LIMITS, SITE, alpaca, indi, place
from tests.gear.mounts.sequences import MOUNTS, planned, play
from tests.patterns import REPOSITORY
from tests.pointing import tpoint_mounts
from tests.pointing.faulty_mounts import CASES, FAULTS, verdicts
from tests.simulate.dialects import DIALECT_RESPONDERS, open_any
from tests.simulate.test_indi import ALSO, FAMILIES

EVENINGS, INDI_EVENINGS = 2000, 60
QUICK_CASES, QUICK_EVENINGS = 40, 2 * len(MOUNTS)
PATIENCE_S = 60.0
SUITES = {
    "conformance": "test_conformance",
    "killed or asleep": "test_killed",
    "real exchanges": "test_real_transcripts",
    "syncs and unknown motion": "test_night_syncs",
    "states of Alpaca": "test_alpaca_words",
    "states of INDI": "test_indi_words",  # EQMod beyond the pole among them
    "asked again after a silence": "test_asked_again",
    "cut between two programs": "test_last_seen",
    "seen to stand": "test_standing",
}
QUICK = "arrives or below_the_horizon or stop_ends or test_killed or test_real_transcripts or syncs or _words or asked_again or standing"


def detective(cases, only=ALL_ROWS):
    """How often the one thing that is wrong with a mount is named, by one to five sightings."""
    for fault in FAULTS:
        if not only(f"detective: {fault or 'healthy'}"):
            continue
        named = [cause for _, cause in verdicts(fault, cases)]
        wrong = sum(cause not in ("", fault) for cause in named)
        shares = {"right": named.count(fault) / cases, "wrong": wrong / cases}
        yield {"driver": fault or "healthy", "line": "detective", "runs": cases} | shares


def detective_by_tpoint(cases, only=ALL_ROWS):
    """The same by another maker of mounts, with what one sighting cannot tell, at 1.8 arcmin of noise."""
    for fault in tpoint_mounts.FAULTS:
        if not only(f"detective by TPOINT: {fault or 'healthy'}"):
            continue
        found = list(tpoint_mounts.verdicts(fault, cases))
        shares = {what: sum(getattr(one, what) for one in found) / cases for what in ("right", "wrong")}
        yield {"driver": fault or "healthy", "line": "detective by TPOINT", "runs": cases} | shares


def evenings(count, indi_count, only=ALL_ROWS):
    """Random evenings at every driver, and at INDI's own simulators where they are installed."""
    rows = {name: Counter() for name in MOUNTS if only(f"evenings: {name}")}
    for seed in range(count):
        plan = planned(seed)
        if plan.driver not in rows:
            continue
        _add(rows[plan.driver], play(plan))
    indi_count = indi_count if only.some("evenings: indi") else 0
    with ExitStack() as stack:
        if indi_count:
            stack.enter_context(indi_sequences.own_network())
        pool = stack.enter_context(ThreadPoolExecutor(indi_sequences.AT_ONCE))
        for evening in pool.map(indi_sequences.play, range(indi_count)):
            _add(rows.setdefault(f"indi: {indi_sequences.PROGRAMS[evening.device]}", Counter()), evening)
    for name, row in rows.items():
        yield {"driver": name, "line": "evenings", "runs": row["evenings"], "violations": row["violations"]}


def _add(row, evening):
    row["evenings"] += 1
    row["violations"] += len(evening.violations)


def stops(only=ALL_ROWS):
    """Stop and silence at the makes whose simulators are not shipped; Stop through both kinds of server."""
    programs = (*((program, far_end) for program, (_, far_end) in FAMILIES.items()), *ALSO)
    driven = {far_end: f"ours, also driven by INDI's {program}" for program, far_end in programs}
    for name in DIALECT_RESPONDERS:
        if only(f"stop: {name}"):
            yield mount_stops.row(name, driven.get(name, "ours"), open_any)
    for name, served in (("indi", indi), ("alpaca", alpaca)):
        if not only(f"stop: {name}"):
            continue
        with tempfile.TemporaryDirectory() as home, served(Path(home)) as bench:
            yield {"driver": name, "line": "stop", "simulator": "ours, at its server"} | _served(bench)


def _served(bench):
    """``byte_ms``: until a simulated telescope behind the server has stood, which it does at once."""
    with Guard(bench.open(), SITE, LIMITS, clock=bench.clock) as guard:
        slew = guard.slew(*place(-70.0, 10.0, bench.clock))
        while not bench.telescope.slewing:
            next(slew)
        begun = monotonic()
        guard.stop()
        while bench.telescope.slewing and monotonic() - begun < PATIENCE_S:
            sleep(0.0005)
        stood_s = monotonic() - begun
        with suppress(DeviceError):
            slew.close()
        guard.emergency.confirm()
        return {"byte_ms": 1000.0 * stood_s, "still_s": stood_s, "stands": not bench.telescope.slewing}


class Counted:
    """Counts what pytest reports, by suite and driver."""

    def __init__(self):
        self.rows = {}

    def pytest_runtest_logreport(self, report):
        """A test that is skipped, or has failed, or was called and passed."""
        if report.when != "call" and report.outcome == "passed":
            return
        file, _, name = report.nodeid.partition("::")
        words = name.partition("[")[2].rstrip("]").split("-")
        driver = next((word for word in words if word in (*MOUNTS, "indi", "alpaca")), "all")
        self.rows.setdefault((Path(file).stem, driver), Counter())[report.outcome] += 1


def suites(quick, only=ALL_ROWS):
    """The conformance suite on every driver, a nudge whose program is killed or asleep, real exchanges played back."""
    counted, here = Counted(), Path(__file__).parent
    files = [str(here / f"{name}.py") for line, name in SUITES.items() if only.some(f"{line}: ")]
    if not files:
        return
    options = ["-q", "-n", "0", "-p", "no:cacheprovider", f"--rootdir={REPOSITORY}"]
    with tempfile.TemporaryFile("w+") as said, redirect_stdout(said):
        pytest.main([*files, *options, *(["-k", QUICK] if quick else [])], plugins=[counted])
    for (file, driver), row in counted.rows.items():
        told = {name: row[name] for name in ("passed", "failed", "skipped")}
        line = next(line for line, name in SUITES.items() if name == file)
        yield {"driver": driver, "line": line, "runs": sum(row.values())} | told


def main() -> None:
    """Print a row as soon as it is measured."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", nargs="+", default=(), help="rows whose names, LINE: DRIVER, begin so")
    asked = parser.parse_args()
    quick, only = asked.quick, Only(tuple(asked.only))
    measured = (
        detective(QUICK_CASES if quick else CASES, only),
        detective_by_tpoint(QUICK_CASES if quick else CASES, only),
        stops(only),
        boards.rows(quick, only),
        evenings(QUICK_EVENINGS if quick else EVENINGS, 0 if quick else INDI_EVENINGS, only),
        suites(quick, only),
    )
    for rows in measured:
        for row in rows:
            if only(f"{row['line']}: {row['driver']}"):
                print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
