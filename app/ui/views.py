"""The views of the Tools menu: each a dock, built when it is first seen."""

from importlib import import_module

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QAction, QKeySequence, QShowEvent
from PySide6.QtWidgets import QDockWidget, QTabWidget, QWidget

from app.ui.main_window import MainWindow
from app.ui.numerals import dress_numbers
from app.ui.services import Services
from app.ui.widgets import scrolled

# name -> (title with its mnemonic, shortcut, the widget, made with Services alone).
# F1, F5 and F11 are taken. Meant for the rest: F2 live, F4 polar, F7 at the bolts.
VIEWS: dict[str, tuple[str, str, str]] = {
    "live": ("L&ive", "F2", "app.ui.live.view:LiveView"),
    "mount": ("&Mount", "F3", "app.ui.mount.view:MountView"),
    "polar": ("&Polar alignment", "F4", "app.ui.polar.view:PolarView"),
    "laboratory": ("&Laboratory", "F6", "app.ui.lab.view:LaboratoryView"),
}
WITH_MOUNT = ("live", "mount", "polar")  # beside these it is said how the mount is
SHARE = 0.5  # of the window's width, for the first dock that is opened


class ViewDock(QDockWidget):
    """The shell of one view; it costs nothing until it is shown."""

    def __init__(self, name: str, title: str, services: Services, window: MainWindow) -> None:
        super().__init__(title, window)
        self.setObjectName(f"view_{name}")  # by which its place is kept across starts
        self.view: QWidget | None = None
        self._name, self._services = name, services

    def showEvent(self, event: QShowEvent) -> None:
        if self.view is None:
            if self._name in WITH_MOUNT:
                self._services.mount  # noqa: B018  (it shows itself in the window's corner)
            self.view = make_view(self._name, self._services)
            self.setWidget(scrolled(self.view))  # a small screen must not be outgrown
            self._services.looks.dress_fields(self.view)
            dress_numbers(self.view)
        super().showEvent(event)


def make_view(name: str, services: Services) -> QWidget:
    """The widget of a view, new."""
    module, _, kind = VIEWS[name][2].partition(":")
    made: QWidget = getattr(import_module(module), kind)(services)
    return made


class Views(QObject):
    """Their docks and the actions that show them."""

    emptied = Signal()  # the last docked view was closed or taken out

    def __init__(self, window: MainWindow, services: Services) -> None:
        super().__init__(window)
        self._window = window
        window.setTabPosition(Qt.DockWidgetArea.RightDockWidgetArea, QTabWidget.TabPosition.North)
        self.docks: dict[str, ViewDock] = {}
        self.actions: dict[str, QAction] = {}
        for name, (title, keys, _) in VIEWS.items():
            self._add(name, title, keys, services)

    def _add(self, name: str, title: str, keys: str, services: Services) -> None:
        dock = ViewDock(name, title.replace("&", ""), services, self._window)
        area = Qt.DockWidgetArea.RightDockWidgetArea
        self._window.addDockWidget(area, dock)
        if self.docks:
            self._window.tabifyDockWidget(next(iter(self.docks.values())), dock)
        dock.hide()
        action = QAction(title, self._window)
        action.setObjectName(f"view_{name}")
        action.setCheckable(True)
        action.setShortcut(QKeySequence(keys))
        action.triggered.connect(lambda _=False: self.toggle(name))
        dock.visibilityChanged.connect(lambda _: action.setChecked(not dock.isHidden()))
        dock.visibilityChanged.connect(self._look)
        dock.topLevelChanged.connect(self._look)
        self._window.menus.tools.addAction(action)
        self._window.addAction(action)
        self.docks[name], self.actions[name] = dock, action

    def _look(self, _: bool) -> None:
        if all(dock.isHidden() or dock.isFloating() for dock in self.docks.values()):
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
        alone = all(d.isHidden() or d.isFloating() for d in self.docks.values())
        dock.show()
        dock.raise_()
        if alone and not dock.isFloating():
            wanted = round(self._window.width() * SHARE)
            self._window.resizeDocks([dock], [wanted], Qt.Orientation.Horizontal)
        if dock.view is not None:
            dock.view.setFocus()
