"""Deliberate bugs, and whether the tests notice.

One place of one module is changed at a time, in a copy, and the tests that execute it are run, quickest first, until one
fails: those that mirror the module, then the others of its room, then those of what imports it. They run in a process
that is forked from this one, which has imported every library but none of the program; all limits are of the processor's
time, so that a busy machine judges as an idle one does. A change that all tests survive is printed: either a test is
missing, or the change means nothing (`tests/mutants/equivalent.py` lists such, with the reason). One is undecided where
the tests take longer than there is time for. The choice is random with a seed, so that a run can be repeated.
"""

import argparse
import math
import random
import sys
import tempfile
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from itertools import accumulate
from multiprocessing import get_context
from pathlib import Path
from time import monotonic

from tests.house import sources
from tests.mutants.changes import Mutant, mutant, places
from tests.mutants.recorded import (
    Copy,
    Recorded,
    Recordings,
    children_s,
    inside_functions,
    test_texts,
    tests_of,
    wanted_lines,
)
from tests.patterns import choose_folder

ROOMS = tuple(sorted({f"kochab.{module.split('.')[1]}" for module in sources() if module.count(".") > 1}))
MOST_SURVIVING = 0.15
MOST_TESTS_S = 25.0  # of the processor, for one change: the quickest tests come first
UNRECORDED_S = 15.0  # of tests that may execute the line in another process
START_S = 10.0  # of the processor, until the first test runs
SLOWER = 4.0  # than when recorded: a change after which the tests take longer has been noticed
WAIT_S = 300.0  # on the clock, for a change after which they wait for ever
LIBRARIES = (
    *("astropy.wcs", "erfa", "PySide6.QtWidgets", "scipy.optimize", "scipy.spatial.transform", "scipy.special"),
    *("hypothesis.strategies", "pytestqt.plugin", "xdist.plugin"),  # plugins, which pytest would rewrite each time
)


def judge(bug: Mutant, copy: Copy, recordings: Recordings) -> tuple[str, int]:
    """``killed``, ``survived`` or ``undecided``, and how many tests were asked."""
    groups = tests_of(bug.module)
    files = [path for group in groups for path in group]
    # What is recorded answers at once, wherever it stands; the others are recorded one by one until one answers.
    known = [path for path in test_texts() if recordings.has(path, bug.module)]
    left_s, asked, complete = MOST_TESTS_S, 0, True
    for some in (known, *([path] for path in files if path not in known)):
        recorded = {path: recordings.of(path, bug.module) for path in some}
        complete = complete and None not in recorded.values()
        tests = quickest(executing(wanted_lines(bug), recorded.values()), left_s)
        code, used = ask(bug, copy, tests)
        if code:
            return "killed", asked + len(tests)
        left_s, asked, complete = left_s - used, asked + len(tests), complete and code is not None
    if not asked:  # the line may be executed by a process that a test starts, which records nothing
        recorded = {path: recordings.of(path, bug.module) for path in groups[0]}
        tests = quickest(
            {test: one for found in recorded.values() for test, one in (found or {}).items()}, UNRECORDED_S
        )
        if ask(bug, copy, tests)[0]:
            return "killed", len(tests)
    return "survived" if complete and left_s > 0.0 else "undecided", asked


def executing(wanted: dict[str, frozenset[int]], found: Iterable[dict[str, Recorded] | None]) -> dict[str, Recorded]:
    """Those tests that execute one of some lines."""
    return {
        test: one
        for tests in found
        for test, one in (tests or {}).items()
        if any(one.lines.get(module, frozenset()) & lines for module, lines in wanted.items())
    }


def quickest(tests: dict[str, Recorded], most_s: float) -> dict[str, float]:
    """As many as the processor does in a time, in the order of their time on the clock."""
    ordered = sorted(tests, key=lambda test: tests[test].duration_s)
    ends = accumulate(tests[test].processor_s for test in ordered)
    return {test: tests[test].processor_s for test, end in zip(ordered, ends, strict=True) if end < most_s}


def ask(bug: Mutant, copy: Copy, tests: dict[str, float]) -> tuple[int | None, float]:
    """What pytest returns of some tests after a change, None when they did not end; and the processor's time."""
    if not tests:
        return 0, 0.0
    with copy.changed(bug.module, bug.text):
        ended = copy.pytest(list(tests), START_S + SLOWER * sum(tests.values()), WAIT_S, "-x")
    return ended.code, ended.processor_s


def interval(part: int, whole: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson 1927, J. Am. Stat. Assoc. 22, 209)."""
    z, n, p = 1.96, max(1, whole), part / max(1, whole)
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, middle - half), min(1.0, middle + half)


@dataclass(frozen=True)
class Tally:
    """What became of the changes of a room, and the processor's time it took."""

    room: str
    killed: int
    survived: int
    undecided: int
    equivalent: int
    recorded_s: float
    judged_s: float

    @property
    def surviving(self) -> float:
        """The share of those decided."""
        return self.survived / max(1, self.killed + self.survived)

    def __str__(self) -> str:
        decided = self.killed + self.survived
        low, high = interval(self.survived, decided)
        tried = decided + self.undecided + self.equivalent
        return (
            f"{self.room:22}{tried:6}{self.killed:8}{self.survived:10}{self.equivalent:12}{self.undecided:11}"
            f"{100 * self.surviving:8.0f} % ({100 * low:.0f} to {100 * high:.0f})"
            f"{self.judged_s / max(1, tried):10.1f} s +{self.recorded_s:.0f} s"
        )


HEADER = (
    "room                   tried  killed  survived  equivalent  undecided  survive (95 %)   processor each, recording"
)


def try_room(room: str, count: int, seed: int, end: float) -> Tally:
    """Judge changes of a room or module; each that is not killed is printed."""
    pool = [place for module in sources() if f"{module}.".startswith(f"{room}.") for place in places(module)]
    random.Random(seed).shuffle(pool)
    found = {"killed": 0, "survived": 0, "undecided": 0, "equivalent": 0}
    with tempfile.TemporaryDirectory(prefix="kochab-mutants-") as folder:
        copy, start_s = Copy(Path(folder)), children_s()
        recordings = Recordings(copy, Path(folder), end)
        for number, place in enumerate(pool[:count], start=1):
            if monotonic() > end:
                break
            bug = mutant(*place)
            fate, tests = ("equivalent", 0) if bug.equivalent else judge(bug, copy, recordings)
            found[fate] += 1
            if fate not in ("killed", "equivalent"):
                print(f"{number}: {fate.upper()} {bug.module}:{bug.line}: {bug.change} ({tests} tests)", flush=True)
        judged_s = children_s() - start_s - recordings.processor_s
    return Tally(room, **found, recorded_s=recordings.processor_s, judged_s=judged_s)


def main() -> int:
    """Try mutants until their number or the time is used up; 1 when too many survive in a room."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("rooms", nargs="*", help="rooms or modules, as kochab.sky; the default is every room")
    parser.add_argument("--count", type=int, default=25, help="changes of each room to try (25)")
    parser.add_argument("--minutes", type=float, default=90.0, help="stop after this time, shared by the rooms (90)")
    parser.add_argument("--processes", type=int, default=2, help="rooms that are tried at once (2)")
    parser.add_argument("--seed", type=int, default=1)
    wanted = parser.parse_args()
    choose_folder()
    for library in LIBRARIES:
        import_module(library)
    for module in sources():
        inside_functions(module)  # as the libraries: before any process is forked
    rooms, begun = wanted.rooms or ROOMS, monotonic()
    length_s = 60.0 * wanted.minutes / math.ceil(len(rooms) / wanted.processes)
    with ProcessPoolExecutor(wanted.processes, get_context("fork")) as pool:
        ends = [begun + length_s * (k // wanted.processes + 1) for k in range(len(rooms))]
        given = (rooms, *([one] * len(rooms) for one in (wanted.count, wanted.seed)), ends)
        tallies = []
        for tally in pool.map(try_room, *given):
            tallies.append(tally)
            print(tally, flush=True)
    print(HEADER, *tallies, sep="\n")
    failed = [tally.room for tally in tallies if tally.surviving > MOST_SURVIVING]
    print(f"More than {100 * MOST_SURVIVING:.0f} % survive in: {', '.join(failed) or 'no room'}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
