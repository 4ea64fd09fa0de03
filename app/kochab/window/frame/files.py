"""The files of a person: opened one or many at a time, opened of late, and the results of those on the film strip."""

from pathlib import Path

from PySide6.QtCore import QObject, Signal

from kochab.core.solution import Solution
from kochab.frames import file_pattern
from kochab.frames.atomic_file import write_atomically
from kochab.sky.elements import ENDINGS, keep_elements
from kochab.text.angle_text import short_name
from kochab.text.translation import tr, tr_n
from kochab.window.dialogs import ask_folder, ask_frames, ask_save, save_task, tell
from kochab.window.frame.batch import Batch, FileState, images_in
from kochab.window.frame.film_strip import Blink, FilmStrip, results_table
from kochab.window.frame.session import Session
from kochab.window.frame.workspace import Workspace
from kochab.window.image.frame_image import FrameImage
from kochab.window.settings import WindowSettings
from kochab.window.undo import Undo
from kochab.workflows.solution_text import results_csv


class Files(QObject):
    """Opens files and folders in the session; several stand on the film strip, where they are solved in turn."""

    opening = Signal(Path)  # a file that a person opened, or the film strip
    recent_changed = Signal()
    elements_kept = Signal()  # of orbits: their bodies may be in the open frame
    notice = Signal(str)  # a sentence for the status bar

    def __init__(self, session: Session, panes: Workspace, settings: WindowSettings, undo: Undo) -> None:
        super().__init__(panes)
        self._session, self._panes, self._settings, self._undo = session, panes, settings, undo
        self.batch, self.blink = Batch(session), Blink(panes)
        self.films = FilmStrip(self.batch)
        panes.add_below(self.films)
        self.films.chosen.connect(self.open)
        self.films.results_wanted.connect(self.show_results)
        session.opened.connect(self._opened)
        session.pictured.connect(self._pictured)

    def choose(self) -> None:
        """Ask for images, and open them."""
        folder = str(self._settings.image_folder)
        self.open_all(ask_frames(self._panes.window(), folder, tr("Open images"), _kinds()))

    def choose_folder(self) -> None:
        """Ask for a folder, and open its images."""
        folder = str(self._settings.image_folder)
        if (path := ask_folder(self._panes.window(), folder, tr("Open a folder"))) is not None:
            self.open_all([path])

    def open(self, path: Path) -> None:
        """Open a file; another than those of the film strip ends it."""
        if path in self.batch.files:
            self._open(path)
        else:
            self._replace_files({}, path)

    def _open(self, path: Path) -> None:
        self.opening.emit(path)
        self._settings.keep("folder", str(path.absolute().parent))
        self._session.open(path)
        self.films.show_open(path)

    def open_all(self, paths: list[Path]) -> None:
        """Open files and folders: the first now, all of them on the film strip, where they are solved in turn.

        Files of orbital elements are kept, and their bodies looked for in dated frames.
        """
        elements = [path for path in paths if path.suffix.lower() in ENDINGS]
        for path in elements:
            self._keep_elements(path)
        paths = [path for path in paths if path not in elements]
        try:
            found = images_in(paths)
        except OSError as error:
            name = short_name(Path(error.filename or paths[0]).name)
            self.notice.emit(tr("Can't open {name}: {why}.", name=name, why=error.strerror or error))
            return
        if len(found) > 1:
            self._replace_files({path: FileState(path) for path in found}, found[0])
        elif found:
            self.open(found[0])
        elif paths:
            self.notice.emit(tr("No images in {name}.", name=short_name(paths[0].name)))

    def _keep_elements(self, path: Path) -> None:
        job = self._session.jobs.run(save_task(lambda: keep_elements(path), path), "elements")
        job.succeeded.connect(
            lambda p: self.notice.emit(tr("Objects from {name} now appear in dated images.", name=p.name))
        )
        job.succeeded.connect(lambda _: self.elements_kept.emit())
        job.failed.connect(self.notice)

    def _replace_files(self, files: dict[Path, FileState], path: Path) -> None:
        """Another film strip, or none, and one file; the strip that ends may be had back."""
        before, after = (self.batch.files, self._session.known.path), (files, path)
        self._show_files(after)
        if (many := len(before[0])) > 1:
            text = tr_n("close the film strip ({n} file)", "close the film strip ({n} files)", many)
            self._undo.made(text, self._show_files, before, after)

    def _show_files(self, shown: tuple[dict[Path, FileState], Path | None]) -> None:
        files, path = shown
        self.batch.take(files)
        self.films.fill()
        if path is not None:
            self._open(path)

    def _opened(self, _: object) -> None:
        if (path := self._session.known.path) is not None:
            self._settings.add_recent(path)
        self.recent_changed.emit()

    def _pictured(self, picture: FrameImage) -> None:
        if (path := self._session.known.path) is not None:
            self.blink.remember(path.name, picture, several=len(self.batch.files) > 1)

    def clear_recent(self) -> None:
        """Forget the files opened of late, which can be had back."""
        before = [str(path) for path in self._settings.recent]
        self._keep_recent([])
        self._undo.made(tr("clear the list of recent files"), self._keep_recent, before, [])

    def _keep_recent(self, names: list[str]) -> None:
        self._settings.keep("recent", names)
        self.recent_changed.emit()

    def show_results(self) -> None:
        """All results of the film strip in a table."""
        results_table(self._panes.window(), self.batch, self._settings.angle_style, self.save_results).open()

    def save_results(self) -> None:
        """Ask where to, and write the results as CSV."""
        window, files = self._panes.window(), list(self.batch.files.values())
        if (path := ask_save(window, files[0].path.with_name("kochab-results.csv"), "CSV (*.csv)")) is not None:
            results = [(str(f.path), f.words, f.result if isinstance(f.result, Solution) else None) for f in files]
            job = self._session.jobs.run(
                save_task(lambda: write_atomically(path, results_csv(results)), path), "results"
            )
            job.succeeded.connect(lambda p: self.notice.emit(tr("Saved {name}", name=p.name)))
            job.failed.connect(lambda sentence: tell(window, tr("Results"), sentence))


def _kinds() -> str:
    """The file types of the open dialog."""
    return tr("Images ({endings});;All files (*)", endings=file_pattern())
