"""The identified stars as a table."""

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
)

from app.core.solution import NamedStar
from app.ui.formats import AngleStyle, dec_text, ra_text

COLUMNS = (  # title, explanation, a text as wide as most
    ("Name", "Its own name, Bayer letter or Flamsteed number", "Zubeneschamali"),
    ("Catalogue", "Its number in the catalogue", "J000000.0+000000"),
    ("V", "Visual magnitude", "−1.46"),
    ("RA", "Right ascension, ICRS", "00h 00m 00.00s"),
    ("Dec", "Declination, ICRS", "+00° 00′ 00.0″"),
    ("x", "Pixels from the left", "00000.0"),
    ("y", "Pixels from the top", "00000.0"),
    ("Off", "Distance from the fitted position, pixels", "0.00"),
)
UNLIKE = (0, 1)  # columns whose texts differ in length: names and numbers
# One function a column: a sort asks thousands of times, and for one column alone.
TEXTS: tuple[Callable[[NamedStar, AngleStyle], str], ...] = (
    lambda s, _: s.name,
    lambda s, _: s.id,
    lambda s, _: f"{s.mag:.2f}",
    lambda s, style: ra_text(s.ra_deg, style),
    lambda s, style: dec_text(s.dec_deg, style),
    lambda s, _: f"{s.x:.1f}",
    lambda s, _: f"{s.y:.1f}",
    lambda s, _: f"{s.residual_px:.2f}",
)


def _number_last(star: NamedStar) -> str:
    """A catalogue's name and its number with leading zeros, so that HIP 9 comes before HIP 10."""
    catalogue, _, number = star.id.partition(" ")
    return f"{catalogue} {number.zfill(12)}"


KEYS: tuple[Callable[[NamedStar], Any], ...] = (
    lambda s: s.name or "\uffff",  # those without a name come last
    _number_last,
    lambda s: s.mag,
    lambda s: s.ra_deg,
    lambda s: s.dec_deg,
    lambda s: s.x,
    lambda s: s.y,
    lambda s: s.residual_px,
)
Index = QModelIndex | QPersistentModelIndex


class StarModel(QAbstractTableModel):
    """The stars of a solution, sorted here: Qt would ask for every value of every comparison."""

    def __init__(self) -> None:
        super().__init__()
        self._stars: tuple[NamedStar, ...] = ()
        self._order: list[int] = []  # row -> index into the stars
        self._sorted_by = (2, False)  # column, falling
        self._style = AngleStyle.SEXAGESIMAL

    def set_stars(self, stars: tuple[NamedStar, ...]) -> None:
        """Other stars."""
        self.beginResetModel()
        self._stars = stars
        self._order = self._sort()
        self.endResetModel()

    def set_style(self, style: AngleStyle) -> None:
        """Write angles in another way."""
        self._style = style
        if self._stars:
            last = self.index(len(self._stars) - 1, len(COLUMNS) - 1)
            self.dataChanged.emit(self.index(0, 0), last)

    def longest(self, column: int) -> str:
        """The longest text of a column; empty where there is none, or its texts are alike."""
        if column not in UNLIKE:
            return ""
        return max((TEXTS[column](star, self._style) for star in self._stars), key=len, default="")

    def star_at(self, row: int) -> int:
        """Index into the solution's stars of a row."""
        return self._order[row]

    def row_of(self, star: int) -> int:
        """Row of ``solution.stars[star]``."""
        return self._order.index(star)

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        if column < 0:
            return
        self._sorted_by = (column, order == Qt.SortOrder.DescendingOrder)
        self.layoutAboutToBeChanged.emit()
        old, self._order = self._order, self._sort()
        row_of = {star: row for row, star in enumerate(self._order)}
        held = self.persistentIndexList()
        moved = [self.index(row_of[old[i.row()]], i.column()) for i in held]
        self.changePersistentIndexList(held, moved)
        self.layoutChanged.emit()

    def _sort(self) -> list[int]:
        column, falling = self._sorted_by
        keys = [KEYS[column](star) for star in self._stars]
        return sorted(range(len(keys)), key=keys.__getitem__, reverse=falling)

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self._stars)

    def columnCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(COLUMNS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation != Qt.Orientation.Horizontal:
            return section + 1 if role == Qt.ItemDataRole.DisplayRole else None
        if role == Qt.ItemDataRole.DisplayRole:
            return COLUMNS[section][0]
        return COLUMNS[section][1] if role == Qt.ItemDataRole.ToolTipRole else None

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        if not index.isValid():
            return None
        if role == Qt.ItemDataRole.DisplayRole:
            return TEXTS[index.column()](self._stars[self._order[index.row()]], self._style)
        if role == Qt.ItemDataRole.TextAlignmentRole and index.column() >= 2:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None


class StarFilter(QSortFilterProxyModel):
    """Leaves rows out; sorting is the model's."""

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        self.sourceModel().sort(column, order)
