"""Which camera looks through the telescope."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLineEdit,
    QVBoxLayout,
    QWidget,
)

from app.cameras import SOURCES
from app.ui.mount.eye import CameraWish
from app.ui.widgets import label

TITLES = {
    "": "none: use the open frame", "simulated": "simulated camera", "folder": "folder of frames",
    "indi": "INDI", "alpaca": "ASCOM Alpaca", "webcam": "webcam",
}  # fmt: skip
EXAMPLES = {
    "folder": "the folder a capture program writes into", "indi": "host:7624/Camera name",
    "alpaca": "host:11111/0", "webcam": "/dev/video0 or an address",
}  # fmt: skip
EXPOSURE_S = (0.001, 60.0)


class CameraBox(QWidget):
    """Source, address and exposure; ``chosen`` when a person has changed one."""

    chosen = Signal(object)  # CameraWish, or None

    def __init__(self) -> None:
        super().__init__()
        self.source = QComboBox()
        self.source.setAccessibleName("Camera on the mount")
        for name in ("", *SOURCES):
            self.source.addItem(TITLES.get(name, name), name)
        self.address = QLineEdit()
        self.address.setAccessibleName("Address of the camera")
        self.exposure = QDoubleSpinBox()
        self.exposure.setAccessibleName("Exposure in seconds")
        self.exposure.setRange(*EXPOSURE_S)
        self.exposure.setDecimals(3)
        self.exposure.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.exposure.setSuffix(" s")
        self.exposure.setValue(2.0)
        line = QHBoxLayout()
        line.addWidget(label("Camera"))
        line.addWidget(self.source, 1)
        line.addWidget(self.exposure)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(6)
        column.addLayout(line)
        column.addWidget(self.address)
        self.source.activated.connect(self._picked)
        self.address.editingFinished.connect(self._tell)
        self.exposure.editingFinished.connect(self._tell)
        self._example()

    def show_wish(self, wish: CameraWish) -> None:
        """Fill the fields."""
        self.source.setCurrentIndex(max(0, self.source.findData(wish.source)))
        self.address.setText(wish.address)
        self.exposure.setValue(wish.exposure_s)
        self._example()

    @property
    def wish(self) -> CameraWish | None:
        """What is chosen; None for no camera."""
        source = str(self.source.currentData())
        if not source:
            return None
        return CameraWish(source, self.address.text().strip(), self.exposure.value())

    def _picked(self) -> None:
        self.address.clear()
        self._example()
        self._tell()

    def _example(self) -> None:
        source = str(self.source.currentData())
        self.address.setPlaceholderText(EXAMPLES.get(source, ""))
        self.address.setVisible(source in EXAMPLES)
        self.exposure.setEnabled(bool(source) and source != "folder")

    def _tell(self) -> None:
        self.chosen.emit(self.wish)
