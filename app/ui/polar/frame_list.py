"""The frames to measure: a list of files, some of them of a second sweep."""

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QListWidget, QListWidgetItem

SWEEP = Qt.ItemDataRole.UserRole
LINES = 6


class FrameList(QListWidget):
    """Each file once; the second sweep is another declination, and shows flexure."""

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName("Frames to measure")
        self.setFixedHeight(LINES * self.fontMetrics().height())

    def add(self, paths: list[Path], sweep: int = 0) -> None:
        """More frames, of the first sweep or the second."""
        there = {self.item(i).toolTip() for i in range(self.count())}
        for path in paths:
            if str(path) not in there:
                there.add(str(path))
                item = QListWidgetItem(f"{path.name}, second sweep" if sweep else path.name)
                item.setToolTip(str(path))
                item.setData(SWEEP, sweep)
                self.addItem(item)

    def paths(self, sweep: int) -> tuple[Path, ...]:
        """The files of one sweep."""
        items = [self.item(i) for i in range(self.count())]
        return tuple(Path(i.toolTip()) for i in items if i.data(SWEEP) == sweep)
