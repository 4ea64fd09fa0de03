"""The views of the Tools menu: each a dock, built when first shown, and what every view is given."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QAction, QKeySequence, QShowEvent
from PySide6.QtWidgets import QDockWidget, QTabWidget, QWidget

from kochab.window.job import Jobs
from kochab.window.session import Session
from kochab.window.settings import WindowSettings
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.main_window import MainWindow, Workspace
from kochab.window.widgets import scrolled
from kochab.workflows.session.wiring import Wiring

if TYPE_CHECKING:
    from kochab.sky import Catalogue
    from kochab.window.cameras import Cameras
    from kochab.window.mount.connection import MountControl


@dataclass(frozen=True)
class Services:
    """What a view may use of the window.

    ``say`` shows a sentence in the status bar for a while; ``panes`` hold the open image.
    ``mount`` is the one owner of the mount's line, ``cameras`` of every camera.
    """

    settings: WindowSettings
    session: Session
    looks: Appearance
    jobs: Jobs
    wiring: Wiring
    say: Callable[[str], None]
    panes: Workspace

    @cached_property
    def mount(self) -> "MountControl":
        """The mount of this window, the same for every view; made when first used."""
        from kochab.window.mount.connection import MountControl
        from kochab.window.mount.status import MountStatus

        control = MountControl(self.settings, self.session, self.jobs, self.wiring, self.cameras)
        window = self.panes.window()
        assert isinstance(window, MainWindow)
        MountStatus(control, window)
        return control

    @cached_property
    def cameras(self) -> "Cameras":
        """The cameras of this window, shared by its views; made when first used."""
        from kochab.window.cameras import Cameras

        return Cameras(self.jobs)

    @staticmethod
    @cache
    def catalogue() -> "Catalogue":
        """The star catalogue, opened once; some ms the first time, so call it in a job."""
        from kochab.sky import open_catalogue

        return open_catalogue()


# name -> (title with its mnemonic, shortcut, the widget, made with Services alone).
VIEWS: dict[str, tuple[str, str, str]] = {
    "live": ("L&ive", "F2", "kochab.window.live.view:LiveView"),
    "mount": ("&Mount", "F3", "kochab.window.mount.view:MountView"),
    "polar": ("&Polar alignment", "F4", "kochab.window.polar.view:PolarView"),
    "laboratory": ("&Laboratory", "F6", "kochab.window.laboratory.view:LaboratoryView"),
}
WITH_MOUNT = ("live", "mount", "polar")  # these show the mount's state in the status bar
SHARE = 0.5  # of the window's width, for the first dock that is opened


class ViewDock(QDockWidget):
    """The dock of one view, which is made when first shown."""

    def __init__(self, name: str, title: str, services: Services, window: MainWindow) -> None:
        super().__init__(title, window)
        self.setObjectName(f"view_{name}")  # by which its place is kept across starts
        self.view: QWidget | None = None
        self._name, self._services = name, services

    def showEvent(self, event: QShowEvent) -> None:
        if self.view is None:
            if self._name in WITH_MOUNT:
                self._services.mount  # noqa: B018  (puts itself in the status bar)
            module, _, kind = VIEWS[self._name][2].partition(":")
            made: QWidget = getattr(import_module(module), kind)(self._services)
            self.view = made
            self.setWidget(scrolled(made))  # a view may be taller than a small screen
            self._services.looks.redden_carets(made)
        super().showEvent(event)


class Views(QObject):
    """The docks of all views and the actions that show them."""

    emptied = Signal()  # the last docked view was closed or taken out

    def __init__(self, window: MainWindow, services: Services) -> None:
        super().__init__(window)
        self._window = window
        window.setTabPosition(Qt.DockWidgetArea.RightDockWidgetArea, QTabWidget.TabPosition.North)
        self.docks: dict[str, ViewDock] = {}
        self.actions: dict[str, QAction] = {}
        for name in VIEWS:
            self._add(name, services)

    def _add(self, name: str, services: Services) -> None:
        title, keys, _ = VIEWS[name]
        dock = ViewDock(name, title.replace("&", ""), services, self._window)
        self._window.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, dock)
        if self.docks:
            self._window.tabifyDockWidget(next(iter(self.docks.values())), dock)
        dock.hide()
        action = QAction(title, self._window, checkable=True, shortcut=QKeySequence(keys))
        action.setObjectName(f"view_{name}")
        action.triggered.connect(lambda _=False: self.toggle(name))
        dock.visibilityChanged.connect(lambda _: action.setChecked(not dock.isHidden()))
        dock.visibilityChanged.connect(self._look)
        dock.topLevelChanged.connect(self._look)
        self._window.menus.tools.addAction(action)
        self._window.addAction(action)
        self.docks[name], self.actions[name] = dock, action

    @property
    def empty(self) -> bool:
        """Whether no view is docked in the window."""
        return all(dock.isHidden() or dock.isFloating() for dock in self.docks.values())

    def _look(self, _: bool) -> None:
        if self.empty:
            self.emptied.emit()

    def toggle(self, name: str) -> None:
        """Bring a view to the front, or close it when it is there already."""
        dock = self.docks[name]
        if not dock.isHidden() and not dock.visibleRegion().isEmpty():
            dock.close()
        else:
            self.show(name)
        self.actions[name].setChecked(not dock.isHidden())

    def show(self, name: str) -> None:
        """Bring a view to the front and give it the focus."""
        dock = self.docks[name]
        alone = self.empty
        dock.show()
        dock.raise_()
        if alone and not dock.isFloating():
            self._window.resizeDocks([dock], [round(self._window.width() * SHARE)], Qt.Orientation.Horizontal)
        if dock.view is not None:
            dock.view.setFocus()
