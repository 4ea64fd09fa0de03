"""``kochab bench papers``: the published tables, the papers' numbers beside ours.

Four papers, a module each. Every number is measured in the run itself, on fields and frames made
from the printed seed, and the default method sees the very same ones.
"""

import math
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from itertools import groupby
from operator import itemgetter
from typing import Any, Literal

from kochab.core.frame import Detections, Hint
from kochab.core.progress import run as drive
from kochab.core.solution import NoSolution, Solution
from kochab.core.values import frozen
from kochab.folders import data_folder
from kochab.identification import IDENTIFIERS
from kochab.lab.bench import BenchResult, Goal, Report, Row, as_cell, machine, timed
from kochab.sky import open_catalogue
from kochab.solver import UNKNOWN_YEAR, SolveOptions
from kochab.solver.few_stars import identify_few
from kochab.solver.pipeline import solve_detections, with_field

Better = Literal["less", "more", ""]
WITHIN, BETTER, WORSE = "within its error", "better", "not reproduced"
NO_FIGURE = "no figure"
EVEN = "equal within the error, paired"


class Published:
    """What a paper prints; :meth:`row` puts a number of ours beside one of its ``rows``.

    A row has what differs from ``EMPTY``: ``table`` is the paper's table or figure, ``paper`` its number,
    ``error`` how far ours may be from it to agree (the paper's statistical error, or half of its last digit),
    ``better`` "less", "more" or "" when neither is, and ``note`` which reading of the paper was tried, or the cause
    of a difference. :meth:`row` fills in ``{words}``.
    """

    EMPTY: Mapping[str, Any] = {
        **dict.fromkeys(("table", "what", "unit"), ""),
        **{"paper": None, "error": 0.0, "better": "", "note": ""},
    }

    def __init__(self, rows: Mapping[str, Mapping[str, Any]], **printed: Any) -> None:
        self.rows = rows
        self.printed = printed

    @classmethod
    def of(cls, paper: str) -> "Published":
        """That of ``resources/papers``; what else is printed there is in ``printed``."""
        return cls(**tomllib.loads((data_folder("resources") / "papers" / f"{paper}.toml").read_text("utf-8")))

    def row(
        self,
        key: str,
        ours: float | None,
        default: float | None = None,
        *,
        best: float | None = None,
        paired: tuple[float, float] | None = None,
        other_reading: bool = False,
        **given: Any,
    ) -> dict[str, Any]:
        """A row of the report.

        Parameters
        ----------
        key : str
            Its key among the paper's numbers.
        ours, default : float or None
            The number of the paper's method as implemented here; that of the default method (or
            detector, or estimator) on the very same fields or frames. None where there is none.
        best : float, optional
            The best number there can be; of a percentage, 0 or 100. Nothing can be ahead of it.
        paired : (float, float), optional
            Where both were measured on the same fields: the mean of ``default`` minus ``ours``, field
            by field, and the standard error of that mean. Within two of those they are equal.
        other_reading : bool
            The row shows what another reading of the paper would give; it counts towards no goal.
        given
            The words of the row's texts; ``unit``, ``paper``, ``error``, ``better`` and ``note``
            replace what the row has.

        """
        cells = {**self.EMPTY, **self.rows[key]}
        cells |= {name: text.format_map(given) for name, text in cells.items() if isinstance(text, str)}
        cells |= {name: given[name] for name in ("unit", "paper", "error", "better", "note") if name in given}
        better: Better = cells["better"]
        if best is None and cells["unit"] == "%" and better:
            best = 100.0 if better == "more" else 0.0
        default_wins = wins(ours, default, better, best)
        if paired is not None and default_wins in ("better", "worse"):
            cells["note"] = f"{cells['note']}; paired difference {paired[0]:+.2f} +- {paired[1]:.2f}".lstrip("; ")
            if abs(paired[0]) <= 2.0 * paired[1]:
                default_wins = EVEN
        reached = verdict(cells["paper"], ours, cells["error"], better)
        verdict_ = f"another reading: {reached}" if other_reading else reached
        return cells | {"ours": ours, "default": default, "verdict": verdict_, "default_wins": default_wins}


def verdict(paper: float | None, ours: float | None, error: float, better: Better) -> str:
    """Whether the paper's number was reproduced.

    Parameters
    ----------
    paper : float or None
        The paper's number; None: it has none.
    ours : float or None
        Ours; None: not measured.
    error : float
        How far they may differ.
    better : Better
        Which way is better, or "" where neither is.
    """
    if paper is None or ours is None or not math.isfinite(ours):
        return NO_FIGURE
    # A part in 1e9 more: a difference of exactly half the last digit agrees.
    if abs(ours - paper) <= error * (1.0 + 1e-9):
        return WITHIN
    gain = {"less": paper - ours, "more": ours - paper, "": 0.0}[better]
    return BETTER if gain > 0.0 else WORSE


def wins(ours: float | None, default: float | None, better: Better, best: float | None = None) -> str:
    """How the default compares: better, equal, both perfect, worse, or "" if moot.

    Parameters
    ----------
    ours : float or None
        The number of the paper's method; None: not measured.
    default : float or None
        That of the default method; None: not measured.
    better : Better
        Which way is better, or "" where neither is.
    best : float or None
        The best there can be; None: there is none.
    """
    if not better or ours is None or default is None:
        return ""
    if not (math.isfinite(ours) and math.isfinite(default)):
        return ""
    if math.isclose(ours, default, rel_tol=1e-9, abs_tol=1e-12):
        perfect = best is not None and math.isclose(ours, best, abs_tol=1e-12)
        return "both perfect" if perfect else "equal"
    return "better" if (default < ours) == (better == "less") else "worse"


def share_error(share: float, count: int, paper_count: int) -> float:
    """Two-sigma error, in per cent, of the difference of two shares (per cent) of samples."""
    p = min(max(share / 100.0, 0.01), 0.99)
    return 200.0 * math.sqrt(p * (1.0 - p) * (1.0 / count + 1.0 / paper_count))


def fastest(work: Callable[[], object], times: int = 5) -> float:
    """The least processor seconds of several runs: what others do to the machine is left out."""
    return min(timed(work)[1] for _ in range(times))


SEED = 20260101
PAPERS = {
    "Attitude from stellar images": "kochab.lab.bench.papers.stellar_images",
    "Spherical triangles": "kochab.lab.bench.papers.spherical_triangles",
    "Star constellations, 1992": "kochab.lab.bench.papers.constellations_1992",
    "Lost in space for robotic telescopes": "kochab.lab.bench.papers.robotic",
}
COLUMNS = {name: name for name in ("table", "what", "unit", "paper", "ours", "default")} | {
    "verdict": "against the paper",
    "default_wins": "default against ours",
    "note": "note",
}
"""Column heads of the Markdown table."""


@frozen
class PapersResult(BenchResult):
    """The rows of all papers; as text they are Markdown."""

    def as_text(self) -> str:
        """A Markdown table a paper, then the goals."""
        lines = ["# The published tables, side by side", ""]
        lines += [", ".join(f"{key} {value}" for key, value in self.machine.items()), ""]
        for paper, mine in groupby(self.rows, itemgetter("paper_name")):
            lines += [f"## {paper}", "", f"| {' | '.join(COLUMNS.values())} |", f"|{' --- |' * len(COLUMNS)}"]
            lines += [f"| {' | '.join(as_cell(row.get(key), 6) for key in COLUMNS)} |" for row in mine]
            lines.append("")
        lines += ["## Goals", ""]
        lines += [f"- {goal.mark}: {goal.name}: {as_cell(goal.value, 6)} (goal {goal.goal})" for goal in self.goals]
        return "\n".join(lines)


def run(quick: bool, report: Report) -> BenchResult:
    """All papers' rows, and how many of them were reached."""
    started = time.process_time()
    rows: list[Row] = []
    for name, module in PAPERS.items():
        report(f"{name}, seed {SEED} ...")
        rows += [{"paper_name": name, **row} for row in import_module(module).rows(quick, SEED)]
    spent = time.process_time() - started
    how = {"seed": SEED, "quick": quick, "processor_seconds": round(spent, 1)}
    return PapersResult("papers", rows, goals(rows, spent, quick), machine() | how)


def goals(rows: Sequence[Row], spent: float, quick: bool) -> list[Goal]:
    """Reproduced or better, and the default ahead, counted paper by paper."""
    made = []
    for paper, group in groupby(rows, itemgetter("paper_name")):
        mine = list(group)
        judged = [row["verdict"] for row in mine if row["verdict"] in (WITHIN, BETTER, WORSE)]
        compared = [row["default_wins"] for row in mine if row["default_wins"]]
        even, what = compared.count("equal") + compared.count(EVEN), f"{paper}: rows on which the default is"
        made += [
            Goal.at_most(f"{paper}: rows not reproduced, of {len(judged)}", judged.count(WORSE), 0),
            Goal.at_most(f"{what} worse, of {len(compared)}", compared.count("worse"), 0),
            Goal.at_most(f"{what} only equal, of {len(compared)}", even, 0),
        ]
    limit = 60.0 if quick else 1200.0
    return [*made, Goal.at_most("processor seconds for all", spent, limit)]


# -- The default method, as the published tables are compared with it --------------------------

KNOWN = 1e-4
"""The published methods know their camera; so does the default, to this share of its scale."""


def solve_timed(detections: Detections, options: SolveOptions) -> tuple[Solution | NoSolution, float]:
    """The answer, and the processor seconds of naming the stars.

    The published methods begin with directions and end with names, so that is what is compared. They are timed in a
    loop of nothing else, with all they need at hand, and the fit between two namings would turn that out; so the
    stars are named once before they are named against the clock, which takes as long as it does in such a loop.
    """
    name_stars(detections, options)
    _, seconds = timed(partial(name_stars, detections, options))
    return drive(solve_detections(detections, options)), seconds


def name_stars(detections: Detections, options: SolveOptions) -> None:
    """Name the stars as the solver does, and fail as it does."""
    hint = with_field(options, detections.width)
    found = drive(IDENTIFIERS.make(options.method).identify(detections, hint, UNKNOWN_YEAR))
    if isinstance(found, NoSolution):
        identify_few(detections, hint, open_catalogue(), UNKNOWN_YEAR)


def options_with_scale(scale_arcsec_px: float, share: float = KNOWN) -> SolveOptions:
    """The options of a solve through a camera whose scale is known to ``share`` of itself.

    The published methods have no other way when their camera is not what they believe; nor has the default here.
    """
    low, high = scale_arcsec_px / (1.0 + share), scale_arcsec_px * (1.0 + share)
    return SolveOptions(hint=Hint(scale_arcsec_px=(low, high)), blind_after_hint=False)
