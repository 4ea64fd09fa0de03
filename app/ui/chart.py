"""A chart: lines with markers over two axes, told before the plotting library is loaded."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from PySide6.QtCore import QPoint, QSize, Qt
from PySide6.QtWidgets import QMenu, QSizePolicy

from app.ui.dialogs import ask_save, tell
from app.ui.job import Job
from app.ui.kept_files import picture_of, table_of, writing_picture, writing_text
from app.ui.plot_place import PlotPlace
from app.ui.red_light import is_red

if TYPE_CHECKING:
    from app.ui.line_plot import LinePlot


@dataclass(frozen=True, slots=True)
class Axis:
    """``span`` is what is shown at first; without one it follows the lines."""

    title: str
    unit: str = ""
    span: tuple[float, float] | None = None
    log: bool = False

    def text(self, value: float) -> str:
        """A value as it is read."""
        number = f"{value:.3g}".replace("-", "−")
        return f"{number} {self.unit}".rstrip()

    @property
    def label(self) -> str:
        """What stands beside the axis."""
        return f"{self.title}, {self.unit}" if self.unit else self.title


@dataclass(frozen=True, slots=True)
class Series:
    """One line; ``style`` numbers its colour, dashes and marker. NaN breaks the line.

    ``sigma``, one standard deviation of each ``y``, is drawn as bars where there is one.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    style: int = 0
    sigma: tuple[float, ...] = ()


class Chart(PlotPlace):
    """Shows some :class:`Series`; the point under the cursor tells its numbers.

    ``title`` is its accessible name and names its files: what is seen is titled by the axes.
    """

    def __init__(self, title: str, across: Axis, up: Axis, legend: bool = False) -> None:
        super().__init__(title)
        self.title, self.across, self.up = title, across, up
        self.series: tuple[Series, ...] = ()
        self._legend = legend
        self._job: Job | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(160, 140)

    def sizeHint(self) -> QSize:
        return QSize(300, 220)

    def show_series(self, series: tuple[Series, ...]) -> None:
        """Draw these."""
        self.series = series
        self.describe("; ".join(map(_spoken, series)))
        self.refill()

    # the plot ---------------------------------------------------------------------------------
    def make_plot(self) -> "LinePlot":
        from app.ui.line_plot import LinePlot

        plot = LinePlot(self.across, self.up, self._legend)
        plot.menu_wanted.connect(self._offer)
        return plot

    def fill_plot(self) -> None:
        self._lines.show_series(self.series)

    def dress_plot(self) -> None:
        self._lines.dress(self.colours)

    @property
    def _lines(self) -> "LinePlot":
        return cast("LinePlot", self.plot)

    # what can be done with it -----------------------------------------------------------------
    def menu(self) -> QMenu:
        """What the person may do, new."""
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Show &all\tHome", self._lines.show_all)
        menu.addAction("Zoom &in\t+", lambda: self._lines.zoom(nearer=True))
        menu.addAction("Zoom &out\t−", lambda: self._lines.zoom(nearer=False))
        menu.addSeparator()
        menu.addAction("Save the &picture…", lambda: self._ask("png"))
        menu.addAction("Save the &numbers…", lambda: self._ask("csv"))
        return menu

    def _offer(self, place: QPoint) -> None:
        self.menu().popup(place)

    def _ask(self, ending: str) -> None:
        name = f"{self.title.lower().replace(' ', '-')}.{ending}"
        kinds = f"{ending.upper()} (*.{ending})"
        path = ask_save(self.window(), Path.home() / name, kinds, is_red())
        if path is not None:
            self.write(path)

    def write(self, path: Path) -> Job:
        """Write what is seen, or the numbers when the name ends in csv, in a thread."""
        numbers = path.suffix.lower() == ".csv"
        task = (
            writing_text(table_of(self.rows()), path)
            if numbers
            else writing_picture(picture_of(self), path)
        )
        self._job = job = Job(task, "chart", self)
        job.failed.connect(lambda sentence: tell(self.window(), "Export", sentence))
        job.start()
        return job

    def rows(self) -> list[tuple[object, ...]]:
        """Every point, under a line of names."""
        head = ("line", self.across.label, self.up.label, "sigma")
        return [head] + [
            (one.name, x, y, one.sigma[k] if one.sigma else "")
            for one in self.series
            for k, (x, y) in enumerate(zip(one.x, one.y, strict=True))
        ]


def _spoken(one: Series) -> str:
    return f"{one.name}: " + ", ".join(
        f"{x:g} gives {y:.3g}" for x, y in zip(one.x, one.y, strict=True)
    )
