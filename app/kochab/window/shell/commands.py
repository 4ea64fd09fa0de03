"""What menus, buttons and keys do, and the help boxes."""

import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from PySide6.QtCore import QObject, QPoint, Qt
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QMenu, QWidget

from kochab import __version__
from kochab.core import tr, tr_n, tr_noop
from kochab.core.angle_text import short_name
from kochab.core.attitude import radec_deg
from kochab.core.solution import Solution
from kochab.frames import SUFFIXES
from kochab.frames.atomic_file import write_atomically
from kochab.gear.actions import reasons_against
from kochab.gear.journal import save_report
from kochab.sky.elements import ENDINGS, keep_elements
from kochab.sky.layer import MARKS
from kochab.window.devices.equipment import Equipment
from kochab.window.dialogs import ask_folder, ask_frames, ask_save, save_task, tell, without_icons
from kochab.window.frame.batch import Batch, FileState, images_in
from kochab.window.frame.exports import FrameExporter
from kochab.window.frame.film_strip import Blink, FilmStrip, results_table
from kochab.window.frame.presenter import Presenter
from kochab.window.frame.search import Search
from kochab.window.image.frame_image import FrameImage
from kochab.window.image.object_card import vector_of
from kochab.window.image.place_menu import AIMS, links, place_menu
from kochab.window.image.thumbnails import thumbnails
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.menus import SPECS, colour_icons
from kochab.window.shell.views import VIEWS, Services, Views
from kochab.window.shell.welcome import Sample
from kochab.window.themes import theme_colours
from kochab.window.undo import Undo
from kochab.window.widgets import Part, column, grid, label, row
from kochab.workflows.session.wiring import Wiring
from kochab.workflows.solution_text import results_csv

LAYOUT = 2  # of the parts of the window; places kept by an older one are forgotten
STILL_THERE = timedelta(minutes=10)  # the Moon, the fastest, moves by 5 arcmin
LEAST_PX = 380  # a minimum of the box itself would keep it from growing with its letters
ABOUT = (
    f"Kochab {__version__}",
    tr_noop("Plate solving, polar alignment and mount control. Nothing to download."),
    tr_noop("Free software under the GNU General Public License, version 3 or later."),
)


KEYS = [
    ("F7", tr_noop("Adjuster display, in Polar alignment")),
    ("Esc", tr_noop("Stop the connected mount, from any view")),
    (tr_noop("Arrows"), tr_noop("Pan the image or chart that has focus")),
    ("Home", tr_noop("Show the whole chart")),
    ("Tab", tr_noop("Next control")),
]


def about(parent: QWidget) -> QDialog:
    """Version and licence."""
    lines = zip(ABOUT, ("title", "", "muted"), strict=True)
    return _box(parent, tr("About Kochab"), *(label(tr(text), role, wrap=True) for text, role in lines))


def keyboard(parent: QWidget) -> QDialog:
    """Every keyboard shortcut."""
    rows = [(s.keys.replace(" ", ", "), tr(s.text).replace("&", "").rstrip("…")) for s in SPECS if s.keys]
    rows += [(keys, tr(title).replace("&", "")) for title, keys, _ in VIEWS.values()]
    rows += [(tr(key), tr(what)) for key, what in KEYS]
    half = (len(rows) + 1) // 2
    lines = ([*rows[i], *(rows[half + i] if half + i < len(rows) else ())] for i in range(half))
    cells = ([label(text, "" if i % 2 else "muted") for i, text in enumerate(line)] for line in lines)
    return _box(parent, tr("Keyboard"), grid(*cells, across=18, down=3))


def _box(parent: QWidget, title: str, *parts: Part) -> QDialog:
    """A dialog of these parts above a button that closes it."""
    box = QDialog(parent)
    box.setWindowTitle(title)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
    without_icons(buttons.buttons())
    buttons.rejected.connect(box.reject)
    column(*parts, row(LEAST_PX, None), buttons, on=box, spacing=12, margins=(20, 20, 20, 16))
    return box


class Commands(QObject):
    """What the actions of one window do."""

    def __init__(self, presenter: Presenter, samples: list[Sample], wiring: Wiring | None = None) -> None:
        super().__init__(presenter.window)
        self.presenter = presenter
        self.window, self.session = presenter.window, presenter.session
        self.settings = presenter.settings
        self.actions = self.window.actions_by_name
        self.looks = Appearance(presenter)
        wiring = wiring or Wiring()
        jobs = self.session.jobs
        seen = presenter.overlay
        self.exporter = FrameExporter(self.window, self.session, self.settings, wiring.to_json, seen)
        panes = self.window.workspace
        self.undo = Undo(self.actions["undo"], self.actions["redo"], self)
        self.equipment = Equipment(self.window.bar.equipment, self.settings, self.actions["preferences"], self.undo)
        self.equipment.refused.connect(self._say)
        self.services = Services(
            self.settings, self.session, self.looks, jobs, wiring, self._say, panes, self.equipment, self.undo
        )
        self.batch, self.blink = Batch(self.session), Blink(self.window)
        self.films = FilmStrip(self.batch)
        self.window.workspace.add_below(self.films)
        self.films.chosen.connect(self.open)
        self.films.results_wanted.connect(self.show_results)
        self.looks.changed.connect(self.films.redraw)
        self.views = Views(self.window, self.services)
        colour_icons(self.actions, theme_colours())
        self.views.emptied.connect(lambda: self.actions["fill"].setChecked(False))
        # After the views: only docks that are there get their places back.
        self._restore()
        self._connect()
        menus = self.window.menus
        menus.show_files(menus.samples, [(s.title, s.path) for s in samples], self.open)
        self._sample_paths = [s.path for s in samples]
        self._show_recent()
        self._enable()

    def _restore(self) -> None:
        window = self.window
        parts = {"geometry": window.restoreGeometry, "rail": lambda kept: window.restoreState(kept, LAYOUT)}
        for name, restore in parts.items():
            if (saved := self.settings.data(name)) is not None:
                restore(saved)
        self.actions["log"].setChecked(not window.log.isHidden())

    def _connect(self) -> None:
        window, panes = self.window, self.window.workspace
        slots: dict[str, Callable[..., object]] = {
            "open": self.choose,
            "folder": self.choose_folder,
            "next": lambda: self.films.step(1),
            "previous": lambda: self.films.step(-1),
            "blink": self.blink.switch,
            "clear_recent": self._clear_recent,
            "quit": window.close,
            "solve": self.presenter.solve,
            "cancel": self._escape,
            "fit": panes.view.fit,
            "one": panes.view.actual_pixels,
            "in": panes.view.zoom_in,
            "out": panes.view.zoom_out,
            "stretch": panes.strip.auto.setChecked,
            "colour": self.looks.show_frame,
            "histogram": panes.strip.setVisible,
            "night": self.looks.use_night,
            "fill": self._fill,
            "full": self._full_screen,
            "log": window.log.setVisible,
            "copy": panes.solution.copy_position,
            "copy_all": panes.solution.copy_all,
            "tab_solution": lambda: self._tab(0),
            "tab_stars": lambda: self._tab(1),
            "tab_hints": lambda: self._tab(2),
            "preferences": self.show_preferences,
            "layers": lambda: self.show_preferences("layers"),
            "help": self.show_help,
            "tour": self.show_tour,
            "news": lambda: self.show_help("news"),
            "search": self.search,
            "atlas": self.show_atlas,
            "about": lambda: about(window).open(),
            "keys": lambda: keyboard(window).open(),
            "report": self.save_report,
            **{name: lambda on, n=name: self.looks.show_mark(n, on) for name in MARKS},
        }
        for name, slot in slots.items():
            if self.actions[name].isCheckable():  # a switch hands over its state
                self.actions[name].toggled.connect(slot)
            else:
                self.actions[name].triggered.connect(lambda _=False, s=slot: s())
        # A tab in front of the log makes it invisible as well, but not hidden.
        window.log.visibilityChanged.connect(lambda _: self.actions["log"].setChecked(not window.log.isHidden()))
        window.log.report_wanted.connect(self.save_report)
        window.log.fault.connect(self._say)
        panes.hints.clear_wanted.connect(self._clear_hints)
        self.equipment.changed.connect(self._show_site)
        window.welcome.open_wanted.connect(self.choose)
        window.welcome.file_wanted.connect(self.open)
        able = self.services.wiring.practice is not None
        for start in (window.menus.practice, window.welcome.practice):
            start.setVisible(able)
        window.menus.practice.triggered.connect(lambda _=False: self.practise())
        window.welcome.practice_wanted.connect(self.practise)
        window.files_dropped.connect(self.open_all)
        panes.view.menu_wanted.connect(self.show_place_menu)
        self.presenter.object_card.menu_wanted.connect(lambda where: self.show_place_menu(None, where))
        window.closing.connect(self._close)
        s = self.session
        for signal in (s.opening, s.solving, s.solved, s.idle, s.opened, s.streaming):
            signal.connect(self._enable)
        s.opened.connect(self._show_recent)
        s.pictured.connect(self._pictured)
        s.streaming.connect(lambda _: self.actions["blink"].setChecked(False))

    def search(self) -> Search:
        """Ask what to find."""
        box = Search(self.presenter)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose, False)
        box.open()
        return box

    def show_place_menu(self, at: tuple[float, float, float] | None, where: QPoint) -> QMenu | None:
        """Offer what can be done with what is at a place of the frame, px, or with what is picked."""
        presenter, known = self.presenter, self.session.known
        solution, mark = presenter.overlay.solution, presenter.mark_at(at)
        tables = presenter.overlay.tables
        if mark is None or solution is None or tables is None or known.frame is None:
            return None
        vector = vector_of(tables, mark, solution)
        against, taken = reasons_against(self.services.situation), known.frame.hint.time_utc
        old = taken is None or abs(datetime.now(UTC) - taken) > STILL_THERE
        # A trail is a satellite's, which is elsewhere by now.
        if mark.body is not None and (old or mark.body.trail):
            against |= dict.fromkeys(AIMS, tr("{name} has moved since the frame was taken.", name=mark.text))
        width_deg = max(0.25, mark.radius * solution.camera.scale_arcsec_px / 900.0)  # four radii
        pages = links(tables, mark, vector, width_deg)
        menu = place_menu(self.window, mark.text, radec_deg(vector), presenter.style, pages, against, self.aim)
        menu.aboutToHide.connect(menu.deleteLater)
        menu.popup(where)
        return menu

    def aim(self, action: str, target: str) -> None:
        """Have the Mount view go to a target, or "centre" it."""
        self.views.show("mount")
        view = self.views.docks["mount"].view
        if view is not None:
            view.aim(action, target)  # type: ignore[attr-defined]

    def practise(self) -> None:
        """Start a simulated telescope in the Mount view."""
        self.views.show("mount")
        view = self.views.docks["mount"].view
        if view is not None:
            view.practise()  # type: ignore[attr-defined]

    def choose(self) -> None:
        self.open_all(ask_frames(self.window, str(self.settings.image_folder), tr("Open images"), _kinds()))

    def choose_folder(self) -> None:
        if (path := ask_folder(self.window, str(self.settings.image_folder), tr("Open a folder"))) is not None:
            self.open_all([path])

    def open(self, path: Path) -> None:
        """Open a file; another than those of the film strip ends it."""
        if path in self.batch.files:
            self._open(path)
        else:
            self._replace_files({}, path)

    def _open(self, path: Path) -> None:
        self.actions["blink"].setChecked(False)
        self.settings.keep("folder", str(path.absolute().parent))
        self.session.open(path)
        self.films.show_open(path)

    def open_all(self, paths: list[Path]) -> None:
        """Open files and folders: the first now, all of them on the film strip, where they are solved in turn.

        Files of orbital elements are kept, and their bodies looked for in dated frames.
        """
        elements = [path for path in paths if path.suffix.lower() in ENDINGS]
        for path in elements:
            self._keep(path)
        paths = [path for path in paths if path not in elements]
        try:
            found = images_in(paths)
        except OSError as error:
            name = short_name(Path(error.filename or paths[0]).name)
            self._say(tr("Can't open {name}: {why}.", name=name, why=error.strerror or error))
            return
        if len(found) > 1:
            self._replace_files({path: FileState(path) for path in found}, found[0])
        elif found:
            self.open(found[0])
        elif paths:
            self._say(tr("No images in {name}.", name=short_name(paths[0].name)))

    def _keep(self, path: Path) -> None:
        job = self.session.jobs.run(save_task(lambda: keep_elements(path), path), "elements")
        job.succeeded.connect(lambda p: self._say(tr("Objects from {name} now appear in dated images.", name=p.name)))
        job.succeeded.connect(lambda _: self.presenter.look_for_bodies())
        job.failed.connect(self._say)

    def _replace_files(self, files: dict[Path, FileState], path: Path) -> None:
        """Another film strip, or none, and one file; the strip that ends may be had back."""
        before, after = (self.batch.files, self.session.known.path), (files, path)
        self._show_files(after)
        if (many := len(before[0])) > 1:
            text = tr_n("close the film strip ({n} file)", "close the film strip ({n} files)", many)
            self.undo.made(text, self._show_files, before, after)

    def _show_files(self, shown: tuple[dict[Path, FileState], Path | None]) -> None:
        files, path = shown
        self.batch.take(files)
        self.films.fill()
        if path is not None:
            self._open(path)

    def _clear_hints(self) -> None:
        hints = self.window.workspace.hints
        before = hints.typed()
        hints.clear()
        self.undo.made(tr("clear the hints"), hints.show_typed, before, hints.typed())

    def _show_site(self) -> None:
        self.window.workspace.hints.show_site(self.settings.site)
        self.presenter.say_place()

    def _pictured(self, picture: FrameImage) -> None:
        if (path := self.session.known.path) is not None:
            self.blink.remember(path.name, picture, several=len(self.batch.files) > 1)

    def show_results(self) -> None:
        """All results of the film strip in a table."""
        results_table(self.window, self.batch, self.presenter.style, self.save_results).open()

    def save_results(self) -> None:
        """Ask where to, and write the results as CSV."""
        files = list(self.batch.files.values())
        if (path := ask_save(self.window, files[0].path.with_name("kochab-results.csv"), "CSV (*.csv)")) is not None:
            told = [(str(f.path), f.words, f.result if isinstance(f.result, Solution) else None) for f in files]
            job = self.services.jobs.run(save_task(lambda: write_atomically(path, results_csv(told)), path), "results")
            job.succeeded.connect(lambda p: self._say(tr("Saved {name}", name=p.name)))
            job.failed.connect(lambda sentence: tell(self.window, tr("Results"), sentence))

    def show_preferences(self, page: str = "") -> None:
        """Open the Preferences, perhaps at the page of the layers, or bring them to the front."""
        from kochab.window.shell.preferences import Preferences  # not needed to show the window

        shown = self.window.findChild(Preferences)
        dialog = shown or Preferences(self.presenter, self.services, self.equipment)
        if page == "layers":
            dialog.tabs.setCurrentWidget(dialog.layers_page)
        dialog.show()
        dialog.raise_()
        dialog.activateWindow()

    def show_help(self, page: str = "") -> None:
        """Open the help book at a page, or at that of the present mode."""
        from kochab.window.shell.help_book import HelpBook

        book = self.window.findChild(HelpBook) or HelpBook(self.window)
        docked = next((name for name in self.views.docked if name in VIEWS), "")
        book.turn_to(page or docked)
        book.show()
        book.raise_()
        book.activateWindow()

    def show_atlas(self) -> None:
        """Open the chart of the sky, or bring it to the front."""
        from kochab.window.atlas.dialog import Atlas

        atlas = self.window.findChild(Atlas) or Atlas(self.presenter, self.services, self.aim)
        atlas.show()
        atlas.raise_()
        atlas.activateWindow()

    def show_tour(self) -> None:
        from kochab.window.shell.tour import Tour

        self.settings.keep("toured", True)
        if self.window.findChild(Tour) is None:
            Tour(self.window)

    def add_thumbnails(self) -> None:
        paths = self._sample_paths + self.window.welcome.recent
        job = self.services.jobs.run(thumbnails(paths), "thumbnails")
        job.succeeded.connect(lambda made: self.window.welcome.add_pictures(made, self.looks.is_night))

    def _show_recent(self) -> None:
        recent = self.settings.recent
        menus = self.window.menus
        menus.show_files(menus.recent, [(p.name, p) for p in recent], self.open)
        self.window.welcome.show_recent(recent)

    def _clear_recent(self) -> None:
        before = [str(path) for path in self.settings.recent]
        self._keep_recent([])
        self.undo.made(tr("clear the list of recent files"), self._keep_recent, before, [])

    def _keep_recent(self, names: list[str]) -> None:
        self.settings.keep("recent", names)
        self._show_recent()

    def save_report(self) -> None:
        """Ask where to, and pack the journal, versions and settings there."""
        if (path := ask_save(self.window, Path.home() / "kochab-report.zip", "ZIP (*.zip)")) is not None:
            settings = self.settings.as_dict()
            job = self.services.jobs.run(save_task(lambda: save_report(path, settings), path), "report")
            job.succeeded.connect(lambda p: self._say(tr("Saved {name}. Attach it to your bug report.", name=p.name)))
            job.failed.connect(lambda sentence: tell(self.window, tr("Report"), sentence))

    def _say(self, sentence: str) -> None:
        self.window.status.showMessage(sentence, 8000)

    def _full_screen(self, on: bool) -> None:
        full, state = Qt.WindowState.WindowFullScreen, self.window.windowState()
        self.window.setWindowState(state | full if on else state & ~full)
        self._enable()

    def _fill(self, on: bool) -> None:
        """Hide the image beside the open tools; without one it stays."""
        docked = [d for d in self.views.docks.values() if d.isVisible() and not d.isFloating()]
        self.window.pages.setVisible(not (on and docked))
        if on and not docked:
            self._say(tr("Open a tool first (Tools menu)."))
            self.actions["fill"].setChecked(False)

    def _tab(self, index: int) -> None:
        panes = self.window.workspace
        self.views.show("details")
        panes.tabs.setCurrentIndex(index)
        (panes.tabs.tabBar(), panes.stars.table, panes.hints.fov)[index].setFocus()

    def _escape(self) -> None:
        # What runs is ended first; the next Esc leaves the full screen.
        if self.session.busy:
            self.session.cancel()
        elif self.actions["full"].isChecked():
            self.actions["full"].setChecked(False)

    def _enable(self, _: object = None) -> None:
        known = self.session.known
        self.actions["cancel"].setEnabled(self.session.busy or self.actions["full"].isChecked())
        self.actions["solve"].setEnabled(known.frame is not None)
        for name in ("copy", "copy_all"):
            self.actions[name].setEnabled(known.last_good is not None)
        for name in ("details", "tab_solution", "tab_stars", "tab_hints"):  # else their keys are the samples' keys too
            self.actions[name].setEnabled(self.window.pages.currentWidget() is self.window.workspace)
        several = len(self.batch.files) > 1
        for name in ("next", "previous", "blink"):
            self.actions[name].setEnabled(several)
        for name in ("fit", "one", "in", "out"):
            self.actions[name].setEnabled(known.frame is not None or self.session.streams)
        self.window.menus.export.setEnabled(isinstance(known.result, Solution))
        for action in self.window.menus.export.actions():
            action.setEnabled(action.objectName() != "export_fits" or _is_fits(known.path))
        self.actions["colour"].setEnabled(
            known.frame is None or known.frame.colour is not None or bool(known.frame.bayer)
        )

    def _close(self) -> None:
        window, keep = self.window, self.settings
        keep.keep("geometry", window.saveGeometry())
        keep.keep("rail", window.saveState(LAYOUT))
        keep.keep("closed", time.strftime("%Y-%m-%d"))
        # The event loop, which writes settings by itself now and then, is about to end.
        keep.write()


def _is_fits(path: Path | None) -> bool:
    """Whether a file may be FITS; only FITS can be copied with a WCS in its header."""
    return path is not None and SUFFIXES.get(path.suffix.lower(), "FITS") == "FITS"


def _kinds() -> str:
    """The file types of the open dialog, in both cases for systems that tell capitals apart."""
    endings = " ".join(f"*{s} *{s.upper()}" for s in SUFFIXES)
    return tr("Images ({endings});;All files (*)", endings=endings)
