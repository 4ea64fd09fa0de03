"""The identified stars as a table."""

from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt

from app.core.solution import NamedStar
from app.ui.formats import AngleStyle, dec_text, ra_text

COLUMNS = (
    ("Name", "Its own name, Bayer letter or Flamsteed number"),
    ("Catalogue", "Its number in the catalogue"),
    ("V", "Visual magnitude"),
    ("RA", "Right ascension, ICRS"),
    ("Dec", "Declination, ICRS"),
    ("x", "Pixels from the left"),
    ("y", "Pixels from the top"),
    ("Off", "Distance from the fitted position, pixels"),
)
Index = QModelIndex | QPersistentModelIndex
SORT_ROLE = Qt.ItemDataRole.UserRole


class StarModel(QAbstractTableModel):
    """Rows are ``solution.stars`` in their order."""

    def __init__(self) -> None:
        super().__init__()
        self._stars: tuple[NamedStar, ...] = ()
        self._style = AngleStyle.SEXAGESIMAL

    def set_stars(self, stars: tuple[NamedStar, ...]) -> None:
        """Other stars."""
        self.beginResetModel()
        self._stars = stars
        self.endResetModel()

    def set_style(self, style: AngleStyle) -> None:
        """Write angles in another way."""
        self._style = style
        if self._stars:
            last = self.index(len(self._stars) - 1, len(COLUMNS) - 1)
            self.dataChanged.emit(self.index(0, 0), last)

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
        star, column = self._stars[index.row()], index.column()
        if role == Qt.ItemDataRole.DisplayRole:
            return self._texts(star)[column]
        if role == SORT_ROLE:
            return _keys(star)[column]
        if role == Qt.ItemDataRole.TextAlignmentRole and column >= 2:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None

    def _texts(self, s: NamedStar) -> tuple[str, ...]:
        return (
            s.name, s.id, f"{s.mag:.2f}", ra_text(s.ra_deg, self._style),
            dec_text(s.dec_deg, self._style), f"{s.x:.1f}", f"{s.y:.1f}", f"{s.residual_px:.2f}",
        )  # fmt: skip


def _keys(s: NamedStar) -> tuple[Any, ...]:
    number = "".join(c for c in s.id if c.isdigit())
    catalogue = f"{s.id.split(' ')[0]} {number.zfill(24)}"
    return (s.name or "￿", catalogue, s.mag, s.ra_deg, s.dec_deg, s.x, s.y, s.residual_px)
