"""What menus, toolbar and keys do, and what of it is remembered."""

import time
from pathlib import Path

from PySide6.QtCore import QObject, Qt

from app.core.solution import Solution
from app.frames.formats import SUFFIXES
from app.ui.actions import MARKS, connect
from app.ui.dialogs import ask_open
from app.ui.exports import Exporter
from app.ui.formats import short_name
from app.ui.help import about, keyboard
from app.ui.looks import Looks
from app.ui.presenter import Presenter
from app.ui.samples import Sample
from app.ui.services import Jobs, Services
from app.ui.thumbnails import Thumbnails
from app.ui.views import Views
from app.ui.wiring import Wiring


class Commands(QObject):
    """Connects the actions of one window."""

    def __init__(
        self, presenter: Presenter, samples: list[Sample], wiring: Wiring | None = None
    ) -> None:
        super().__init__(presenter.window)
        self.presenter = presenter
        self.window, self.session = presenter.window, presenter.session
        self.settings = presenter.settings
        self.actions = self.window.actions_by_name
        self.looks = Looks(presenter)
        wiring = wiring or Wiring()
        self.exporter = Exporter(
            self.window, self.session, wiring.to_json, red=lambda: self.looks.is_night
        )
        self.services = Services(
            self.settings, self.session, self.looks, Jobs(self.window), wiring, self._say,
            self.window.workspace.view, self.window.workspace,
        )  # fmt: skip
        self.views = Views(self.window, self.services)
        self.views.emptied.connect(lambda: self.actions["fill"].setChecked(False))
        self._restore()
        self._connect()
        self.window.menus.show_files(
            self.window.menus.samples, [(s.title, s.path) for s in samples], self.open
        )
        self._sample_paths = [s.path for s in samples]
        self._show_recent()
        self._enable()

    # set-up -----------------------------------------------------------------------------------
    def _restore(self) -> None:
        keep, window = self.settings, self.window
        for name, restore in (("geometry", window.restoreGeometry), ("state", window.restoreState),
                              ("splitter", window.workspace.restoreState)):  # fmt: skip
            saved = keep.data(name)
            if saved is not None:
                restore(saved)
        self.actions["log"].setChecked(not window.log.isHidden())

    def _connect(self) -> None:
        window, panes = self.window, self.window.workspace
        connect(self.actions, {
            "open": self.choose, "clear_recent": self._clear_recent, "quit": window.close,
            "solve": self.presenter.solve, "cancel": self._escape, "fit": panes.view.fit,
            "one": panes.view.actual_pixels, "in": panes.view.zoom_in, "out": panes.view.zoom_out,
            "stretch": panes.strip.auto.setChecked, "colour": self.looks.show_frame,
            "night": self.looks.use_night,
            "fill": self._fill, "full": self._full_screen, "log": window.log.setVisible,
            "copy": panes.solution.copy_position, "copy_all": panes.solution.copy_all,
            "tab_solution": lambda: self._tab(0), "tab_stars": lambda: self._tab(1),
            "tab_hints": lambda: self._tab(2), "about": lambda: about(window).open(),
            "keys": lambda: keyboard(window).open(),
            **{name: lambda on, n=name: self.looks.show_mark(n, on) for name in MARKS},
        })  # fmt: skip
        window.log.visibilityChanged.connect(
            lambda _: self.actions["log"].setChecked(not window.log.isHidden())
        )
        window.welcome.open_wanted.connect(self.choose)
        window.welcome.file_wanted.connect(self.open)
        self._offer_practice()
        window.files_dropped.connect(self._open_dropped)
        window.closing.connect(self._close)
        for signal in (self.session.opening, self.session.solving, self.session.solved,
                       self.session.idle, self.session.opened, self.session.streaming):  # fmt: skip
            signal.connect(self._enable)
        self.session.opened.connect(self._show_recent)

    def _offer_practice(self) -> None:
        able = self.services.wiring.practice is not None
        menu = self.window.menus.practice
        menu.setVisible(able)
        menu.triggered.connect(lambda _=False: self.practise())
        self.window.welcome.practice.setVisible(able)
        self.window.welcome.practice_wanted.connect(self.practise)

    def practise(self) -> None:
        """Start a simulated telescope in the Mount view."""
        self.views.show("mount")
        view = self.views.docks["mount"].view
        if view is not None:
            view.practise()  # type: ignore[attr-defined]

    # files ------------------------------------------------------------------------------------
    def choose(self) -> None:
        """Ask for a file and open it."""
        start = self.settings.text("folder", str(Path.home()))
        path = ask_open(self.window, start, _kinds(), self.looks.is_night)
        if path is not None:
            self.open(path)

    def open(self, path: Path) -> None:
        """Open a file."""
        self.settings.keep("folder", str(path.absolute().parent))
        self.session.open(path)

    def _open_dropped(self, paths: list[Path]) -> None:
        self.open(paths[0])
        if len(paths) > 1:
            self._say(f"One frame is open at a time: {short_name(paths[0].name)}, of {len(paths)}.")

    def add_thumbnails(self) -> None:
        """Draw small pictures of the samples, when they are ready."""
        made = Thumbnails(self._sample_paths, self.window)
        made.made.connect(
            lambda path, picture: self.window.welcome.add_picture(
                path, picture, self.looks.is_night
            )
        )
        made.job.start()

    def _show_recent(self) -> None:
        recent = self.settings.recent
        menus = self.window.menus
        menus.show_files(menus.recent, [(p.name, p) for p in recent], self.open)
        self.window.welcome.show_recent(recent)

    def _clear_recent(self) -> None:
        self.settings.clear_recent()
        self._show_recent()

    # window -----------------------------------------------------------------------------------
    def _say(self, sentence: str) -> None:
        self.window.status.showMessage(sentence, 8000)

    def _full_screen(self, on: bool) -> None:
        full, state = Qt.WindowState.WindowFullScreen, self.window.windowState()
        self.window.setWindowState(state | full if on else state & ~full)
        self._enable()

    def _fill(self, on: bool) -> None:
        """Leave the window to the tools that are open; without one the frame stays."""
        docked = [d for d in self.views.docks.values() if d.isVisible() and not d.isFloating()]
        self.window.pages.setVisible(not (on and docked))
        if on and not docked:
            self._say("Open a tool first (Tools menu).")
            self.actions["fill"].setChecked(False)

    def _tab(self, index: int) -> None:
        panes = self.window.workspace
        if panes.turn_to(index):
            (panes.tabs.tabBar(), panes.stars.table, panes.hints.fov)[index].setFocus()
        else:
            panes.view.setFocus()

    def _escape(self) -> None:
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
        keep.keep("state", window.saveState())
        keep.keep("splitter", window.workspace.saveState())
        keep.keep("closed", time.strftime("%Y-%m-%d"))
        keep.write()
        self.session.close()


def _is_fits(path: Path | None) -> bool:
    """Whether a file may be FITS, which alone can be copied with other words in its header."""
    return path is not None and SUFFIXES.get(path.suffix.lower(), "FITS") == "FITS"


def _kinds() -> str:
    """The file kinds of the open dialog; some systems tell capitals apart."""
    endings = " ".join(f"*{s} *{s.upper()}" for s in SUFFIXES)
    return f"Frames ({endings});;All files (*)"
