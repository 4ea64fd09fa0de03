"""What the Laboratory found: a table with a row for each method, detector or estimator, and their curves.

The curves show success against each fault of a field, and time against its stars.
"""

from collections import Counter
from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QGridLayout, QHeaderView, QTableWidget, QTableWidgetItem

from kochab.lab.laboratory.comparison import REGISTRIES, ComparedPart, Trial, in_words
from kochab.lab.laboratory.curves import SWEEPS, Point, sweeps_of
from kochab.text.angle_text import AngleStyle, angle_text, arcsec_text, false_alarm_text, milliseconds_text, radec_text
from kochab.text.translation import tr, tr_noop
from kochab.window.charts.chart import Chart, Legend
from kochab.window.charts.series import ChartAxis, Series
from kochab.window.widgets import Page, column

LAST = float("inf")
EVERY = {
    ComparedPart.METHOD: tr_noop("Results of every method"),
    ComparedPart.DETECTOR: tr_noop("Results of every detector"),
    ComparedPart.ATTITUDE: tr_noop("Results of every attitude"),
}
NOTHING = "–"


class TrialCell(QTableWidgetItem):
    """A cell: its text, the number it sorts by where it has one, and its tooltip if that is not the text."""

    def __init__(self, text: str, rank: float | None = None, tip: str = "") -> None:
        super().__init__(text)
        self.rank = rank
        self.setToolTip(tip or text)
        self.setFlags(Qt.ItemFlag.ItemIsSelectable | Qt.ItemFlag.ItemIsEnabled)

    def __lt__(self, other: QTableWidgetItem) -> bool:
        if isinstance(other, TrialCell) and self.rank is not None and other.rank is not None:
            return self.rank < other.rank
        return self.text() < other.text()


def columns_of(kind: ComparedPart) -> dict[str, Callable[[Trial], TrialCell]]:
    """The columns of a table of this kind, by title."""
    more: dict[str, Callable[[Trial], TrialCell]] = {}
    if kind is ComparedPart.DETECTOR:
        more = {tr("Found"): lambda t: _count(None if t.found is None else t.found.stars), tr("True"): _true}
    elif kind is ComparedPart.ATTITUDE:
        more = {tr("From the fit"): _from_fit}
    more |= {tr("Matches"): _matches, tr("Wrong"): lambda t: _count(t.wrong)}
    if kind is not ComparedPart.METHOD:
        more["RMS"] = _rms
    return {
        tr(kind.capitalize()): lambda t: TrialCell(in_words(t.name)),
        tr("Answer"): _answer,
        **more,
        tr("Time"): _time,
        tr("Sigma"): _sigma,
        tr("Reason"): lambda t: TrialCell(t.reason, None, t.advice),
        tr("Paper"): lambda t: TrialCell(t.paper),
    }


def _answer(t: Trial) -> TrialCell:
    """Right, wrong or none; the pointing where the truth is not known."""
    if t.ra_dec_deg is None:
        return TrialCell(tr("none"), 3.0, t.advice)
    where, off = radec_text(*t.ra_dec_deg, AngleStyle.SEXAGESIMAL), angle_text((t.off_arcsec or 0.0) / 3600.0)
    # Right answers first, then those without a known truth, then wrong ones, then none.
    texts = {
        True: (tr("right, {off} off", off=off), 0.0),
        None: (where, 1.0),
        False: (tr("WRONG, {off} off", off=off), 2.0),
    }
    odds = false_alarm_text(LAST if t.log10_false_alarm is None else t.log10_false_alarm)
    return TrialCell(*texts[t.right], "\n".join((where, tr("chance match: {odds}", odds=odds))))


def _matches(t: Trial) -> TrialCell:
    return TrialCell(f"{t.matches}" if t.answered else NOTHING, float(t.matches))


def _count(count: int | None) -> TrialCell:
    return TrialCell(NOTHING, LAST) if count is None else TrialCell(f"{count}", count)


def _true(t: Trial) -> TrialCell:
    found = t.found
    if found is None or found.true is None:
        return TrialCell(NOTHING, LAST, tr("Known for simulated fields only"))
    share = tr("{true} of {there}", true=found.true, there=found.there)
    tip = tr("{share} stars found", share=share)
    if found.error_px is not None:
        tip = tr("{share} stars found, positions {px:.2f} px off", share=share, px=found.error_px)
    # Most stars first.
    return TrialCell(share, -found.true, tip)


def _rms(t: Trial) -> TrialCell:
    if t.rms_px is None:
        return TrialCell(NOTHING, LAST)
    return TrialCell(tr("{px:.2f} px", px=t.rms_px), t.rms_px, tr("Residual of the matched stars"))


def _from_fit(t: Trial) -> TrialCell:
    if t.from_fit_arcsec is None:
        return TrialCell(NOTHING, 0.0 if t.answered else LAST)
    away, roll = t.from_fit_arcsec
    sky, turn = arcsec_text(away), arcsec_text(roll)
    return TrialCell(sky, away, tr("Difference from the fit: {sky} on the sky, {roll} in roll", sky=sky, roll=turn))


def _time(t: Trial) -> TrialCell:
    spent = processor_time_text(t.seconds)
    tables = processor_time_text(t.tables_s)
    tip = tr("{spent} processor time", spent=spent)
    if t.tables_s > 0:
        tip = tr("{spent} processor time; building its tables took {tables}, once", spent=spent, tables=tables)
    return TrialCell(spent, t.seconds, tip)


def _sigma(t: Trial) -> TrialCell:
    if t.sigma_arcsec is None:
        return TrialCell(NOTHING, LAST, tr("Too few matches") if t.answered else "")
    x, y, roll = (arcsec_text(value) for value in t.sigma_arcsec)
    most = max(t.sigma_arcsec[:2])
    tip = tr("From the matches’ residuals: {x} × {y}, roll {roll}", x=x, y=y, roll=roll)
    return TrialCell(arcsec_text(most), most, tip)


def processor_time_text(seconds: float) -> str:
    """A processor time, in microseconds below 1 ms."""
    return tr("{us:.0f} µs", us=1e6 * seconds) if 0 < seconds < 1e-3 else milliseconds_text(1e3 * seconds)


class TrialTable(QTableWidget):
    """Shows :class:`kochab.lab.laboratory.comparison.Trial` as they come."""

    def __init__(self) -> None:
        super().__init__()
        self.trials: list[Trial] = []
        self.verticalHeader().hide()
        self.setAlternatingRowColors(True)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setTabKeyNavigation(False)
        self.setWordWrap(False)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        self.horizontalHeader().setStretchLastSection(True)
        self.begin(ComparedPart.METHOD)

    def begin(self, kind: ComparedPart) -> None:
        self.trials = []
        self._columns = columns_of(kind)
        self.setSortingEnabled(False)
        self.setRowCount(0)
        self.setColumnCount(len(self._columns))
        self.setHorizontalHeaderLabels(list(self._columns))
        self.horizontalHeader().setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        self.setAccessibleName(tr(EVERY[kind]))

    def add(self, trial: Trial) -> None:
        self.trials.append(trial)
        # A sorted table would move the new row while its cells are set.
        self.setSortingEnabled(False)
        row = self.rowCount()
        self.insertRow(row)
        for place, say in enumerate(self._columns.values()):
            self.setItem(row, place, say(trial))
        self.setSortingEnabled(True)  # by no column until one is clicked
        self.resizeColumnsToContents()


# -- The curves --

Height = Callable[[Point], float | None]
HEIGHTS: dict[ComparedPart, tuple[ChartAxis, Height]] = {
    ComparedPart.METHOD: (ChartAxis(tr_noop("success"), "%", (0.0, 100.0)), lambda p: 100.0 * p.success),
    ComparedPart.DETECTOR: (
        ChartAxis(tr_noop("stars found"), "%", (0.0, 100.0)),
        lambda p: None if p.found is None else 100.0 * p.found,
    ),
    ComparedPart.ATTITUDE: (ChartAxis(tr_noop("error"), tr_noop("arcsec")), lambda p: p.off_arcsec),
}
TIME = ChartAxis(tr_noop("time"), tr_noop("ms"), log=True)
TIME_CHART = "time"
SHARES = ("false", "missing")  # sweeps whose values are shares
TITLES = {
    "noise_px": tr_noop("Noise"),
    "false": tr_noop("False stars"),
    "missing": tr_noop("Missing stars"),
    "stars": tr_noop("Number of stars"),
    "margin_px": tr_noop("Error margin"),
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
        self.charts = {name: Chart(tr(TITLES[name]), _across(name), up) for name in sweeps_of(kind)}
        self.time = Chart(tr("Time"), _across("stars"), TIME)
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
        self.legend.show_names(tuple((in_words(m), self._style(m)) for m in methods))
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
            # A logarithmic axis has no zero.
            self.time.show_series(self._series("stars", lambda p: 1e3 * p.median_s or None))
        else:
            self.charts[name].show_series(self._series(name, self._height))

    def wrong_answers(self) -> dict[str, int]:
        """Number of wrong answers by method, without the zeros."""
        # In the order of the registry.
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
        return tuple(Series(in_words(method), x, y, self._style(method)) for method, (x, y) in columns.items())

    def _style(self, method: str) -> int:
        return list(REGISTRIES[self.kind]).index(method)


def _across(name: str) -> ChartAxis:
    sweep = SWEEPS[name]
    share = name in SHARES
    unit, times = ("%", 100.0) if share else (sweep.unit, 1.0)
    low = min(sweep.values) if sweep.option else 0.0
    return ChartAxis(sweep.title, unit, (low, times * max(sweep.values)), log=sweep.option)
