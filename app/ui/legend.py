"""The names of the lines of several charts, each with its line, wrapped to the width."""

from typing import TYPE_CHECKING, cast

from PySide6.QtCore import QSize
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QSizePolicy

from app.ui.plot_place import PlotPlace

if TYPE_CHECKING:
    from app.ui.legend_plot import LegendPlot

SAMPLE_PX = 48  # a line with its marker, and the gaps beside it
AROUND_PX = 8  # what the library leaves above and below a name


class Legend(PlotPlace):
    """Names with their lines."""

    def __init__(self) -> None:
        super().__init__("Legend")
        self._names: tuple[tuple[str, int], ...] = ()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def show_names(self, names: tuple[tuple[str, int], ...]) -> None:
        """Names and the numbers of their styles."""
        if names == self._names:
            return
        self._names = names
        self.describe(", ".join(name for name, _ in names))
        self._fit()
        self.refill()

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._fit()
        super().resizeEvent(event)

    def sizeHint(self) -> QSize:
        return QSize(300, self._rows() * self._line_px())

    # the plot ---------------------------------------------------------------------------------
    def make_plot(self) -> "LegendPlot":
        from app.ui.legend_plot import LegendPlot

        return LegendPlot()

    def fill_plot(self) -> None:
        self._items.show_names(self._names, self._columns())

    def dress_plot(self) -> None:
        self._items.dress(self.colours)

    @property
    def _items(self) -> "LegendPlot":
        return cast("LegendPlot", self.plot)

    def _fit(self) -> None:
        """As high as the lines of names are at this width."""
        height = self._rows() * self._line_px()
        if self.height() != height:
            self.setFixedHeight(height)
        if self.plot is not None:
            self._items.set_columns(self._columns())

    def _columns(self) -> int:
        """How many names stand side by side."""
        metrics = self.fontMetrics()
        widest = max((metrics.horizontalAdvance(name) for name, _ in self._names), default=0)
        return max(1, min(len(self._names), self.width() // (widest + SAMPLE_PX)))

    def _rows(self) -> int:
        return -(-len(self._names) // self._columns())

    def _line_px(self) -> int:
        return self.fontMetrics().height() + AROUND_PX
