"""The picture of a legend that stands apart from its charts, by pyqtgraph."""

import pyqtgraph as pg
from PySide6.QtCore import Qt

from app.ui.line_plot import line_options, wear_legend
from app.ui.palette import Colours


class LegendPlot(pg.GraphicsView):
    """Lines that are in no chart, with their names."""

    def __init__(self) -> None:
        super().__init__()
        self._colours: Colours | None = None
        self._lines: list[tuple[pg.PlotDataItem, int]] = []
        self._legend = pg.LegendItem(frame=False, horSpacing=6, labelTextSize="")
        self._legend.layout.setContentsMargins(2, 0, 0, 0)
        self.scene().addItem(self._legend)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def show_names(self, names: tuple[tuple[str, int], ...], columns: int) -> None:
        """Names and the numbers of their styles, so many side by side."""
        self._legend.clear()
        self._lines = []
        for name, style in names:
            line = pg.PlotDataItem(antialias=True)
            self._lines.append((line, style))
            self._legend.addItem(line, name)
        self._legend.setColumnCount(max(columns, 1))
        self._wear()

    def set_columns(self, columns: int) -> None:
        """So many names side by side."""
        self._legend.setColumnCount(max(columns, 1))

    def dress(self, colours: Colours) -> None:
        """The colours of a theme."""
        self._colours = colours
        self.setBackground(colours.window)
        self._wear()

    def _wear(self) -> None:
        if self._colours is None:
            return
        for line, style in self._lines:
            line.setData([0.0], [0.0], **line_options(style, self._colours))
        wear_legend(self._legend, self._colours)
