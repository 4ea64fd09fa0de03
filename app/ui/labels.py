"""Keeps labels on a frame from covering each other."""

from PySide6.QtCore import QRectF


class LabelSpace:
    """Remembers the boxes already taken on a widget of ``width`` x ``height`` px."""

    def __init__(self, width: int, height: int) -> None:
        self._edges = QRectF(2, 2, width - 4, height - 4)
        self._taken: list[QRectF] = []

    def place(self, box: QRectF) -> QRectF | None:
        """``box`` moved inside the widget, or None when its place is taken."""
        if not self._edges.intersects(box):
            return None
        box = self._inside(box)
        grown = box.adjusted(-3, -2, 3, 2)
        if any(grown.intersects(other) for other in self._taken):
            return None
        self._taken.append(grown)
        return box

    def _inside(self, box: QRectF) -> QRectF:
        e = self._edges
        x = min(max(box.left(), e.left() + 3), e.right() - box.width() - 3)
        y = min(max(box.top(), e.top() + 1), e.bottom() - box.height() - 1)
        return QRectF(x, y, box.width(), box.height())
