"""Histograms and other plots without axes, drawn by pyqtgraph."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor

from kochab.core.arrays import Floats
from kochab.window.themes import Colours


class StillPlot(pg.PlotWidget):
    """It takes neither the mouse nor the focus: all of it is always seen."""

    def __init__(self) -> None:
        super().__init__(enableMenu=False)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        item = self.getPlotItem()
        item.hideButtons()
        item.hideAxis("bottom")
        item.hideAxis("left")
        self.getViewBox().setMouseEnabled(x=False, y=False)


SHADE = 120  # alpha of the counts
EDGE = 0.05  # of the height stays free above and below


class HistogramPlot(StillPlot):
    """Over 0 to 1 both ways, with dotted lines at ``shares`` of the width."""

    def __init__(self, shares: tuple[float, ...] = ()) -> None:
        super().__init__()
        self.setObjectName("histogram")
        self.getViewBox().setRange(xRange=(0.0, 1.0), yRange=(0.0, 1.0), padding=EDGE / 2.0)
        self.counts = pg.PlotCurveItem(fillLevel=0.0, pen=None, antialias=True)
        self.curve = pg.PlotCurveItem(antialias=True)
        self.black = pg.InfiniteLine(pos=0.0)
        self.shares = [pg.InfiniteLine(pos=share) for share in shares]
        self.full = pg.InfiniteLine(pos=1.0)
        for part in (self.counts, self.curve, self.black, self.full, *self.shares):
            self.addItem(part)
        self.black.setVisible(False)
        self.full.setVisible(False)

    def show_heights(self, heights: Floats) -> None:
        """Heights (N,), 0 to 1, from the left to the right."""
        self.counts.setData(np.linspace(0.0, 1.0, len(heights)), heights)

    def show_stretch(self, across: Floats, curve: Floats, black: float) -> None:
        """A curve (N,) and the black point, 0 to 1."""
        self.curve.setData(across, curve)
        self.black.setValue(black)
        self.black.setVisible(True)

    def mark_full(self, on: bool) -> None:
        self.full.setVisible(on)

    def set_colours(self, colours: Colours) -> None:
        shade = QColor(colours.muted)
        shade.setAlpha(SHADE)
        self.setBackground(colours.surface)
        self.counts.setBrush(shade)
        self.curve.setPen(pg.mkPen(colours.accent, width=1.6))
        self.black.setPen(pg.mkPen(colours.text, style=Qt.PenStyle.DashLine))
        self.full.setPen(pg.mkPen(colours.bad, width=3.0))
        for line in self.shares:
            line.setPen(pg.mkPen(colours.muted, style=Qt.PenStyle.DotLine))
