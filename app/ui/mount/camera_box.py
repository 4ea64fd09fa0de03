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
from app.core.capture import CameraDevice
from app.ui.mount.eye import CameraWish
from app.ui.widgets import button, label, narrow_box

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
    look_wanted = Signal(str, str)  # source, address: which cameras there are

    def __init__(self) -> None:
        super().__init__()
        self.source = QComboBox()
        self.source.setAccessibleName("Camera on the mount")
        for name in ("", *SOURCES):
            self.source.addItem(TITLES.get(name, name), name)
        self.found = narrow_box("Cameras that were found", 12)
        self.found.setPlaceholderText("none found yet")
        self.look = button("Fin&d", self._look, tip="Look for cameras of this kind")
        self.address = QLineEdit()
        self.address.setAccessibleName("Address of the camera")
        self.exposure = QDoubleSpinBox()
        self.exposure.setAccessibleName("Exposure in seconds")
        self.exposure.setRange(*EXPOSURE_S)
        self.exposure.setDecimals(3)
        self.exposure.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.exposure.setSuffix(" s")
        self.exposure.setValue(2.0)
        self.told = label("", "muted", wrap=True)
        self.told.setVisible(False)
        line = QHBoxLayout()
        line.addWidget(label("Camera"))
        line.addWidget(self.source, 1)
        line.addWidget(self.exposure)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(6)
        column.addLayout(line)
        finding = QHBoxLayout()
        finding.addWidget(self.found, 1)
        finding.addWidget(self.look)
        column.addLayout(finding)
        column.addWidget(self.address)
        column.addWidget(self.told)
        self.source.activated.connect(self._picked)
        self.found.activated.connect(self._take)
        self.address.editingFinished.connect(self._tell)
        self.exposure.editingFinished.connect(self._tell)
        self._example()

    def show_wish(self, wish: CameraWish) -> None:
        """Fill the fields, and ask which cameras there are of this kind."""
        other = wish.source != str(self.source.currentData())
        self.source.setCurrentIndex(max(0, self.source.findData(wish.source)))
        self.address.setText(wish.address)
        self.exposure.setValue(wish.exposure_s)
        self._example()
        if other:
            self.found.clear()
            if not self.found.isHidden():
                self._look()
        self._point_out()

    def say(self, sentence: str) -> None:
        """What is to be known of the camera in use, until the next; an empty one takes it away."""
        if sentence != self.told.text():
            self.told.setText(sentence)
            self.told.setVisible(bool(sentence))

    def show_found(self, source: str, devices: list[CameraDevice]) -> None:
        """Cameras that can be chosen now; the only one is taken if none was named."""
        if source != str(self.source.currentData()):
            return
        self.found.clear()
        for device in devices:
            self.found.addItem(device.description, device.address)
        self.found.setPlaceholderText("" if devices else "none found")
        self.found.setToolTip("")
        self.found.setEnabled(bool(devices))
        if len(devices) == 1 and not self.address.text().strip():
            self._take(0)
        self._point_out()

    def show_missed(self, source: str, sentence: str) -> None:
        """Why they cannot be asked for."""
        if source == str(self.source.currentData()):
            self.show_found(source, [])
            self.found.setToolTip(sentence)
            self.found.setAccessibleDescription(sentence)

    @property
    def wish(self) -> CameraWish | None:
        """What is chosen; None for no camera."""
        source = str(self.source.currentData())
        if not source:
            return None
        return CameraWish(source, self.address.text().strip(), self.exposure.value())

    def _picked(self) -> None:
        self.address.clear()
        self.found.clear()
        self._example()
        self._tell()
        if not self.found.isHidden():
            self._look()

    def _look(self) -> None:
        self.look_wanted.emit(str(self.source.currentData()), self.address.text().strip())

    def _take(self, index: int) -> None:
        self.address.setText(str(self.found.itemData(index)))
        self._tell()

    def _point_out(self) -> None:
        self.found.setCurrentIndex(self.found.findData(self.address.text().strip()))

    def _example(self) -> None:
        source = str(self.source.currentData())
        self.address.setPlaceholderText(EXAMPLES.get(source, ""))
        self.address.setVisible(source in EXAMPLES)
        for widget in (self.found, self.look):
            widget.setVisible(source not in ("", "folder"))
        self.exposure.setEnabled(bool(source) and source != "folder")

    def _tell(self) -> None:
        self.chosen.emit(self.wish)
