"""What menus, toolbar and keys do: files, looks, help; and what of it is remembered."""

import time
from pathlib import Path

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QApplication, QFileDialog, QMessageBox

from app import __version__
from app.ui.actions import MARKS, SPECS, connect, dress
from app.ui.exports import EXPORTS
from app.ui.palette import THEMES
from app.ui.presenter import Presenter
from app.ui.samples import Sample
from app.ui.stretch import Stretch
from app.ui.theme import apply_theme

KINDS = (
    "Frames (*.fit *.fits *.fts *.fz *.xisf *.tif *.tiff *.png *.jpg *.jpeg *.bmp *.heic *.heif "
    "*.cr2 *.cr3 *.nef *.arw *.dng *.orf *.raf *.rw2 *.pef *.FIT *.FITS *.CR2 *.CR3 *.NEF *.ARW "
    "*.DNG *.JPG *.PNG *.TIF);;All files (*)"
)


class Commands(QObject):
    """Connects the actions of one window."""

    def __init__(self, presenter: Presenter, samples: list[Sample]) -> None:
        super().__init__(presenter.window)
        self.presenter = presenter
        self.window, self.session = presenter.window, presenter.session
        self.settings = presenter.settings
        self.actions = self.window.actions_by_name
        self._last_dark = "dark"
        self._restore()
        self._connect()
        self.window.menus.show_files(
            self.window.menus.samples, [(s.title, s.path) for s in samples], self.open
        )
        self._show_recent()
        self._enable()

    # set-up -----------------------------------------------------------------------------------
    def _restore(self) -> None:
        keep, window = self.settings, self.window
        for name in MARKS:
            self.actions[name].setChecked(getattr(self.presenter.overlay.switches, name))
        self.actions["stretch"].setChecked(keep.flag("stretch", True))
        window.workspace.strip.auto.setChecked(keep.flag("stretch", True))
        self.actions["colour"].setChecked(keep.flag("colour", True))
        self._last_dark = keep.text("day_theme", "dark")
        self.use_theme(keep.text("theme", "dark"), keep.text("text_size", "normal"))
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
            "stretch": panes.strip.auto.setChecked, "colour": self._look, "night": self._night,
            "full": self._full_screen, "log": window.log.setVisible,
            "copy": panes.solution.copy_position, "copy_all": panes.solution.copy_all,
            "tab_solution": lambda: self._tab(0), "tab_stars": lambda: self._tab(1),
            "tab_hints": lambda: self._tab(2), "about": self._about, "keys": self._keys,
            **{name: lambda on, n=name: self._mark(n, on) for name in MARKS},
        })  # fmt: skip
        window.log.visibilityChanged.connect(
            lambda _: self.actions["log"].setChecked(not window.log.isHidden())
        )
        window.menus.themes.triggered.connect(lambda a: self.use_theme(a.data()))
        window.menus.text_sizes.triggered.connect(lambda a: self.use_theme(text_size=a.data()))
        window.welcome.open_wanted.connect(self.choose)
        window.welcome.file_wanted.connect(self.open)
        window.files_dropped.connect(lambda paths: self.open(paths[0]))
        window.closing.connect(self._close)
        panes.strip.changed.connect(self._stretched)
        for signal in (self.session.opening, self.session.solving, self.session.solved,
                       self.session.idle, self.session.opened):  # fmt: skip
            signal.connect(self._enable)
        self.session.opened.connect(self._show_recent)
        for name, (text, suffix, write) in EXPORTS.items():
            action = window.menus.export.addAction(text)
            action.setObjectName(f"export_{name}")
            action.triggered.connect(lambda _=False, s=suffix, w=write: self._export(s, w))

    # files ------------------------------------------------------------------------------------
    def choose(self) -> None:
        """Ask for a file and open it."""
        options = QFileDialog.Option(0)
        if self.settings.text("theme", "dark") == "night":  # the system's own would not be red
            options |= QFileDialog.Option.DontUseNativeDialog
        start = self.settings.text("folder", str(Path.home()))
        name, _ = QFileDialog.getOpenFileName(
            self.window, "Open a frame", start, KINDS, options=options
        )
        if name:
            self.open(Path(name))

    def open(self, path: Path) -> None:
        """Open a file."""
        self.settings.keep("folder", str(path.absolute().parent))
        self.session.open(path)

    def _show_recent(self) -> None:
        recent = self.settings.recent
        menus = self.window.menus
        menus.show_files(menus.recent, [(p.name, p) for p in recent], self.open)
        self.window.welcome.show_recent(recent)

    def _clear_recent(self) -> None:
        self.settings.clear_recent()
        self._show_recent()

    def _export(self, suffix: str, write: object) -> None:
        from app.ui.exports import run_export

        run_export(self.window, self.session.known, suffix, write)

    # looks ------------------------------------------------------------------------------------
    def use_theme(self, name: str | None = None, text_size: str | None = None) -> None:
        """Dress the application and remember it."""
        name = name or self.settings.text("theme", "dark")
        name = name if name in THEMES else "dark"
        size = text_size or self.settings.text("text_size", "normal")
        app = QApplication.instance()
        assert isinstance(app, QApplication)
        colours = apply_theme(app, name, size)
        self.settings.keep("theme", name)
        self.settings.keep("text_size", size)
        if name != "night":
            self._last_dark = name
            self.settings.keep("day_theme", name)
        dress(self.actions, colours)
        overlay, panes = self.presenter.overlay, self.window.workspace
        overlay.colours, overlay.font = colours, app.font()
        panes.strip.histogram.colours = colours
        panes.view.background.setNamedColor(colours.sky)
        _check(self.window.menus.themes, name)
        _check(self.window.menus.text_sizes, size)
        self.actions["night"].blockSignals(True)
        self.actions["night"].setChecked(name == "night")
        self.actions["night"].blockSignals(False)
        self._look()
        panes.strip.histogram.update()

    def _night(self, on: bool) -> None:
        self.use_theme("night" if on else self._last_dark)

    def _look(self, _: object = None) -> None:
        panes = self.window.workspace
        self.settings.keep("colour", self.actions["colour"].isChecked())
        red = self.settings.text("theme", "dark") == "night"
        panes.view.set_look(panes.strip.stretch, self.actions["colour"].isChecked(), red)

    def _stretched(self, _: Stretch) -> None:
        auto = self.window.workspace.strip.auto.isChecked()
        self.actions["stretch"].setChecked(auto)
        self.settings.keep("stretch", auto)
        self._look()

    def _mark(self, name: str, on: bool) -> None:
        setattr(self.presenter.overlay.switches, name, on)
        self.settings.keep_switches(self.presenter.overlay.switches)
        self.window.workspace.view.update()

    def _full_screen(self, on: bool) -> None:
        if on:
            self.window.setWindowState(self.window.windowState() | Qt.WindowState.WindowFullScreen)
        else:
            self.window.setWindowState(self.window.windowState() & ~Qt.WindowState.WindowFullScreen)

    def _tab(self, index: int) -> None:
        tabs = self.window.workspace.tabs
        tabs.setCurrentIndex(index)
        (tabs.tabBar(), self.window.workspace.stars.table,
         self.window.workspace.hints.fov)[index].setFocus()  # fmt: skip

    def _escape(self) -> None:
        if self.session.busy:
            self.session.cancel()
        elif self.actions["full"].isChecked():
            self.actions["full"].setChecked(False)

    def _enable(self, _: object = None) -> None:
        known = self.session.known
        self.actions["solve"].setEnabled(known.frame is not None)
        for name in ("copy", "copy_all"):
            self.actions[name].setEnabled(known.last_good is not None)
        self.window.menus.export.setEnabled(known.last_good is not None)
        self.actions["colour"].setEnabled(
            known.frame is None or known.frame.colour is not None or bool(known.frame.bayer)
        )

    # help -------------------------------------------------------------------------------------
    def _about(self) -> None:
        QMessageBox.about(
            self.window, "About Kochab",
            f"Kochab {__version__}\n\nWhere your camera points: every star in the frame named, with "
            "nothing to download.\n\nFree software under the GNU General Public License, version 3 "
            "or later.",
        )  # fmt: skip

    def _keys(self) -> None:
        rows = [f"{s.keys.split()[0]:<14}{s.text.replace('&', '').rstrip('…')}"
                for s in SPECS if s.keys]  # fmt: skip
        rows.append("Arrows        Move the frame (when it has the focus)")
        box = QMessageBox(self.window)
        box.setWindowTitle("Keyboard")
        box.setTextFormat(Qt.TextFormat.PlainText)
        box.setText("\n".join(rows))
        box.setStyleSheet("QLabel { font-family: monospace; }")
        box.exec()

    def _close(self) -> None:
        window, keep = self.window, self.settings
        keep.keep("geometry", window.saveGeometry())
        keep.keep("state", window.saveState())
        keep.keep("splitter", window.workspace.saveState())
        keep.keep("closed", time.strftime("%Y-%m-%d"))
        keep.write()
        self.session.close()


def _check(group: object, name: str) -> None:
    for action in group.actions():  # type: ignore[attr-defined]
        action.setChecked(action.data() == name)
