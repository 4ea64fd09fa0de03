"""The Laboratory's curves: success against each fault of a field, time against its stars."""

from collections import Counter
from collections.abc import Callable, Sequence

from PySide6.QtCore import QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout

from kochab.lab.laboratory.comparison import REGISTRIES, ComparedPart
from kochab.lab.laboratory.curves import SWEEPS, Point, sweeps_of
from kochab.window.charts.chart import Chart, Legend
from kochab.window.charts.series import ChartAxis, Series
from kochab.window.widgets import Page, column

Height = Callable[[Point], float | None]
HEIGHTS: dict[ComparedPart, tuple[ChartAxis, Height]] = {
    ComparedPart.METHOD: (ChartAxis("success", "%", (0.0, 100.0)), lambda p: 100.0 * p.success),
    ComparedPart.DETECTOR: (
        ChartAxis("stars found", "%", (0.0, 100.0)),
        lambda p: None if p.found is None else 100.0 * p.found,
    ),
    ComparedPart.ATTITUDE: (ChartAxis("error", "arcsec"), lambda p: p.off_arcsec),
}
TIME = ChartAxis("time", "ms", log=True)
TIME_CHART = "time"
SHARES = ("false", "missing")  # sweeps whose values are shares
TITLES = {
    "noise_px": "Noise",
    "false": "False stars",
    "missing": "Missing stars",
    "stars": "Number of stars",
    "margin_px": "Error margin",
}
DRAW_EVERY_MS = 50
NARROW, WIDE, WIDE_PX = 2, 3, 1000  # columns, and from which width on there are more


class Plots(Page):
    """Charts over one legend; every method keeps its colour, dashes and marker."""

    def __init__(self, kind: ComparedPart) -> None:
        super().__init__()
        self.kind = kind
        self.points: dict[tuple[str, float, str], Point] = {}
        up, self._height = HEIGHTS[kind]
        self.charts = {name: Chart(TITLES[name], _across(name), up) for name in sweeps_of(kind)}
        self.time = Chart("Time", _across("stars"), TIME)
        self.legend = Legend()
        self._stale: dict[str, None] = {}  # charts to be drawn again, in their turn
        self._timer = QTimer(self, interval=DRAW_EVERY_MS)
        self._timer.timeout.connect(self._draw_next)
        self._grid = QGridLayout()
        self._grid.setSpacing(6)
        self._columns = 0
        self._arrange(NARROW)
        column(self._grid, self.legend, on=self, margins=(4, 4, 4, 4)).setStretch(0, 1)

    def _arrange(self, columns: int) -> None:
        if columns != self._columns:
            self._columns = columns
            for place, chart in enumerate((*self.charts.values(), self.time)):
                self._grid.addWidget(chart, place // columns, place % columns)

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._arrange(WIDE if event.size().width() > WIDE_PX else NARROW)
        super().resizeEvent(event)

    def begin(self, methods: Sequence[str]) -> None:
        self.points = {}
        self.legend.show_names(tuple((m, self._style(m)) for m in methods))
        self._stale = dict.fromkeys((*self.charts, TIME_CHART))
        self._timer.start()

    def add(self, point: Point) -> None:
        self.points[point.sweep, point.value, point.name] = point
        self._stale[point.sweep] = None
        if point.sweep == "stars":
            self._stale[TIME_CHART] = None
        if not self._timer.isActive():
            self._timer.start()

    @property
    def drawn(self) -> bool:
        return not self._stale

    def _draw_next(self) -> None:
        """Draw one chart at a time: several would hold up the event loop."""
        if not self._stale:
            self._timer.stop()
            return
        name = next(iter(self._stale))
        del self._stale[name]
        if name == TIME_CHART:
            self.time.show_series(self._series("stars", lambda p: 1e3 * p.median_s or None))
        else:
            self.charts[name].show_series(self._series(name, self._height))

    def wrong_answers(self) -> dict[str, int]:
        """Number of wrong answers by method, without the zeros."""
        counts = Counter(dict.fromkeys(REGISTRIES[self.kind], 0))
        for point in self.points.values():
            counts[point.name] += point.wrong
        return {method: count for method, count in counts.items() if count}

    def _series(self, sweep: str, height: Height) -> tuple[Series, ...]:
        times = 100.0 if sweep in SHARES else 1.0
        lines: dict[str, dict[float, float]] = {method: {} for method in REGISTRIES[self.kind]}
        for (of, value, method), point in self.points.items():
            if of == sweep and (up := height(point)) is not None:
                lines[method][times * value] = up
        drawn = {method: sorted(line.items()) for method, line in lines.items() if line}
        columns = {method: tuple(zip(*line, strict=True)) for method, line in drawn.items()}
        return tuple(Series(method, x, y, self._style(method)) for method, (x, y) in columns.items())

    def _style(self, method: str) -> int:
        return list(REGISTRIES[self.kind]).index(method)


def _across(name: str) -> ChartAxis:
    sweep = SWEEPS[name]
    share = name in SHARES
    unit, times = ("%", 100.0) if share else (sweep.unit, 1.0)
    low = min(sweep.values) if sweep.option else 0.0
    return ChartAxis(sweep.title, unit, (low, times * max(sweep.values)), log=sweep.option)
