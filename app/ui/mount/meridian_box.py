"""The choice of what the mount does at the meridian."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.ui.mount.meridian import Meridian
from app.ui.widgets import label, narrow_box

TIP = (
    "A German mount changes the side of its pier there, and runs into the pier when it does not. "
    "A fork, a wedge or an altazimuth mount just goes on, whatever side it tells."
)


class MeridianBox(QWidget):
    """Shows one :class:`Meridian`; ``chosen`` tells of another that a person wants."""

    chosen = Signal(object)  # Meridian

    def __init__(self) -> None:
        super().__init__()
        self.choice = narrow_box("What the mount does at the meridian", 8)
        self.choice.setToolTip(TIP)
        for meridian in Meridian:
            self.choice.addItem(str(meridian), meridian)
        self.choice.activated.connect(lambda _: self.chosen.emit(self.meridian))
        name = label("Meridian")
        line = QHBoxLayout(self)
        line.setContentsMargins(0, 0, 0, 0)
        line.addWidget(name)
        line.addWidget(self.choice, 1)

    @property
    def meridian(self) -> Meridian:
        """The one that is chosen."""
        return list(Meridian)[self.choice.currentIndex()]

    def show_meridian(self, meridian: Meridian) -> None:
        """Choose it without telling."""
        self.choice.setCurrentIndex(list(Meridian).index(meridian))
