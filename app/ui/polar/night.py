"""The history of the night: every alignment, its error over time, and a report to keep."""

from pathlib import Path

from PySide6.QtWidgets import QComboBox, QHBoxLayout, QPlainTextEdit, QVBoxLayout, QWidget

from app.polar.history import Entry, History
from app.ui.chart import Axis, Chart, Series
from app.ui.dialogs import ask_save, tell
from app.ui.palette import Colours
from app.ui.polar.keep_report import writing
from app.ui.polar.target import primes, typeset
from app.ui.services import Services
from app.ui.widgets import button, label

NOTHING = "Nothing was measured tonight yet."
KINDS = "Web page (*.html);;PDF (*.pdf)"


class NightPage(QWidget):
    """Alignments of this sitting, the newest in front."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.setObjectName("page")
        self._services = services
        self.histories: list[History] = []
        self.which = QComboBox()
        self.which.setAccessibleName("Alignment")
        self.which.currentIndexChanged.connect(self._show)
        self.save = button("Save the &report…", self._ask, tip="Numbers and plots, HTML or PDF")
        self.told = label(NOTHING, "muted", wrap=True)
        self.chart = Chart(
            "Error from the pole over time",
            Axis("time", "min"),
            Axis("error", "arcsec", log=True),
            legend=True,
        )
        self.lines = QPlainTextEdit()
        self.lines.setReadOnly(True)
        self.lines.setTabChangesFocus(True)
        self.lines.setAccessibleName("What happened")
        line = QHBoxLayout()
        line.addWidget(self.which, 1)
        line.addWidget(self.save)
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 12, 12, 12)
        column.addLayout(line)
        column.addWidget(self.told)
        column.addWidget(self.chart, 2)
        column.addWidget(self.lines, 3)
        column.addStretch(0)
        self._show()

    @property
    def history(self) -> History | None:
        """The one in front."""
        index = self.which.currentIndex()
        return self.histories[index] if 0 <= index < len(self.histories) else None

    def keep(self, history: History) -> None:
        """A history that is new, or has grown."""
        if not any(known is history for known in self.histories):
            self.histories.append(history)
            self.which.addItem(f"Alignment {len(self.histories)}")
        self.which.setCurrentIndex([known is history for known in self.histories].index(True))
        self._show()

    def wear(self, colours: Colours) -> None:
        """The theme's colours, for what is painted."""
        self.chart.wear(colours)

    def _show(self, _: int = 0) -> None:
        history = self.history
        self.save.setEnabled(history is not None)
        for part in (self.which, self.save, self.chart, self.lines):
            part.setVisible(history is not None)
        if history is None:
            self.told.setText(NOTHING)
            return
        entries = list(history.entries)  # the alignment may add to it meanwhile
        measured = [e for e in entries if e.kind == "measured"]
        self.told.setText(_summary(measured))
        start = entries[0].time_utc if entries else None
        series = []
        for number, (name, kind) in enumerate((("seen", "live"), ("measured", "measured"))):
            chosen = [e for e in entries if e.kind == kind]
            minutes = tuple((e.time_utc - start).total_seconds() / 60.0 for e in chosen if start)
            error = tuple(e.total_arcsec for e in chosen)
            sigma = tuple(e.sigma_total_arcsec for e in chosen) if kind == "measured" else ()
            series.append(Series(name, minutes, error, number, sigma))
        self.chart.show_series(tuple(s for s in series if s.x))
        self.lines.setPlainText("\n".join(_line(e) for e in entries if e.kind != "live"))

    # the report -------------------------------------------------------------------------------
    def _ask(self) -> None:
        history = self.history
        if history is None:
            return
        day = f"{history.entries[0].time_utc:%Y-%m-%d}" if history.entries else "alignment"
        folder = Path(self._services.settings.text("folder", str(Path.home())))
        path = ask_save(
            self.window(), folder / f"polar-{day}.html", KINDS, self._services.looks.is_night
        )
        if path is not None:
            self.write(path)

    def write(self, path: Path) -> None:
        """Write the report of the alignment in front; a PDF when the name ends so."""
        history = self.history
        assert history is not None, "the button is off without one"
        job = self._services.jobs.run(writing(path, history), "report")
        job.succeeded.connect(lambda p: self._services.say(f"Wrote {p.name}"))
        job.failed.connect(lambda sentence: tell(self.window(), "Report", sentence))


def _summary(measured: list[Entry]) -> str:
    if not measured:
        return NOTHING
    first, last = measured[0], measured[-1]
    told = f"{last.time_utc:%H:%M} UTC: {typeset(last.total_arcsec)} from the pole"
    if first is last:
        return f"{told}, measured once."
    return f"{told}, {typeset(first.total_arcsec)} at first; measured {len(measured)} times."


def _line(entry: Entry) -> str:
    sigma = typeset(entry.sigma_total_arcsec)
    what = "Measured." if entry.kind == "measured" else "Told:"
    moment, error = f"{entry.time_utc:%H:%M:%S}", typeset(entry.total_arcsec)
    return f"{moment}  {error} ± {sigma}  {what} {primes(entry.text)}"
