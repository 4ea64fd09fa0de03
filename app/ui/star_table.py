"""The pane with the identified stars; a row and its star in the frame are selected together."""

from PySide6.QtCore import QItemSelection, Qt, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLineEdit,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from app.core.solution import NamedStar
from app.ui.formats import AngleStyle
from app.ui.star_model import COLUMNS, StarFilter, StarModel
from app.ui.widgets import copy_text, label


class StarTable(QWidget):
    """Sortable, filterable; ``picked`` carries the index into ``solution.stars``, or None."""

    picked = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self.model = StarModel()
        self.proxy = StarFilter()
        self.proxy.setSourceModel(self.model)
        self.proxy.setFilterKeyColumn(-1)
        self.proxy.setFilterCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        self.filter = QLineEdit()
        self.filter.setPlaceholderText("Filter by name or number")
        self.filter.setAccessibleName("Filter stars")
        self.filter.setClearButtonEnabled(False)
        self.filter.textChanged.connect(self.proxy.setFilterFixedString)
        self.table = self._table()
        self.count = label("No stars identified yet", "muted")
        layout = QVBoxLayout(self)
        layout.setContentsMargins(10, 10, 10, 10)
        layout.addWidget(self.filter)
        layout.addWidget(self.table, 1)
        layout.addWidget(self.count)
        copy = QShortcut(QKeySequence.StandardKey.Copy, self.table)
        copy.setContext(Qt.ShortcutContext.WidgetShortcut)
        copy.activated.connect(self._copy)

    def _table(self) -> QTableView:
        table = QTableView()
        table.setAccessibleName("Identified stars")
        table.setModel(self.proxy)
        table.setSortingEnabled(True)
        table.sortByColumn(2, Qt.SortOrder.AscendingOrder)
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.setAlternatingRowColors(True)
        table.setShowGrid(False)
        table.setTabKeyNavigation(False)
        table.setWordWrap(False)
        table.verticalHeader().hide()
        table.verticalHeader().setMinimumSectionSize(16)
        table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        table.horizontalHeader().setHighlightSections(False)
        table.selectionModel().selectionChanged.connect(self._selection)
        return table

    def set_stars(self, stars: tuple[NamedStar, ...]) -> None:
        """Other stars, none selected."""
        self.model.set_stars(stars)
        named = sum(bool(s.name) for s in stars)
        self.count.setText(
            f"{len(stars)} stars identified, {named} of them have a name" if stars
            else "No stars identified"
        )  # fmt: skip
        self._fit()

    def set_style(self, style: AngleStyle) -> None:
        """Write angles in another way."""
        self.model.set_style(style)
        self._fit()

    def _fit(self) -> None:
        self.table.verticalHeader().setDefaultSectionSize(self.table.fontMetrics().height() + 8)
        metrics = self.table.fontMetrics()
        for column, (title, _, wide) in enumerate(COLUMNS):  # measuring every cell takes long
            wide = self.model.longest(column) or wide
            width = max(metrics.horizontalAdvance(wide), metrics.horizontalAdvance(title) + 14)
            self.table.setColumnWidth(column, width + 16)

    def select(self, star: int | None) -> None:
        """Select the row of ``solution.stars[star]`` and bring it into sight."""
        if star is None:
            self.table.clearSelection()
            return
        index = self.proxy.mapFromSource(self.model.index(self.model.row_of(star), 0))
        if not index.isValid():  # the filter hides it
            self.filter.clear()
            index = self.proxy.mapFromSource(self.model.index(self.model.row_of(star), 0))
        self.table.selectRow(index.row())
        self.table.scrollTo(index)

    @property
    def selected(self) -> int | None:
        """The selected star, as an index into ``solution.stars``."""
        chosen = self.table.selectionModel().selectedRows()
        return self.model.star_at(self.proxy.mapToSource(chosen[0]).row()) if chosen else None

    def _selection(self, _on: QItemSelection, _off: QItemSelection) -> None:
        self.picked.emit(self.selected)

    def _copy(self) -> None:
        chosen = self.table.selectionModel().selectedRows()
        if chosen:
            columns = range(self.model.columnCount())
            copy_text("\t".join(str(chosen[0].siblingAtColumn(c).data()) for c in columns))
