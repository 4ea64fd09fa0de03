"""The Laboratory's curves: success against what is wrong with a field, time against its stars."""

from collections.abc import Callable

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout, QVBoxLayout, QWidget

from app.identify import IDENTIFIERS
from app.ui.chart import Axis, Chart, Series
from app.ui.legend import Legend
from app.ui.palette import Colours
from app.workflows.laboratory_curves import SWEEPS, Point

SUCCESS = Axis("success", "%", (0.0, 100.0))
TIME = Axis("time", "ms", log=True)
SHARES = ("false", "missing")  # sweeps whose values are shares
TITLES = {
    "noise_px": "Noise", "false": "False stars", "missing": "Missing stars",
    "stars": "Number of stars", "margin_px": "Error margin",
}  # fmt: skip
NARROW, WIDE, WIDE_PX = 2, 3, 1000  # columns, and from which width on there are more


class Plots(QWidget):
    """Six charts over one legend; every method keeps its colour, dashes and marker."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("page")
        self.points: dict[tuple[str, float, str], Point] = {}
        self.charts = {name: Chart(TITLES[name], _across(name), SUCCESS) for name in SWEEPS}
        self.time = Chart("Time", _across("stars"), TIME)
        self.legend = Legend()
        self._grid = QGridLayout()
        self._grid.setSpacing(6)
        self._columns = 0
        self._arrange(NARROW)
        column = QVBoxLayout(self)
        column.setContentsMargins(4, 4, 4, 4)
        column.addLayout(self._grid, 1)
        column.addWidget(self.legend)

    def _arrange(self, columns: int) -> None:
        if columns != self._columns:
            self._columns = columns
            for place, chart in enumerate((*self.charts.values(), self.time)):
                self._grid.addWidget(chart, place // columns, place % columns)

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._arrange(WIDE if event.size().width() > WIDE_PX else NARROW)
        super().resizeEvent(event)

    def clear(self) -> None:
        """No curves."""
        self.points = {}
        self.draw()

    def add(self, point: Point) -> None:
        """Keep a point; :meth:`draw` shows it."""
        self.points[point.sweep, point.value, point.method] = point

    def draw(self) -> None:
        """Show every point there is."""
        for name, chart in self.charts.items():
            chart.show_series(self._series(name, lambda p: 100.0 * p.success))
        self.time.show_series(self._series("stars", lambda p: 1e3 * p.median_s))
        methods = {point.method for point in self.points.values()}
        self.legend.show_names(tuple((m, _style(m)) for m in IDENTIFIERS if m in methods))

    def wrong_answers(self) -> dict[str, int]:
        """How many answers of each method were wrong, for those that gave any."""
        counts = {
            method: sum(p.wrong for p in self.points.values() if p.method == method)
            for method in IDENTIFIERS
        }
        return {method: count for method, count in counts.items() if count}

    def dress(self, colours: Colours) -> None:
        """Use the colours of another theme."""
        for plot in (*self.charts.values(), self.time, self.legend):
            plot.wear(colours)

    def _series(self, sweep: str, height: Callable[[Point], float]) -> tuple[Series, ...]:
        made = []
        for method in IDENTIFIERS:
            mine = [p for key, p in self.points.items() if key[0] == sweep and key[2] == method]
            mine.sort(key=lambda p: p.value)
            if mine:
                x = tuple(p.value * (100.0 if sweep in SHARES else 1.0) for p in mine)
                made.append(Series(method, x, tuple(map(height, mine)), _style(method)))
        return tuple(made)


def _style(method: str) -> int:
    return list(IDENTIFIERS).index(method)


def _across(name: str) -> Axis:
    sweep = SWEEPS[name]
    share = name in SHARES
    unit, times = ("%", 100.0) if share else (sweep.unit, 1.0)
    low = min(sweep.values) if sweep.option else 0.0
    return Axis(sweep.title, unit, (low, times * max(sweep.values)), log=sweep.option)
