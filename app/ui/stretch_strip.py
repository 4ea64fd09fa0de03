"""The strip under the frame: histogram, automatic stretch, black and brightness sliders."""

import math

import numpy as np
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QCheckBox, QGridLayout, QHBoxLayout, QLabel, QSlider, QWidget

from app.ui.histogram import AXIS_POWER, Histogram
from app.ui.picture import Picture
from app.ui.ready_picture import ReadyPicture
from app.ui.stretch import Stretch

STEPS = 1000
DECADES = 4.0  # brightness runs from linear to four decades of lift


class StretchStrip(QWidget):
    """Emits the stretch to use; linear when automatic is off and nothing was moved."""

    changed = Signal(object)  # Stretch

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self._automatic = Stretch()
        self.histogram = Histogram()
        self.auto = QCheckBox("A&uto stretch")
        self.auto.setChecked(True)
        self.auto.setToolTip("Show the sky dark grey and faint stars clearly")
        self.black, self.bright = self._slider("Black point"), self._slider("Brightness")
        self.auto.toggled.connect(self._auto_toggled)
        for slider in (self.black, self.bright):
            slider.valueChanged.connect(self._moved)
        grid = QGridLayout()
        grid.setVerticalSpacing(2)
        grid.setHorizontalSpacing(8)
        for row, (title, slider) in enumerate((("Blac&k", self.black), ("Bri&ght", self.bright))):
            name = QLabel(title)
            name.setBuddy(slider)
            grid.addWidget(name, row, 0)
            grid.addWidget(slider, row, 1)
        line = QHBoxLayout(self)
        line.setContentsMargins(10, 6, 10, 6)
        line.setSpacing(14)
        line.addWidget(self.histogram, 2)
        line.addWidget(self.auto)
        line.addLayout(grid, 1)
        self.setEnabled(False)

    def show_picture(self, picture: Picture | ReadyPicture) -> None:
        """Another frame: its histogram, and its automatic stretch when that is on."""
        self._automatic = picture.auto
        self.histogram.set_counts(picture.histogram)
        self.setEnabled(True)
        if self.auto.isChecked():
            self._place(picture.auto)
        self._tell()

    def forget_picture(self) -> None:
        """No frame: nothing to stretch."""
        self.histogram.set_counts(np.zeros(0))
        self.setEnabled(False)

    @property
    def stretch(self) -> Stretch:
        """What the sliders say; the exact automatic one when that is on."""
        if self.auto.isChecked():
            return self._automatic
        black = (self.black.value() / STEPS) ** AXIS_POWER
        return Stretch(min(black, 0.999), 0.5 * 10 ** (-DECADES * self.bright.value() / STEPS))

    def _auto_toggled(self, on: bool) -> None:
        self._place(self._automatic if on else Stretch())
        self._tell()

    def _moved(self) -> None:
        with QSignalBlocker(self.auto):
            self.auto.setChecked(False)
        self._tell()

    def _place(self, stretch: Stretch) -> None:
        lift = -math.log10(max(stretch.mid, 1e-9) / 0.5) / DECADES
        with QSignalBlocker(self.black), QSignalBlocker(self.bright):
            self.black.setValue(round(stretch.black ** (1 / AXIS_POWER) * STEPS))
            self.bright.setValue(round(min(max(lift, 0.0), 1.0) * STEPS))

    def _tell(self) -> None:
        self.histogram.set_stretch(self.stretch)
        self.changed.emit(self.stretch)

    def _slider(self, name: str) -> QSlider:
        slider = QSlider(Qt.Orientation.Horizontal)
        slider.setRange(0, STEPS)
        slider.setPageStep(STEPS // 20)
        slider.setMinimumWidth(60)
        slider.setAccessibleName(name)
        return slider
