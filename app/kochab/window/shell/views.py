"""The modes of the rail: each a dock beside the image, built when first shown, and what every view is given."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtGui import QAction, QKeySequence, QShowEvent
from PySide6.QtWidgets import QDockWidget, QWidget

from kochab.core import tr, tr_noop
from kochab.gear.actions import MountSituation
from kochab.window.devices.equipment import Equipment
from kochab.window.frame.session import Session
from kochab.window.frame.workspace import Workspace
from kochab.window.job import Jobs
from kochab.window.settings import WindowSettings
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.main_window import MainWindow
from kochab.window.undo import Undo
from kochab.window.widgets import scrolled
from kochab.workflows.session.wiring import Wiring

if TYPE_CHECKING:
    from kochab.sky import Catalogue
    from kochab.window.devices.cameras import Cameras
    from kochab.window.devices.mount_control import MountControl


@dataclass(frozen=True)
class Services:
    """What a view may use of the window.

    ``say`` shows a sentence in the status bar for a while; ``panes`` hold the open image.
    ``equipment`` is the profile in use, ``undo`` has what may be taken back; ``mount`` is the one owner of the mount's
    line, ``cameras`` of every camera.
    """

    settings: WindowSettings
    session: Session
    looks: Appearance
    jobs: Jobs
    wiring: Wiring
    say: Callable[[str], None]
    panes: Workspace
    equipment: Equipment
    undo: Undo

    @cached_property
    def mount(self) -> "MountControl":
        """The mount of this window, the same for every view; made when first used."""
        from kochab.window.devices.mount_control import MountControl
        from kochab.window.devices.mount_status import MountStatus

        control = MountControl(self.settings, self.session, self.jobs, self.wiring, self.cameras)
        window = self.panes.window()
        assert isinstance(window, MainWindow)
        window.bar.add(MountStatus(control, window.closing))
        control.changed.connect(lambda: self.equipment.lock(control.known.phase != "off"))
        self.equipment.changed.connect(control.compare_site)
        self.panes.hints.site_given.connect(control.compare_site)
        return control

    @cached_property
    def cameras(self) -> "Cameras":
        """The cameras of this window, shared by its views; made when first used."""
        from kochab.window.devices.cameras import Cameras

        return Cameras(self.jobs)

    @property
    def situation(self) -> MountSituation:
        """What decides on orders to the mount, whose owner is not made to ask."""
        made: MountControl | None = vars(self).get("mount")
        return MountSituation() if made is None else made.situation

    @staticmethod
    @cache
    def catalogue() -> "Catalogue":
        """The star catalogue, opened once; some ms the first time, so call it in a job."""
        from kochab.sky import open_catalogue

        return open_catalogue()


# name -> (title with its mnemonic, shortcut, the widget, made with Services alone).
VIEWS: dict[str, tuple[str, str, str]] = {
    "live": (tr_noop("L&ive"), "F2", "kochab.window.live.view:LiveView"),
    "mount": (tr_noop("&Mount"), "F3", "kochab.window.mount.view:MountView"),
    "polar": (tr_noop("&Polar alignment"), "F4", "kochab.window.polar.view:PolarView"),
    "laboratory": (tr_noop("&Laboratory"), "F6", "kochab.window.laboratory.view:LaboratoryView"),
}
# On the rail, where they differ from the title.
SHORT = {"polar": tr_noop("Polar"), "laboratory": tr_noop("Lab")}
WITH_MOUNT = ("live", "mount", "polar")  # these show the mount's state in the bar
SHARE, MOST_PX = 0.34, 640  # of the window's width for what stands beside the image, and the most it takes
LEAST_SHARE = 0.5  # of the image, in a window that was made smaller


class ViewDock(QDockWidget):
    """The dock of one view, which is made when first shown."""

    def __init__(self, name: str, title: str, services: Services, window: MainWindow) -> None:
        super().__init__(title, window)
        self.setObjectName(f"view_{name}")  # by which its place is kept across starts
        self.view: QWidget | None = None
        self._name, self._services = name, services

    def hold(self, view: QWidget) -> None:
        """Hold a view that is made already."""
        self.view = view
        self.setWidget(view)

    def make(self) -> QWidget:
        """The view, made now if it was not."""
        if self.view is None:
            if self._name in WITH_MOUNT:
                self._services.mount  # noqa: B018  (puts itself in the bar)
            module, _, kind = VIEWS[self._name][2].partition(":")
            self.view = getattr(import_module(module), kind)(self._services)
        assert self.view is not None
        return self.view

    def dress(self) -> None:
        """Hold the view, in the window's style."""
        view = self.make()
        if self.widget() is None:
            self.setWidget(holder := scrolled(view))  # a view may be taller than a small screen
            self._services.looks.redden_carets(view)
            # Styled here, while `toggle` shows it in the next turn of the event loop.
            holder.ensurePolished()

    def showEvent(self, event: QShowEvent) -> None:
        self.dress()
        super().showEvent(event)


class Views(QObject):
    """The docks of all views, the frame's details among them, and the actions that show them: one at a time."""

    emptied = Signal()  # the last docked view was closed or taken out

    def __init__(self, window: MainWindow, services: Services) -> None:
        super().__init__(window)
        self._window = window
        self.docks: dict[str, ViewDock] = {}
        self._coming = ""  # the view that is being made, styled and shown, each in a turn of the event loop
        self.image = self._action("image", tr("Ima&ge"), "F8")
        self.image.triggered.connect(lambda _=False: self.show("image"))
        self.actions = {name: self._action(name, tr(title), keys) for name, (title, keys, _) in VIEWS.items()}
        window.rail.fill(
            [self.image, *self.actions.values()], [window.actions_by_name[name] for name in ("night", "preferences")]
        )
        self.actions["details"] = window.actions_by_name["details"]
        for name in self.actions:
            self._add(name, services)
        self.docks["details"].hold(services.panes.tabs)
        window.resized.connect(self._keep_share)
        self._look()

    def _action(self, name: str, title: str, keys: str) -> QAction:
        action = QAction(title, self._window, checkable=True, shortcut=QKeySequence(keys), iconVisibleInMenu=False)
        action.setObjectName(f"view_{name}")
        action.setIconText(tr(SHORT[name]) if name in SHORT else title.replace("&", ""))
        action.setToolTip(f"{title.replace('&', '')} ({keys})")
        self._window.actions_by_name[name] = action
        self._window.menus.tools.addAction(action)
        self._window.addAction(action)
        return action

    def _add(self, name: str, services: Services) -> None:
        dock = ViewDock(name, self.actions[name].text().replace("&", ""), services, self._window)
        self._window.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, dock)
        if self.docks:
            self._window.tabifyDockWidget(next(iter(self.docks.values())), dock)
        dock.hide()
        self.actions[name].triggered.connect(lambda _=False: self.toggle(name))
        dock.visibilityChanged.connect(self._look)
        dock.topLevelChanged.connect(self._look)
        self.docks[name] = dock

    @property
    def docked(self) -> list[str]:
        """What stands beside the image."""
        return [name for name, dock in self.docks.items() if not (dock.isHidden() or dock.isFloating())]

    def _look(self, _: bool = False) -> None:
        for name, dock in self.docks.items():
            self.actions[name].setChecked(not dock.isHidden())
        self.image.setChecked(not set(self.docked) - {"details"})
        if not self.docked:
            self.emptied.emit()

    def _keep_share(self) -> None:
        """Leave the image half of a window that was made smaller: what stands beside it keeps its width by itself."""
        for dock in map(self.docks.__getitem__, self.docked):
            if dock.width() > LEAST_SHARE * self._window.width():
                self._window.resizeDocks([dock], [self._share_px], Qt.Orientation.Horizontal)

    @property
    def _share_px(self) -> int:
        return min(round(self._window.width() * SHARE), MOST_PX)

    def toggle(self, name: str) -> None:
        """Bring a view to the front, or close it when it is there already."""
        dock = self.docks[name]
        if dock.view is None:  # all in one turn would hold up the window for 60 ms
            self._coming = name
            dock.make()
            QTimer.singleShot(0, self, self._go_on)
        else:
            self.show(name if dock.isHidden() else "image")

    def _go_on(self) -> None:
        """Style, and in the next turn show, the view that was asked for last."""
        if self._coming and self.docks[self._coming].widget() is None:
            self.docks[self._coming].dress()
            QTimer.singleShot(0, self, self._go_on)
        elif self._coming:
            self.show(self._coming)

    def show(self, name: str) -> None:
        """Put a view beside the image, in place of the one there, and give it the focus; "image" puts none there."""
        self._coming = ""
        dock, before = self.docks.get(name), self.docked
        if dock is not None:
            dock.show()
            dock.raise_()
            if not dock.isFloating() and not before:
                self._window.resizeDocks([dock], [self._share_px], Qt.Orientation.Horizontal)
            if dock.view is not None:
                dock.view.setFocus()
        for other in before:
            self.docks[other].setHidden(other != name)
        if dock is None and self._window.pages.currentWidget() is self._window.workspace:
            self._window.workspace.view.setFocus()
        self._look()
