"""What can be written of a solved frame, through the functions of the rooms below."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal

from app.core.errors import KochabError
from app.core.frame import Frame
from app.core.progress import Progress, Task
from app.core.solution import Solution
from app.frames.whole_file import write_whole
from app.ui.dialogs import ask_save, tell
from app.ui.job import Job
from app.ui.main_window import MainWindow
from app.ui.session import Session
from app.ui.wiring import ToJson

Write = Callable[[Frame, Solution, Path], None]


@dataclass(frozen=True, slots=True)
class Export:
    """One kind of file: its menu text, what its name ends in, and how it is written."""

    name: str
    text: str
    ending: str
    kinds: str
    write: Write


def _csv(_: Frame, solution: Solution, path: Path) -> None:
    from app.frames.export import write_csv

    write_csv(solution, path)


def _regions(_: Frame, solution: Solution, path: Path) -> None:
    from app.frames.export import write_regions

    write_regions(solution, path)


def _wcs(_: Frame, solution: Solution, path: Path) -> None:
    from app.solve.wcs import write_wcs

    write_wcs(solution, path)


def _fits(frame: Frame, solution: Solution, path: Path) -> None:
    from app.solve.wcs import write_solved_copy

    write_solved_copy(solution, frame.path, path)


def _picture(frame: Frame, solution: Solution, path: Path) -> None:
    from app.frames.export import annotate

    annotate(frame, solution, path)


EXPORTS = (
    Export("csv", "Stars as &CSV…", "-stars.csv", "CSV (*.csv)", _csv),
    Export("regions", "&DS9 regions…", ".reg", "DS9 regions (*.reg)", _regions),
    Export("wcs", "&WCS header…", ".wcs", "WCS header (*.wcs)", _wcs),
    Export("fits", "&FITS copy with WCS…", "-solved.fits", "FITS (*.fits)", _fits),
    Export("picture", "Annotated &picture…", "-annotated.png", "PNG (*.png)", _picture),
)


def json_export(to_json: ToJson) -> Export:
    """The solution as one JSON object, in the form of the command line."""

    def write(frame: Frame, solution: Solution, path: Path) -> None:
        write_whole(path, to_json(frame.path, solution) + "\n")

    return Export("json", "Solution as &JSON…", ".json", "JSON (*.json)", write)


class Exporter(QObject):
    """Asks where to, writes in a thread, and says how it went."""

    wrote = Signal(Path)

    def __init__(
        self,
        window: MainWindow,
        session: Session,
        to_json: ToJson | None,
        red: Callable[[], bool],
    ) -> None:
        super().__init__(window)
        self._window, self._session, self._red = window, session, red
        self._jobs: list[Job] = []
        kinds = EXPORTS if to_json is None else (*EXPORTS, json_export(to_json))
        self.kinds = {kind.name: kind for kind in kinds}
        for kind in kinds:
            action = window.menus.export.addAction(kind.text)
            action.setObjectName(f"export_{kind.name}")
            action.triggered.connect(lambda _=False, k=kind: self.ask(k))
        window.closing.connect(self._close)

    def ask(self, kind: Export) -> None:
        """Ask for a name and write there."""
        base = self._session.known.path or Path("frame")
        start = base.with_name(base.stem + kind.ending)
        path = ask_save(self._window, start, kind.kinds, self._red())
        if path is not None:
            self.write(kind, path)

    def write(self, kind: Export, path: Path) -> None:
        """Write the open frame's solution to ``path``."""
        known = self._session.known
        if known.frame is None or not isinstance(known.result, Solution):
            return
        job = Job(_task(kind, known.frame, known.result, path), f"export-{kind.name}")
        self._jobs = [j for j in self._jobs if j.running] + [job]
        job.succeeded.connect(self._done)
        job.failed.connect(self._trouble)
        job.start()

    def _done(self, path: Path) -> None:
        self._window.status.showMessage(f"Wrote {path.name}", 6000)
        self.wrote.emit(path)

    def _trouble(self, sentence: str) -> None:
        tell(self._window, "Export", sentence)

    def _close(self) -> None:
        for job in self._jobs:
            job.abandon()
        for job in self._jobs:
            job.join(5.0)


def _task(kind: Export, frame: Frame, solution: Solution, path: Path) -> Task[Any]:
    yield Progress("export", None, path.name)
    try:
        kind.write(frame, solution, path)
    except OSError as error:
        raise KochabError(
            f"{path.name} could not be written: {error.strerror or error}."
        ) from error
    return path
