"""The window: it lays out its panes, takes files that are dropped, and closes cleanly."""

import sys

from PySide6.QtCore import QChildEvent, QRect, QSize, Qt, Signal
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QResizeEvent
from PySide6.QtWidgets import QMainWindow, QStackedWidget, QWidget

from kochab.window.dialogs import dropped_files
from kochab.window.frame.workspace import Workspace
from kochab.window.panels.log_panel import LogPanel
from kochab.window.shell.actions import make_actions
from kochab.window.shell.lost_field import typed_in
from kochab.window.shell.menus import Menus, Rail, button_of
from kochab.window.shell.status import Status, TopBar
from kochab.window.shell.welcome import Sample, Welcome

SAY_MS = 8000
GIVES_PX = 40  # so much narrower than its page needs a window may be made, and then shows the page or what is beside it


class MainWindow(QMainWindow):
    """Widgets only; :func:`kochab.window.application.build` makes what connects them."""

    files_dropped = Signal(object)  # list[Path]
    about_to_close = Signal(object)  # a list, into which goes why the window has to stay a little longer
    closing = Signal()
    resized = Signal()
    has_part = Signal(object)  # a QWidget that is about to be seen in the window

    def __init__(self, methods: list[str], detectors: list[str], samples: list[Sample]) -> None:
        super().__init__()
        self.ended_by_signal = False
        self.setWindowTitle("Kochab")
        self.setAcceptDrops(True)
        # The same in every theme, so that the window itself need not be dressed again.
        self.setStyleSheet("QMainWindow::separator { background: transparent; width: 4px; height: 4px; }")
        self.resize(1360, 860)
        self.actions_by_name = make_actions(self)
        self.bar = TopBar()
        self.setMenuWidget(self.bar)
        self.menus = Menus(self, self.bar.menus, self.actions_by_name)
        self.rail = Rail(self)
        self.welcome = Welcome(samples)
        over = [self.actions_by_name[name] for name in ("histogram", "fit", "details")]
        self.bar.add_first(button_of(self.actions_by_name["open"]))
        self.bar.add_search(button_of(self.actions_by_name["search"]))
        buttons = [button_of(self.menus.layers.menuAction(), self.menus.layers), *map(button_of, over)]
        self.workspace = Workspace(methods, detectors, buttons)
        self.pages = _Pages()
        self.pages.addWidget(self.welcome)
        self.pages.addWidget(self.workspace)
        self.setCentralWidget(self.pages)
        self._page: QWidget = self.welcome  # the one that a room gives its place back to
        self.log = LogPanel(self)
        self.addDockWidget(Qt.DockWidgetArea.BottomDockWidgetArea, self.log)
        self.log.hide()
        self.welcome.first.setFocus()
        self.status = Status()
        self.setStatusBar(self.status)

    def keep_within(self, room: QRect) -> None:
        """Shrink and move, so that all of it with its frame is inside ``room``, the screen's in logical px."""
        if self.isMaximized() or self.isFullScreen():
            return
        frame, inside = self.frameGeometry(), self.geometry()
        rim = frame.size() - inside.size()
        for _ in range(2):  # a window that becomes narrow shows less at a time, and then may be narrower still
            self.resize(inside.size().boundedTo(room.size() - rim))
            if (layout := self.layout()) is not None:
                layout.activate()
        frame = self.frameGeometry()
        x = min(max(frame.left(), room.left()), room.right() + 1 - frame.width())
        y = min(max(frame.top(), room.top()), room.bottom() + 1 - frame.height())
        if (x, y) != (frame.left(), frame.top()):
            self.move(x, y)

    def say(self, sentence: str) -> None:
        """Show a sentence in the status bar for a while."""
        self.status.showMessage(sentence, SAY_MS)

    def end(self) -> None:
        """Close, with an alarm too: the program was told to end by a signal, and nobody may be there to read it."""
        self.ended_by_signal = True
        self.close()

    def close_at_last(self, alarm: str) -> None:
        """What the window stayed for is over; with an ``alarm`` it stays open until it is closed once more."""
        self.status.showMessage(alarm)
        if alarm and sys.stderr is not None:  # a program without a console has none
            sys.stderr.write(f"{alarm}\n")
        if not alarm or self.ended_by_signal:
            self.close()

    def show_frame_page(self) -> None:
        self._page = self.workspace
        self.pages.setCurrentWidget(self.workspace)
        if not typed_in(self.focusWidget()):  # letters that follow would be keys of the view
            self.workspace.view.setFocus()

    def take_frame(self) -> None:
        """A camera's frame has come: it takes the welcome page's place, but not that of a view's room."""
        if self.in_room:
            self._page = self.workspace
        else:
            self.show_frame_page()

    @property
    def in_room(self) -> bool:
        """Whether a view's room fills the middle."""
        return self.pages.currentWidget() not in (self.welcome, self.workspace)

    def show_room(self, room: QWidget | None) -> None:
        """Fill the middle with a view's room, or with what was there before it."""
        if room is not None and self.pages.indexOf(room) < 0:
            self.pages.addWidget(room)
            self.has_part.emit(room)
        self.pages.setCurrentWidget(self._page if room is None else room)
        if room is not None:  # the tool that was maximised may have no room of its own, this one has
            self.actions_by_name["fill"].setChecked(False)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.resized.emit()
        self.rail.suit(self.size())

    def childEvent(self, event: QChildEvent) -> None:
        # When it is added, a child is not constructed yet, and no QWidget.
        child = event.child() if event.polished() else None
        if isinstance(child, QWidget):
            self.has_part.emit(child)
        super().childEvent(event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if dropped_files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        if paths := dropped_files(event):
            event.acceptProposedAction()
            self.files_dropped.emit(paths)

    def closeEvent(self, event: QCloseEvent) -> None:
        stays: list[str] = []
        self.about_to_close.emit(stays)
        if stays:
            event.ignore()
            self.status.showMessage(stays[0])
            return
        self.closing.emit()
        self.log.detach()
        super().closeEvent(event)


class _Pages(QStackedWidget):
    """Needs no more room than the page that is seen, and a little less beside a view, which then ``gives_way``."""

    def __init__(self) -> None:
        super().__init__()
        self.gives_way = False
        self.currentChanged.connect(self.updateGeometry)

    @property
    def page_px(self) -> int:
        """The width that the page which is seen needs."""
        page = self.currentWidget()
        return 0 if page is None else page.minimumSizeHint().width()

    def minimumSizeHint(self) -> QSize:
        page = self.currentWidget()
        least = super().minimumSizeHint() if page is None else page.minimumSizeHint()
        return least - QSize(GIVES_PX, 0) if self.gives_way else least
