"""``kochab bench papers``: the published tables, the papers' numbers beside ours.

Four papers, a module each. Every number is measured in the run itself, on fields and frames made
from the printed seed, and the default method sees the very same ones.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from app.bench.papers_row import BETTER, EVEN, WITHIN, WORSE
from app.bench.report import BenchResult, Goal, machine

SEED = 20260101
PAPERS = {
    "Attitude from stellar images": "app.bench.papers_stellar_images",
    "Spherical triangles": "app.bench.papers_spherical_triangles",
    "Star constellations, 1992": "app.bench.papers_1992",
    "Lost in space for robotic telescopes": "app.bench.papers_robotic",
}
COLUMNS = ("table", "what", "unit", "paper", "ours", "default", "verdict", "default_wins", "note")
HEADS = ("table", "what", "unit", "paper", "ours", "default", "against the paper",
         "default against ours", "note")  # fmt: skip


@dataclass(frozen=True, slots=True)
class PapersResult(BenchResult):
    """The rows of all papers; as text they are Markdown."""

    def as_text(self) -> str:
        """A Markdown table a paper, then the goals."""
        lines = ["# The published tables, side by side", ""]
        lines += [", ".join(f"{key} {value}" for key, value in self.machine.items()), ""]
        for paper in dict.fromkeys(str(row["paper_name"]) for row in self.rows):
            mine = [row for row in self.rows if row["paper_name"] == paper]
            lines += [f"## {paper}", "", *_markdown(mine), ""]
        lines += ["## Goals", ""]
        for goal in self.goals:
            mark = {True: "met", False: "NOT MET", None: "not measured"}[goal.met]
            lines.append(f"- {mark}: {goal.name}: {_cell(goal.value)} (goal {goal.goal})")
        return "\n".join(lines)


def run(quick: bool, report: Callable[[str], None]) -> BenchResult:
    """All papers' rows, and how many of them were reached."""
    started = time.process_time()
    rows: list[dict[str, Any]] = []
    for name, module in PAPERS.items():
        if find_spec(module) is None:
            report(f"{name}: not there yet")
            continue
        report(f"{name}, seed {SEED} ...")
        rows += [_named(name, row) for row in import_module(module).rows(quick, SEED)]
    spent = time.process_time() - started
    how = {"seed": SEED, "quick": quick, "processor_seconds": round(spent, 1)}
    return PapersResult("papers", rows, goals(rows, spent, quick), machine() | how)


def _named(name: str, row: Mapping[str, Any]) -> dict[str, Any]:
    return {"paper_name": name, **row}


def goals(rows: Sequence[Mapping[str, Any]], spent: float, quick: bool) -> list[Goal]:
    """Reproduced or better, and the default ahead, counted paper by paper."""
    made = []
    for paper in dict.fromkeys(str(row["paper_name"]) for row in rows):
        mine = [row for row in rows if row["paper_name"] == paper]
        judged = [row for row in mine if row.get("verdict") in (WITHIN, BETTER, WORSE)]
        lost = [row for row in judged if row["verdict"] == WORSE]
        made.append(Goal.at_most(f"{paper}: rows not reproduced, of {len(judged)}", len(lost), 0))
        compared = [row for row in mine if row.get("default_wins")]
        behind = [row for row in compared if row["default_wins"] == "worse"]
        even = [row for row in compared if row["default_wins"] in ("equal", EVEN)]
        what = f"{paper}: rows on which the default is"
        made.append(Goal.at_most(f"{what} worse, of {len(compared)}", len(behind), 0))
        made.append(Goal.at_most(f"{what} only equal, of {len(compared)}", len(even), 0))
    limit = 60.0 if quick else 1200.0
    return [*made, Goal.at_most("processor seconds for all", spent, limit)]


def _markdown(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """A table in Markdown."""
    head = [f"| {' | '.join(HEADS)} |", f"|{' --- |' * len(HEADS)}"]
    return head + [f"| {' | '.join(_cell(row.get(key)) for key in COLUMNS)} |" for row in rows]


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool | str):
        return str(value)
    return f"{float(value):.6g}"
