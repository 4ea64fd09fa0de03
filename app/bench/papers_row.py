"""One row of the published tables: what the paper has, what its method gives here, and ours.

A module of one paper, ``papers_*.py``, has ``rows(quick, seed) -> list[dict]`` whose dicts come
from :func:`row`.
"""

import math
import time
from collections.abc import Callable
from typing import Any, Literal, TypeVar

T = TypeVar("T")
Better = Literal["less", "more", ""]
WITHIN, BETTER, WORSE = "within its error", "better", "not reproduced"
NO_FIGURE = "no figure"
EVEN = "equal within the error, paired"


def row(
    table: str, what: str, *, paper: float | None, ours: float | None,
    default: float | None = None, unit: str = "", error: float = 0.0, better: Better = "",
    note: str = "", best: float | None = None, paired: tuple[float, float] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """A row of the report.

    Parameters
    ----------
    table, what : str
        The paper's table or figure, and what is measured.
    paper, ours, default : float or None
        Its number; that of its method as implemented here; that of the default method (or
        detector, or estimator) on the very same fields or frames. None where there is none.
    unit : str
    error : float
        How far ``ours`` may be from ``paper`` to agree: the paper's statistical error, or half of
        its last digit.
    better : {"less", "more", ""}
        Which way is better, "" when neither is.
    best : float, optional
        The best number there can be; of a percentage, 0 or 100. Nothing can be ahead of it.
    paired : (float, float), optional
        Where both were measured on the same fields: the mean of ``default`` minus ``ours``, field
        by field, and the standard error of that mean. Within two of those they are equal.
    note : str
        Which reading was tried, or the cause of a difference.

    """
    default_wins = wins(ours, default, better, _best(best, unit, better))
    if paired is not None and default_wins in ("better", "worse"):
        note = f"{note}; paired difference {paired[0]:+.2f} +- {paired[1]:.2f}".lstrip("; ")
        if abs(paired[0]) <= 2.0 * paired[1]:
            default_wins = EVEN
    return {
        "table": table, "what": what, "unit": unit, "paper": paper, "ours": ours,
        "default": default, "verdict": verdict(paper, ours, error, better), "error": error,
        "better": better, "default_wins": default_wins, "note": note,
    }  # fmt: skip


def verdict(paper: float | None, ours: float | None, error: float, better: Better) -> str:
    """Whether the paper's number was reproduced."""
    if paper is None or ours is None or not math.isfinite(ours):
        return NO_FIGURE
    if abs(ours - paper) <= error * (1.0 + 1e-9):
        return WITHIN
    gain = {"less": paper - ours, "more": ours - paper, "": 0.0}[better]
    return BETTER if gain > 0.0 else WORSE


def _best(best: float | None, unit: str, better: Better) -> float | None:
    if best is None and unit == "%" and better:
        return 100.0 if better == "more" else 0.0
    return best


def wins(
    ours: float | None, default: float | None, better: Better, best: float | None = None
) -> str:
    """How the default compares: better, equal, both perfect, worse, or "" if moot."""
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


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """What ``work`` returns, and the processor seconds it took."""
    started = time.process_time()
    done = work()
    return done, time.process_time() - started
