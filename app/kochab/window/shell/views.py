"""The modes of the rail: each a dock beside the image, whose view is made when first shown."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtGui import QAction, QKeySequence, QShowEvent
from PySide6.QtWidgets import QDockWidget, QWidget

from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_status import MountStatus
from kochab.window.services import Services
from kochab.window.shell.actions import colour_icons
from kochab.window.shell.appearance import Appearance
from kochab.window.shell.main_window import MainWindow
from kochab.window.shell.side import HANDLE_PX, Side
from kochab.window.themes import theme_colours
from kochab.window.view import View


class Mode(NamedTuple):
    """A view on the rail. Its class, ``made_by``, is imported and built from the services when first shown."""

    title: str  # with its mnemonic
    key: str
    made_by: str  # "module:Class"
    short: str = ""  # on the rail, where it differs from the title
    needs_mount: bool = False  # the bar shows the mount's state from then on
    on_rail: bool = True  # else among the tools alone


VIEWS: dict[str, Mode] = {
    "live": Mode(tr_noop("L&ive"), "F2", "kochab.window.live.view:LiveView", needs_mount=True),
    "mount": Mode(tr_noop("&Mount"), "F3", "kochab.window.mount.view:MountView", needs_mount=True),
    "polar": Mode(
        tr_noop("&Polar alignment"), "F4", "kochab.window.polar.view:PolarView", tr_noop("Polar"), needs_mount=True
    ),
    "laboratory": Mode(tr_noop("&Laboratory"), "F6", "kochab.window.laboratory.view:LaboratoryView", tr_noop("Lab")),
    "last_night": Mode(tr_noop("Last nig&ht"), "F9", "kochab.window.night.view:NightView", on_rail=False),
}
SHARE, MOST_PX = 0.34, 640  # of the window's width for what stands beside the image, and the most it takes
BESIDE_ROOM, BESIDE_ROOM_PX = 0.2, 400  # the same beside a view's own room
ANY_PX = 16_777_215  # Qt's own number for no limit
EDGES_PX = 4  # between the image and what stands beside it
LEAST_SHARE = 0.5  # of the image, in a window that was made smaller


class ViewDock(QDockWidget):
    """The dock of one view, which ``make`` makes when first shown."""

    held = Signal(object)  # itself, once it has its view

    def __init__(
        self, name: str, title: str, make: Callable[[str], QWidget], appearance: Appearance, window: MainWindow
    ) -> None:
        super().__init__(title, window)
        self.setObjectName(f"view_{name}")  # by which its place is kept across starts
        self.view: QWidget | None = None
        self.side: Side | None = None
        self._bare = QWidget()  # no title over a folded side
        self._name, self._make, self._appearance = name, make, appearance

    def hold(self, view: QWidget) -> None:
        """Hold a view that is made already."""
        self.view = view
        self.side = Side(view)
        self.setWidget(self.side)
        self.held.emit(self)

    def make(self) -> QWidget:
        """The view, made now if it was not."""
        if self.view is None:
            self.view = self._make(self._name)
        return self.view

    def dress(self) -> None:
        """Hold the view, in the window's style."""
        view = self.make()
        if self.side is None:
            self.hold(view)
            self._appearance.redden_carets(view)
            if isinstance(view, View) and view.room is not None:
                self._appearance.redden_carets(view.room)
            # Styled here, while `toggle` shows it in the next turn of the event loop.
            assert self.side is not None
            self.ensurePolished()
            self._appearance.meet(self)  # an empty one has had no style, or that of an earlier theme
            self.side.ensurePolished()

    def show_folded(self) -> None:
        """Be as narrow as the handle while the view is folded away."""
        if self.side is None:
            return
        self.side.handle.setHidden(self.isFloating())
        folded = self.side.folded and not self.isFloating()
        self.setMaximumWidth(HANDLE_PX if folded else ANY_PX)
        if (self.titleBarWidget() is self._bare) is not folded:
            # None gives it Qt's own again.
            self.setTitleBarWidget(self._bare if folded else None)  # type: ignore[arg-type]

    def showEvent(self, event: QShowEvent) -> None:
        self.dress()
        super().showEvent(event)


class Views(QObject):
    """The docks of all views, the frame's details among them, and the actions that show them: one at a time."""

    emptied = Signal()  # the last docked view was closed or taken out

    def __init__(
        self, window: MainWindow, services: Services, appearance: Appearance, mount_status: MountStatus
    ) -> None:
        super().__init__(window)
        self._window, self._services = window, services
        self._appearance, self._mount_status = appearance, mount_status
        self._made: dict[str, View] = {}
        self.docks: dict[str, ViewDock] = {}
        self._room: QWidget | None = None  # of the view that is shown
        self._hides = False  # whether the image gave its place to what stands beside it
        self._coming = ""  # the view that is being made, styled and shown, each in a turn of the event loop
        self.image = self._action("image", tr("Ima&ge"), "F8")
        self.image.triggered.connect(lambda _=False: self.show("image"))
        self.actions = {name: self._action(name, tr(mode.title), mode.key, mode.short) for name, mode in VIEWS.items()}
        window.rail.fill(
            [self.image, *(self.actions[name] for name, mode in VIEWS.items() if mode.on_rail)],
            [window.actions_by_name[name] for name in ("night", "preferences")],
        )
        colour_icons({"image": self.image, **self.actions}, theme_colours())  # the others have theirs
        self.actions["details"] = window.actions_by_name["details"]
        for name in self.actions:
            self._add(name)
        self.docks["details"].hold(services.panes.tabs)
        for dock in self.docks.values():
            dock.held.connect(self._hold)
            dock.topLevelChanged.connect(lambda _, of=dock: None if of.side is None else of.side.fold(False))
        self._hold(self.docks["details"])
        window.resized.connect(self._keep_share)
        self._look()

    def _action(self, name: str, title: str, keys: str, short: str = "") -> QAction:
        action = QAction(title, self._window, checkable=True, shortcut=QKeySequence(keys), iconVisibleInMenu=False)
        action.setObjectName(f"view_{name}")
        action.setIconText(tr(short) or title.replace("&", ""))
        action.setToolTip(f"{title.replace('&', '')} ({keys})")
        self._window.actions_by_name[name] = action
        self._window.menus.tools.addAction(action)
        self._window.addAction(action)
        return action

    def _make(self, name: str) -> View:
        mode = VIEWS[name]
        if mode.needs_mount:
            self._mount_status.show()
        module, _, kind = mode.made_by.partition(":")
        view: View = getattr(import_module(module), kind)(self._services)
        self._made[name] = view
        view.side_wanted.connect(lambda: self._unfold(name, True))
        view.frame_wanted.connect(lambda on: self._show_frame(name, view, on))
        return view

    def _unfold(self, name: str, on: bool) -> None:
        if (side := self.docks[name].side) is not None and (on or side.alone):
            side.fold(not on)

    def _show_frame(self, name: str, view: View, on: bool) -> None:
        self._window.show_room(None if on else view.room)
        self._unfold(name, False)  # where it stands in the picture's place

    def _add(self, name: str) -> None:
        title = self.actions[name].text().replace("&", "")
        dock = ViewDock(name, title, self._make, self._appearance, self._window)
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
            self._part(self._window.width())
        shown = [view for name, view in self._made.items() if not self.docks[name].isHidden()]
        room = next((view.room for view in shown if view.room is not None), None)
        if room is not self._room:  # and not again, when the open frame was asked for in its place
            self._room = room
            self._window.show_room(room)

    def _hold(self, dock: ViewDock) -> None:
        """Listen to the handle of a dock that holds its view now."""
        assert dock.side is not None
        dock.side.handled.connect(lambda: self._give_width(dock))

    def _keep_share(self) -> None:
        """Leave the image half of a window that was made smaller, and its page what that needs.

        What stands beside it keeps its width by itself.
        """
        self._part(self._window.width())
        pages = self._window.pages
        for dock in map(self.docks.__getitem__, self.docked):
            wide = dock.width() > LEAST_SHARE * self._window.width() or pages.width() < pages.page_px
            if wide and not pages.isHidden():
                self._window.resizeDocks([dock], [self._share_px(dock)], Qt.Orientation.Horizontal)

    def _part(self, width: int) -> None:
        """Where a window of this width has no room for the image and what stands beside it, show one of them."""
        window, pages = self._window, self._window.pages
        sides = [dock.side for dock in map(self.docks.__getitem__, self.docked) if dock.side is not None]
        pages.gives_way = bool(sides)
        room = width - window.rail.sizeHint().width() - EDGES_PX
        alone = any(pages.page_px + side.whole_px > room for side in sides)
        for side in sides:
            if side.alone is not alone:
                side.alone = alone
                side.show_folded()
        for dock in self.docks.values():
            dock.show_folded()
        hidden = alone and not all(side.folded for side in sides)
        if hidden is not self._hides or hidden:
            self._hides = hidden
            pages.setVisible(not hidden and not window.actions_by_name["fill"].isChecked())

    def _give_width(self, dock: ViewDock) -> None:
        """Leave the handle of a dock, or give it its width back."""
        self._part(self._window.width())
        if not dock.isFloating():
            self._window.resizeDocks([dock], [self._share_px(dock)], Qt.Orientation.Horizontal)

    def _share_px(self, dock: ViewDock) -> int:
        share, most = (BESIDE_ROOM, BESIDE_ROOM_PX) if self._has_room(dock) else (SHARE, MOST_PX)
        return min(round(self._window.width() * share), most)

    @staticmethod
    def _has_room(dock: ViewDock | None) -> bool:
        return dock is not None and isinstance(dock.view, View) and dock.view.room is not None

    def aim(self, action: str, target: str) -> None:
        """Have the Mount view go to a target, or "centre" it."""
        self.show("mount")
        if (view := self._made.get("mount")) is not None:
            view.aim(action, target)

    def practise(self) -> None:
        """Have the Mount view start a simulated telescope."""
        self.show("mount")
        if (view := self._made.get("mount")) is not None:
            view.practise()

    def measure(self, paths: list[Path]) -> None:
        """Have the Polar view measure the axis from these frames."""
        self.show("polar")
        if (view := self._made.get("polar")) is not None:
            view.measure(paths)

    def toggle(self, name: str) -> None:
        """Bring a view to the front, or close it when it is there already."""
        dock = self.docks[name]
        if dock.view is None:  # all in one turn would hold up the window for 60 ms
            self._coming = name
            dock.make()
            QTimer.singleShot(0, self, self._go_on)
        elif not dock.isHidden() and self._has_room(dock) and not self._window.in_room:
            self._window.show_room(self._room)
        else:
            self.show(name if dock.isHidden() else "image")

    def _go_on(self) -> None:
        """Style, and in the next turn show, the view that was asked for last."""
        if self._coming and self.docks[self._coming].side is None:
            self.docks[self._coming].dress()
            QTimer.singleShot(0, self, self._go_on)
        elif self._coming:
            self.show(self._coming)

    def show(self, name: str) -> None:
        """Put a view beside the image, in place of the one there, and give it the focus; "image" puts none there."""
        self._coming = ""
        dock, before, size = self.docks.get(name), self.docked, self._window.size()
        if dock is not None:
            dock.show()
            dock.raise_()
            wide = [self._has_room(self.docks[other]) for other in before] != [self._has_room(dock)]
            if not dock.isFloating() and wide:
                self._window.resizeDocks([dock], [self._share_px(dock)], Qt.Orientation.Horizontal)
            if dock.view is not None:
                dock.view.setFocus()
        for other in before:
            self.docks[other].setHidden(other != name)
        if dock is None and self._window.pages.currentWidget() is self._window.workspace:
            self._window.workspace.view.setFocus()
        self._look()
        self._part(size.width())
        if self._window.size() != size:  # it grew for two views and a room at once, perhaps past the screen
            if (layout := self._window.layout()) is not None:
                layout.activate()
            self._window.resize(size)
        QTimer.singleShot(0, self, self._keep_share)  # once the parts have their sizes
