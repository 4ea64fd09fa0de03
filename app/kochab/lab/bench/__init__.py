"""Benches: each measures one thing in this machine's own run and compares it with the goals."""

import json
import math
import os
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, field
from pkgutil import resolve_name
from typing import Any, TypeVar

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.errors import UsageError
from kochab.core.threads import processors
from kochab.core.values import frozen

T = TypeVar("T")
Row = Mapping[str, Any]
Report = Callable[[str], None]
"""Called with a line of progress."""


@frozen
class Goal:
    """A number an issue asks for, measured.

    ``goal`` reads like ``"<= 25"``, its unit is in ``name``; ``met`` is None when not measured.
    """

    name: str
    value: float | None
    goal: str
    met: bool | None

    @property
    def mark(self) -> str:
        """Whether it was met, in words."""
        return {True: "met", False: "NOT MET", None: "not measured"}[self.met]

    @classmethod
    def at_most(cls, name: str, value: float | None, limit: float) -> "Goal":
        """A goal met when ``value <= limit``."""
        return cls(name, value, f"<= {limit:g}", None if value is None or math.isnan(value) else value <= limit)

    @classmethod
    def between(cls, name: str, value: float, low: float, high: float) -> "Goal":
        """A goal met when ``low <= value <= high``.

        Parameters
        ----------
        name : str
            What is measured.
        value : float
            What was measured.
        low, high : float
            Least and largest that meet the goal.
        """
        return cls(name, value, f"{low:g} to {high:g}", low <= value <= high)

    @classmethod
    def at_least(cls, name: str, value: float | None, limit: float) -> "Goal":
        """A goal met when ``value >= limit``."""
        return cls(name, value, f">= {limit:g}", None if value is None or math.isnan(value) else value >= limit)


def children_s() -> float:
    """Processor time, s, of this process's children that have ended; NaN on Windows, which does not record it."""
    spent = os.times()
    return math.nan if os.name == "nt" else spent.children_user + spent.children_system


@frozen
class BenchResult:
    """``rows`` are measurements (plain numbers and words), ``goals`` compare some of them."""

    bench: str
    rows: Sequence[Row]
    goals: Sequence[Goal]
    machine: Mapping[str, Any] = field(default_factory=lambda: machine())

    def as_json(self) -> dict[str, Any]:
        """The stable JSON form; what is not a finite number becomes null."""
        return {
            "bench": self.bench,
            "machine": dict(self.machine),
            "rows": [{k: _plain(v) for k, v in row.items()} for row in self.rows],
            "goals": [{k: _plain(v) for k, v in asdict(goal).items()} for goal in self.goals],
        }

    def as_text(self) -> str:
        """A table of the rows and a list of the goals."""
        parts = [f"bench {self.bench}: {', '.join(f'{k} {v}' for k, v in self.machine.items())}"]
        parts += [table(self.rows)] if self.rows else []
        parts += [f"{g.mark:>12}  {g.name}: {as_cell(g.value)} (goal {g.goal})" for g in self.goals]
        return "\n".join(parts)


def machine() -> dict[str, Any]:
    """What the bench ran on, without naming the host."""
    return {
        "cpus": processors(),
        "cpu": platform.processor() or platform.machine(),
        "system": platform.system(),
        "python": ".".join(map(str, sys.version_info[:3])),
        "numpy": np.__version__,
    }


def table(rows: Sequence[Row]) -> str:
    """The rows as aligned text, one column a key in order of first appearance."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    cells = [keys, *([as_cell(row.get(key)) for key in keys] for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(keys))]
    return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in cells)


def as_cell(value: Any, digits: int = 4) -> str:
    """A value of a table as text, "-" for none."""
    value = _plain(value)
    if value is None:
        return "-"
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def reported(row: Row, report: Report) -> Row:
    """The row, told in JSON as soon as it is measured: a bench that is ended keeps what it had."""
    report(f"  {json.dumps({key: _plain(value) for key, value in row.items()})}")
    return row


def _plain(value: Any) -> Any:
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def column(rows: Sequence[Row], key: str) -> Floats:
    """What the rows (N) have under a key, (N,)."""
    return np.array([row[key] for row in rows], dtype=np.float64)


def summary(rows: Sequence[Row], **columns: tuple[str, Callable[[Floats], Any]]) -> dict[str, Any]:
    """What the rows have under some keys, each in one number: ``median_s=("s", np.median)``."""
    return {name: reduced(column(rows, key)) for name, (key, reduced) in columns.items()}


def timed(work: Callable[[], T], clock: Callable[[], float] = time.process_time) -> tuple[T, float]:
    """What ``work`` returns, and the seconds it took: the processor's, or another clock's."""
    started = clock()
    done = work()
    return done, clock() - started


@frozen
class Only:
    """Selects the rows whose names begin with one of ``names``; all rows when it is empty."""

    names: tuple[str, ...] = ()

    def __call__(self, row: str) -> bool:
        """Whether the row of this name is wanted."""
        return not self.names or any(row.startswith(name) for name in self.names)

    def some(self, rows: str) -> bool:
        """Whether any of the rows whose names begin like this is wanted."""
        return self(rows) or any(name.startswith(rows) for name in self.names)


ALL_ROWS = Only()
Bench = Callable[[bool, Report], BenchResult]
"""``run(quick, report)``: measures, a small part of it when ``quick``."""
RowBench = Callable[[bool, Report, Only], BenchResult]
"""``run(quick, report, only)``: the same of some rows only, with the goals that these tell."""

BENCHES: dict[str, str] = {
    "archive": "kochab.lab.bench.archive:run",
    "detect": "kochab.lab.bench.detect:run",
    "detectors": "kochab.lab.bench.detectors:run",
    "identify": "kochab.lab.bench.identify:run",
    "live": "kochab.lab.bench.live:run",
    "mount": "kochab.lab.bench.mount:run",
    "narrow": "kochab.lab.bench.narrow:run",
    "night": "kochab.lab.bench.night:run",
    "papers": "kochab.lab.bench.papers:run",
    "peers": "kochab.lab.bench.peers:run",
    "polar": "kochab.lab.bench.polar:run",
    "reach": "kochab.lab.bench.reach:run",
    "refusal": "kochab.lab.bench.refusal:run",
    "serve": "kochab.lab.bench.serve:run",
    "sky": "kochab.lab.bench.sky:run",
    "soak": "kochab.lab.bench.soak:run",
}


BY_ROWS: dict[str, str] = {name: BENCHES[name] for name in ("archive", "mount", "night", "polar", "reach", "serve")}
"""Those whose rows can be measured one by one: they take long, or need a machine that is idle."""


def load_bench(name: str) -> Bench:
    """The function ``run(quick, report) -> BenchResult`` of a bench by name."""
    if name not in BENCHES:
        raise UsageError(f"There is no bench called {name}; there are {', '.join(BENCHES)}.")
    found: Bench = resolve_name(BENCHES[name])
    return found


def measure_rows(name: str, quick: bool, report: Report, only: Only) -> BenchResult:
    """Some rows of a bench; UsageError where it has none of them.

    Parameters
    ----------
    name : str
        The bench, one of ``BY_ROWS``.
    quick : bool
        Whether a small part is enough.
    report : callable
        Called with a line of progress.
    only : Only
        The rows that are wanted.
    """
    if name not in BY_ROWS:
        raise UsageError(f"The rows of bench {name} can't be measured one by one; those of {', '.join(BY_ROWS)} can.")
    by_rows: RowBench = resolve_name(BY_ROWS[name])
    result = by_rows(quick, report, only)
    if not result.rows:
        raise UsageError(f"No row of bench {name} begins with {' or '.join(map(repr, only.names))}.")
    return result
