"""Deliberate bugs, and whether the tests notice.

One place of one module is changed at a time, in a copy, and the tests that execute it are run, quickest first, until one
fails: those that mirror the module, then the others of its room, then those of what imports it. A change that all of
them survive is printed: either a test is missing, or the change means nothing (`tests/mutants/equivalent.py` lists such,
with the reason). One is undecided where the tests take longer than there is time for. The choice is random with a seed,
so that a run can be repeated.
"""

import argparse
import math
import random
import sys
import tempfile
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from time import monotonic

from tests.house import sources
from tests.mutants.changes import Mutant, mutant, places
from tests.mutants.recorded import Copy, Recordings, path_of, tests_of, wanted_lines
from tests.patterns import choose_folder

ROOMS = tuple(sorted({f"kochab.{module.split('.')[1]}" for module in sources() if module.count(".") > 1}))
MOST_SURVIVING = 0.15
MOST_TESTS_S = 60.0  # of tests for one change: the quickest come first
UNRECORDED_S = 20.0  # of tests that may execute the line in another process
START_S = 60.0  # of the processor, and on a busy machine, until the first test runs
SLOWER = 4.0  # than when recorded: a change after which the tests take longer has been noticed
LIBRARIES = (
    *("astropy.wcs", "erfa", "PySide6.QtWidgets", "scipy.optimize", "scipy.spatial.transform", "scipy.special"),
    *("hypothesis.strategies", "pytestqt.plugin", "xdist.plugin"),  # plugins, which pytest would rewrite each time
)


@dataclass
class Asked:
    """What was asked about one change so far, and how much of the tests' time is left."""

    tests: int = 0
    left_s: float = MOST_TESTS_S
    complete: bool = True


def tests_for(bug: Mutant, recordings: Recordings, files: list[Path], first: bool, asked: Asked) -> dict[str, float]:
    """Those tests of some files that may notice a change, quickest first, with their time."""
    wanted, exact, other = wanted_lines(bug), {}, {}
    for path in files:
        if (known := recordings.of(path)) is None:
            asked.complete = False
            continue
        for test, seconds in known.durations_s.items():
            executed = known.lines[test]
            hit = any(executed.get(module, frozenset()) & lines for module, lines in wanted.items())
            (exact if hit else other)[test] = seconds
    # A line may be executed by a process that a test starts, which records nothing: that much is tried.
    unrecorded = other if first and not exact else {}
    chosen = {}
    for test, seconds in sorted((exact or unrecorded).items(), key=lambda one: one[1]):
        if asked.left_s - seconds < (0.0 if exact else MOST_TESTS_S - UNRECORDED_S) and asked.tests + len(chosen):
            asked.complete = asked.complete and not exact
            break
        asked.left_s -= seconds
        chosen[test] = seconds
    return chosen


def judge(bug: Mutant, copy: Copy, recordings: Recordings) -> tuple[str, int]:
    """``killed``, ``survived`` or ``undecided``, and how many tests were asked."""
    file = copy.app / path_of(bug.module)
    before, asked = file.read_text(encoding="utf-8"), Asked()
    for k, group in enumerate(tests_of(bug.module)):
        # What is recorded already answers at once; the others are recorded one by one, and only until one answers.
        known = [path for path in group if recordings.has(path)]
        for files in (known, *([path] for path in group if path not in known)):
            tests = tests_for(bug, recordings, files, k == 0, asked)
            if not tests:
                continue
            asked.tests += len(tests)
            limit_s = START_S + SLOWER * sum(tests.values())
            file.write_text(bug.text, encoding="utf-8")
            try:
                code = copy.pytest(list(tests), limit_s, 2.0 * limit_s, "-x")
            finally:
                file.write_text(before, encoding="utf-8")
            if code:
                return "killed", asked.tests
            asked.complete = asked.complete and code is not None
    return "survived" if asked.complete else "undecided", asked.tests


def interval(part: int, whole: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson 1927, J. Am. Stat. Assoc. 22, 209)."""
    z, n, p = 1.96, max(1, whole), part / max(1, whole)
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, middle - half), min(1.0, middle + half)


@dataclass(frozen=True)
class Tally:
    """What became of the changes of a room."""

    killed: int
    survived: int
    undecided: int

    @property
    def surviving(self) -> float:
        """The share of those decided."""
        return self.survived / max(1, self.killed + self.survived)

    def __str__(self) -> str:
        decided = self.killed + self.survived
        low, high = interval(self.survived, decided)
        share = f"{100 * self.surviving:.0f} % (95 %: {100 * low:.0f} to {100 * high:.0f} %)"
        return f"{decided} decided, {self.killed} killed, {self.survived} survived: {share}; {self.undecided} undecided"


def try_room(room: str, count: int, seed: int, end: float) -> Tally:
    """Judge changes of a room or module; each that is not killed is printed."""
    pool = [place for module in sources() if f"{module}.".startswith(f"{room}.") for place in places(module)]
    random.Random(seed).shuffle(pool)
    found = {"killed": 0, "survived": 0, "undecided": 0}
    with tempfile.TemporaryDirectory(prefix="kochab-mutants-") as folder:
        copy = Copy(Path(folder))
        recordings = Recordings(copy, Path(folder), end)
        for number, place in enumerate(pool[:count], start=1):
            if monotonic() > end:
                break
            bug = mutant(*place)
            fate, tests = judge(bug, copy, recordings)
            found[fate] += 1
            if fate != "killed":
                print(f"{number}: {fate.upper()} {bug.module}:{bug.line}: {bug.change} ({tests} tests)", flush=True)
    tally = Tally(**found)
    print(f"{room} ({len(pool)} places): {tally}", flush=True)
    return tally


def main() -> int:
    """Try mutants until their number or the time is used up; 1 when too many survive in a room."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("rooms", nargs="*", help="rooms or modules, as kochab.sky; the default is every room")
    parser.add_argument("--count", type=int, default=25, help="changes of each room to try (25)")
    parser.add_argument("--minutes", type=float, default=90.0, help="stop after this time, shared by the rooms (90)")
    parser.add_argument("--seed", type=int, default=1)
    wanted = parser.parse_args()
    choose_folder()
    for library in LIBRARIES:
        import_module(library)
    rooms, start = wanted.rooms or ROOMS, monotonic()
    shares_s = [60.0 * wanted.minutes * k / len(rooms) for k in range(1, len(rooms) + 1)]
    tallies = [try_room(room, wanted.count, wanted.seed, start + s) for room, s in zip(rooms, shares_s, strict=True)]
    failed = [room for room, tally in zip(rooms, tallies, strict=True) if tally.surviving > MOST_SURVIVING]
    print(f"More than {100 * MOST_SURVIVING:.0f} % survive in: {', '.join(failed) or 'no room'}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
