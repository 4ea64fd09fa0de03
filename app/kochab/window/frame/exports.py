"""What can be exported of a solved frame: asks where to, and writes in a thread."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QMenu, QWidget

from kochab.core.frame import Frame
from kochab.core.progress import Task
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.frames.atomic_file import write_atomically
from kochab.frames.export import stars_csv
from kochab.frames.outputs import refuse_input
from kochab.frames.wcs import write_solved_copy, write_wcs
from kochab.sky.elements import kept_elements
from kochab.text.translation import tr, tr_noop
from kochab.window.dialogs import ask_save, save_task, tell
from kochab.window.frame.session import Session
from kochab.window.image.overlay import Overlay
from kochab.window.settings import WindowSettings
from kochab.workflows.annotated_image import annotate, write_stellarium
from kochab.workflows.frame_objects import objects_csv, objects_of, sky_regions
from kochab.workflows.printed_sheet import write_sheet
from kochab.workflows.solution_json import as_json, to_line

Write = Callable[[Frame, Solution, Path], None]


@frozen
class Export:
    """One kind of file: its menu text, what its name ends in, and how it is written."""

    name: str
    text: str
    ending: str
    kinds: str
    write: Write


CSV = "CSV (*.csv)"
PICTURES = "PNG (*.png);;JPEG (*.jpg);;TIFF (*.tif);;PDF (*.pdf);;SVG (*.svg)"
EXPORTS = (
    Export("csv", tr_noop("Stars as &CSV…"), "-stars.csv", CSV, lambda _, s, p: write_atomically(p, stars_csv(s))),
    Export(
        "regions",
        tr_noop("&DS9 regions…"),
        ".reg",
        tr_noop("DS9 regions (*.reg)"),
        lambda f, s, p: write_atomically(p, sky_regions(s, objects_of(f, s, kept_elements()))),
    ),
    Export("wcs", tr_noop("&WCS header…"), ".wcs", tr_noop("WCS header (*.wcs)"), lambda _, s, p: write_wcs(s, p)),
    Export(
        "fits",
        tr_noop("&FITS copy with WCS…"),
        "-solved.fits",
        "FITS (*.fits)",
        lambda f, s, p: write_solved_copy(s, f.path, p),
    ),
    Export(
        "objects",
        tr_noop("&Objects as CSV…"),
        "-objects.csv",
        CSV,
        lambda f, s, p: write_atomically(p, objects_csv(objects_of(f, s, kept_elements()))),
    ),
    Export(
        "stellarium",
        tr_noop("S&tellarium script…"),
        "-stellarium.ssc",
        tr_noop("Stellarium script (*.ssc)"),
        write_stellarium,
    ),
    Export("print", tr_noop("&Print sheet (A4)…"), "-a4.pdf", "PDF (*.pdf)", write_sheet),
    Export(
        "letter", tr_noop("Print sheet (&Letter)…"), "-letter.pdf", "PDF (*.pdf)", partial(write_sheet, paper="letter")
    ),
    Export("picture", tr_noop("Annotated &image…"), "-annotated.png", PICTURES, annotate),
    Export(
        "json",
        tr_noop("Solution as &JSON…"),
        ".json",
        "JSON (*.json)",
        lambda f, s, p: write_atomically(p, to_line(as_json(f.path, s)) + "\n"),
    ),
)


class FrameExporter(QObject):
    """Fills the Export menu; ``wrote`` carries the path of a file that is written."""

    wrote = Signal(Path)

    def __init__(
        self,
        parent: QWidget,
        menu: QMenu,
        session: Session,
        settings: WindowSettings,
        overlay: Overlay,
        say: Callable[[str], None],
    ) -> None:
        super().__init__(parent)
        self._parent, self._session, self._settings, self._overlay = parent, session, settings, overlay
        self._say = say
        self.kinds = {kind.name: kind for kind in EXPORTS}
        for kind in self.kinds.values():
            action = menu.addAction(tr(kind.text))
            action.setObjectName(f"export_{kind.name}")
            action.setToolTip(tr("Export: {what}", what=tr(kind.text).replace("&", "").rstrip("…")))
            action.triggered.connect(lambda _=False, k=kind: self.ask(k))

    def ask(self, kind: Export) -> None:
        base = self._session.known.path or Path("frame")
        if (path := ask_save(self._parent, base.with_name(base.stem + kind.ending), tr(kind.kinds))) is not None:
            self.write(kind, path)

    def write(self, kind: Export, path: Path) -> None:
        """Write the open frame's solution to ``path``; never over the frame itself."""
        known = self._session.known
        frame, solution, source = known.frame, known.result, known.path
        if frame is None or not isinstance(solution, Solution):
            return

        write = kind.write
        if kind.name == "picture":  # as it is seen now
            # A copy: layers may be switched while the thread writes.
            layers, more = deepcopy(self._overlay.layers), kept_elements()
            write = partial(annotate, more=more, layers=layers, detected=self._overlay.circled)
        # The frame's own site counts more than the person's.
        sited = replace(frame, hint=replace(frame.hint, site=frame.hint.site or self._settings.site))

        def task() -> Task[Path]:
            refuse_input(path, [source] if source else [])
            return (yield from save_task(lambda: write(sited, solution, path), path))

        job = self._session.jobs.run(task(), f"export-{kind.name}")
        job.succeeded.connect(self._done)
        job.failed.connect(lambda sentence: tell(self._parent, tr("Export"), sentence))

    def _done(self, path: Path) -> None:
        self._say(tr("Saved {name}", name=path.name))
        self.wrote.emit(path)
