"""Where the parts of the window stand, from one start to the next: full screen, tools that fill it, tabs of details."""

import time

from PySide6.QtCore import QObject, Qt

from kochab.text.translation import tr
from kochab.window.frame.session import Session
from kochab.window.settings import WindowSettings
from kochab.window.shell.main_window import MainWindow
from kochab.window.shell.views import Views

LAYOUT = 2  # of the parts of the window; places kept by an older one are forgotten


class Layout(QObject):
    """Restores the places of the parts, keeps them at the end, and changes them meanwhile."""

    def __init__(self, window: MainWindow, views: Views, session: Session, settings: WindowSettings) -> None:
        super().__init__(window)
        self._window, self._views, self._session, self._settings = window, views, session, settings
        self._actions = window.actions_by_name
        views.emptied.connect(lambda: self._actions["fill"].setChecked(False))
        window.closing.connect(self._keep)

    def restore(self) -> None:
        """Put the parts where they were; only docks that are there by now get their places back."""
        window = self._window
        parts = {"geometry": window.restoreGeometry, "rail": lambda kept: window.restoreState(kept, LAYOUT)}
        for name, restore in parts.items():
            if (saved := self._settings.data(name)) is not None:
                restore(saved)
        self._actions["log"].setChecked(not window.log.isHidden())

    def _keep(self) -> None:
        window, keep = self._window, self._settings
        keep.keep("geometry", window.saveGeometry())
        keep.keep("rail", window.saveState(LAYOUT))
        keep.keep("closed", time.strftime("%Y-%m-%d"))
        # The event loop, which writes settings by itself now and then, is about to end.
        keep.write()

    def use_full_screen(self, on: bool) -> None:
        """Fill the screen, or go back to the window's size."""
        full, state = Qt.WindowState.WindowFullScreen, self._window.windowState()
        self._window.setWindowState(state | full if on else state & ~full)

    def fill(self, on: bool) -> None:
        """Hide the image beside the open tools; without one it stays, as does a picture that belongs to the tool."""
        docked = [d for d in self._views.docks.values() if d.isVisible() and not d.isFloating()]
        fills = on and bool(docked) and not self._window.in_room
        self._window.pages.setVisible(not fills)
        if on and not fills:
            self._window.say(
                tr("The picture is part of this tool.") if docked else tr("Open a tool first (Tools menu).")
            )
            self._actions["fill"].setChecked(False)

    def show_solution(self) -> None:
        """Show the solution among the details."""
        self._show_tab(0)

    def show_stars(self) -> None:
        """Show the table of stars among the details."""
        self._show_tab(1)

    def show_hints(self) -> None:
        """Show hints and methods among the details."""
        self._show_tab(2)

    def _show_tab(self, index: int) -> None:
        panes = self._window.workspace
        self._views.show("details")
        panes.tabs.setCurrentIndex(index)
        (panes.tabs.tabBar(), panes.stars.table, panes.hints.fov)[index].setFocus()

    def escape(self) -> None:
        """End what runs first; the next Esc leaves the full screen."""
        if self._session.busy:
            self._session.cancel()
        elif self._actions["full"].isChecked():
            self._actions["full"].setChecked(False)
