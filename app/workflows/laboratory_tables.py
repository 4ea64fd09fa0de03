"""What the Laboratory found, as CSV for a spreadsheet."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import astuple

from app.workflows.laboratory import Trial
from app.workflows.laboratory_curves import SWEEPS, Point

TRIALS = (
    "compared", "name", "answered", "right", "ra_deg", "dec_deg", "off_arcsec",
    "stars_found", "stars_true", "stars_there", "place_error_px", "matches", "wrong",
    "from_fit_arcsec", "from_fit_roll_arcsec", "time_ms", "tables_ms", "rms_px",
    "sigma_x_arcsec", "sigma_y_arcsec", "sigma_roll_arcsec",
    "log10_false_alarm", "reason", "tried", "paper",
)  # fmt: skip
POINTS = (
    "varied", "unit", "value", "name", "fields", "right", "wrong", "success", "found",
    "off_arcsec", "median_ms",
)  # fmt: skip


def trials_csv(trials: Iterable[Trial]) -> str:
    """A line for each; what is not known is empty."""
    return _csv(TRIALS, (_trial(t) for t in trials))


def points_csv(points: Iterable[Point]) -> str:
    """A line for each point of each curve, in the order of the curves."""
    order = list(SWEEPS)
    sorted_points = sorted(points, key=lambda p: (order.index(p.sweep), p.name, p.value))
    return _csv(POINTS, (_point(p) for p in sorted_points))


def _trial(t: Trial) -> Sequence[object]:
    ra, dec = (f"{angle:.7f}" for angle in t.ra_dec_deg) if t.ra_dec_deg else ("", "")
    sigma = t.sigma_arcsec or ("", "", "")
    found = astuple(t.found) if t.found else ("", "", "", "")
    return (
        t.kind, t.name, t.answered, t.right, ra, dec, t.off_arcsec, *found, t.matches, t.wrong,
        *(t.from_fit_arcsec or ("", "")), 1e3 * t.seconds, 1e3 * t.tables_s, t.rms_px, *sigma,
        t.log10_false_alarm, t.reason, t.advice, t.paper,
    )  # fmt: skip


def _point(p: Point) -> Sequence[object]:
    unit = SWEEPS[p.sweep].unit
    return (
        p.sweep, unit, p.value, p.name, p.fields, p.right, p.wrong, p.success,
        p.found, p.off_arcsec, 1e3 * p.median_s,
    )  # fmt: skip


def _csv(names: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return out.getvalue()


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else value
