"""Charts and their legend, and how they are saved; the plotting library is loaded when one is shown."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QBuffer, QByteArray, QIODevice, QPoint, QSize, Qt
from PySide6.QtGui import QImage, QImageWriter, QResizeEvent
from PySide6.QtWidgets import QMenu, QSizePolicy, QWidget

from kochab.core.progress import Task
from kochab.frames.atomic_file import write_atomically
from kochab.frames.export import csv_text
from kochab.text.translation import tr
from kochab.window.charts.plot_area import PlotArea
from kochab.window.charts.series import ChartAxis, Series
from kochab.window.dialogs import ask_save, save_task, tell
from kochab.window.job import Job

if TYPE_CHECKING:
    from kochab.window.charts.line_plot import LegendPlot, LinePlot


SAMPLE_PX = 48  # a line with its marker, and the gaps beside it
AROUND_PX = 8  # what the library leaves above and below a name


class Legend(PlotArea):
    """The names of the lines of several charts, wrapped to the width."""

    def __init__(self) -> None:
        super().__init__(tr("Legend"))
        self._names: tuple[tuple[str, int], ...] = ()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def show_names(self, names: tuple[tuple[str, int], ...]) -> None:
        self._names = names
        self.describe(", ".join(name for name, _ in names))
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._fit()
        super().resizeEvent(event)

    def sizeHint(self) -> QSize:
        rows = math.ceil(len(self._names) / self._columns())
        return QSize(300, rows * (self.fontMetrics().height() + AROUND_PX))

    def make_plot(self) -> "LegendPlot":
        from kochab.window.charts.line_plot import LegendPlot

        return LegendPlot()

    def fill_plot(self) -> None:
        self.plot.show_names(self._names, self._columns())

    def _fit(self) -> None:
        self.setFixedHeight(self.sizeHint().height())
        self.refill()

    def _columns(self) -> int:
        """How many names fit side by side."""
        metrics = self.fontMetrics()
        widest = max((metrics.horizontalAdvance(name) for name, _ in self._names), default=0)
        return max(1, min(len(self._names), self.width() // (widest + SAMPLE_PX)))


RATIO = 2.0  # pixels of the picture for one of the screen


def image_of(widget: QWidget) -> QImage:
    """An image of a widget, at twice the size."""
    size = widget.size() * RATIO
    image = QImage(size, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(RATIO)
    image.fill(widget.palette().window().color())
    widget.render(image, QPoint())
    return image


def write_image(picture: QImage, path: Path) -> Task[Path]:
    """Write a picture; KochabError when that cannot be done."""

    def write() -> None:
        paper = QBuffer()  # a writer keeps its file open, and Windows renames no such file
        paper.open(QIODevice.OpenModeFlag.WriteOnly)
        writer = QImageWriter(paper, QByteArray(b"PNG"))
        if not writer.write(picture):
            raise OSError(writer.errorString())
        write_atomically(path, bytes(paper.data().data()))

    return save_task(write, path)


def write_text(text: str, path: Path) -> Task[Path]:
    """Write a text; KochabError when that cannot be done."""
    return save_task(lambda: write_atomically(path, text), path)


class Chart(PlotArea):
    """Shows some :class:`Series`, with the numbers of the point under the cursor.

    ``title`` is its accessible name and names its files; it is not drawn.
    """

    def __init__(self, title: str, across: ChartAxis, up: ChartAxis, legend: bool = False) -> None:
        super().__init__(title)
        self.title, self.across, self.up = title, across, up
        self.series: tuple[Series, ...] = ()
        self._legend = legend
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(160, 140)

    def sizeHint(self) -> QSize:
        return QSize(300, 220)

    def show_series(self, series: tuple[Series, ...]) -> None:
        self.series = series
        self.describe("; ".join(map(_spoken, series)))
        self.refill()

    def make_plot(self) -> "LinePlot":
        from kochab.window.charts.line_plot import LinePlot

        plot = LinePlot(self.across, self.up, self._legend)
        plot.menu_wanted.connect(lambda place: self.menu().popup(place))
        return plot

    def fill_plot(self) -> None:
        self.plot.show_series(self.series)

    def menu(self) -> QMenu:
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction(tr("Show &all\tHome"), self.plot.show_all)
        menu.addAction(tr("Zoom &in\t+"), lambda: self.plot.zoom(nearer=True))
        menu.addAction(tr("Zoom &out\t−"), lambda: self.plot.zoom(nearer=False))
        menu.addSeparator()
        menu.addAction(tr("Save &image…"), lambda: self._ask("png"))
        menu.addAction(tr("Save &numbers…"), lambda: self._ask("csv"))
        return menu

    def _ask(self, ending: str) -> None:
        name = f"{self.title.lower().replace(' ', '-')}.{ending}"
        kinds = f"{ending.upper()} (*.{ending})"
        path = ask_save(self.window(), Path.home() / name, kinds)
        if path is not None:
            self.write(path)

    def write(self, path: Path) -> Job:
        """Write the image, or the numbers when the name ends in csv, in a thread."""
        numbers = path.suffix.lower() == ".csv"
        task = write_text(csv_text(self.rows()), path) if numbers else write_image(image_of(self), path)
        job = Job(task, "chart")
        job.failed.connect(lambda sentence: tell(self.window(), tr("Export"), sentence))
        job.start()
        return job

    def rows(self) -> list[tuple[object, ...]]:
        """Every point, under a row of column names."""
        head = ("line", self.across.label, self.up.label, "sigma")
        return [head] + [
            (one.name, x, y, one.sigma[k] if one.sigma else "")
            for one in self.series
            for k, (x, y) in enumerate(zip(one.x, one.y, strict=True))
        ]


def _spoken(one: Series) -> str:
    points = ", ".join(tr("{x:g} gives {y:.3g}", x=x, y=y) for x, y in zip(one.x, one.y, strict=True))
    return f"{one.name}: {points}"
