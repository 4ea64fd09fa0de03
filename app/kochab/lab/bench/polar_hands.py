"""People at the bolts, from hands that do as they are told to hands that do not: where the tutor leads them.

The hands, their bolts and the mount they turn are :mod:`tests.nights.hands`, which shares nothing with
``kochab.polar``. A row a kind: how far from the pole they end in 30 instructions, how many end farther than they began,
and how often clock or time zone was blamed.
"""

from typing import Any

from kochab.lab.bench import ALL_ROWS, Goal, Only, Report
from kochab.lab.bench.checkout import rows_of

MODULE = "tests.nights.hands"
FULL, QUICK = 80, 3  # of each kind
SEED = 91  # no hand of which anything was tuned on
WRONG_CLOCK, TOO_FAR = "hands: clock 6 h wrong", "hands: overshoots 5 arcmin"


def hands_rows(quick: bool, report: Report, only: Only = ALL_ROWS) -> tuple[list[dict[str, Any]], list[Goal]]:
    """A row a kind of hand, and what is asked of all."""
    if not only.some("hands: "):
        return [], []
    count = QUICK if quick else FULL
    report(f"{count} hands of each kind at the bolts ...")
    found = rows_of(
        MODULE,
        ["--json", "--count", str(count), "--seed", str(SEED), *(["--only", *only.names] if only.names else [])],
        report,
    )
    rows = [{"kind": f"hands: {found}"}] if isinstance(found, str) else found
    return rows, hands_goals(rows)


def hands_goals(rows: list[dict[str, Any]]) -> list[Goal]:
    """Over all kinds; None where they were not measured."""
    measured = [row for row in rows if "runs" in row]
    sound = [row for row in measured if row["kind"] != WRONG_CLOCK]
    too_far = [row["below_60"] / row["runs"] for row in measured if row["kind"] == TOO_FAR]
    worse, accused, blind = (
        float(combined) if measured else None
        for combined in (
            sum(row["worse"] for row in measured),
            sum(row["accused"] for row in sound),
            max((row["blind_turns"] for row in measured), default=0.0),
        )
    )
    return [
        Goal.at_most("hands that end farther from the pole than they began", worse, 0.0),
        Goal.at_least("share of hands 5 arcmin too far that end below 60 arcsec", next(iter(too_far), None), 1.0),
        Goal.at_most("hands with a sound clock whose clock was blamed", accused, 0.0),
        Goal.at_most("most turns asked of a bolt that nobody had turned", blind, 0.25),
    ]
