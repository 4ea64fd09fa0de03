"""A row of widgets that goes on in the next line where there is no room: no view is wider than its widest button."""

from collections.abc import Sequence

from PySide6.QtCore import QPoint, QRect, QSize, Qt
from PySide6.QtWidgets import QLayout, QLayoutItem, QWidget

SPACING_PX = 8


class Flow(QLayout):
    """Lays widgets out from left to right, in as many lines as they need.

    ``fill`` takes the rest of its line, and has one of its own where not all are in one.
    What follows a None stands at the right end of its line.
    """

    def __init__(self, *parts: QWidget | None, fill: QWidget | None = None, spacing: int = SPACING_PX) -> None:
        super().__init__()
        self.setContentsMargins(0, 0, 0, 0)
        self._items: list[QLayoutItem] = []
        self._fill, self._spacing = fill, spacing
        self._right: QWidget | None = None
        for at, part in enumerate(parts):
            if part is not None:
                self.addWidget(part)
                if at and parts[at - 1] is None:
                    self._right = part

    def addItem(self, item: QLayoutItem) -> None:
        self._items.append(item)

    def count(self) -> int:
        return len(self._items)

    def itemAt(self, index: int) -> QLayoutItem:
        return self._items[index] if 0 <= index < len(self._items) else None  # type: ignore[return-value]  # as Qt asks

    def takeAt(self, index: int) -> QLayoutItem:
        return self._items.pop(index) if 0 <= index < len(self._items) else None  # type: ignore[return-value]

    def expandingDirections(self) -> Qt.Orientation:
        return Qt.Orientation.Horizontal

    def hasHeightForWidth(self) -> bool:
        return True

    def heightForWidth(self, width: int) -> int:
        lines = self._lines(width)
        return sum(map(_height, lines)) + self._spacing * max(0, len(lines) - 1)

    def sizeHint(self) -> QSize:
        """All in one line."""
        seen = self._seen
        wide = sum(item.sizeHint().width() for item in seen) + self._spacing * max(0, len(seen) - 1)
        return QSize(wide, _height(seen))

    def minimumSize(self) -> QSize:
        """As wide as the widest."""
        return QSize(max((self._least(item) for item in self._seen), default=0), _height(self._seen))

    def setGeometry(self, rect: QRect) -> None:
        super().setGeometry(rect)
        top = rect.top()
        for line in self._lines(rect.width()):
            high = _height(line)
            rest = rect.width() - sum(map(self._wide, line)) - self._spacing * (len(line) - 1)
            left = rect.left()
            for item in line:
                wide = self._wide(item)
                if item.widget() is self._fill:
                    wide += rest
                elif item.widget() is self._right and len(line) > 1:
                    left += max(0, rest)
                tall = item.sizeHint().height()
                item.setGeometry(QRect(QPoint(left, top + (high - tall) // 2), QSize(min(wide, rect.width()), tall)))
                left += wide + self._spacing
            top += high + self._spacing

    @property
    def _seen(self) -> list[QLayoutItem]:
        return [item for item in self._items if not item.isEmpty()]

    def _least(self, item: QLayoutItem) -> int:
        return item.minimumSize().width()

    def _wide(self, item: QLayoutItem) -> int:
        """A widget that fills its line asks for no more than it needs."""
        return self._least(item) if item.widget() is self._fill else item.sizeHint().width()

    def _lines(self, width: int) -> list[list[QLayoutItem]]:
        seen = self._seen
        one = sum(map(self._wide, seen)) + self._spacing * (len(seen) - 1) <= width
        lines: list[list[QLayoutItem]] = []
        left, full = 0, True  # whether the next goes into another line
        for item in seen:
            alone = not one and item.widget() is self._fill
            if full or alone or left + self._wide(item) > width:
                lines.append([])
                left = 0
            lines[-1].append(item)
            left += self._wide(item) + self._spacing
            full = alone
        return lines


def _height(items: Sequence[QLayoutItem]) -> int:
    return max((item.sizeHint().height() for item in items), default=0)
