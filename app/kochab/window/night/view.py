"""The Last night view: a folder of frames measured, and the page of it in the middle of the window."""

from pathlib import Path

from kochab.core.errors import UsageError
from kochab.core.progress import Progress
from kochab.frames.atomic_file import write_atomically
from kochab.solver import SolveOptions
from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import ask_folder, ask_save, save_task, tell
from kochab.window.job import Job
from kochab.window.night.page import NightBrowser
from kochab.window.services import Services
from kochab.window.view import View
from kochab.window.widgets import ProgressBar, button, column, label, row, show_text, text_field
from kochab.workflows.night.earlier import Compared
from kochab.workflows.night.folder import half_done, measure_folder
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.page import night_page
from kochab.workflows.night.summary import Night
from kochab.workflows.night.table import night_csv, night_json_text

FOLDER = "night/folder"
KINDS = tr_noop("Web page (*.html);;CSV (*.csv);;JSON (*.json)")
ABOUT = tr_noop("Focus, tilt, drift, cloud, what crossed the field, best and worst frames, each with its uncertainty.")


class NightView(View):
    """The folder and what is done with it; its room is the page."""

    room: NightBrowser

    def __init__(self, services: Services) -> None:
        super().__init__()
        self._services = services
        self.night: Night | None = None
        self._earlier: list[Compared] = []
        self._frames: list[NightFrame] = []
        self._job: Job | None = None
        self._measured = Path()  # the folder that the page is of
        self.folder = text_field(tr("Folder of the night"), tr("folder of frames"))
        self.folder.setText(services.settings.text(FOLDER, "") or services.settings.text("folder", ""))
        self.choose = button(tr("F&older…"), self._choose, tip=tr("Choose the folder of a night"))
        self.start = button(tr("&Measure"), self.measure_night, "main", tr("Solve and measure every frame"))
        self.stop = button(tr("S&top"), self._stop, tip=tr("Stop and show what is measured"))
        self.save = button(tr("&Save…"), self._save, tip=tr("The page, or the numbers of every frame as CSV or JSON"))
        self.bar = ProgressBar(tr("Progress of the night"))
        self.status = label(tr(ABOUT), "muted", wrap=True)
        self.room = NightBrowser()
        buttons = row(self.start, self.stop, self.save, None)
        top = label(tr("Last night"), "heading")
        parts = (top, row((self.folder, 1), self.choose), buttons, self.bar, self.status, None)
        column(*parts, on=self, spacing=10, margins=(10, 10, 10, 10))
        self.folder.returnPressed.connect(self.measure_night)
        self.setFocusProxy(self.start)
        self._show_running(False)

    def measure_night(self) -> None:
        """Measure the frames of the folder."""
        if self._job is not None:
            return
        self._measured, self._frames = Path(self.folder.text().strip()).expanduser(), []
        self._services.settings.keep(FOLDER, self.folder.text().strip())
        task = measure_folder(self._measured, SolveOptions(), self._services.settings.site, self._frames)
        self._job = job = self._services.jobs.run(task, "night")
        job.progressed.connect(self._progressed)
        job.succeeded.connect(self._has_night)
        job.failed.connect(lambda sentence: show_text(self.status, sentence, "wrong"))
        job.cancelled.connect(self._stopped)
        job.finished.connect(self._finished)
        self._show_running(True)

    def _progressed(self, progress: Progress) -> None:
        self.bar.show_share(progress.fraction)
        show_text(self.status, progress.detail, "muted")

    def _has_night(self, made: tuple[Night, list[Compared]]) -> None:
        self.night, self._earlier = made
        self._show_night()
        show_text(self.status, tr(ABOUT), "muted")

    def _stopped(self) -> None:
        """A half-done night is shown as such."""
        try:
            self.night, self._earlier = half_done(self._frames, self._measured), []
        except UsageError as error:  # the folder went away meanwhile
            show_text(self.status, str(error), "wrong")
            return
        self._show_night()
        show_text(self.status, tr("Stopped after {n} frames.", n=len(self._frames)), "muted")

    def _show_night(self) -> None:
        if self.night is not None:
            self.room.show_night(self.night, self._measured.name, self._earlier)

    def _finished(self) -> None:
        self._job = None
        self._show_running(False)

    def _show_running(self, on: bool) -> None:
        for shown in (self.stop, self.bar):
            shown.setVisible(on)
        for used in (self.start, self.folder, self.choose):
            used.setEnabled(not on)
        self.save.setEnabled(not on and self.night is not None)

    def _stop(self) -> None:
        if self._job is not None:
            self._job.cancel()

    def _choose(self) -> None:
        if (path := ask_folder(self.window(), self.folder.text(), tr("Folder of the night"))) is not None:
            self.folder.setText(str(path))

    def _save(self) -> None:
        start = self._measured.parent / f"{self._measured.name}-night.html"
        if (path := ask_save(self.window(), start, tr(KINDS))) is not None:
            self.write(path)

    def write(self, path: Path) -> None:
        """Write the page, or the numbers, as the name of the file ends."""
        night, name, earlier = self.night, self._measured.name, self._earlier
        assert night is not None, "the button is off without one"

        def text() -> str:
            match path.suffix.lower():
                case ".csv":
                    return night_csv(night)
                case ".json":
                    return night_json_text(night, earlier)
            return night_page(night, name, earlier)

        job = self._services.jobs.run(save_task(lambda: write_atomically(path, text()), path), "night page")
        job.succeeded.connect(lambda done: self._services.say(tr("Wrote {name}", name=done.name)))
        job.failed.connect(lambda sentence: tell(self.window(), tr("Last night"), sentence))
