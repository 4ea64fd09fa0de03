"""A plot without axes that is only looked at, by pyqtgraph."""

import pyqtgraph as pg
from PySide6.QtCore import Qt


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
