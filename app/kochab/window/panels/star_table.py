"""The Stars tab; a row and its star in the image are selected together."""

from collections.abc import Callable
from typing import Any, NamedTuple

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from kochab.core.solution import NamedStar
from kochab.text.angle_text import AngleStyle, dec_text, ra_text
from kochab.text.translation import number, tr, tr_n, tr_noop
from kochab.window.widgets import Page, column, copy_text, label, text_field

Index = QModelIndex | QPersistentModelIndex
UNEVEN = (0, 1)  # columns whose texts differ in length: names and numbers


def _number_last(star: NamedStar) -> str:
    """A catalogue's name and its number with leading zeros, so that HIP 9 comes before HIP 10."""
    catalogue, _, number = star.id.partition(" ")
    return f"{catalogue} {number.zfill(12)}"


def _nameless_last(star: NamedStar) -> str:
    return star.name or "\uffff"


class Column(NamedTuple):
    """``text`` and ``key`` are functions of one column: a sort calls its key thousands of times."""

    title: str
    tip: str
    widest: str  # as wide as most texts
    text: Callable[[NamedStar, AngleStyle], str]
    key: Callable[[NamedStar], Any]


COLUMNS = (
    Column(
        tr_noop("Name"),
        tr_noop("Proper name, Bayer letter or Flamsteed number"),
        "Zubeneschamali",
        lambda s, _: s.name,
        _nameless_last,
    ),
    Column(tr_noop("Catalogue"), tr_noop("Catalogue number"), "J000000.0+000000", lambda s, _: s.id, _number_last),
    Column("V", tr_noop("Visual magnitude"), "−1.46", lambda s, _: number(s.mag, ".2f"), lambda s: s.mag),
    Column(
        "RA", tr_noop("Right ascension, ICRS"), "00h 00m 00.00s", lambda s, a: ra_text(s.ra_deg, a), lambda s: s.ra_deg
    ),
    Column(
        tr_noop("Dec"),
        tr_noop("Declination, ICRS"),
        "+00° 00′ 00.0″",
        lambda s, a: dec_text(s.dec_deg, a),
        lambda s: s.dec_deg,
    ),
    Column("x", tr_noop("Pixels from the left"), "00000.0", lambda s, _: number(s.x, ".1f"), lambda s: s.x),
    Column("y", tr_noop("Pixels from the top"), "00000.0", lambda s, _: number(s.y, ".1f"), lambda s: s.y),
    Column(
        tr_noop("Residual"),
        tr_noop("Distance from the fitted position, pixels"),
        "0.00",
        lambda s, _: number(s.residual_px, ".2f"),
        lambda s: s.residual_px,
    ),
)


def _spellings(star: NamedStar) -> str:
    """All by which the filter finds a star: θ is not on every keyboard."""
    return f"{star.name}\n{star.ascii_name}\n{star.id}".casefold()


class StarModel(QAbstractTableModel):
    """The stars of a solution, filtered and sorted here: Qt would ask for every value of every comparison."""

    def __init__(self) -> None:
        super().__init__()
        self._stars: tuple[NamedStar, ...] = ()
        self.order: list[int] = []  # row -> index into the stars
        self._sorted_by = (2, False)  # column, falling
        self._wanted = ""
        self._style = AngleStyle.SEXAGESIMAL

    def set_stars(self, stars: tuple[NamedStar, ...]) -> None:
        self._stars = stars
        self._arrange()

    def set_filter(self, text: str) -> None:
        """Keep the stars with ``text`` in a name or number."""
        self._wanted = text.casefold()
        self._arrange()

    def set_style(self, style: AngleStyle) -> None:
        self._style = style
        if self.order:
            self.dataChanged.emit(self.index(0, 0), self.index(len(self.order) - 1, len(COLUMNS) - 1))

    def longest(self, column: int) -> str:
        """The longest text of a column; empty where there is none, or its texts are alike."""
        if column not in UNEVEN:
            return ""
        return max((COLUMNS[column].text(star, self._style) for star in self._stars), key=len, default="")

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        if column >= 0:
            self._sorted_by = (column, order == Qt.SortOrder.DescendingOrder)
            self._arrange()

    def _arrange(self) -> None:
        column, falling = self._sorted_by
        keys = [COLUMNS[column].key(star) for star in self._stars]
        shown = [i for i, star in enumerate(self._stars) if not self._wanted or self._wanted in _spellings(star)]
        self.beginResetModel()
        self.order = sorted(shown, key=keys.__getitem__, reverse=falling)
        self.endResetModel()

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self.order)

    def columnCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(COLUMNS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation != Qt.Orientation.Horizontal:
            return section + 1 if role == Qt.ItemDataRole.DisplayRole else None
        if role == Qt.ItemDataRole.DisplayRole:
            return tr(COLUMNS[section].title)
        return tr(COLUMNS[section].tip) if role == Qt.ItemDataRole.ToolTipRole else None

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        if not index.isValid():
            return None
        if role == Qt.ItemDataRole.DisplayRole:
            return COLUMNS[index.column()].text(self._stars[self.order[index.row()]], self._style)
        if role == Qt.ItemDataRole.TextAlignmentRole and index.column() >= 2:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None


class StarTable(Page):
    """Sortable, filterable; ``selected`` is an index into ``solution.named`` or None, and ``picked`` carries it."""

    picked = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.model = StarModel()
        self.selected: int | None = None
        self.filter = text_field(tr("Filter stars"), tr("Filter by name or number"))
        self.filter.textChanged.connect(self.model.set_filter)
        self.table = self._table()
        self.count = label(tr("No stars identified yet"), "muted")
        column(self.filter, (self.table, 1), self.count, on=self, margins=(10, 10, 10, 10))
        copy = QShortcut(QKeySequence.StandardKey.Copy, self.table)
        copy.setContext(Qt.ShortcutContext.WidgetShortcut)
        copy.activated.connect(self._copy)

    def _table(self) -> QTableView:
        table = QTableView(showGrid=False, wordWrap=False)
        table.setAccessibleName(tr("Identified stars"))
        table.setModel(self.model)
        table.setSortingEnabled(True)
        table.sortByColumn(2, Qt.SortOrder.AscendingOrder)
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.setAlternatingRowColors(True)
        table.setTabKeyNavigation(False)
        table.verticalHeader().hide()
        table.verticalHeader().setMinimumSectionSize(16)
        table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        table.horizontalHeader().setHighlightSections(False)
        table.selectionModel().selectionChanged.connect(self._selection)
        self.model.modelReset.connect(self._select_again)
        return table

    def set_stars(self, stars: tuple[NamedStar, ...]) -> None:
        self.selected = None
        self.model.set_stars(stars)
        named = sum(bool(s.name) for s in stars)
        text = tr_n(
            "{n} star identified, {named} with a name",
            "{n} stars identified, {named} with a name",
            len(stars),
            named=named,
        )
        self.count.setText(text if stars else tr("No stars identified"))
        self._fit()

    def set_style(self, style: AngleStyle) -> None:
        self.model.set_style(style)
        self._fit()

    def _fit(self) -> None:
        self.table.verticalHeader().setDefaultSectionSize(self.table.fontMetrics().height() + 8)
        metrics = self.table.fontMetrics()
        for at, (title, _, widest, _, _) in enumerate(COLUMNS):  # measuring every cell takes long
            longest = self.model.longest(at) or widest
            width = max(metrics.horizontalAdvance(longest), metrics.horizontalAdvance(tr(title)) + 14)
            self.table.setColumnWidth(at, width + 16)

    def select(self, star: int | None) -> None:
        """Select the row of ``solution.named[star]`` and bring it into sight."""
        if star is None:
            self.table.clearSelection()
            return
        if star not in self.model.order:  # the filter hides it
            self.filter.clear()
        row = self.model.order.index(star)
        self.table.selectRow(row)
        self.table.scrollTo(self.model.index(row, 0))

    def _select_again(self) -> None:
        """Select the same star in a table that was arranged anew, unless the filter hides it."""
        if self.selected in self.model.order:
            with QSignalBlocker(self):  # nothing new is picked
                self.table.selectRow(self.model.order.index(self.selected))
        elif self.selected is not None:
            self.selected = None
            self.picked.emit(None)

    def _selection(self) -> None:
        chosen = self.table.selectionModel().selectedRows()
        self.selected = self.model.order[chosen[0].row()] if chosen else None
        self.picked.emit(self.selected)

    def _copy(self) -> None:
        chosen = self.table.selectionModel().selectedRows()
        if chosen:
            columns = range(self.model.columnCount())
            copy_text("\t".join(str(chosen[0].siblingAtColumn(c).data()) for c in columns))
