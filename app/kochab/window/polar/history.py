"""The history of the night: every alignment, its error over time, and a report to save."""

import re
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice, QMarginsF, QSizeF, QUrl
from PySide6.QtGui import QImage, QPageLayout, QPageSize, QPainter, QPdfWriter, QTextDocument
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QPlainTextEdit

from kochab.core.errors import KochabError
from kochab.core.progress import Progress, Task
from kochab.frames.atomic_file import write_atomically
from kochab.polar.error import angle_in_words
from kochab.polar.report import Entry, History, report_html, write_report
from kochab.text.translation import tr, tr_n, tr_noop
from kochab.window.charts.chart import Chart
from kochab.window.charts.series import ChartAxis, Series
from kochab.window.dialogs import ask_save, save_task, tell
from kochab.window.services import Services
from kochab.window.widgets import Page, button, choice_box, column, label, row, show_text

DPI, MARGIN_MM, FINE = 150, 15.0, 2.0  # FINE: pixels of a drawing for one of the page
SVG = re.compile(r"<svg.*?</svg>", re.DOTALL)


def writing(path: Path, history: History) -> Task[Path]:
    """Write the web page and its JSON, or a PDF when the name ends so; takes 0.1 s, so in a job.

    Raises KochabError when the file cannot be written.
    """
    if path.suffix.lower() == ".pdf":
        return (yield from save_task(lambda: write_pdf_report(path, history), path))
    yield Progress("report", None, path.name)
    numbers = path.with_suffix(".json")
    if numbers.exists() and not path.exists():  # the dialog asked about the page alone
        raise KochabError("{name} already exists. Choose another name for the report.", name=numbers.name)
    write_report(path, history)
    return path


def write_pdf_report(path: Path, history: History) -> None:
    """The same page on paper, A4; OSError when the file cannot be written."""
    paper = QBuffer()  # QPdfWriter reports no error when a file cannot be written
    paper.open(QIODevice.OpenModeFlag.WriteOnly)
    writer = QPdfWriter(paper)
    writer.setResolution(DPI)
    writer.setPageSize(QPageSize(QPageSize.PageSizeId.A4))
    writer.setPageMargins(QMarginsF(MARGIN_MM, MARGIN_MM, MARGIN_MM, MARGIN_MM), QPageLayout.Unit.Millimeter)
    writer.setTitle(tr("Polar alignment"))
    document = page_document(history)
    document.documentLayout().setPaintDevice(writer)
    document.setPageSize(QSizeF(writer.width(), writer.height()))
    document.print_(writer)
    write_atomically(path, bytes(paper.data().data()))


def page_document(history: History) -> QTextDocument:
    """The report with its drawings as images, as QTextDocument has no SVG."""
    document = QTextDocument()
    html = report_html(history)
    for number, drawing in enumerate(SVG.findall(html)):
        name = f"plot{number}.png"
        picture = _drawn(drawing)
        document.addResource(QTextDocument.ResourceType.ImageResource.value, QUrl(name), picture)
        wide = round(picture.width() / FINE * DPI / 96.0)  # 96 CSS px to the inch
        html = html.replace(drawing, f'<p><img src="{name}" width="{wide}"></p>')
    # QTextDocument knows little of a table's style.
    html = html.replace("text-align:right;", "").replace("</td>", "&nbsp;&nbsp;</td>")
    document.setHtml(html)
    return document


def _drawn(drawing: str) -> QImage:
    renderer = QSvgRenderer(drawing.encode("utf-8"))
    image = QImage(renderer.defaultSize() * FINE, QImage.Format.Format_RGB32)
    image.fill(0xFFFFFF)
    painter = QPainter(image)
    renderer.render(painter)
    painter.end()
    return image


NOTHING = tr_noop("No alignment measured tonight.")
KINDS = tr_noop("Web page (*.html);;PDF (*.pdf)")


class HistoryPage(Page):
    """The alignments since the window opened, the newest in front."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.histories: list[History] = []
        self.which = choice_box(tr("Alignment"), ())
        self.which.currentIndexChanged.connect(self._show)
        self.save = button(tr("Save &report…"), self._ask, tip=tr("Numbers and plots, HTML or PDF"))
        self.summary = label(NOTHING, "muted", wrap=True)
        self.notes = label("", "", wrap=True)
        self.notes.setAccessibleDescription(tr("All that is known now"))
        time, error = ChartAxis("time", "min"), ChartAxis("error", "arcsec", log=True)
        self.chart = Chart(tr("Polar error over time"), time, error, legend=True)
        self.lines = QPlainTextEdit(readOnly=True, tabChangesFocus=True)
        self.lines.setAccessibleName(tr("Log of the alignment"))
        top = row((self.which, 1), self.save)
        column(top, self.summary, self.notes, (self.chart, 2), (self.lines, 3), on=self, margins=(12, 12, 12, 12))
        self._show()

    def note(self, text: str) -> None:
        """Show all that is known of the alignment under way; the room says the most urgent of it."""
        show_text(self.notes, text)

    @property
    def history(self) -> History | None:
        """The one in front."""
        index = self.which.currentIndex()
        return self.histories[index] if 0 <= index < len(self.histories) else None

    def keep(self, history: History) -> None:
        """Show a history that is new, or has grown."""
        at = next((i for i, known in enumerate(self.histories) if known is history), len(self.histories))
        if at == len(self.histories):
            self.histories.append(history)
            self.which.addItem(tr("Alignment {at}", at=at + 1))
        self.which.setCurrentIndex(at)
        self._show()

    def _show(self, _: int = 0) -> None:
        history = self.history
        self.save.setEnabled(history is not None)
        for part in (self.which, self.save, self.chart, self.lines):
            part.setVisible(history is not None)
        if history is None:
            self.summary.setText(tr(NOTHING))
            return
        entries = list(history.entries)  # the alignment may add to it meanwhile
        measured = [e for e in entries if e.kind == "measured"]
        self.summary.setText(_summary(measured))
        start = entries[0].time_utc if entries else None
        series = []
        for number, (name, kind) in enumerate(((tr("seen"), "live"), (tr("measured"), "measured"))):
            chosen = [e for e in entries if e.kind == kind]
            minutes = tuple((e.time_utc - start).total_seconds() / 60.0 for e in chosen if start)
            error = tuple(e.total_arcsec for e in chosen)
            sigma = tuple(e.sigma_total_arcsec for e in chosen) if kind == "measured" else ()
            series.append(Series(name, minutes, error, number, sigma))
        self.chart.show_series(tuple(s for s in series if s.x))
        self.lines.setPlainText("\n".join(_line(e) for e in entries if e.kind != "live"))

    def _ask(self) -> None:
        history = self.history
        assert history is not None, "the button is off without one"
        day = f"{history.entries[0].time_utc:%Y-%m-%d}" if history.entries else "alignment"
        folder = Path(self._services.settings.text("folder", str(Path.home())))
        path = ask_save(self.window(), folder / f"polar-{day}.html", tr(KINDS))
        if path is not None:
            self.write(path)

    def write(self, path: Path) -> None:
        """Write the report of the alignment in front; a PDF when the name ends so."""
        history = self.history
        assert history is not None, "the button is off without one"
        job = self._services.jobs.run(writing(path, history), "report")
        job.succeeded.connect(lambda p: self._services.say(tr("Wrote {name}", name=p.name)))
        job.failed.connect(lambda sentence: tell(self.window(), tr("Report"), sentence))


def _summary(measured: list[Entry]) -> str:
    if not measured:
        return tr(NOTHING)
    first, last = measured[0], measured[-1]
    time, angle, before = (
        f"{last.time_utc:%H:%M}",
        angle_in_words(last.total_arcsec),
        angle_in_words(first.total_arcsec),
    )
    if first is last:
        return tr("{time} UTC: {angle} from the pole, measured once.", time=time, angle=angle)
    return tr_n(
        "{time} UTC: {angle} from the pole, {before} at first, measured {n} time.",
        "{time} UTC: {angle} from the pole, {before} at first, measured {n} times.",
        len(measured),
        time=time,
        angle=angle,
        before=before,
    )


def _line(entry: Entry) -> str:
    sigma = angle_in_words(entry.sigma_total_arcsec)
    what = tr("Measured.") if entry.kind == "measured" else tr("Instruction:")
    moment, error = f"{entry.time_utc:%H:%M:%S}", angle_in_words(entry.total_arcsec)
    return f"{moment}  {error} ± {sigma}  {what} {entry.text}"
