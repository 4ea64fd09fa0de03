"""The Laboratory's results as files: numbers as CSV, what is seen as PNG."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QByteArray, QObject, QPoint
from PySide6.QtGui import QImage, QImageWriter
from PySide6.QtWidgets import QWidget

from app.core.errors import KochabError
from app.core.progress import Progress, Task
from app.ui.dialogs import ask_save, tell
from app.ui.services import Services
from app.ui.widgets import button
from app.workflows.laboratory_tables import points_csv, trials_csv

if TYPE_CHECKING:
    from app.ui.lab.view import LaboratoryView

RATIO = 2.0  # pixels of the picture for one of the screen


class Exporter(QObject):
    """Writes whichever tab is in front."""

    def __init__(self, view: "LaboratoryView", services: Services) -> None:
        super().__init__(view)
        self._view, self._services = view, services
        self.csv = button("CSV…", lambda: self._ask("csv"), tip="The numbers, for a spreadsheet")
        self.png = button("PNG…", lambda: self._ask("png"), tip="The picture, twice the size")
        self.csv.setAccessibleName("Export as CSV")
        self.png.setAccessibleName("Export as PNG")
        view.tabs.currentChanged.connect(self.enable)

    @property
    def curves(self) -> bool:
        """Whether the curves are in front, and not the table."""
        return self._view.tabs.currentIndex() == 1

    def enable(self, _: int = 0) -> None:
        """Only what there is can be written."""
        some = bool(self._view.plots.points if self.curves else self._view.table.trials)
        self.csv.setEnabled(some)
        self.png.setEnabled(some)

    def _ask(self, ending: str) -> None:
        folder = Path(self._services.settings.text("folder", str(Path.home())))
        name = "laboratory-curves" if self.curves else "laboratory-table"
        kinds = "CSV (*.csv)" if ending == "csv" else "PNG (*.png)"
        red = self._services.looks.is_night
        path = ask_save(self._view.window(), folder / f"{name}.{ending}", kinds, red)
        if path is not None:
            self.write(ending, path)

    def write(self, ending: str, path: Path) -> None:
        """Write the tab in front to ``path``, in a thread."""
        view = self._view
        if ending == "png":
            picture = picture_of(view.tabs.currentWidget())
            job = self._services.jobs.run(_written(path, lambda: _save(picture, path)), "export")
        else:
            points = list(view.plots.points.values())
            text = points_csv(points) if self.curves else trials_csv(view.table.trials)
            job = self._services.jobs.run(
                _written(path, lambda: _write(text, path)), "export"
            )  # fmt: skip
        job.succeeded.connect(lambda p: self._services.say(f"Wrote {p.name}"))
        job.failed.connect(lambda sentence: tell(view.window(), "Export", sentence))


def picture_of(widget: QWidget) -> QImage:
    """What a widget shows, at twice the size."""
    size = widget.size() * RATIO
    image = QImage(size, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(RATIO)
    image.fill(widget.palette().window().color())
    widget.render(image, QPoint())
    return image


def _save(picture: QImage, path: Path) -> None:
    writer = QImageWriter(str(path), QByteArray(b"PNG"))
    if not writer.write(picture):
        raise OSError(writer.errorString())


def _write(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _written(path: Path, write: Callable[[], None]) -> Task[Path]:
    yield Progress("export", None, path.name)
    try:
        write()
    except OSError as error:
        why = error.strerror or error
        raise KochabError(f"{path.name} could not be written: {why}.") from error
    return path
