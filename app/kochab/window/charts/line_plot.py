"""Charts and legends drawn by pyqtgraph; loading this file loads that library."""

from math import isfinite, log10
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPoint, Qt, Signal
from PySide6.QtGui import QColor, QContextMenuEvent, QFont, QFontMetrics, QKeyEvent
from PySide6.QtWidgets import QApplication

from kochab.core.arrays import Floats
from kochab.text.translation import number
from kochab.window.charts.series import MARKER_PX, WIDTH_PX, ChartAxis, Series, line_style
from kochab.window.themes import Colours, theme_colours

STEP = 0.1  # of what is seen, for an arrow key
ZOOM = 0.8
PADDING = 0.04, 0.08  # across and up: markers and numbers at the ends of a span are whole
GRID_ALPHA, BEHIND_ALPHA = 60, 190
BELOW = -10.0  # the grid lies under the lines
MARGINS_PX = (6, 8, 12, 7)  # the library lets the titles of axes hang over by five
PANS = {
    Qt.Key.Key_Left: (-STEP, 0.0),
    Qt.Key.Key_Right: (STEP, 0.0),
    Qt.Key.Key_Down: (0.0, -STEP),
    Qt.Key.Key_Up: (0.0, STEP),
}
ZOOMS = {Qt.Key.Key_Plus: True, Qt.Key.Key_Equal: True, Qt.Key.Key_Minus: False}
HELD = ~(Qt.KeyboardModifier.ShiftModifier | Qt.KeyboardModifier.KeypadModifier)


class Scale(pg.AxisItem):
    """An axis whose decades are divided at 2 and 5."""

    def logTickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        shown = [10.0**value * scale for value in values]
        # By the first digit in scientific notation.
        return [number(v, "g") if f"{v:e}"[0] in "125" else "" for v in shown]


class LinePlot(pg.PlotWidget):
    """Zooms with the wheel, + and −; pans by dragging and with the arrows; Home shows all."""

    menu_wanted = Signal(QPoint)  # the place on the screen

    def __init__(self, across: ChartAxis, up: ChartAxis, legend: bool = False) -> None:
        sides = {"bottom": across, "left": up}
        drawn = {side: Scale(side) for side in sides}
        super().__init__(axisItems=drawn, enableMenu=False)  # its menu is not red at night
        self._axes = sides
        self._lines: dict[str, pg.PlotDataItem] = {}
        self._bars: dict[str, pg.ErrorBarItem] = {}
        self._shown: dict[str, Series] = {}
        item = self.getPlotItem()
        item.hideButtons()
        item.layout.setContentsMargins(*MARGINS_PX)
        item.setLogMode(across.log, up.log)
        item.showGrid(x=True, y=True)
        for side in self._axes:
            item.getAxis(side).enableAutoSIPrefix(False)
            item.getAxis(side).setZValue(BELOW)
        self._legend = item.addLegend(offset=(-8, 8), labelTextSize="") if legend else None
        self.show_all()

    def show_series(self, series: tuple[Series, ...]) -> None:
        """Draw these lines and no others; a line that has not changed costs nothing."""
        for name in self._lines.keys() - {one.name for one in series}:
            self._drop(name)
        for one in series:
            if self._shown.get(one.name) != one:
                self._shown[one.name] = one
                self._draw(one)

    def show_all(self) -> None:
        """The spans of the axes; all of the lines where an axis has none."""
        box = self.getViewBox()
        for side, axis in ((pg.ViewBox.XAxis, self._axes["bottom"]), (pg.ViewBox.YAxis, self._axes["left"])):
            if axis.span is None:
                box.enableAutoRange(axis=side)
                continue
            low, high = (log10(v) if axis.log else v for v in axis.span)
            set_range = box.setXRange if side == pg.ViewBox.XAxis else box.setYRange
            set_range(low, high, padding=PADDING[side])

    def zoom(self, nearer: bool) -> None:
        share = ZOOM if nearer else 1.0 / ZOOM
        self.getViewBox().scaleBy((share, share))

    def set_colours(self, colours: Colours) -> None:
        font = QFont(QApplication.font())
        self.setBackground(colours.surface)
        for side, axis in self._axes.items():
            drawn = self.getAxis(side)
            drawn.setStyle(tickFont=font, hideOverlappingLabels=QFontMetrics(font).height())
            drawn.label.setFont(font)
            drawn.setPen(colours.line)
            drawn.setTickPen(colours.faint)
            drawn.setTextPen(colours.muted)
            drawn.setLabel(axis.label, color=colours.text)
            drawn.setGrid(GRID_ALPHA)
        for one in self._shown.values():
            self._draw(one)
        if self._legend is not None:
            colour_legend(self._legend)

    def _draw(self, one: Series) -> None:
        if one.name not in self._lines:
            self._add(one)
        x, y = np.asarray(one.x, dtype=np.float64), np.asarray(one.y, dtype=np.float64)
        tips = [self._tip(one, *point) for point in zip(one.x, one.y, strict=True)]
        if not np.isfinite(y).any():
            x, y, tips = np.zeros(0), np.zeros(0), []
        self._lines[one.name].setData(x, y, data=tips, **line_options(one.style))
        if one.sigma:
            self._draw_bars(one, x, y)

    def _add(self, one: Series) -> None:
        line = pg.PlotDataItem(connect="finite", antialias=True)
        line.scatter.opts.update(hoverable=True, tip=lambda x, y, data: data)
        self.addItem(line)
        self._lines[one.name] = line
        if self._legend is not None:
            self._legend.addItem(line, one.name)
            colour_legend(self._legend)
        if one.sigma:
            self._bars[one.name] = bars = pg.ErrorBarItem()
            self.addItem(bars)

    def _draw_bars(self, one: Series, x: Floats, y: Floats) -> None:
        """Place the bars; the library does not do so on logarithmic axes."""
        sigma = np.asarray(one.sigma[: len(y)], dtype=np.float64)
        ends = np.stack([y - sigma, y, y + sigma])
        if self._axes["left"].log:
            # A bar that reaches zero or less, which has no logarithm, ends two decades below its point.
            ends = np.log10(np.maximum(ends, y / 100.0))
        across = np.log10(x) if self._axes["bottom"].log else x
        low, middle, high = ends
        pen = pg.mkPen(line_style(one.style, theme_colours()).colour)
        self._bars[one.name].setData(x=across, y=middle, bottom=middle - low, top=high - middle, pen=pen)

    def _drop(self, name: str) -> None:
        line = self._lines.pop(name)
        if self._legend is not None:
            self._legend.removeItem(line)
        self.removeItem(line)
        if name in self._bars:
            self.removeItem(self._bars.pop(name))
        del self._shown[name]

    def _tip(self, one: Series, x: float, y: float) -> str:
        if not isfinite(y):
            return ""
        return f"{one.name}: {self._axes['bottom'].text(x)}, {self._axes['left'].text(y)}"

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key, box = Qt.Key(event.key()), self.getViewBox()
        if event.modifiers() & HELD:
            event.ignore()
        elif key in PANS:
            (left, right), (low, high) = box.viewRange()
            across, up = PANS[key]
            box.translateBy(x=across * (right - left), y=up * (high - low))
        elif key in ZOOMS:
            self.zoom(nearer=ZOOMS[key])
        elif key == Qt.Key.Key_Home:
            self.show_all()
        else:
            event.ignore()

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        self.menu_wanted.emit(event.globalPos())
        event.accept()


def line_options(style: int) -> dict[str, Any]:
    """The library's options for line number ``style`` in the present theme."""
    look = line_style(style, theme_colours())
    return {
        "pen": pg.mkPen(look.colour, width=WIDTH_PX, dash=list(look.dashes) or None),
        "symbol": look.marker,
        "symbolSize": MARKER_PX,
        "symbolPen": None,
        "symbolBrush": look.colour,
    }


def colour_legend(legend: pg.LegendItem) -> None:
    """Give the names of ``legend`` the colours and font of the present theme."""
    colours = theme_colours()
    point = QApplication.font().pointSizeF()
    for _, text in legend.items:
        text.setText(text.text, color=colours.text, size=f"{point:.1f}pt")
    ground = QColor(colours.surface)
    ground.setAlpha(BEHIND_ALPHA)
    legend.setBrush(ground)
    legend.updateSize()


class LegendPlot(pg.GraphicsView):
    """A legend that stands apart from its charts."""

    def __init__(self) -> None:
        super().__init__()
        self._lines: list[tuple[pg.PlotDataItem, int]] = []
        self._legend = pg.LegendItem(frame=False, horSpacing=6, labelTextSize="")
        self._legend.layout.setContentsMargins(2, 0, 0, 0)
        self.scene().addItem(self._legend)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def show_names(self, names: tuple[tuple[str, int], ...], columns: int) -> None:
        """Names and the numbers of their styles, in columns."""
        self._legend.clear()
        self._lines = []
        for name, style in names:
            line = pg.PlotDataItem(antialias=True)
            self._lines.append((line, style))
            self._legend.addItem(line, name)
        self._legend.setColumnCount(columns)
        self.set_colours(theme_colours())

    def set_colours(self, colours: Colours) -> None:
        self.setBackground(colours.window)
        for line, style in self._lines:
            line.setData([0.0], [0.0], **line_options(style))
        colour_legend(self._legend)
