"""The stretch over the frame: histogram, automatic stretch, black and brightness sliders."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSignalBlocker, QSize, Qt, Signal
from PySide6.QtWidgets import QFrame, QLabel, QSizePolicy, QSlider

from kochab.text.translation import tr
from kochab.window.charts.plot_area import PlotArea
from kochab.window.image.frame_image import FrameImage, ScreenStretch
from kochab.window.image.screen_image import RenderedFrame
from kochab.window.widgets import grid, named, row, switch

if TYPE_CHECKING:
    from kochab.window.charts.histogram_plot import HistogramPlot


AXIS_POWER = 3.0  # the axis is the cube root of the value: the sky is near black, stars are far up
CURVE_POINTS = 160


class Histogram(PlotArea):
    """Pixel values on a logarithmic scale, with the stretch over them."""

    after_ms = 600  # it comes with the first frame, which goes first

    def __init__(self, title: str = "") -> None:
        super().__init__(title or tr("Histogram of pixel values"))
        self.heights: NDArray[np.float64] = np.zeros(0)
        self._stretch: ScreenStretch | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setMinimumWidth(60)

    def sizeHint(self) -> QSize:
        return QSize(240, 56)

    def set_counts(self, counts: NDArray[np.float64]) -> None:
        """Counts (N,) over the cube-root axis."""
        top = np.log1p(counts)
        self.heights = top / max(float(top.max()), 1e-9) if len(top) else top
        self.refill()

    def set_stretch(self, stretch: ScreenStretch) -> None:
        self._stretch = stretch
        self.refill()

    def make_plot(self) -> "HistogramPlot":
        from kochab.window.charts.histogram_plot import HistogramPlot

        return HistogramPlot()

    def fill_plot(self) -> None:
        self.plot.show_heights(self.heights)
        if self._stretch is not None and len(self.heights):
            across = np.linspace(0.0, 1.0, CURVE_POINTS)
            curve = self._stretch.apply(across**AXIS_POWER)
            self.plot.show_stretch(across, curve, self._stretch.black ** (1.0 / AXIS_POWER))


STEPS = 1000
DECADES = 4.0  # brightness runs from linear to four decades of lift


class StretchStrip(QFrame):
    """Emits the stretch to use; linear while automatic is off and no slider was moved."""

    changed = Signal(object)  # Stretch

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("card")
        self._automatic = ScreenStretch()
        self.histogram = Histogram()
        self.auto = switch(tr("Auto stretch"), tr("Stretch the image so that faint stars show (T)"))
        self.auto.setChecked(True)
        self.black, self.bright = self._slider(tr("Black point")), self._slider(tr("Midtones"))
        self.auto.toggled.connect(self._auto_toggled)
        for slider in (self.black, self.bright):
            slider.valueChanged.connect(self._moved)
        black, bright = QLabel(tr("Blac&k")), QLabel(tr("Midt&ones"))
        black.setBuddy(self.black)
        bright.setBuddy(self.bright)
        sliders = grid((black, self.black), (bright, self.bright), across=8, down=2)
        row((self.histogram, 2), self.auto, (sliders, 1), on=self, spacing=14, margins=(10, 6, 10, 6))
        self.setEnabled(False)

    def show_picture(self, picture: FrameImage | RenderedFrame) -> None:
        self.follow(picture)
        self.setEnabled(True)
        self.changed.emit(self.stretch)

    def follow(self, picture: FrameImage | RenderedFrame) -> None:
        """Show how a frame of a stream is stretched, and tell nobody.

        A slider that is moved begins there: where an earlier frame had its black point, a brighter sky is black.
        """
        self._automatic = picture.auto
        self.histogram.set_counts(picture.histogram)
        if self.auto.isChecked():
            self._place(picture.auto)
        self.histogram.set_stretch(self.stretch)

    def forget_picture(self) -> None:
        self.histogram.set_counts(np.zeros(0))
        self.setEnabled(False)

    @property
    def stretch(self) -> ScreenStretch:
        """That of the sliders, or exactly the automatic one when that is on."""
        if self.auto.isChecked():
            return self._automatic
        black = (self.black.value() / STEPS) ** AXIS_POWER
        return ScreenStretch(min(black, 0.999), 0.5 * 10 ** (-DECADES * self.bright.value() / STEPS))

    def _auto_toggled(self, on: bool) -> None:
        self._place(self._automatic if on else ScreenStretch())
        self._tell()

    def _moved(self) -> None:
        # Its signal would move the sliders.
        with QSignalBlocker(self.auto):
            self.auto.setChecked(False)
        self._tell()

    def _place(self, stretch: ScreenStretch) -> None:
        lift = -math.log10(max(stretch.mid, 1e-9) / 0.5) / DECADES
        with QSignalBlocker(self.black), QSignalBlocker(self.bright):
            self.black.setValue(round(stretch.black ** (1 / AXIS_POWER) * STEPS))
            self.bright.setValue(round(min(max(lift, 0.0), 1.0) * STEPS))

    def _tell(self) -> None:
        self.histogram.set_stretch(self.stretch)
        self.changed.emit(self.stretch)

    def _slider(self, name: str) -> QSlider:
        slider = named(QSlider(Qt.Orientation.Horizontal), name)
        slider.setRange(0, STEPS)
        slider.setPageStep(STEPS // 20)
        slider.setMinimumWidth(60)
        return slider
