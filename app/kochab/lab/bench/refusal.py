"""``kochab bench refusal``: how long the slowest "no solution" takes, from memory and from the disk.

Lists of 5 to 300 random points, solved blind. Before each the patterns' files are taken out of the
system's page cache, so that the first search reads them from the disk and the second from memory. Pages that
another program has mapped stay. The clock's seconds are held against the goal on an idle machine only: on a
busy one they tell of the others.
"""

import os
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from kochab.core.progress import run as drive
from kochab.core.solution import Identification
from kochab.identification.index import SHIPPED, Volume, open_volume, shipped_volume_folder
from kochab.identification.index_build import make_fine
from kochab.identification.patterns import Patterns
from kochab.lab.bench import BenchResult, Goal, Report, summary, timed
from kochab.simulate.random_fields import random_points

SEED = 20261122
LISTS, QUICK_LISTS = 500, 25
POINTS = (5, 300)
LIMIT_S = 0.5
BUSY = 1.5  # processes that run or wait for the disk, this one among them


def run(quick: bool, report: Report) -> BenchResult:
    """Refuse random lists; print the slowest by the clock and by the processor."""
    free = idle()
    made = drive(make_fine(), lambda p: report(f"patterns for small fields: {p.detail}"))
    # the installation's volumes, in the order a search knows them
    folders = [*(shipped_volume_folder() / name for name in SHIPPED), made.folder]
    rng, lists = np.random.default_rng(SEED), QUICK_LISTS if quick else LISTS
    drive(Patterns(opened(folders)).identify(random_points(rng, 60)))  # what is imported for it
    rows: dict[str, list[dict[str, float]]] = {"from the disk": [], "from memory": []}
    for number in range(lists):
        points = random_points(rng, int(rng.integers(POINTS[0], POINTS[1] + 1)))
        forget(folders)
        volumes = opened(folders)
        for kept in rows.values():
            started = time.process_time()
            answer, wall_s = timed(partial(drive, Patterns(volumes).identify(points)), time.perf_counter)
            wrong = isinstance(answer, Identification)
            kept.append({"wall_s": wall_s, "cpu_s": time.process_time() - started, "wrong": wrong})
        # Unmapped before the next forget(): pages that are mapped stay in the cache.
        del volumes
        if number % 100 == 99:
            report(f"{number + 1} lists ...")
    table = [row(name, kept) for name, kept in rows.items()]
    return BenchResult("refusal", table, goals(table, free and idle()))


def idle() -> bool:
    """Whether hardly anything but this bench has run in the last minute, as far as the system tells."""
    return not hasattr(os, "getloadavg") or os.getloadavg()[0] < BUSY


def row(name: str, kept: Sequence[dict[str, float]]) -> dict[str, Any]:
    """One line of the table: all lists read one way."""
    wall = summary(kept, median_s=("wall_s", np.median), slowest_s=("wall_s", np.max))
    cpu = summary(kept, median_cpu_s=("cpu_s", np.median), slowest_cpu_s=("cpu_s", np.max))
    return {"patterns": name} | summary(kept, n=("wrong", len), wrong=("wrong", np.sum)) | wall | cpu


def goals(rows: Sequence[dict[str, Any]], free: bool) -> list[Goal]:
    """What the issue asks for; the clock's seconds are not measured unless the machine was ``free``."""
    asked = [Goal.at_most("random lists accepted", max(r["wrong"] for r in rows), 0)]
    for r in rows:
        wall_s = r["slowest_s"] if free else None
        asked.append(Goal.at_most(f"slowest refusal {r['patterns']}, s, idle machine", wall_s, LIMIT_S))
        asked.append(Goal.at_most(f"slowest refusal {r['patterns']}, processor s", r["slowest_cpu_s"], LIMIT_S))
    return asked


def opened(folders: Sequence[Path]) -> tuple[Volume, ...]:
    """The volumes in ``folders``, opened anew."""
    return tuple(open_volume(folder) for folder in folders)


def forget(folders: Sequence[Path]) -> None:
    """Take the patterns' files out of the page cache, where the system lets one ask for that."""
    if not hasattr(os, "posix_fadvise"):
        return
    for folder in folders:
        for path in folder.glob("*.npy"):
            with path.open("rb") as file:
                os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
