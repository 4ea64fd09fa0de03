"""The Laboratory's table: a line for each method."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableWidget, QTableWidgetItem

from app.ui.formats import (
    AngleStyle,
    angle_text,
    arcsec_text,
    false_alarm_text,
    milliseconds_text,
    radec_text,
)
from app.workflows.laboratory import Trial

COLUMNS = ("Method", "Answer", "Matches", "Wrong", "Time", "Sigma", "Reason", "Paper")
LAST = float("inf")


class _Cell(QTableWidgetItem):
    """A cell that sorts by a number where it has one."""

    def __init__(self, text: str, rank: float | None = None, tip: str = "") -> None:
        super().__init__(text)
        self.rank = rank
        self.setToolTip(tip or text)
        self.setFlags(Qt.ItemFlag.ItemIsSelectable | Qt.ItemFlag.ItemIsEnabled)

    def __lt__(self, other: QTableWidgetItem) -> bool:
        if isinstance(other, _Cell) and self.rank is not None and other.rank is not None:
            return self.rank < other.rank
        return self.text() < other.text()


class TrialTable(QTableWidget):
    """Shows :class:`app.workflows.laboratory.Trial` as they come."""

    def __init__(self) -> None:
        super().__init__(0, len(COLUMNS))
        self.trials: list[Trial] = []
        self.setHorizontalHeaderLabels(COLUMNS)
        self.verticalHeader().hide()
        self.setAlternatingRowColors(True)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setTabKeyNavigation(False)
        self.setWordWrap(False)
        self.setAccessibleName("Methods and their answers")
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        self.horizontalHeader().setStretchLastSection(True)
        self.horizontalHeader().setSortIndicator(-1, Qt.SortOrder.AscendingOrder)

    def clear_trials(self) -> None:
        """No lines."""
        self.trials = []
        self.setRowCount(0)

    def add(self, trial: Trial) -> None:
        """One more line."""
        self.trials.append(trial)
        self.setSortingEnabled(False)
        row = self.rowCount()
        self.insertRow(row)
        for column, cell in enumerate(cells(trial)):
            self.setItem(row, column, cell)
        self.setSortingEnabled(True)  # by no column until one is clicked
        self.resizeColumnsToContents()


def cells(t: Trial) -> list[QTableWidgetItem]:
    """The cells of one line."""
    spent, tables = milliseconds_text(1e3 * t.seconds), milliseconds_text(1e3 * t.tables_s)
    first = f"; making its tables took {tables}, once" if t.tables_s > 0 else ""
    sigma = t.sigma_arcsec
    return [
        _Cell(t.method),
        _Cell(answer(t), _rank(t), _where(t)),
        _Cell(f"{t.matches}" if t.answered else "–", float(t.matches)),
        _Cell("–" if t.wrong is None else f"{t.wrong}", LAST if t.wrong is None else t.wrong),
        _Cell(spent, t.seconds, f"{spent} of processor time{first}"),
        _Cell(f"{arcsec_text(max(sigma[:2]))}" if sigma else "–", max(sigma[:2]) if sigma else LAST,
              _sigma(t)),
        _Cell(t.reason, None, t.advice),
        _Cell(t.paper),
    ]  # fmt: skip


def answer(t: Trial) -> str:
    """Right, wrong, or none; where it points when nobody knows better."""
    if not t.answered or t.ra_dec_deg is None:
        return "none"
    if t.right is None:
        return radec_text(*t.ra_dec_deg, AngleStyle.SEXAGESIMAL)
    off = angle_text((t.off_arcsec or 0.0) / 3600.0)
    return f"right, {off} off" if t.right else f"WRONG, {off} off"


def _rank(t: Trial) -> float:
    """Right answers first, then those nobody can judge, then wrong ones, then none."""
    return {True: 0.0, None: 1.0, False: 2.0}[t.right] if t.answered else 3.0


def _where(t: Trial) -> str:
    if t.ra_dec_deg is None:
        return t.advice
    odds = false_alarm_text(t.log10_false_alarm if t.log10_false_alarm is not None else LAST)
    return f"{radec_text(*t.ra_dec_deg, AngleStyle.SEXAGESIMAL)}\nby chance: {odds}"


def _sigma(t: Trial) -> str:
    if t.sigma_arcsec is None:
        return "Too few matches to tell"
    x, y, roll = (arcsec_text(value) for value in t.sigma_arcsec)
    return f"From the method’s own matches: {x} × {y}, roll {roll}"
