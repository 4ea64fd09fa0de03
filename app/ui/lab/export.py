"""The Laboratory's results as files: numbers as CSV, what is seen as PNG."""

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

from app.ui.dialogs import ask_save, tell
from app.ui.kept_files import picture_of, writing_picture, writing_text
from app.ui.services import Services
from app.ui.widgets import button
from app.workflows.laboratory_tables import points_csv, trials_csv

if TYPE_CHECKING:
    from app.ui.lab.view import LaboratoryView


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
            task = writing_picture(picture_of(view.tabs.currentWidget()), path)
        else:
            points = list(view.plots.points.values())
            text = points_csv(points) if self.curves else trials_csv(view.table.trials)
            task = writing_text(text, path)
        job = self._services.jobs.run(task, "export")
        job.succeeded.connect(lambda p: self._services.say(f"Wrote {p.name}"))
        job.failed.connect(lambda sentence: tell(view.window(), "Export", sentence))
