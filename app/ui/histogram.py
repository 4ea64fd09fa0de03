"""A small histogram of pixel values, with the stretch over it."""

from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSize
from PySide6.QtWidgets import QSizePolicy

from app.ui.plot_place import PlotPlace
from app.ui.stretch import Stretch

if TYPE_CHECKING:
    from app.ui.histogram_plot import HistogramPlot

AXIS_POWER = 3.0  # the axis is the cube root of the value: the sky is near black, stars are far up
CURVE_POINTS = 160


class Histogram(PlotPlace):
    """Counts on a logarithmic height; drawn, not asked anything."""

    after_ms = 600  # it is seen with the person's first frame, which goes first

    def __init__(self, title: str = "Histogram of pixel values") -> None:
        super().__init__(title)
        self.heights: NDArray[np.float64] = np.zeros(0)
        self._stretch: Stretch | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setMinimumWidth(60)

    def sizeHint(self) -> QSize:
        return QSize(240, 56)

    def set_counts(self, counts: NDArray[np.float64]) -> None:
        """Counts (N,) over the cube-root axis."""
        top = np.log1p(counts)
        self.heights = top / max(float(top.max()), 1e-9) if len(top) else top
        self.refill()

    def set_stretch(self, stretch: Stretch) -> None:
        """The curve to draw."""
        self._stretch = stretch
        self.refill()

    # the plot ---------------------------------------------------------------------------------
    def make_plot(self) -> "HistogramPlot":
        from app.ui.histogram_plot import HistogramPlot

        return HistogramPlot()

    def fill_plot(self) -> None:
        self.bars.show_heights(self.heights)
        if self._stretch is not None and len(self.heights):
            across = np.linspace(0.0, 1.0, CURVE_POINTS)
            curve = self._stretch.apply(across**AXIS_POWER)
            self.bars.show_stretch(across, curve, self._stretch.black ** (1.0 / AXIS_POWER))

    def dress_plot(self) -> None:
        self.bars.dress(self.colours)

    @property
    def bars(self) -> "HistogramPlot":
        """The plot, once it is made."""
        return cast("HistogramPlot", self.plot)
