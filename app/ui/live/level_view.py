"""The histogram beside the exposure: how far the camera's pixels are filled."""

from typing import TYPE_CHECKING

from app.ui.histogram import AXIS_POWER, Histogram
from app.ui.live.brighten import Levels

if TYPE_CHECKING:
    from app.ui.histogram_plot import HistogramPlot

MARKS = (0.01, 0.1, 0.5)  # shares of full that are marked


class LevelView(Histogram):
    """Counts over the whole of what the camera can hold, full at the right edge."""

    def __init__(self) -> None:
        super().__init__("Histogram of the camera, empty to full")
        self._levels = Levels()

    def show_levels(self, levels: Levels) -> None:
        """Another frame's."""
        if levels is not self._levels:
            self._levels = levels
            self.set_counts(levels.counts)

    def make_plot(self) -> "HistogramPlot":
        plot = super().make_plot()
        plot.mark_shares(tuple(share ** (1 / AXIS_POWER) for share in MARKS))
        return plot

    def fill_plot(self) -> None:
        super().fill_plot()
        self.bars.mark_full(self._levels.clipped > 0)
