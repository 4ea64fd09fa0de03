"""The Laboratory's table: a line for each method, detector or estimator."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableWidget, QTableWidgetItem

from app.ui.lab.cells import Said, columns_of
from app.workflows.laboratory import Trial
from app.workflows.laboratory_kinds import Kind


class _Cell(QTableWidgetItem):
    """A cell that sorts by a number where it has one."""

    def __init__(self, said: Said) -> None:
        super().__init__(said.text)
        self.rank = said.rank
        self.setToolTip(said.tip or said.text)
        self.setFlags(Qt.ItemFlag.ItemIsSelectable | Qt.ItemFlag.ItemIsEnabled)

    def __lt__(self, other: QTableWidgetItem) -> bool:
        if isinstance(other, _Cell) and self.rank is not None and other.rank is not None:
            return self.rank < other.rank
        return self.text() < other.text()


class TrialTable(QTableWidget):
    """Shows :class:`app.workflows.laboratory.Trial` as they come."""

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
        self.begin(Kind.METHOD)

    def begin(self, kind: Kind) -> None:
        """No lines, under the titles of this kind."""
        self.trials = []
        self._columns = columns_of(kind)
        self.setSortingEnabled(False)
        self.setRowCount(0)
        self.setColumnCount(len(self._columns))
        self.setHorizontalHeaderLabels(list(self._columns))
        self.horizontalHeader().setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        self.setAccessibleName(f"Every {kind} and its answer")

    def add(self, trial: Trial) -> None:
        """One more line."""
        self.trials.append(trial)
        self.setSortingEnabled(False)
        row = self.rowCount()
        self.insertRow(row)
        for column, say in enumerate(self._columns.values()):
            self.setItem(row, column, _Cell(say(trial)))
        self.setSortingEnabled(True)  # by no column until one is clicked
        self.resizeColumnsToContents()
