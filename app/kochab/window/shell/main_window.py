"""The window: it lays out its panes, takes files that are dropped, and closes cleanly."""

from pathlib import Path

from PySide6.QtCore import QChildEvent, QSize, Qt, Signal
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QResizeEvent
from PySide6.QtWidgets import QMainWindow, QSplitter, QStackedWidget, QWidget

from kochab.window.image.frame_view import FrameView
from kochab.window.image.stretch_strip import StretchStrip
from kochab.window.panels.hints_panel import HintsPanel
from kochab.window.panels.log_panel import LogPanel
from kochab.window.panels.solution_panel import SolutionPanel, StateCard
from kochab.window.panels.star_table import StarTable
from kochab.window.shell.menus import Menus, make_actions, make_toolbar
from kochab.window.shell.status import Status
from kochab.window.shell.welcome import Sample, Welcome
from kochab.window.widgets import column, page, scrolled, tab_pages

SIDE_PX, LEAST_SIDE_PX = 400, 320
LEAST_FRAME_PX = 420  # beside the side; a frame that is smaller is better seen alone


class Workspace(QSplitter):
    """The open frame with its strip, and the side pane with its tabs.

    Where a tool leaves no room for both, the frame is shown alone, and the keys of the side's tabs
    swap it for the side and back.
    """

    def __init__(self, methods: list[str], detectors: list[str]) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self.view = FrameView()
        self.strip = StretchStrip()
        self.card = StateCard()
        self.solution = SolutionPanel()
        self.stars = StarTable()
        self.hints = HintsPanel(methods, detectors)
        first = page()
        column(self.card, self.solution, None, on=first, spacing=12, margins=(12, 12, 12, 12))
        tabs = ("Solution", scrolled(first)), ("Stars", self.stars), ("Hints, method", scrolled(self.hints))
        self.tabs = tab_pages("Frame details", *tabs)
        for index in range(self.tabs.count()):
            self.tabs.setTabToolTip(index, f"Alt+{index + 1}")
        self.tabs.setMinimumWidth(LEAST_SIDE_PX)
        self._side_wanted, self._side_alone = True, False
        self._left = page()
        column((self.view, 1), self.strip, on=self._left, spacing=0, margins=(0, 0, 0, 0))
        self.addWidget(self._left)
        self.addWidget(self.tabs)
        self.setStretchFactor(0, 1)
        self.setSizes([900, SIDE_PX])
        self.setCollapsible(0, False)

    def minimumSizeHint(self) -> QSize:
        """As narrow as the frame alone."""
        return QSize(self._left.minimumSizeHint().width(), super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._share()

    def show_side(self, on: bool) -> None:
        """Whether the side may be seen at all."""
        self._side_wanted = on
        self._share()

    def turn_to(self, index: int) -> bool:
        """Bring a tab of the side in front; False when that has brought the frame back instead."""
        again = self._side_alone and self.tabs.currentIndex() == index
        self._side_alone = not again
        self.tabs.setCurrentIndex(index)
        self._share()
        return self.tabs.isVisible()

    def _share(self) -> None:
        least = max(self._left.minimumSizeHint().width(), LEAST_FRAME_PX)
        both = self.width() >= least + LEAST_SIDE_PX
        if both or not self._side_wanted:
            self._side_alone = False
        self.tabs.setVisible(self._side_wanted and (both or self._side_alone))
        self._left.setVisible(not self._side_alone)


class MainWindow(QMainWindow):
    """Widgets only; :class:`kochab.window.shell.presenter.Presenter` connects them."""

    files_dropped = Signal(object)  # list[Path]
    closing = Signal()
    has_part = Signal(object)  # a QWidget that is about to be seen in the window

    def __init__(self, methods: list[str], detectors: list[str], samples: list[Sample]) -> None:
        super().__init__()
        self.setWindowTitle("Kochab")
        self.setAcceptDrops(True)
        # The same in every theme, so that the window itself need not be dressed again.
        self.setStyleSheet("QMainWindow::separator { background: transparent; width: 4px; height: 4px; }")
        self.resize(1360, 860)
        self.actions_by_name = make_actions(self)
        self.menus = Menus(self, self.actions_by_name)
        self.tools = make_toolbar(self, self.actions_by_name)
        self.welcome = Welcome(samples)
        self.workspace = Workspace(methods, detectors)
        self.pages = _Pages()
        self.pages.addWidget(self.welcome)
        self.pages.addWidget(self.workspace)
        self.setCentralWidget(self.pages)
        self.log = LogPanel(self)
        self.addDockWidget(Qt.DockWidgetArea.BottomDockWidgetArea, self.log)
        self.log.hide()
        self.welcome.first.setFocus()
        self.status = Status()
        self.setStatusBar(self.status)

    def show_frame_page(self) -> None:
        self.pages.setCurrentWidget(self.workspace)
        self.workspace.view.setFocus()

    def childEvent(self, event: QChildEvent) -> None:
        child = event.child() if event.polished() else None
        if isinstance(child, QWidget):
            self.has_part.emit(child)
        super().childEvent(event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if _files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        if paths := _files(event):
            event.acceptProposedAction()
            self.files_dropped.emit(paths)

    def closeEvent(self, event: QCloseEvent) -> None:
        self.closing.emit()
        self.log.detach()
        super().closeEvent(event)


class _Pages(QStackedWidget):
    """Needs no more room than the page that is seen."""

    def __init__(self) -> None:
        super().__init__()
        self.currentChanged.connect(self.updateGeometry)

    def minimumSizeHint(self) -> QSize:
        page = self.currentWidget()
        return super().minimumSizeHint() if page is None else page.minimumSizeHint()


def _files(event: QDragEnterEvent | QDropEvent) -> list[Path]:
    urls = event.mimeData().urls() if event.mimeData().hasUrls() else []
    return [Path(u.toLocalFile()) for u in urls if u.isLocalFile()]
