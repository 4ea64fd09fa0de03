"""The Laboratory's table: a row for each method, detector or estimator."""

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableWidget, QTableWidgetItem

from kochab.core.angle_text import AngleStyle, angle_text, arcsec_text, false_alarm_text, milliseconds_text, radec_text
from kochab.lab.laboratory.comparison import ComparedPart, Trial

LAST = float("inf")
NOTHING = "–"


@dataclass(frozen=True, slots=True)
class CellText:
    """A cell: its text, what it sorts by if not that, and its tooltip."""

    text: str
    rank: float | None = None
    tip: str = ""


def columns_of(kind: ComparedPart) -> dict[str, Callable[[Trial], CellText]]:
    """The columns of a table of this kind, by title."""
    more: dict[str, Callable[[Trial], CellText]] = {}
    if kind is ComparedPart.DETECTOR:
        more = {"Found": lambda t: _count(None if t.found is None else t.found.stars), "True": _true}
    elif kind is ComparedPart.ATTITUDE:
        more = {"From the fit": _from_fit}
    more |= {"Matches": _matches, "Wrong": lambda t: _count(t.wrong)}
    if kind is not ComparedPart.METHOD:
        more["RMS"] = _rms
    return {
        kind.capitalize(): lambda t: CellText(t.name),
        "Answer": _answer,
        **more,
        "Time": _time,
        "Sigma": _sigma,
        "Reason": lambda t: CellText(t.reason, None, t.advice),
        "Paper": lambda t: CellText(t.paper),
    }


def answer(t: Trial) -> str:
    """Right, wrong or none; the pointing where the truth is not known."""
    if not t.answered or t.ra_dec_deg is None:
        return "none"
    if t.right is None:
        return radec_text(*t.ra_dec_deg, AngleStyle.SEXAGESIMAL)
    off = angle_text((t.off_arcsec or 0.0) / 3600.0)
    return f"right, {off} off" if t.right else f"WRONG, {off} off"


def _answer(t: Trial) -> CellText:
    # Right answers first, then those without a known truth, then wrong ones, then none.
    rank = {True: 0.0, None: 1.0, False: 2.0}[t.right] if t.answered else 3.0
    if t.ra_dec_deg is None:
        return CellText(answer(t), rank, t.advice)
    odds = false_alarm_text(t.log10_false_alarm if t.log10_false_alarm is not None else LAST)
    where = radec_text(*t.ra_dec_deg, AngleStyle.SEXAGESIMAL)
    return CellText(answer(t), rank, f"{where}\nchance match: {odds}")


def _matches(t: Trial) -> CellText:
    return CellText(f"{t.matches}" if t.answered else NOTHING, float(t.matches))


def _count(count: int | None) -> CellText:
    return CellText(NOTHING, LAST) if count is None else CellText(f"{count}", count)


def _true(t: Trial) -> CellText:
    found = t.found
    if found is None or found.true is None:
        return CellText(NOTHING, LAST, "Known for simulated fields only")
    place = "" if found.error_px is None else f", positions {found.error_px:.2f} px off"
    tip = f"{found.true} of {found.there} stars found{place}"
    return CellText(f"{found.true} of {found.there}", -found.true, tip)


def _rms(t: Trial) -> CellText:
    if t.rms_px is None:
        return CellText(NOTHING, LAST)
    return CellText(f"{t.rms_px:.2f} px", t.rms_px, "Residual of the matched stars")


def _from_fit(t: Trial) -> CellText:
    if t.from_fit_arcsec is None:
        return CellText(NOTHING, 0.0 if t.answered else LAST)
    away, roll = t.from_fit_arcsec
    tip = f"{arcsec_text(away)} on the sky, {arcsec_text(roll)} in roll"
    return CellText(arcsec_text(away), away, f"Difference from the fit: {tip}")


def _time(t: Trial) -> CellText:
    spent = duration_text(t.seconds)
    tables = duration_text(t.tables_s)
    first = f"; building its tables took {tables}, once" if t.tables_s > 0 else ""
    return CellText(spent, t.seconds, f"{spent} processor time{first}")


def _sigma(t: Trial) -> CellText:
    if t.sigma_arcsec is None:
        return CellText(NOTHING, LAST, "Too few matches" if t.answered else "")
    x, y, roll = (arcsec_text(value) for value in t.sigma_arcsec)
    most = max(t.sigma_arcsec[:2])
    return CellText(arcsec_text(most), most, f"From the matches’ residuals: {x} × {y}, roll {roll}")


def duration_text(seconds: float) -> str:
    """A processor time, in microseconds below 1 ms."""
    return f"{1e6 * seconds:.0f} µs" if 0 < seconds < 1e-3 else milliseconds_text(1e3 * seconds)


class _Cell(QTableWidgetItem):
    """A cell that sorts by a number where it has one."""

    def __init__(self, cell: CellText) -> None:
        super().__init__(cell.text)
        self.rank = cell.rank
        self.setToolTip(cell.tip or cell.text)
        self.setFlags(Qt.ItemFlag.ItemIsSelectable | Qt.ItemFlag.ItemIsEnabled)

    def __lt__(self, other: QTableWidgetItem) -> bool:
        if isinstance(other, _Cell) and self.rank is not None and other.rank is not None:
            return self.rank < other.rank
        return self.text() < other.text()


class TrialTable(QTableWidget):
    """Shows :class:`kochab.lab.laboratory.comparison.Trial` as they come."""

    def __init__(self) -> None:
        super().__init__()
        self.trials: list[Trial] = []
        self.verticalHeader().hide()
        self.setAlternatingRowColors(True)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setTabKeyNavigation(False)
        self.setWordWrap(False)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        self.horizontalHeader().setStretchLastSection(True)
        self.begin(ComparedPart.METHOD)

    def begin(self, kind: ComparedPart) -> None:
        self.trials = []
        self._columns = columns_of(kind)
        self.setSortingEnabled(False)
        self.setRowCount(0)
        self.setColumnCount(len(self._columns))
        self.setHorizontalHeaderLabels(list(self._columns))
        self.horizontalHeader().setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        self.setAccessibleName(f"Results of every {kind}")

    def add(self, trial: Trial) -> None:
        self.trials.append(trial)
        self.setSortingEnabled(False)
        row = self.rowCount()
        self.insertRow(row)
        for column, say in enumerate(self._columns.values()):
            self.setItem(row, column, _Cell(say(trial)))
        self.setSortingEnabled(True)  # by no column until one is clicked
        self.resizeColumnsToContents()
